"""What one more run costs and tells, its leg included, learnt from the days that were planned.

A run takes its own time, and a share of the repositioning that plans have beyond the direct way. Its way made good
saves time of that way. It tells what it does along the way to the goal: its heading decides what wind and an unknown
current leave to be told. The legs that lead to runs tell, too. Each is taken to tell what legs did on average: how long
a leg is, and so what it tells, depends on its place in the day more than on the run that it leads to. These are
estimates for the next plan; the next plan itself says what is true.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.information.disturbed import bordered_runs
from expdesign.plan.assembly import ship_on_legs
from expdesign.plan.drafts import Draft
from expdesign.plan.values import PlanProblem
from expdesign.signals import Trajectory
from expdesign.values import Array, sealed

# information from runs in the first day, as a share of what is needed, as legs tell the rest; and in a draft, whose
# manoeuvres tell less, so that it has more runs and more legs
FIRST_SHARE, DRAFT_SHARE = 0.55, 0.42
COURSES = 4  # on which runs are taken to be sailed
# standard deviation of these about the straight line, before a day has been planned: two courses, so far to each side,
# average smooth functions as any even spread does, up to the third order
COURSE_STD_RAD = 0.37
FIRST_LEG_S = 15.0  # time of repositioning for each run, before a day has been planned [s]
OTHER_RUNS = 1  # of each manoeuvre that it has more or fewer, at most
AVERAGE_LEGS = 2.0  # legs to one manoeuvre that the average of all legs counts as, once days have been planned
LEAST_LEG_S = 5.0  # least of it once days have been planned [s]
MOST_RUNS = 200  # of one primitive


def runs_along(problem: PlanProblem, courses: Array) -> Array:
    """(q, d, d) information of one whole run of each primitive, on average over courses (c,) that it makes good [rad].

    Sums over samples. (q, d + 2, d + 2) where the forecast leaves a steady current unknown.
    """
    durations, runs = problem.design.problem, problem.primitives
    lengths, found = np.array([len(run.commands) for run in runs]), dict[int, Array]()
    for length in np.unique(lengths):
        some: Sequence[int] = np.flatnonzero(lengths == length).tolist()
        matrices, _ = bordered_runs(
            problem.vessel,
            np.array([runs[index].commands.values for index in some]),
            np.array([runs[index].entry_velocity for index in some]),
            durations.parameters,
            environment=problem.environment,
            mean_subtraction=durations.mean_subtraction,
            standing=np.array([runs[index].entry_inputs for index in some]),
            courses=courses,
        )
        found |= dict(zip(some, length * matrices, strict=True))
    return np.array([found[index] for index in range(len(runs))])


def straight_courses(problem: PlanProblem) -> Array:
    """(c,) near the straight line to the goal [rad]; of all directions where runs last longer than the way."""
    away = problem.goal[:2] - problem.start[:2]
    longest_m = max(float(np.hypot(*item.displacement[:2])) for item in problem.primitives)
    if np.hypot(*away) <= longest_m:
        return np.asarray(2 * np.pi * np.arange(COURSES) / COURSES)
    return np.asarray(np.arctan2(away[1], away[0]) + COURSE_STD_RAD * np.array([-1.0, 1.0]))


def courses_of(track: Trajectory) -> Array:
    """(c,) of equally long parts of a track [rad]."""
    places = track.pose[np.linspace(0, len(track) - 1, COURSES + 1).round().astype(int), :2]
    away = np.diff(places, axis=0)
    return np.asarray(np.arctan2(away[:, 1], away[:, 0]))


@sealed(matrices="q d d", cost_s="q", saved_s="q", known="d d", fewest="q", most="q")
class Offer:
    """Runs to choose from."""

    matrices: Array  # (q, d, d) information of one whole run, summed over its samples
    cost_s: Array  # (q,) of one whole run
    saved_s: Array  # (q,) time of transit that its way made good saves
    way_s: float  # most that all runs save together
    known: Array  # (d, d) information without runs
    # fewest, most: (q,) limits on runs
    fewest: Array
    most: Array

    def information(self, runs: Array) -> Array:
        """(d, d) of runs (q,), and what is known."""
        return np.asarray(self.known + np.tensordot(runs, self.matrices, axes=1))

    def total_s(self, runs: Array) -> float:
        """Cost of runs (q,), less what they save."""
        return float(runs @ self.cost_s) - min(float(runs @ self.saved_s), self.way_s)


@sealed(cost_s="q", saved_s="q", runs="q d d", leg="d d", goal="d d")
class Prices:
    """Costs and information at the margin."""

    cost_s: Array  # (q,) of one more whole run, its leg included
    saved_s: Array  # (q,) time at transit speed of its way made good
    way_s: float  # time at transit speed of the way from start to goal
    runs: Array  # (q, d, d) information of one more whole run
    leg: Array  # (d, d) information of the leg that leads to it
    goal: Array  # (d, d) information of the leg to the goal
    level: float = 0.0  # margin of the accuracy that runs and legs must reach by these estimates


@dataclass(frozen=True, kw_only=True, eq=False)
class DraftedDay:
    """A day as drafted."""

    repeats: tuple[int, ...]  # (q,) runs
    draft: Draft  # the day
    # (legs, d, d) of each leg of its track, or (legs, d + 2, d + 2) where the forecast leaves a steady current unknown
    information: Array
    margin: float  # of the accuracy, by the whole track
    # (p, p) of estimates from the whole track; None where it does not determine every parameter
    covariance: Array | None = None
    drawn: bool = False  # whether drawn trials tell how late it is

    @property
    def whole(self) -> Array:
        """(d, d) or (d + 2, d + 2) information of the whole track."""
        return np.asarray(self.information.sum(axis=0))

    @property
    def day_s(self) -> float:
        """Everything between start and goal, as planned [s]."""
        return self.draft.sailed.day_s

    @property
    def expected_s(self) -> float:
        """The same as drawn trials take on average, go-arounds included [s]."""
        return self.day_s + float(self.draft.late_s.sum())

    def late(self, late_s: Array) -> DraftedDay:
        """The day whose legs take drawn trials so much longer (legs,) [s]."""
        return replace(self, draft=replace(self.draft, late_s=late_s), drawn=True)

    def taken_late(self, run_s: float) -> DraftedDay:
        """The day whose legs to runs are taken to take so much longer each [s]."""
        legs = self.draft.sailed.legs
        to_runs = [leg.kind == "primitive" for leg in legs[1:]] + [False]
        return replace(self, draft=replace(self.draft, late_s=run_s * np.array(to_runs, dtype=float)))

    @property
    def late_run_s(self) -> float:
        """How late drawn trials are for each run, on average [s]."""
        return float(self.draft.late_s.sum()) / max(sum(self.repeats), 1)


def first_prices(problem: PlanProblem) -> Prices:
    """Prices before any day was planned: the way is at least the straight line to the goal."""
    transit_mps = ship_on_legs(problem).transit_speed_mps
    runs = runs_along(problem, straight_courses(problem))
    return Prices(
        cost_s=problem.design.problem.run_s + FIRST_LEG_S,
        saved_s=_made_good_s(problem.primitives, transit_mps),
        way_s=float(np.hypot(*(problem.goal - problem.start)[:2])) / transit_mps,
        runs=runs,
        leg=np.zeros_like(runs[0]),
        goal=np.zeros_like(runs[0]),
        level=float(np.log(DRAFT_SHARE if problem.settings.draft else FIRST_SHARE)),
    )


def offered(problem: PlanProblem, prices: Prices, free: Collection[str] = (), placeless: Collection[str] = ()) -> Offer:
    """What runs cost and tell with their legs.

    Args:
        problem: gives the runs and the limits on them.
        placeless: not offered, as they have no place in the water, unless the limits require them.
    """
    durations, limits = problem.design.problem, problem.design.problem.constraints
    names, barred = durations.names, set(limits.excluded) - set(free)
    fewest, most = fewest_runs(problem), np.where([name in barred for name in names], 0.0, most_runs(problem))
    return Offer(
        matrices=prices.runs + prices.leg,
        cost_s=prices.cost_s,
        saved_s=prices.saved_s,
        way_s=prices.way_s,
        known=prices.goal,
        fewest=fewest,
        most=np.where([name in placeless for name in names], fewest, most),
    )


def fewest_runs(problem: PlanProblem) -> Array:
    """(q,) of each primitive, by the limits on durations."""
    durations, limits = problem.design.problem, problem.design.problem.constraints
    least_s = np.array([limits.least_s.get(name, 0.0) for name in durations.names])
    required = np.array([float(name in limits.required) for name in durations.names])
    return np.asarray(np.maximum(np.ceil(least_s / durations.run_s), required))


def most_runs(problem: PlanProblem) -> Array:
    """(q,) of each primitive, by the limits on durations, whether or not it is excluded."""
    durations, limits = problem.design.problem, problem.design.problem.constraints
    most_s = np.array([limits.most_s.get(name, np.inf) for name in durations.names])
    return np.asarray(np.minimum(np.floor(most_s / durations.run_s), MOST_RUNS))


def near_day(offer: Offer, runs: Array, day: DraftedDay, names: Sequence[str]) -> Offer:
    """The offer round a day: a run more or fewer of each, by what the day's own runs tell with the legs beside them.

    Other runs tell what they are taken to, (q, d, d), and come with the average of the day's legs between runs.
    """
    had, legs, joined = np.array(day.repeats, dtype=float), day.draft.sailed.legs, with_legs(day)
    done = np.array([names.index(leg.name) if leg.kind == "primitive" else -1 for leg in legs])
    alone, told = day.information[done >= 0].sum(axis=0), joined[done >= 0].sum(axis=0)
    matrices = runs + (told - alone) / had.sum()
    for index in np.flatnonzero(had).tolist():
        matrices[index] = joined[done == index].mean(axis=0)
    return replace(
        offer,
        matrices=matrices,
        known=day.whole - told,
        fewest=np.clip(had - OTHER_RUNS, offer.fewest, offer.most),
        most=np.clip(had + OTHER_RUNS, offer.fewest, offer.most),
    )


def with_legs(day: DraftedDay) -> Array:
    """(legs, d, d) information of runs with half of each leg beside them; of legs what is left.

    Where a run is left out one leg takes the place of two, and is taken to tell what these do on average. Turns and
    changes of speed tell much, and which there are depends on the runs at both ends.
    """
    found = np.array(day.information)
    runs = [leg.kind == "primitive" for leg in day.draft.sailed.legs]
    for place in np.flatnonzero(~np.array(runs)).tolist():
        for beside in (place - 1, place + 1):
            if 0 <= beside < len(runs) and runs[beside]:
                found[beside] += day.information[place] / 2
                found[place] -= day.information[place] / 2
    return found


def learnt_prices(problem: PlanProblem, days: Sequence[DraftedDay]) -> Prices:
    """Prices by all days so far; `level` is left at 0.

    Args:
        days: one at least; runs are taken to lie along the track of the last.
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
    names = problem.design.problem.names
    saved_s = _made_good_s(problem.primitives, draft.transit_mps)
    return Prices(
        cost_s=np.array([item.duration_s for item in problem.primitives]) + _legs_s(names, days, saved_s),
        saved_s=saved_s,
        way_s=draft.direct_s,
        runs=runs_along(problem, courses_of(days[-1].draft.sailed.trajectory)),
        leg=told.mean(axis=0),
        goal=goal,
    )


def _legs_s(names: Sequence[str], days: Sequence[DraftedDay], saved_s: Array) -> Array:
    """(q,) repositioning for each run, beyond the way that it and its leg make good, as drawn trials take it [s].

    By the legs that led to it so far, and the average leg, which counts as `AVERAGE_LEGS` of them. Of a day that no
    drawn trial ended, as planned.
    """
    beyond_s, into = list[float](), list[int]()
    for day in days:
        draft, sailed = day.draft, day.draft.sailed
        runs, late_s = [leg.kind == "primitive" for leg in sailed.legs], draft.late_s
        beyond = lost_s(draft) + np.where(np.isfinite(late_s), late_s, 0.0)
        for place in np.flatnonzero(runs).tolist():
            run = names.index(sailed.legs[place].name)
            first = place - 1 if place and not runs[place - 1] else place
            own_s = sailed.legs_s[place] - saved_s[run]
            into.append(run)
            beyond_s.append(float(beyond[first : place + 1].sum()) - own_s)
    average_s, count = np.mean(beyond_s), np.bincount(into, minlength=len(names))
    sums_s = np.bincount(into, weights=beyond_s, minlength=len(names))
    learnt_s: Array = (AVERAGE_LEGS * average_s + sums_s) / (AVERAGE_LEGS + count)
    return np.asarray(np.maximum(learnt_s, LEAST_LEG_S))


def lost_s(draft: Draft) -> Array:
    """(legs,) time beyond that of the way that each run or leg makes good [s]."""
    return np.asarray(draft.sailed.legs_s - draft.made_good_m / draft.transit_mps)


def _made_good_s(primitives: Sequence[Primitive], transit_mps: float) -> Array:
    """(q,) time at transit speed of each run's displacement."""
    return np.array([np.hypot(*item.displacement[:2]) for item in primitives]) / transit_mps
