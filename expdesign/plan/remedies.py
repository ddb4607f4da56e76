"""Remedies of a refusal: changes of one key for which the test that failed passes, each checked by that test.

Few changes are tried, the most promising first, so that looking for a remedy takes no longer than planning. The refusal
says what was not tried, and where no remedy could be checked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np
import shapely

from expdesign.durations import DurationDesign, solve_durations
from expdesign.errors import InputError, NoAnswer, NoPlan
from expdesign.plan.assembly import (
    confidence_of_run,
    dispersions,
    footprints,
    leg_water,
    roomy_water,
    run_space,
    search_space,
    ship_on_legs,
)
from expdesign.plan.checked import accepted, verified
from expdesign.plan.feasibility import place_of
from expdesign.plan.legs import LegWater, escapes
from expdesign.plan.local_planner import RunSpace, local_planner
from expdesign.plan.problem import PlanProblem
from expdesign.plan.runs import draws_for
from expdesign.plan.sailing import sail_all
from expdesign.plan.search import place_runs
from expdesign.plan.tuning import PLAN
from expdesign.plan.values import SailedTrial
from expdesign.plan.work_budget import WorkBudget
from expdesign.progress import silent
from expdesign.values import Array

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


def advised(problem: PlanProblem, refused: NoPlan) -> NoPlan:
    """The refusal with what helps.

    Args:
        problem: that was refused, with the water in which it was.
        refused: by the planner.
    """
    check = CHECKS.get(refused.what)
    if check is None:
        refused.remedies = refused.remedies or (UNCHECKED,)
        return refused
    try:
        found = tuple(check(problem, refused))
    except NoPlan as error:  # another obstacle behind this one
        found = (f"a remedy cannot be checked: {error.obstacle}",)
    refused.remedies = (*found, *refused.remedies)
    return refused


def _for_parted(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """The place nearest to the goal that a path leads to."""
    water = leg_water(problem, ship_on_legs(problem))
    vessel, start, goal = problem.vessel, problem.start, shapely.Point(problem.goal[1], problem.goal[0])
    roomy = water.area.safe_water(max(water.leg_margin_m, water.clearance_m + np.hypot(*vessel.hull_b.T).max()) + 1.0)
    parts = [part for part in roomy.geoms if any(shapely.contains(whole, shapely.points(start[1::-1])) and
             shapely.intersects(whole, part) for whole in water.area.water.geoms)]  # fmt: skip
    for part in sorted(parts, key=goal.distance):
        place = shapely.get_coordinates(shapely.shortest_line(part, goal))[0, ::-1]
        if water.candidate_paths(start[:2], place):
            lat, lon = water.area.frame.to_degrees(place)
            yield (
                f"the nearest place that a path leads to is goal.lat_deg = {lat:.6f}, goal.lon_deg = {lon:.6f} "
                f"(north_m = {place[0]:.2f}, east_m = {place[1]:.2f}); {REST}"
            )
            return
    yield NONE.format("other places for the goal")


def _for_passage(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """The largest clearance with which a path leads through."""
    water = leg_water(problem, ship_on_legs(problem))

    def passes(clearance_m: float) -> bool:
        return bool(replace(water, clearance_m=clearance_m).candidate_paths(problem.start[:2], problem.goal[:2]))

    clearance_m = _largest(passes, problem.settings.clearance_m)
    if clearance_m is None:
        yield NONE.format("plan.clearance_m down to 0")
    else:
        yield f"with plan.clearance_m = {clearance_m:g} a path leads through; {REST}"


def _for_room(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """A clearance or a confidence with which the runs find places, or the runs to leave out."""
    water = leg_water(problem, ship_on_legs(problem))
    space = run_space(problem, water)
    lacking = _without_place(space)
    changes = chain(_clearances(problem, water, space, lacking), _confidences(problem, space, lacking))
    yield from _first(chain(changes, _exclusions(problem, lacking or {refused.which})), _found, PLACES, UNTRIED)


@dataclass(frozen=True, kw_only=True, eq=False)
class Change:
    """A change of one key.

    Attributes:
        words: the key and its value.
        problem: with the change; None where runs then still have no place by themselves.
    """

    words: str
    problem: PlanProblem | None


def _first(
    changes: Iterable[Change], passes: Callable[[PlanProblem], bool], says: str, untried: str = "", *, most: int = 0
) -> Iterator[str]:
    """The first change with which a test passes; what was tried, where none of them does.

    Changes come with the most promising first. Only so many are tried that this takes no longer than planning: a narrow
    search for places keeps a quarter of the partial plans.
    """
    tried, left = [], most or PLAN.most_searches
    for change in changes:
        if change.problem is not None and passes(change.problem):
            yield f"with {change.words} {says}; {REST}" if REST_OPEN[says] else f"with {change.words} {says}"
            return
        tried.append(change.words)
        left -= change.problem is not None
        if not left:
            break
    yield "; ".join(filter(None, (NONE.format(", ".join(tried)) if tried else UNCHECKED, untried)))


def _clearances(problem: PlanProblem, water: LegWater, space: RunSpace, lacking: set[str]) -> Iterator[Change]:
    """Shares of the largest clearance with which every run has a place by itself.

    The grid tells distances to the shore, whatever the clearance, and room for runs only grows as that falls.
    """
    asked = problem.settings.clearance_m
    off_m = dispersions(problem)

    def fits(clearance_m: float) -> bool:
        other = _with(problem, clearance_m=clearance_m)
        margin_m = replace(water, clearance_m=clearance_m).leg_margin_m + water.field.cell_m / 2
        return not _without_place(_only(space, other, off_m, lacking, margin_m))

    most = _largest(fits, asked) if lacking else asked
    if most is None:
        yield Change(words="plan.clearance_m down to 0", problem=None)
        return
    for share in PLAN.clearance_shares:
        clearance_m = float(f"{share * most:.2g}")
        if clearance_m < asked:
            yield Change(words=f"plan.clearance_m = {clearance_m:g}", problem=_with(problem, clearance_m=clearance_m))


def _confidences(problem: PlanProblem, space: RunSpace, lacking: set[str]) -> Iterator[Change]:
    """Lower confidences with which every run has a place by itself, where they leave runs more room."""
    if not any((off > problem.settings.clearance_m).any() for off in dispersions(problem)):
        return
    for confidence in PLAN.lower_confidences:
        if confidence < problem.settings.confidence:
            other = _with(problem, confidence=confidence)
            none = _without_place(_only(space, other, dispersions(other), lacking, space.leg_margin_m))
            yield Change(words=f"plan.confidence = {confidence:g}", problem=None if none else other)


def _only(space: RunSpace, problem: PlanProblem, off_m: Sequence[Array], names: set[str], margin_m: float) -> RunSpace:
    """The space with some of the runs, and the room that another problem leaves them."""
    runs = tuple(run for run in footprints(problem, space.field, off_m) if run.name in names)
    return replace(space, footprints=runs, leg_margin_m=margin_m)


def _exclusions(problem: PlanProblem, lacking: set[str]) -> Iterator[Change]:
    """Designs without the runs that have no place, and without those that then come in and have none."""
    if not isinstance(problem.design, DurationDesign):
        return
    limits = problem.design.problem.constraints
    water = leg_water(problem, ship_on_legs(problem))
    for _ in range(PLAN.most_left_out):
        excluded = (*limits.excluded, *sorted(lacking - set(limits.excluded)))
        try:
            task = replace(problem.design.problem, constraints=replace(limits, excluded=excluded))
            other = replace(problem, design=solve_durations(task))
            more = _without_place(run_space(other, water))
        except (InputError, NoAnswer):  # no design without them
            break
        if not more:
            names = ", ".join(f'"{name}"' for name in excluded)
            yield Change(words=f"design.excluded = [{names}]", problem=other)
            return
        lacking = lacking | more
    yield Change(words=f"design.excluded with {', '.join(sorted(lacking))}", problem=None)


def _for_lattice(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """The other planner, if it finds places for the runs."""
    yield from _first([Change(words="plan.planner = 'beam'", problem=problem)], _found, PLACES)


def _for_sailing(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """Less clearance, or a design without the run that no leg led to, with which every run is sailed."""
    asked = problem.settings.clearance_m
    halves = [float(f"{share * asked:.2g}") for share in PLAN.sailed_shares] if asked > 0 else []
    changes = [
        Change(words=f"plan.clearance_m = {value:g}", problem=_with(problem, clearance_m=value)) for value in halves
    ]
    names = {refused.which} - {"", "goal"}
    tries = chain(changes[:1], _exclusions(problem, names) if names else (), changes[1:])
    yield from _first(tries, lambda other: _sailed(other) is not None, SAILED, most=PLAN.most_plans)


def _for_risk(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """A better forecast, or a design without the run at which most trials fail, that drawn trials accept."""

    def passes(other: PlanProblem) -> bool:
        made = _sailed(other)
        return made is not None and accepted(other, *made)

    names = {refused.which} - {"", "goal"}
    more = "the planner has tried more room" if len(refused.tried) > 1 else ""
    forecasts = tuple(_forecasts(problem))
    tries = chain(forecasts[:1], _exclusions(problem, names) if names else (), forecasts[1:])
    yield from _first(tries, passes, ACCEPTED, more, most=PLAN.most_plans)


def _forecasts(problem: PlanProblem) -> Iterator[Change]:
    """Current and wind known twice as well, as far as they are uncertain."""
    for key, name in (("current_to", "current_std_mps"), ("wind_to", "wind_std_mps")):
        std_mps = float(f"{getattr(problem.environment, name) / 2:.3g}")
        if std_mps > 0:
            better: dict[str, Any] = {name: std_mps}
            words = f"environment.{key}.std_mps = {std_mps:g} (a better forecast)"
            yield Change(words=words, problem=replace(problem, environment=replace(problem.environment, **better)))


def _for_verification(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """Another seed, whose plan passes."""

    def passes(other: PlanProblem) -> bool:
        made = _sailed(other)
        try:
            return made is not None and verified(other, *made).verified
        except NoPlan:
            return False

    seeds = range(problem.seed + 1, problem.seed + 1 + PLAN.most_plans)
    changes = (Change(words=f"--seed {seed}", problem=replace(problem, seed=seed)) for seed in seeds)
    yield from _first(changes, passes, VERIFIED, most=PLAN.most_plans)


def _sailed(problem: PlanProblem) -> tuple[LegWater, SailedTrial] | None:
    """The first plan, as far as sailing it, with a part of the time budget; None where there is none."""
    part = _with(problem, time_budget_s=PLAN.remedy_budget * problem.settings.time_budget_s)
    try:
        water, room = roomy_water(part, ship_on_legs(part), silent)
        return water, sail_all(part, room, silent, stated=water, budget=WorkBudget())
    except NoPlan:
        return None


def _found(problem: PlanProblem) -> bool:
    """Whether a narrow search finds places for all runs."""
    try:
        draws_for(confidence_of_run(problem))
        water = leg_water(problem, ship_on_legs(problem))
        space = search_space(problem, water, local_planner(water, problem.used), strict=True)
        repeats = [problem.repeats[run.name] for run in space.footprints]
        place_runs(space, repeats, start=problem.start, width=PLAN.transition_beam, orders=0)
    except NoPlan:
        return False
    return True


def _with(problem: PlanProblem, **settings: Any) -> PlanProblem:
    return replace(problem, settings=replace(problem.settings, **settings))


def _without_place(space: RunSpace) -> set[str]:
    """Names of runs for which no place was found."""
    return {run.name for index, run in enumerate(space.footprints) if place_of(space, index).pose is None}


def _for_berth(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """Another heading, less clearance, or tighter turns at the start or the goal."""
    backwards = refused.which == "goal"
    pose = problem.goal if backwards else problem.start
    water = leg_water(problem, ship_on_legs(problem))

    def free(heading_rad: float, where: LegWater) -> bool:
        turned = np.array([*pose[:2], heading_rad])
        return where.holds(turned[None]) and escapes(turned, where, backwards=backwards)

    for turn_deg in (turn * side for turn in PLAN.turns_deg for side in (1, -1)):
        heading_deg = round(float(np.degrees(pose[2])) + turn_deg) % 360
        if free(np.radians(heading_deg), water):
            yield f"{refused.which}.heading_deg = {heading_deg} has such a path; {REST}"
            return
    clearance_m = _largest(lambda value: free(pose[2], replace(water, clearance_m=value)), problem.settings.clearance_m)
    if clearance_m is not None:
        yield f"with plan.clearance_m = {clearance_m:g} there is such a path; {REST}"
        return
    for key, radius in (("plan.turning_radius_m", share * water.ship.turning_radius_m) for share in PLAN.tighter):
        value = _up(radius)
        try:
            ship = ship_on_legs(_with(problem, turning_radius_m=value))
        except NoPlan:
            break
        if free(pose[2], replace(water, ship=ship)):
            yield f"with {key} = {value:g} there is such a path; {REST}"
            return
    yield NONE.format(f"{refused.which}.heading_deg, plan.clearance_m down to 0, plan.turning_radius_m")


def _for_confidence(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """The largest confidence of those tried at which the room of runs can be estimated, and every run has a place."""
    lower = [value for value in PLAN.lower_confidences if value < problem.settings.confidence]
    changes = (
        Change(words=f"plan.confidence = {value:g}", problem=_with(problem, confidence=value)) for value in lower
    )
    without = _exclusions(problem, {refused.which}) if refused.what == "unstable" else ()
    yield from _first(chain(changes, without), _found, PLACES, most=len(lower) + 1)


def _for_settings(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """Speeds and radii that the ship is capable of."""
    key = "transit_speed_mps" if refused.what == "speed" else "turning_radius_m"
    for value in (None, *(_speeds(problem) if refused.what == "speed" else ())):
        other = _with(problem, **{key: value})
        if other.settings != problem.settings and _capable(other):
            change = f"without plan.{key}" if value is None else f"with plan.{key} = {value:g}"
            yield f"{change} the vessel is capable of what is asked; {REST}"
            return
    yield NONE.format(f"plan.{key}")


def _speeds(problem: PlanProblem) -> tuple[float, ...]:
    """Speeds faster than the mean current, the slowest first [m/s]."""
    return tuple(_up(share * problem.current_mps) for share in PLAN.faster if problem.current_mps > 0)


def _capable(problem: PlanProblem) -> bool:
    try:
        return ship_on_legs(problem) is not None
    except NoPlan:
        return False


def _largest(passes: Callable[[float], bool], refused: float) -> float | None:
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


def _up(value: float) -> float:
    """A value rounded up to three digits."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 2)
    return float(f"{np.ceil(value / unit) * unit:.6g}")


CHECKS: Mapping[str, Callable[[PlanProblem, NoPlan], Iterator[str]]] = {
    "berth": _for_berth,
    "confidence": _for_confidence,
    "lattice": _for_lattice,
    "parted": _for_parted,
    "passage": _for_passage,
    "radius": _for_settings,
    "risk": _for_risk,
    "room": _for_room,
    "sailing": _for_sailing,
    "speed": _for_settings,
    "unstable": _for_confidence,
    "verification": _for_verification,
}
"""Remedies by the kind of obstacle, as `NoPlan.what` names it."""
