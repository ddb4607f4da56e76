"""Checks of the plan: verification beside the requirements, and the conditions of IMO MSC/Circ.1053."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from expdesign.export import words
from expdesign.export.report.content import ReportContent
from expdesign.export.report.procedure import aborted_words, extra_words, left_words
from expdesign.indices import Condition, Conditions, admissibility
from expdesign.plan.values import RiskEstimate
from expdesign.sea_area import SeaArea
from expdesign.values import Array
from expdesign.vessel import VesselModel


@dataclass(frozen=True, kw_only=True)
class Check:
    """One line of the verification; `passed` is None where a number is only reported."""

    what: str
    found: str
    required: str
    passed: bool | None


def checks(content: ReportContent) -> list[Check]:
    """Results of the independent check beside the requirements."""
    plan, found = content.plan, content.plan.verification
    rows = [
        Check(
            what="Least distance from the hull to forbidden water",
            found=f"{words.distance(found.clearance_min_m)} at {words.clock(found.clearance_time_s)}",
            required=f"at least {words.distance(content.clearance_m)}",
            passed=found.clearance_min_m >= content.clearance_m,
        ),
        Check(
            what="Largest distance between the planned track and the independent simulation",
            found="less than 1 mm" if found.reproduction_error_m < 1e-3 else words.distance(found.reproduction_error_m),
            required="",
            passed=None,
        ),
        Check(
            what="Largest violation of an actuator limit or rate limit",
            found="none" if found.limit_excess < 1e-6 else f"{words.percent(found.limit_excess)} of its range",
            required="",
            passed=None,
        ),
    ]
    if found.heel_max_rad is not None:
        rows.append(_heel_check(content, found.heel_max_rad))
    if plan.risk is None:
        return rows
    return [*rows, *_risk_checks(plan.risk, 1.0 - content.confidence), *_conditioned_prior(content.vessel.model)]


def _heel_check(content: ReportContent, heel_rad: float) -> Check:
    """The roll of [roll], which does not act back on the path."""
    pendulum = content.vessel.pendulum
    limit = float("inf") if pendulum is None else pendulum.heel_max_rad
    stated = np.isfinite(limit)
    return Check(
        what="Largest roll angle of the independent simulation, in still water",
        found=f"{words.number(float(np.degrees(heel_rad)), 1)}\N{DEGREE SIGN}",
        required=f"at most {words.number(float(np.degrees(limit)), 1)}\N{DEGREE SIGN}" if stated else "",
        passed=bool(heel_rad <= limit + 1e-9) if stated else None,
    )


def _conditioned_prior(model: VesselModel) -> list[Check]:
    """Which vessels the Monte Carlo trials were drawn from, where the file states what is known to hold."""
    if not model.parameter_range:
        return []
    share = words.percent(model.share_in_range())
    return [
        Check(
            what="Simulated vessels, drawn from the standard deviations in the vessel file",
            found=f"{share} of the drawn ones keep to its parameter_min and parameter_max; the others were drawn again",
            required="",
            passed=None,
        )
    ]


def _risk_checks(risk: RiskEstimate, allowed: float) -> list[Check]:
    """Results of the Monte Carlo trials."""
    return [
        Check(
            what="Probability that the hull leaves allowed water during the trial",
            found=left_words(risk),
            required=f"at most {words.percent(allowed)}",
            passed=risk.left <= allowed + 1e-12,
        ),
        Check(
            what="Trials aborted because a run could not start within its tolerances",
            found=aborted_words(risk),
            required=f"at most {words.percent(risk.aborted_most)}",
            passed=not risk.note,
        ),
        Check(
            what="Time in addition to the plan, for returning to the start of each run",
            found=extra_words(risk),
            required="",
            passed=None,
        ),
    ]


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
            required_room_m=content.clearance_m,
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
