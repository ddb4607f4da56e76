"""The corridor of a leg: how far to port and to starboard of a straight line the ship may be.

Port and starboard are as seen when sailing the leg; beyond its ends the corridor is round.
"""

from __future__ import annotations

import numpy as np
import shapely

from expdesign.export.tuning import TUNING
from expdesign.values import Array

Sides = tuple[float, float]
"""Widths to port and to starboard [m]."""


def sides_needed(points: Array, start: Array, end: Array) -> Sides:
    """Largest distances of points (k, 2) north, east from the leg, to port and to starboard [m]."""
    along = end - start
    length = float(np.hypot(*along))
    from_start = points - start
    if length == 0.0:
        away = float(np.hypot(*from_start.T).max(initial=0.0))
        return away, away
    share = np.clip(from_start @ along / length**2, 0.0, 1.0)
    away = np.hypot(*(from_start - np.outer(share, along)).T)
    to_starboard = along[0] * from_start[:, 1] - along[1] * from_start[:, 0] >= 0.0
    port = float(away[~to_starboard].max(initial=0.0))
    return port, float(away[to_starboard].max(initial=0.0))


def corridor(start: Array, end: Array, sides: Sides) -> shapely.Geometry:
    """Everything that is within the sides of a leg, in (east, north).

    Its rounded ends are drawn by polygons around the arcs, so that it is never smaller than what it stands for.
    """
    line = shapely.LineString([start[::-1], end[::-1]])
    parts = []
    for side, sign in zip(sides, (-1.0, 1.0), strict=True):
        if side > 0.0:
            around = line.buffer(side / np.cos(np.pi / 64), quad_segs=16)
            parts.append(shapely.intersection(around, _half(start, end, sign, 4.0 * (side + line.length))))
    return shapely.union_all([line, *parts])


def _half(start: Array, end: Array, sign: float, size: float) -> shapely.Polygon:
    """A rectangle on one side of a leg; -1 is port."""
    along = (end - start) / max(float(np.hypot(*(end - start))), 1e-9)
    across = sign * np.array([-along[1], along[0]])
    middle = (start + end) / 2
    corners = [middle - size * along, middle + size * along]
    corners += [corners[1] + size * across, corners[0] + size * across]
    return shapely.Polygon([corner[::-1] for corner in corners])


def corridor_in_water(
    start: Array, end: Array, sides: Sides, *, water: shapely.Geometry | None, half_beam_m: float
) -> bool:
    """Whether a ship of this beam whose centre is in the corridor of a leg, heading along it, is in the water."""
    if water is None:
        return True
    wide = (sides[0] + half_beam_m, sides[1] + half_beam_m)
    return bool(water.covers(corridor(start, end, wide)))


def widened(
    start: Array,
    end: Array,
    needed: Sides,
    *,
    wanted_m: float,
    water: shapely.Geometry | None,
    half_beam_m: float,
) -> Sides:
    """The needed sides, each widened to what is wanted or to what the water allows."""
    sides = list(needed)
    for index in (0, 1):
        low, high = sides[index], wanted_m
        if low >= high:
            continue
        for _ in range(TUNING.corridor_halvings):
            sides[index] = high
            if corridor_in_water(start, end, (sides[0], sides[1]), water=water, half_beam_m=half_beam_m):
                low = high
                break
            high = low + (high - low) / 2
        sides[index] = low
    return sides[0], sides[1]
