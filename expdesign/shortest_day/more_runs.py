"""Runs put into a drafted day, each within one of its legs, until it should reach the accuracy.

They are further runs of its own manoeuvres: what these tell there is known from the day.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.plan.drafts import another_in_leg
from expdesign.plan.values import Placement, PlanProblem
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.prices import LEAST_LEG_S, DraftedDay, most_runs, with_legs
from expdesign.values import Array

# days that lack more than a little get more than they lack: which runs are spare is known once all are planned
A_LITTLE, AMPLE = 0.1, 0.3
LEGS, KINDS = 6, 4  # the longest legs, and the manoeuvres that tell most for their time, tried with each other
# what information costs in runs put in, as a share of what it costs in the whole day; off Helsinki a third to a half
CHEAPER = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Grown:
    """A day with more runs, as foreseen."""

    day: DraftedDay  # without them
    placements: list[Placement]  # of all runs
    enough_s: float  # about how long the day is that reaches the accuracy, go-arounds included


@dataclass(frozen=True, kw_only=True, eq=False)
class _Place:
    """One run within one leg."""

    leg: int  # number of the leg
    placement: Placement  # of the run
    more_s: float  # by which the day is longer with it, go-arounds included


def enough_s(day: DraftedDay, margin: float, more_s: float = 0.0) -> float:
    """About how long a day is with the runs that it lacks, as information grows with the time spent beyond the way [s].

    Args:
        day: gives what information costs.
        margin: of the accuracy.
        more_s: by which it is longer than this day [s].
    """
    return day.expected_s + more_s + CHEAPER * -margin * max(day.day_s - day.draft.direct_s, 0.0)


def with_more(problem: PlanProblem, accuracy: Accuracy, day: DraftedDay, late_run_s: float) -> Grown | None:
    """A day that falls short with runs put in, those first that cost least for what is lacking; None without places.

    Args:
        problem: with the runs of the day.
        accuracy: to be reached.
        day: that falls short.
        late_run_s: by which drawn trials are late for each run [s].
    """
    names = problem.design.problem.names
    left = dict(zip(names, (most_runs(problem) - np.array(day.repeats)).tolist(), strict=True))
    told = {name: one for name, one in _told_by_run(day).items() if left[name] >= 1}
    places = _places(problem, accuracy, day, told, late_run_s)
    whole, spare = day.whole, day.margin - accuracy.margin(day.whole)
    margin, more_s, put = day.margin, 0.0, dict[int, Placement]()
    level = AMPLE if margin < -A_LITTLE else 0.0
    while margin < level:
        places = [place for place in places if place.leg not in put and left[place.placement.primitive] >= 1]
        reached = np.array([accuracy.margin(whole + told[place.placement.primitive]) + spare for place in places])
        gains = np.minimum(reached, level) - margin
        if not (gains > 0).any():
            break
        costs = [place.more_s / gain if gain > 0 else np.inf for place, gain in zip(places, gains, strict=True)]
        best, margin = places[int(np.argmin(costs))], float(reached[int(np.argmin(costs))])
        name = best.placement.primitive
        put[best.leg], more_s, whole = best.placement, more_s + best.more_s, whole + told[name]
        left[name] -= 1
    if not put:
        return None
    placements = list(day.draft.sailed.placements)
    for leg in sorted(put, reverse=True):
        placements.insert(leg, put[leg])
    return Grown(day=day, placements=placements, enough_s=enough_s(day, margin, more_s))


def _told_by_run(day: DraftedDay) -> dict[str, Array]:
    """(d, d) information of one more run of each of the day's manoeuvres, with half of each leg beside it."""
    told = [
        (leg, one) for leg, one in zip(day.draft.sailed.legs, with_legs(day), strict=True) if leg.kind == "primitive"
    ]
    names = sorted({leg.name for leg, _ in told})
    return {name: np.mean([one for leg, one in told if leg.name == name], axis=0) for name in names}


def _places(
    problem: PlanProblem, accuracy: Accuracy, day: DraftedDay, told: dict[str, Array], late_run_s: float
) -> list[_Place]:
    """Places of the manoeuvres that tell most for their time, of those told of, in the longest legs."""
    draft, legs, found = day.draft, day.draft.sailed.legs, list[_Place]()
    runs = np.array([leg.kind == "primitive" for leg in legs])
    legs_s = np.bincount(np.cumsum(runs), weights=np.where(runs, 0.0, draft.sailed.legs_s), minlength=runs.sum() + 1)
    alone, worth = accuracy.margin(day.whole), dict[int, float]()
    for run, item in enumerate(draft.room.space.footprints):
        if item.name in told:
            cost_s = max(item.duration_s - item.displacement_m / draft.transit_mps + late_run_s, LEAST_LEG_S)
            worth[run] = (accuracy.margin(day.whole + told[item.name]) - alone) / cost_s
    for run in sorted(worth, key=lambda run: -worth[run])[:KINDS]:
        for leg in np.argsort(-legs_s, kind="stable").tolist()[:LEGS]:
            if another := another_in_leg(problem, draft, leg, run):
                found.append(_Place(leg=leg, placement=another[0], more_s=another[1] + late_run_s))
    return found
