"""The part of a chart that a trial can reach, so that planning does not depend on how much chart surrounds it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from expdesign.plan.chart.clearance_grid import grid_cell_m
from expdesign.plan.chart.tuning import CHART
from expdesign.sea_area import SeaArea, as_multipolygon
from expdesign.values import Array


def reachable(area: SeaArea, ends: Array, reach_m: float) -> SeaArea:
    """The water round the ends (k, 2), as far as a distance north, south, east and west, that is connected to them.

    The area itself where that extends about as far, and where an end is not in the water.
    """
    east_north = np.asarray(ends)[:, ::-1]
    least, most = east_north.min(axis=0) - reach_m, east_north.max(axis=0) + reach_m
    west, south, east, north = area.water.bounds
    all_in = (least <= (west, south)).all() and (most >= (east, north)).all()
    water = area.water if all_in else as_multipolygon(shapely.intersection(area.water, shapely.box(*least, *most)))
    parts, points = shapely.get_parts(water), shapely.points(east_north)
    held = np.array([shapely.intersects(part, points) for part in parts])
    found = shapely.MultiPolygon(list(parts[held.any(axis=1)]))
    kept = shapely.box(*found.bounds).area > CHART.kept * shapely.box(*area.water.bounds).area
    return area if kept or not held.any(axis=0).all() else replace(area, water=found)


def connects(area: SeaArea, ends: Array) -> bool:
    """Whether one part of the water holds all ends (k, 2)."""
    points = shapely.points(np.asarray(ends)[:, ::-1])
    return any(bool(shapely.intersects(part, points).all()) for part in area.water.geoms)


def resolved(area: SeaArea, ends: Array, reach_m: float, *, hull_m: float) -> tuple[SeaArea, float]:
    """The reachable water, no larger than the clearance grid resolves well for a hull, and its reach [m].

    Args:
        area, ends, reach_m: as for `reachable`.
        hull_m: length of the hull.
    """
    reach_m = max(reach_m, CHART.least_reach_hulls * hull_m)
    found = reachable(area, ends, reach_m)
    while grid_cell_m(found, hull_m / 8) > CHART.fine_hulls * hull_m:
        smaller_m = reach_m * np.sqrt(0.5)
        less = reachable(found, ends, smaller_m)
        if smaller_m < CHART.least_reach_hulls * hull_m or (connects(found, ends) and not connects(less, ends)):
            break
        found, reach_m = less, smaller_m
    return found, reach_m
