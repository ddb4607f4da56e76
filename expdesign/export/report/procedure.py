"""The procedure on board, and the result of its Monte Carlo simulation: shared by the report and the run cards."""

from __future__ import annotations

import math

from expdesign.export import words
from expdesign.plan.values import DayLength, Plan, RiskEstimate


def procedure_sentences(plan: Plan) -> list[str]:
    """The steps between runs, one text each; none where no Monte Carlo trials were simulated."""
    risk = plan.risk
    if risk is None:
        return []
    within = _tolerances(risk, [leg.kind == "primitive" for leg in plan.legs])
    return [
        "Run: give the orders on the card without correcting for the motion of the ship.",
        "After the run: return to the planned leg and follow it under control. If the leg is too short to correct the "
        "deviation, a ship that keeps station sails parallel to it, up to half of the start gate's distance beside it. "
        "If that is not enough, or the path is not in safe water, make a go-around at once.",
        f"Start gate: begin the next run if {within}.",
        "Go-around, if not: take the shortest path in safe water to a point behind the start. Approach the start again "
        f"on the planned heading at the planned speed. After {words.counted(risk.go_arounds, 'go-around')}, abort the "
        "trial.",
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
