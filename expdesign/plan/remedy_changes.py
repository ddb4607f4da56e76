"""Changes of one key, and the tests that say whether a refused plan passes with them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from expdesign.durations import DurationDesign, solve_durations
from expdesign.errors import InputError, NoAnswer, NoPlan
from expdesign.plan.assembly import (
    TRANSITION_BEAM,
    confidence_of_run,
    leg_water,
    roomy_water,
    run_space,
    search_space,
    ship_on_legs,
)
from expdesign.plan.feasibility import place_of
from expdesign.plan.legs import LegWater
from expdesign.plan.local_planner import Departure, RunSpace, local_planner
from expdesign.plan.runs import draws_for
from expdesign.plan.sailing import sail_all
from expdesign.plan.search import place_runs
from expdesign.plan.values import PlanProblem, SailedTrial, WorkBudget
from expdesign.progress import silent

MOST_SEARCHES = 8  # narrow searches for places, each with a quarter of the partial plans, to check remedies
REMEDY_BUDGET = 0.3  # share of the time budget that such a plan may spend on failures
MOST_LEFT_OUT = 8  # designs tried as remedies, each without the runs that had no place in the one before


NONE = "no single change of those tried helps ({})"
REST = "the rest of the plan was not tried with it"
UNCHECKED = "no remedy could be checked"
UNTRIED = "not tried: less design.total_s, wider [bounds] of the area"
PLACES = "the search finds a place for every run"
SAILED = "every run is sailed"
VERIFIED = "the plan passes its verification"
ACCEPTED = "drawn trials accept the plan"
REST_OPEN = {PLACES: True, SAILED: True, VERIFIED: True, ACCEPTED: False}
"""What a remedy was checked to do, and whether more of a plan was left unchecked."""


Tell = Callable[[str], None]
"""Is called with what is tried next."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Change:
    """A change of one key."""

    words: str  # the key and its value
    problem: PlanProblem | None  # with the change; None where runs then still have no place by themselves


def first_that_passes(
    changes: Iterable[Change],
    passes: Callable[[PlanProblem], bool],
    says: str,
    untried: str = "",
    *,
    tell: Tell,
    most: int = 0,
    affords: Callable[[], bool] = lambda: True,
) -> Iterator[str]:
    """The first change with which a test passes; what was tried, where none of them does.

    Changes come with the most promising first. Only so many are tried that this takes no longer than planning: a narrow
    search for places keeps a quarter of the partial plans. Those that work is not left for are told.
    """
    tried, passed_over, left = [], [], most or MOST_SEARCHES
    for change in changes:
        if change.problem is not None and not affords():
            passed_over.append(change.words)
            continue
        if change.problem is not None:
            tell(change.words)
        if change.problem is not None and passes(change.problem):
            yield f"with {change.words} {says}; {REST}" if REST_OPEN[says] else f"with {change.words} {says}"
            return
        tried.append(change.words)
        left -= change.problem is not None
        if not left:
            break
    beyond = f"not tried, as looking for remedies took as much work as planning: {', '.join(passed_over)}"
    none = NONE.format(", ".join(tried)) if tried else UNCHECKED
    yield "; ".join(filter(None, (none, beyond if passed_over else "", untried)))


def with_settings(problem: PlanProblem, **settings: Any) -> PlanProblem:
    """The problem with other settings."""
    return replace(problem, settings=replace(problem.settings, **settings))


def of_setting(problem: PlanProblem, key: str, value: float) -> Change:
    """The change of one of the planner's settings."""
    return Change(words=f"plan.{key} = {value:g}", problem=with_settings(problem, **{key: value}))


def exclusions(problem: PlanProblem, lacking: set[str]) -> Iterator[Change]:
    """Designs without the runs that have no place, and without those that then come in and have none."""
    if not isinstance(problem.design, DurationDesign):
        return
    limits = problem.design.problem.constraints
    water = leg_water(problem, ship_on_legs(problem))
    for _ in range(MOST_LEFT_OUT):
        excluded = (*limits.excluded, *sorted(lacking - set(limits.excluded)))
        try:
            task = replace(problem.design.problem, constraints=replace(limits, excluded=excluded))
            other = replace(problem, design=solve_durations(task))
            more = without_place(run_space(other, water))
        except (InputError, NoAnswer):  # no design without them
            break
        if not more:
            names = ", ".join(f'"{name}"' for name in excluded)
            yield Change(words=f"design.excluded = [{names}]", problem=other)
            return
        lacking = lacking | more
    yield Change(words=f"design.excluded with {', '.join(sorted(lacking))}", problem=None)


def without_place(space: RunSpace) -> set[str]:
    """Names of runs for which no place was found."""
    return {run.name for index, run in enumerate(space.footprints) if place_of(space, index).pose is None}


def finds_places(problem: PlanProblem) -> bool:
    """Whether a narrow search finds places for all runs."""
    try:
        draws_for(confidence_of_run(problem))
        water = leg_water(problem, ship_on_legs(problem))
        space = search_space(problem, water, local_planner(water, problem.used), strict=True)
        repeats = [problem.repeats[run.name] for run in space.footprints]
        place_runs(space, repeats, Departure(pose=problem.start), width=TRANSITION_BEAM, orders=0)
    except NoPlan:
        return False
    return True


def first_sailed(problem: PlanProblem, budget: WorkBudget) -> tuple[LegWater, SailedTrial] | None:
    """The first plan, as far as sailing it, with a part of the time budget; None where there is none.

    Its work is counted.
    """
    part = with_settings(problem, time_budget_s=REMEDY_BUDGET * problem.settings.time_budget_s)
    try:
        water, room = roomy_water(part, ship_on_legs(part), silent)
        return water, sail_all(part, room, silent, stated=water, budget=budget)
    except NoPlan:
        return None


def largest(passes: Callable[[float], bool], refused: float) -> float | None:
    """The largest value below a refused one that passes, to a twentieth of it or so, or None where 0 does not."""
    if not refused > 0 or not passes(0.0):
        return None
    step = refused / 20
    low, high = 0, 20
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if passes(middle * step) else (low, middle)
    rounded = float(f"{low * step:.2g}")
    return rounded if rounded <= low * step else float(f"{low * step:.6g}")


def rounded_up(value: float) -> float:
    """A value rounded up to three digits."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 2)
    return float(f"{np.ceil(value / unit) * unit:.6g}")
