"""How a trial is sailed, and what was found when drawn ships sailed it so: the same words in report and run cards."""

from __future__ import annotations

import math

from expdesign.export import words
from expdesign.plan.values import Plan, Promise


def procedure_sentences(plan: Plan) -> list[str]:
    """What the crew does between runs, one sentence for each step; none where nothing is promised."""
    promise = plan.promise
    if promise is None:
        return []
    within = _tolerances(promise, [leg.kind == "primitive" for leg in plan.legs])
    return [
        "Run: give the orders of the card open loop, from the state the ship really has.",
        "After it: come back to the planned leg from wherever the run has ended, and follow it, steered. Where that "
        "way does not lie in safe water, or the leg is too short to make the distance good, go round at once.",
        f"Start: begin the next run if {within}.",
        "Otherwise go round: the shortest way in safe water to a place behind the start, then steady on the planned "
        f"heading at the planned speed up to the start once more; {words.counted(promise.rounds, 'time')} at most, "
        "then break the trial off.",
    ]


def _tolerances(promise: Promise, runs: list[bool]) -> str:
    """Within which a run may begin."""
    off = [leg.position_m for leg, run in zip(promise.legs, runs, strict=True) if run] or [math.nan]
    least, most = words.distance(min(off)), words.distance(max(off))
    position = least if least == most else f"what its card says ({least} to {most}, by the room there is)"
    return (
        f"the position is within {position} of the planned start, the heading within "
        f"{words.significant(math.degrees(promise.heading_rad), 2)}{words.NB}\N{DEGREE SIGN}, the velocity over ground "
        f"within {words.speed(promise.speed_mps)} and the yaw rate within "
        f"{words.significant(math.degrees(promise.yaw_rate_radps), 2)}{words.NB}\N{DEGREE SIGN}/s of the planned ones"
    )


def left_words(promise: Promise) -> str:
    """The share of drawn trials that left allowed water, with how sure that is."""
    most = f"below {words.percent(promise.left_most)} with 95{words.NB}% confidence"
    count = round(promise.left * promise.trials)
    if count == 0:
        return f"none of {promise.trials} drawn trials: {most}"
    return f"{words.percent(promise.left)}, {count} of {promise.trials} drawn trials: {most}"


def aborted_words(promise: Promise) -> str:
    """How many trials were broken off, and where and why."""
    if promise.aborted == 0.0:
        return f"none of {promise.trials} drawn trials"
    return f"{words.percent(promise.aborted)} of {promise.trials} drawn trials: {'; '.join(promise.reasons)}"


def extra_words(promise: Promise) -> str:
    """Time beyond the plan's."""
    if math.isnan(promise.extra_median_s):
        return "no drawn trial came to the goal"
    return (
        f"{_more(promise.extra_median_s)} in the middle, up to {_more(promise.extra_most_s)} in 95{words.NB}% of trials"
    )


def _more(seconds: float) -> str:
    return words.duration(max(seconds, 0.0))


def day_sentence(promise: Promise | None, planned_s: float) -> str:
    """That the trial may well be broken off, and how long to book; "" where it is not known."""
    if promise is None or math.isnan(promise.extra_median_s):
        return ""
    warning = f"Mind: {promise.note}. " if promise.note else ""
    whole = words.duration(planned_s + max(promise.extra_most_s, 0.0))
    return (
        f"{warning}Coming back to the starts takes time that the plan does not show: {extra_words(promise)}. Book "
        f"{whole} from start to goal, besides breaks."
    )
