"""Whether a vessel fits where the trial is to start or end."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.ops import nearest_points

from expdesign.conventions import to_n_frame
from expdesign.sea_area import SeaArea
from expdesign.values import Array
from expdesign.vessel import Vessel


def berth_problem(pose: Array, vessel: Vessel, area: SeaArea, clearance_m: float, *, degrees: bool) -> str:
    """What is wrong with a pose as start or goal, or "" when the hull keeps its clearance there.

    Args:
        pose: (3,) north m, east m, heading rad.
        vessel: gives the hull rectangle.
        area: allowed water.
        clearance_m: least distance of the hull from anything forbidden [m].
        degrees: whether the remedy is put in latitude and longitude or in metres.
    """
    if not np.isfinite(pose).all():
        return f"is thousands of kilometres from the area {area.name!r}, expected a position in it"
    hull = shapely.Polygon(to_n_frame(vessel.hull_b, pose)[:, ::-1])
    centre = shapely.Point(pose[1], pose[0])
    if area.land.covers(centre):
        problem = f"is on land, {_metres(centre.distance(area.water))} from allowed water"
    elif not area.water.covers(centre):
        problem = (
            f"is outside the allowed water (bounds, depth, no-go zones), {_metres(centre.distance(area.water))} from it"
        )
    elif not area.water.covers(hull):
        distance = centre.distance(area.water.boundary)
        problem = f"is {_metres(distance)} from forbidden water, less than the hull of {vessel.length_m:g} m needs"
    else:
        distance = hull.distance(area.water.boundary)
        if distance >= clearance_m:
            return ""
        problem = f"leaves {_metres(distance)} between the hull and forbidden water"
    remedy = _remedy(centre, vessel, area, clearance_m, degrees)
    return f"{problem}, expected at least clearance_m = {clearance_m:g} around the hull; {remedy}"


def _remedy(centre: shapely.Point, vessel: Vessel, area: SeaArea, clearance_m: float, degrees: bool) -> str:
    """The nearest position with room at any heading, rounded as printed."""
    radius = float(np.hypot(vessel.length_m, vessel.beam_m)) / 2
    roomy = area.safe_water(clearance_m + radius + (1.0 if degrees else 0.01))
    if roomy.is_empty:
        return "nowhere in the area is there that much room"
    point = nearest_points(roomy, centre)[0]
    if not degrees:
        return f"the nearest place with room is north_m = {point.y:.2f}, east_m = {point.x:.2f}"
    lat, lon = area.frame.to_degrees(np.array([point.y, point.x]))
    return f"the nearest place with room is lat_deg = {lat:.6f}, lon_deg = {lon:.6f}"


def _metres(distance: float) -> str:
    return f"{distance:.3g} m" if distance < 100 else f"{distance:.0f} m"
