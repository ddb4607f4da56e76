"""The procedure on board, and the result of its Monte Carlo simulation: shared by the report and the run cards."""

from __future__ import annotations

import math

from expdesign.export import words
from expdesign.plan.values import Plan, Promise


def procedure_sentences(plan: Plan) -> list[str]:
    """The steps between runs, one text each; none where no Monte Carlo trials were simulated."""
    promise = plan.promise
    if promise is None:
        return []
    within = _tolerances(promise, [leg.kind == "primitive" for leg in plan.legs])
    return [
        "Run: give the orders on the card without correcting for the motion of the ship.",
        "After the run: return to the planned leg and follow it under control. If the return path is not in safe "
        "water, or the leg is too short to correct the deviation, make a go-around at once.",
        f"Start gate: begin the next run if {within}.",
        "Go-around, if not: take the shortest path in safe water to a point behind the start. Approach the start again "
        f"on the planned heading at the planned speed. After {words.counted(promise.rounds, 'go-around')}, abort the "
        "trial.",
    ]


def _tolerances(promise: Promise, runs: list[bool]) -> str:
    """Tolerances at the start of a run, in words."""
    off = [leg.position_m for leg, run in zip(promise.legs, runs, strict=True) if run] or [math.nan]
    least, most = words.distance(min(off)), words.distance(max(off))
    position = least if least == most else f"the distance on its card ({least} to {most}, depending on the sea room)"
    return (
        f"the position is within {position} of the planned start, the heading within "
        f"{words.significant(math.degrees(promise.heading_rad), 2)}{words.NB}\N{DEGREE SIGN}, the velocity over ground "
        f"within {words.speed(promise.speed_mps)} and the yaw rate within "
        f"{words.significant(math.degrees(promise.yaw_rate_radps), 2)}{words.NB}\N{DEGREE SIGN}/s of the planned ones"
    )


def left_words(promise: Promise) -> str:
    """The share of simulated trials that left allowed water, with its confidence bound."""
    most = f"probability below {words.percent(promise.left_most)} with 95{words.NB}% confidence"
    count = round(promise.left * promise.trials)
    if count == 0:
        return f"none of {promise.trials} simulated trials; {most}"
    return f"{words.percent(promise.left)}, {count} of {promise.trials} simulated trials; {most}"


def aborted_words(promise: Promise) -> str:
    """How many trials were aborted, where and why."""
    if promise.aborted == 0.0:
        return f"none of {promise.trials} simulated trials"
    return f"{words.percent(promise.aborted)} of {promise.trials} simulated trials: {'; '.join(promise.reasons)}"


def extra_words(promise: Promise) -> str:
    """Time in addition to the planned time."""
    if math.isnan(promise.extra_median_s):
        return "no simulated trial reached the goal"
    return f"median {_more(promise.extra_median_s)}, 95th percentile {_more(promise.extra_most_s)}"


def _more(seconds: float) -> str:
    return words.duration(max(seconds, 0.0))


def day_sentence(promise: Promise | None, planned_s: float) -> str:
    """The probability of an abort where it is high, and the time to reserve; "" where it is not known."""
    if promise is None or math.isnan(promise.extra_median_s):
        return ""
    warning = f"Warning: {promise.note}. " if promise.note else ""
    whole = words.duration(planned_s + max(promise.extra_most_s, 0.0))
    return (
        f"{warning}Returning to the start of each run takes time in addition to the plan: {extra_words(promise)}. "
        f"Reserve {whole} from start to goal, without breaks."
    )
