"""Conditions of IMO MSC/Circ.1053 that can be judged from the plan."""

from __future__ import annotations

import numpy as np
import shapely

from expdesign.export.report.content import ReportContent
from expdesign.indices import Condition, Conditions, admissibility
from expdesign.sea_area import SeaArea
from expdesign.values import Array


def conditions(content: ReportContent) -> tuple[Condition, ...]:
    """Depth, wind, sea, current and room of the plan beside the limits."""
    environment, plan = content.environment, content.plan
    return admissibility(
        Conditions(
            draught_m=content.vessel.draught_m,
            least_depth_m=least_charted_depth(plan.area, plan.trajectory.pose[:, :2]),
            wind_mps=float(np.hypot(*environment.wind_to)),
            wind_std_mps=environment.wind_std_mps,
            sea_state=environment.sea_state,
            current_mps=float(np.hypot(*environment.current_to)),
            current_std_mps=environment.current_std_mps,
            room_m=plan.verification.clearance_min_m,
            room_asked_m=content.clearance_m,
        )
    )


def least_charted_depth(area: SeaArea, points: Array) -> float | None:
    """Least charted depth along a track (k, 2) north, east [m]; None where a part of it has no charted depth."""
    east, north = points[:, 1], points[:, 0]
    depth = np.full(len(points), -np.inf)
    for least, polygons in area.depths:
        shapely.prepare(polygons)
        inside = shapely.contains_xy(polygons, east, north)
        depth = np.where(inside, np.maximum(depth, least), depth)
    return float(depth.min()) if len(depth) and np.isfinite(depth).all() else None
