"""Cutting a curved track into straight chords."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely

from expdesign.errors import NoPlan
from expdesign.values import Array


def cut_into_chords(
    points: Array, *, boundaries: Sequence[int], tolerance_m: float, water: shapely.MultiPolygon | None
) -> list[int]:
    """Indices of the samples that the chords connect.

    Between two of them every sample lies within the tolerance of the chord, the track does not run back along it by
    more than the tolerance, and the chord stays in the water.

    Args:
        points: (k, 2) north, east [m], in time order.
        boundaries: indices to keep, the first and the last sample among them.
        tolerance_m: largest cross-track error [m].
        water: where chords may go, in (east, north), or None for anywhere.

    Raises:
        NoPlan: the track itself leaves the water.

    Source: D. H. Douglas and T. K. Peucker (1973), with a test for reversals and one for water.
    """
    kept = set(boundaries)
    waiting = list(pairwise(boundaries))[::-1]
    while waiting:
        first, last = waiting.pop()
        split = _split(points, first, last, tolerance_m, water)
        if split is not None:
            kept.add(split)
            waiting += [(split, last), (first, split)]
    return sorted(kept)


def _split(points: Array, first: int, last: int, tolerance_m: float, water: shapely.MultiPolygon | None) -> int | None:
    """Where the chord must be broken, or None when it is acceptable."""
    off, back = _off_and_back(points[first : last + 1])
    if last - first > 1 and off.max() > tolerance_m:
        return first + int(off.argmax())
    if last - first > 1 and back[1] > tolerance_m:
        return first + back[0]
    if chord_in_water(points[first], points[last], water):
        return None
    if last - first == 1:
        north, east = points[first]
        raise NoPlan(f"the track leaves the allowed water near north {north:.0f} m, east {east:.0f} m")
    inner = int(off[1:-1].argmax()) + 1
    return first + (inner if off[inner] > 0 else (last - first) // 2)


def _off_and_back(points: Array) -> tuple[Array, tuple[int, float]]:
    """(k,) distances to the chord, and the sample before the largest backward motion along it with its size [m]."""
    chord = points[-1] - points[0]
    length = float(np.hypot(*chord))
    from_start = points - points[0]
    if length == 0.0:
        return np.hypot(*from_start.T), (0, 0.0)
    along = from_start @ chord / length
    nearest = np.outer(np.clip(along, 0.0, length) / length, chord)
    reached = np.maximum.accumulate(along)
    worst = int((reached - along).argmax())
    return np.hypot(*(from_start - nearest).T), (int(along[: worst + 1].argmax()), float(reached[worst] - along[worst]))


def chord_in_water(start: Array, end: Array, water: shapely.MultiPolygon | None) -> bool:
    """Whether the straight line between two points (2,) north, east stays in the water."""
    return water is None or bool(water.covers(shapely.LineString([start[::-1], end[::-1]])))


def merge_standing(
    points: Array, ends: Sequence[int], *, distance_m: float, water: shapely.MultiPolygon | None
) -> list[tuple[int, int]]:
    """Chord ends that nearly coincide become one point with an arrival and a departure sample.

    Turning on the spot and lying still are no legs of a route. A point is kept where leaving it out would send the
    next chord out of the water.

    Args:
        points: (k, 2) north, east [m].
        ends: samples that chords connect.
        distance_m: points nearer than this to the first of their group join it [m].
        water: where chords may go, in (east, north), or None for anywhere.

    Returns:
        (arrival, departure) samples of each remaining point; its place is that of the arrival.
    """
    groups = [(ends[0], ends[0])]
    for number, sample in enumerate(ends[1:], start=1):
        place = groups[-1][0]
        near = float(np.hypot(*(points[sample] - points[place]))) < distance_m
        following = points[ends[min(number + 1, len(ends) - 1)]]
        if near and chord_in_water(points[place], following, water):
            groups[-1] = (place, sample)
        else:
            groups.append((sample, sample))
    return groups
