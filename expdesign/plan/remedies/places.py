"""Remedies where runs find no place, or the room that they need cannot be estimated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

from expdesign.errors import NoPlan
from expdesign.plan.assembly import (
    dispersions,
    footprints,
    leg_water,
    run_space,
    ship_on_legs,
)
from expdesign.plan.legs import LegWater
from expdesign.plan.local_planner import RunSpace
from expdesign.plan.problem import PlanProblem
from expdesign.plan.remedies.changes import (
    PLACES,
    UNTRIED,
    Change,
    Tell,
    exclusions,
    finds_places,
    first_that_passes,
    largest,
    of_setting,
    with_settings,
    without_place,
)
from expdesign.plan.tuning import PLAN
from expdesign.values import Array


def for_room(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """A clearance or a confidence with which the runs find places, or the runs to leave out."""
    water = leg_water(problem, ship_on_legs(problem))
    space = run_space(problem, water)
    lacking = without_place(space)
    changes = chain(_clearances(problem, water, space, lacking), _confidences(problem, space, lacking))
    tries = chain(changes, exclusions(problem, lacking or {refused.which}))
    yield from first_that_passes(tries, finds_places, PLACES, UNTRIED, tell=tell)


def _clearances(problem: PlanProblem, water: LegWater, space: RunSpace, lacking: set[str]) -> Iterator[Change]:
    """Shares of the largest clearance with which every run has a place by itself.

    The grid holds distances to the shore for any clearance, and a smaller clearance only leaves more room.
    """
    asked = problem.settings.clearance_m
    off_m = dispersions(problem)

    def fits(clearance_m: float) -> bool:
        other = with_settings(problem, clearance_m=clearance_m)
        margin_m = replace(water, clearance_m=clearance_m).leg_margin_m + water.field.cell_m / 2
        return not without_place(_only(space, other, off_m, lacking, margin_m))

    most = largest(fits, asked) if lacking else asked
    if most is None:
        yield Change(words="plan.clearance_m down to 0", problem=None)
        return
    for share in PLAN.clearance_shares:
        clearance_m = float(f"{share * most:.2g}")
        if clearance_m < asked:
            yield of_setting(problem, "clearance_m", clearance_m)


def _confidences(problem: PlanProblem, space: RunSpace, lacking: set[str]) -> Iterator[Change]:
    """Lower confidences with which every run has a place by itself, where they leave runs more room."""
    if not any((off > problem.settings.clearance_m).any() for off in dispersions(problem)):
        return
    for confidence in PLAN.lower_confidences:
        if confidence < problem.settings.confidence:
            other = with_settings(problem, confidence=confidence)
            none = without_place(_only(space, other, dispersions(other), lacking, space.leg_margin_m))
            yield Change(words=f"plan.confidence = {confidence:g}", problem=None if none else other)


def _only(space: RunSpace, problem: PlanProblem, off_m: Sequence[Array], names: set[str], margin_m: float) -> RunSpace:
    """The space with some of the runs, and the room that another problem leaves them."""
    runs = tuple(run for run in footprints(problem, space.field, off_m) if run.name in names)
    return replace(space, footprints=runs, leg_margin_m=margin_m)


def for_lattice(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """The other planner, if it finds places for the runs."""
    beam = Change(words="plan.planner = 'beam'", problem=problem)
    yield from first_that_passes([beam], finds_places, PLACES, tell=tell)


def for_confidence(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """The largest confidence of those tried at which the room of runs can be estimated, and every run has a place."""
    lower = [value for value in PLAN.lower_confidences if value < problem.settings.confidence]
    changes = (of_setting(problem, "confidence", value) for value in lower)
    without = exclusions(problem, {refused.which}) if refused.what == "unstable" else ()
    yield from first_that_passes(chain(changes, without), finds_places, PLACES, tell=tell, most=len(lower) + 1)
