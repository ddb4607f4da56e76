"""What one more run costs and tells, its leg included, learnt from the days that were planned.

A run takes its own time, and a share of the repositioning that plans have beyond the direct way. Its way made good
saves time of that way. The legs that lead to runs tell, too. Each is taken to tell what legs did on average: how long
a leg is, and so what it tells, depends on its place in the day more than on the run that it leads to. These are
estimates for the next plan; the next plan itself says what is true.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.plan.assembly import ship_on_legs
from expdesign.plan.problem import PlanProblem
from expdesign.plan.solve import Draft
from expdesign.shortest_day.offer import Offer
from expdesign.shortest_day.tuning import TUNING
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class Prices:
    """Costs and information at the margin.

    Attributes:
        cost_s: (q,) of one more whole run, its leg included.
        saved_s: (q,) time at transit speed of its way made good.
        way_s: time at transit speed of the way from start to goal.
        legs: (q, d, d) information of the leg that leads to each.
        goal: (d, d) information of the leg to the goal.
        level: margin of the accuracy that runs and legs must reach by these estimates.
    """

    cost_s: Array
    saved_s: Array
    way_s: float
    legs: Array
    goal: Array
    level: float = 0.0

    def __post_init__(self) -> None:
        seal(self, cost_s="q", saved_s="q", legs="q d d", goal="d d")


@dataclass(frozen=True, kw_only=True, eq=False)
class DraftedDay:
    """A day as drafted.

    Attributes:
        repeats: (q,) runs.
        draft: the day.
        information: (legs, d, d) of each leg of its track, were the current known.
        whole: (d, d) of the whole track, beside a steady current that the forecast leaves unknown.
        margin: of the accuracy, by the whole track.
    """

    repeats: tuple[int, ...]
    draft: Draft
    information: Array
    whole: Array
    margin: float

    @property
    def day_s(self) -> float:
        """Everything between start and goal, as planned [s]."""
        return self.draft.sailed.day_s

    @property
    def expected_s(self) -> float:
        """The same with the expected time of go-arounds [s]."""
        return self.day_s + self.draft.going_round_s


def first_prices(problem: PlanProblem) -> Prices:
    """Prices before any day was planned: the way is at least the straight line to the goal."""
    count, dimension = len(problem.primitives), problem.design.problem.dimension
    transit_mps = ship_on_legs(problem).transit_speed_mps
    return Prices(
        cost_s=problem.design.problem.run_s + TUNING.first_leg_s,
        saved_s=_made_good_s(problem.primitives, transit_mps),
        way_s=float(np.hypot(*(problem.goal - problem.start)[:2])) / transit_mps,
        legs=np.zeros((count, dimension, dimension)),
        goal=np.zeros((dimension, dimension)),
        level=float(np.log(TUNING.first_share)),
    )


def offered(problem: PlanProblem, prices: Prices, free: Collection[str] = ()) -> Offer:
    """What runs cost and tell with their legs.

    Args:
        problem: gives the runs and the limits on them.
        prices: of runs.
        free: of the limits.
    """
    durations, limits = problem.design.problem, problem.design.problem.constraints
    names, run_s = durations.names, durations.run_s
    barred = set(limits.excluded) - set(free)
    least_s = np.array([limits.least_s.get(name, 0.0) for name in names])
    most_s = np.array([0.0 if name in barred else limits.most_s.get(name, np.inf) for name in names])
    required = np.array([float(name in limits.required) for name in names])
    samples = run_s / problem.vessel.sample_time_s
    return Offer(
        matrices=durations.matrices * samples[:, None, None] + prices.legs,
        cost_s=prices.cost_s,
        saved_s=prices.saved_s,
        way_s=prices.way_s,
        known=prices.goal,
        fewest=np.maximum(np.ceil(least_s / run_s), required),
        most=np.minimum(np.floor(most_s / run_s), TUNING.most_runs),
    )


def learnt_prices(primitives: Sequence[Primitive], days: Sequence[DraftedDay]) -> Prices:
    """Prices by all days so far; `level` is left at 0.

    Args:
        primitives: of the dictionary.
        days: one at least.
    """
    told = np.array(
        [
            matrix
            for day in days
            for leg, matrix in zip(day.draft.sailed.legs[:-1], day.information[:-1], strict=True)
            if leg.kind == "reposition"
        ]
    )
    goal, draft = np.mean([day.information[-1] for day in days], axis=0), days[0].draft
    saved_s = _made_good_s(primitives, draft.transit_mps)
    return Prices(
        cost_s=np.array([item.duration_s for item in primitives]) + _leg_s(days, saved_s),
        saved_s=saved_s,
        way_s=draft.direct_s,
        legs=np.broadcast_to(told.mean(axis=0), (len(primitives), *told.shape[1:])),
        goal=goal,
    )


def _leg_s(days: Sequence[DraftedDay], saved_s: Array) -> float:
    """Repositioning for each run, beyond the way to the goal that runs leave [s]."""
    beyond_s = sum(
        day.draft.sailed.seconds("reposition")
        + day.draft.going_round_s
        - max(day.draft.direct_s - float(np.dot(day.repeats, saved_s)), 0.0)
        for day in days
    )
    return max(float(beyond_s) / sum(sum(day.repeats) for day in days), TUNING.least_leg_s)


def _made_good_s(primitives: Sequence[Primitive], transit_mps: float) -> Array:
    """(q,) time at transit speed of each run's displacement."""
    return np.array([np.hypot(*item.displacement[:2]) for item in primitives]) / transit_mps
