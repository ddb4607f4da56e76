"""Checks of the plan: verification beside the requirements, and the conditions of IMO MSC/Circ.1053."""

from __future__ import annotations

import math

import numpy as np
import shapely

from expdesign.export import words
from expdesign.export.report.content import ReportContent
from expdesign.indices import Condition, Conditions, admissibility
from expdesign.plan.values import DayLength, Plan, RiskEstimate
from expdesign.sea_area import SeaArea
from expdesign.values import Array
from expdesign.vessel import VesselModel


def procedure_sentences(plan: Plan) -> list[str]:
    """The steps between runs, one text each; none where no Monte Carlo trials were simulated."""
    risk = plan.risk
    if risk is None:
        return []
    longest_s = [leg.longest_s for leg in risk.legs if leg.longest_s]
    longest = " to ".join(dict.fromkeys(words.duration(value) for value in (min(longest_s), max(longest_s))))
    later = ", by the length of the leg" if " to " in longest else ""
    within = _tolerances(risk, [leg.kind == "primitive" for leg in plan.legs])
    return [
        "Run: give the orders on the card without correcting for the motion of the ship.",
        "After the run: return to the planned leg and follow it under control. If the leg is too short to correct the "
        "deviation, a ship that keeps station sails parallel to it, up to half of the start gate's distance beside it. "
        "If that is not enough, or the path is not in safe water, make a go-around at once. If there is room for none, "
        "but the leg is clear, follow the leg.",
        f"Start gate: begin the next run if {within}. At a start from rest, stop on the planned heading. A ship that "
        "thrusters hold there waits until she is well within; any other begins as soon as she is within.",
        "Go-around, if not: take the shortest path in safe water to a point behind the start. Approach the start again "
        "on the planned heading at the planned speed. If a steered ship had not settled on it, make the next approach "
        "twice as long, and the one after it three times, where there is room. "
        f"After {words.counted(risk.go_arounds, 'go-around')}, abort the trial; also where a start is not reached "
        f"within {longest} of the end of the run before{later}.",
        f"Goal: it is reached within {words.distance(risk.legs[-1].position_m)} of it, at any heading and speed.",
    ]


def _tolerances(risk: RiskEstimate, runs: list[bool]) -> str:
    """Tolerances at the start of a run, in words."""
    begun = [leg for leg, run in zip(risk.legs, runs, strict=True) if run]
    off, differs = [leg.position_m for leg in begun] or [math.nan], [leg.speed_mps for leg in begun] or [math.nan]
    least, most = words.distance(min(off)), words.distance(max(off))
    position = least if least == most else f"the distance on its card ({least} to {most}, depending on the sea room)"
    least, most = words.speed(min(differs)), words.speed(max(differs))
    speed = least if least == most else f"the speed on its card ({least} to {most})"
    return (
        f"the position is within {position} of the planned start, the heading within "
        f"{words.significant(math.degrees(risk.heading_rad), 2)}\N{DEGREE SIGN}, the velocity over ground "
        f"within {speed} and the yaw rate within "
        f"{words.significant(math.degrees(risk.yaw_rate_radps), 2)}{words.NB}\N{DEGREE SIGN}/s of the planned ones"
    )


def left_words(risk: RiskEstimate) -> str:
    """The share of simulated trials that left allowed water, with its confidence bound."""
    most = f"probability below {words.percent(risk.left_most)} with 95{words.NB}% confidence"
    count = round(risk.left * risk.trials)
    if count == 0:
        return f"none of {risk.trials} simulated trials; {most}"
    return f"{words.percent(risk.left)}, {count} of {risk.trials} simulated trials; {most}"


def aborted_words(risk: RiskEstimate) -> str:
    """How many trials were aborted, where and why."""
    if risk.aborted == 0.0:
        return f"none of {risk.trials} simulated trials"
    return f"{words.percent(risk.aborted)} of {risk.trials} simulated trials: {'; '.join(risk.reasons)}"


def extra_words(risk: RiskEstimate) -> str:
    """Time in addition to the planned time."""
    if math.isnan(risk.extra_median_s):
        return "no simulated trial reached the goal"
    return f"median {_more(risk.extra_median_s)}, 95th percentile {_more(risk.extra_most_s)}"


def _more(seconds: float) -> str:
    return words.duration(max(seconds, 0.0))


def day_words(day: DayLength) -> str:
    """The day as planned, and in simulated trials."""
    planned = words.duration(day.planned_s)
    if math.isnan(day.median_s):
        return planned
    median, most = words.duration(day.median_s), words.duration(max(day.most_s, day.planned_s))
    return f"{planned} as planned; median {median}, 95th percentile {most}"


def day_sentence(plan: Plan) -> str:
    """The probability of an abort where it is high, and the time to reserve; "" where it is not known."""
    risk, day = plan.risk, plan.day
    if risk is None or math.isnan(risk.extra_median_s):
        return ""
    warning = f"Warning: {risk.note}. " if risk.note else ""
    whole = words.duration(max(day.most_s, day.planned_s))
    return (
        f"{warning}The day takes {words.duration(day.planned_s)} as planned, {words.duration(day.median_s)} in the "
        f"middle of the simulated trials, which return to the start of some runs, and at most {whole} in "
        f"95{words.NB}% of them. Reserve {whole} from start to goal, without breaks."
    )


def checks(content: ReportContent) -> list[Condition]:
    """Results of the independent check beside the requirements; some are only reported."""
    plan, found = content.plan, content.plan.verification
    rows = [
        Condition(
            "Least distance from the hull to forbidden water",
            f"{words.distance(found.clearance_min_m)} at {words.clock(found.clearance_time_s)}",
            f"at least {words.distance(content.clearance_m)}",
            found.clearance_min_m >= content.clearance_m,
        ),
        Condition(
            "Largest distance between the planned track and the independent simulation"
            + (f", begun anew every {words.duration(found.stretch_s)}" if found.stretch_s else ""),
            "less than 1 mm" if found.reproduction_error_m < 1e-3 else words.distance(found.reproduction_error_m),
        ),
        Condition(
            "Largest violation of an actuator limit or rate limit",
            "none" if found.limit_excess < 1e-6 else f"{words.percent(found.limit_excess)} of its range",
        ),
    ]
    if found.heel_max_rad is not None:
        rows.append(_heel_check(content, found.heel_max_rad))
    if plan.risk is None:
        return rows
    return [*rows, *_risk_checks(plan.risk, 1.0 - content.confidence), *_conditioned_prior(content.vessel.model)]


def _heel_check(content: ReportContent, heel_rad: float) -> Condition:
    """The roll of [roll], which does not act back on the path."""
    pendulum = content.vessel.pendulum
    limit = float("inf") if pendulum is None else pendulum.heel_max_rad
    stated = np.isfinite(limit)
    return Condition(
        "Largest roll angle of the independent simulation, in still water",
        f"{words.number(float(np.degrees(heel_rad)), 1)}\N{DEGREE SIGN}",
        f"at most {words.number(float(np.degrees(limit)), 1)}\N{DEGREE SIGN}" if stated else "",
        bool(heel_rad <= limit + 1e-9) if stated else None,
    )


def _conditioned_prior(model: VesselModel) -> list[Condition]:
    """Which vessels the Monte Carlo trials were drawn from, where the file states what is known to hold."""
    if not model.parameter_range:
        return []
    share = words.percent(model.share_in_range())
    return [
        Condition(
            "Simulated vessels, drawn from the standard deviations in the vessel file",
            f"{share} of the drawn ones keep to its parameter_min and parameter_max; the others were drawn again",
        )
    ]


def _risk_checks(risk: RiskEstimate, allowed: float) -> list[Condition]:
    """Results of the Monte Carlo trials."""
    return [
        Condition(
            "Probability that the hull leaves allowed water during the trial",
            left_words(risk),
            f"at most {words.percent(allowed)}",
            risk.left <= allowed + 1e-12,
        ),
        Condition(
            "Trials aborted because a run could not start within its tolerances",
            aborted_words(risk),
            f"at most {words.percent(risk.aborted_most)}",
            not risk.note,
        ),
        Condition(
            "Time in addition to the plan, for returning to the start of each run",
            extra_words(risk),
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
