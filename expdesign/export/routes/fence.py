"""The allowed water around a track as few polygons: a geofence for autopilots, never larger than that water.

The fence holds for the ship's centre: it lies at least half a beam inside the allowed water.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from expdesign.sea_area import LocalFrame, eroded
from expdesign.values import Array

FENCE_MARGIN = 0.1  # room around the track, as a share of its extent, that the fence may cover
FENCE_HALVINGS = 12  # of the slack by which the fence is simplified, until it keeps to the water


DECIMALS = 7


@dataclass(frozen=True, kw_only=True)
class Fence:
    """One polygon to stay in and some to stay out of; rings are open, (latitude, longitude) [deg]."""

    inside: tuple[tuple[float, float], ...]  # ring, counter-clockwise as seen on a chart
    outside: tuple[tuple[tuple[float, float], ...], ...]  # rings of what is forbidden within it, clockwise


def build_fence(
    points: Array, *, water: shapely.Geometry, beam_m: float, clearance_m: float, frame: LocalFrame
) -> Fence | None:
    """The fence around a track, or None where the track touches the fence's own margin.

    Args:
        points: (k, 2) track, north and east [m].
        water: allowed water in (east, north).
        beam_m: of the ship.
        clearance_m: that the plan keeps; it is what the fence may be simplified by.
        frame: the plan's.
    """
    line = shapely.LineString(points[:, ::-1])
    west, south, east, north = line.bounds
    margin = FENCE_MARGIN * max(east - west, north - south) + 4 * (clearance_m + beam_m)
    near = shapely.intersection(water, shapely.box(west - margin, south - margin, east + margin, north + margin))
    slack = max(clearance_m, 0.1) / 2
    for _ in range(FENCE_HALVINGS):
        found = _simplified(near, line, inset_m=beam_m / 2 + slack, slack_m=slack)
        if found is not None:
            degrees = _in_degrees(found, frame)
            if _holds(degrees, near, line, frame):
                return degrees
        slack /= 2
    return None


def _simplified(
    water: shapely.Geometry, line: shapely.LineString, *, inset_m: float, slack_m: float
) -> shapely.Polygon | None:
    inner = shapely.simplify(eroded(water, inset_m, join_style="mitre"), slack_m, preserve_topology=True)
    parts = [part for part in shapely.get_parts(inner) if part.geom_type == "Polygon" and part.covers(line)]
    return shapely.orient_polygons(parts[0]) if parts else None


def _in_degrees(polygon: shapely.Polygon, frame: LocalFrame) -> Fence:
    def ring(line: shapely.LinearRing) -> tuple[tuple[float, float], ...]:
        corners = np.array(line.coords)[:-1, ::-1]
        return tuple((lat, lon) for lat, lon in frame.to_degrees(corners).round(DECIMALS).tolist())

    return Fence(inside=ring(polygon.exterior), outside=tuple(ring(hole) for hole in polygon.interiors))


def fence_polygon(fence: Fence, frame: LocalFrame) -> shapely.Polygon:
    """The fence as written, in (east, north) of a frame."""
    rings = [frame.to_metres(np.array(ring))[:, ::-1] for ring in (fence.inside, *fence.outside)]
    return shapely.Polygon(rings[0], rings[1:])


def _holds(fence: Fence, water: shapely.Geometry, line: shapely.LineString, frame: LocalFrame) -> bool:
    polygon = fence_polygon(fence, frame)
    return bool(polygon.is_valid and water.covers(polygon) and polygon.covers(line))
