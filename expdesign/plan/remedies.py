"""What helps against a refusal: changes of one key for which the test that failed passes, each checked by that test.

Few changes are tried, the most promising first, so that looking for a remedy takes no longer than planning. The refusal
says what was not tried, and where no remedy could be checked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, islice
from typing import Any

import numpy as np
import shapely

from expdesign.errors import NoPlan
from expdesign.plan.assembly import dispersions, footprints, leg_water, run_space, ship_on_legs
from expdesign.plan.checked import Refused, accepted, promising, verified
from expdesign.plan.legs import LegWater, escapes
from expdesign.plan.local_planner import RunSpace
from expdesign.plan.remedy_changes import (
    ACCEPTED,
    NONE,
    PLACES,
    REST,
    SAILED,
    UNCHECKED,
    UNTRIED,
    VERIFIED,
    Change,
    Tell,
    exclusions,
    finds_places,
    first_sailed,
    first_that_passes,
    largest,
    of_setting,
    rounded_up,
    with_settings,
    without_place,
)
from expdesign.plan.values import PlanProblem, WorkBudget
from expdesign.progress import Progress, silent
from expdesign.values import Array

REPLANS = 2  # plans made after the first one, each with more room where drawn trials of the one before left the water
# from the heading asked for at start and goal, tried as remedies to both sides [deg]
TURNS_DEG: tuple[float, ...] = tuple(15.0 * count for count in range(1, 13))

CLEARANCE_SHARES = (1.0, 0.75, 0.5, 0.0)  # of the largest clearance with which every run has a place, tried as remedies
SAILED_SHARES = (0.5, 0.0)  # of the clearance asked for, tried as remedies where legs fail
MOST_PLANS = 2  # plans made to check remedies
# counted work of looking for remedies where legs or drawn trials fail, in that of the refused plan: with that plan no
# more than the three plans that a trial may take
REMEDY_WORK = 1.75
# tried as remedies of a refusal, the highest first
LOWER_CONFIDENCES = (0.9999, 0.9995, 0.999, 0.995, 0.99, 0.98, 0.95, 0.9, 0.8)
TOLERANCES = (2.0, 4.0)  # `plan.start_tolerance` tried as remedies
TIGHTER = (0.9, 0.8, 0.7, 0.6, 0.5)  # turning radii tried as remedies, in that of legs
FASTER = (1.05, 1.2, 1.5)  # repositioning speeds tried as remedies, in the mean current


# Remedies where no path leads through, a berth cannot be left or reached, or the ship cannot do what is asked.


def for_parted(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """The place nearest to the goal that a path leads to."""
    tell("another place for the goal")
    water = leg_water(problem, ship_on_legs(problem))
    vessel, start, goal = problem.vessel, problem.start, shapely.Point(problem.goal[1], problem.goal[0])
    roomy = water.area.safe_water(max(water.leg_margin_m, water.clearance_m + np.hypot(*vessel.hull_b.T).max()) + 1.0)
    parts = [part for part in roomy.geoms if any(shapely.contains(whole, shapely.points(start[1::-1])) and
             shapely.intersects(whole, part) for whole in water.area.water.geoms)]  # fmt: skip
    for part in sorted(parts, key=goal.distance):
        place = shapely.get_coordinates(shapely.shortest_line(part, goal))[0, ::-1]
        if water.joins(start[:2], place):
            lat, lon = water.area.frame.to_degrees(place)
            yield (
                f"the nearest place that a path leads to is goal.lat_deg = {lat:.6f}, goal.lon_deg = {lon:.6f} "
                f"(north_m = {place[0]:.2f}, east_m = {place[1]:.2f}); {REST}"
            )
            return
    yield NONE.format("other places for the goal")


def for_passage(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """The largest clearance with which a path leads through."""
    tell("less plan.clearance_m")
    water = leg_water(problem, ship_on_legs(problem))

    def passes(clearance_m: float) -> bool:
        return replace(water, clearance_m=clearance_m).joins(problem.start[:2], problem.goal[:2])

    clearance_m = largest(passes, problem.settings.clearance_m)
    if clearance_m is None:
        yield NONE.format("plan.clearance_m down to 0")
    else:
        yield f"with plan.clearance_m = {clearance_m:g} a path leads through; {REST}"


def for_berth(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """Another heading, less clearance, or tighter turns at the start or the goal."""
    tell(f"another {refused.which}.heading_deg, less plan.clearance_m, tighter turns")
    backwards = refused.which == "goal"
    pose = problem.goal if backwards else problem.start
    water = leg_water(problem, ship_on_legs(problem))

    def free(heading_rad: float, where: LegWater) -> bool:
        turned = np.array([*pose[:2], heading_rad])
        return where.holds(turned[None]) and escapes(turned, where, backwards=backwards)

    for turn_deg in (turn * side for turn in TURNS_DEG for side in (1, -1)):
        heading_deg = round(float(np.degrees(pose[2])) + turn_deg) % 360
        if free(np.radians(heading_deg), water):
            yield f"{refused.which}.heading_deg = {heading_deg} has such a path; {REST}"
            return
    clearance_m = largest(lambda value: free(pose[2], replace(water, clearance_m=value)), problem.settings.clearance_m)
    if clearance_m is not None:
        yield f"with plan.clearance_m = {clearance_m:g} there is such a path; {REST}"
        return
    for key, radius in (("plan.turning_radius_m", share * water.ship.turning_radius_m) for share in TIGHTER):
        value = rounded_up(radius)
        try:
            ship = ship_on_legs(with_settings(problem, turning_radius_m=value))
        except NoPlan:
            break
        if free(pose[2], replace(water, ship=ship)):
            yield f"with {key} = {value:g} there is such a path; {REST}"
            return
    yield NONE.format(f"{refused.which}.heading_deg, plan.clearance_m down to 0, plan.turning_radius_m")


def for_settings(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """Speeds and radii that the ship is capable of."""
    tell("other speeds and radii")
    key = "transit_speed_mps" if refused.what == "speed" else "turning_radius_m"
    for value in (None, *(_speeds(problem) if refused.what == "speed" else ())):
        other = with_settings(problem, **{key: value})
        if other.settings != problem.settings and _capable(other):
            change = f"without plan.{key}" if value is None else f"with plan.{key} = {value:g}"
            yield f"{change} the vessel is capable of what is asked; {REST}"
            return
    yield NONE.format(f"plan.{key}")


def _speeds(problem: PlanProblem) -> tuple[float, ...]:
    """Speeds faster than the mean current, the slowest first [m/s]."""
    return tuple(rounded_up(share * problem.current_mps) for share in FASTER if problem.current_mps > 0)


def _capable(problem: PlanProblem) -> bool:
    try:
        return ship_on_legs(problem) is not None
    except NoPlan:
        return False


# Remedies where runs find no place, or the room that they need cannot be estimated.


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
    for share in CLEARANCE_SHARES:
        clearance_m = float(f"{share * most:.2g}")
        if clearance_m < asked:
            yield of_setting(problem, "clearance_m", clearance_m)


def _confidences(problem: PlanProblem, space: RunSpace, lacking: set[str]) -> Iterator[Change]:
    """Lower confidences with which every run has a place by itself, where they leave runs more room."""
    if not any((off > problem.settings.clearance_m).any() for off in dispersions(problem)):
        return
    for confidence in LOWER_CONFIDENCES:
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
    lower = [value for value in LOWER_CONFIDENCES if value < problem.settings.confidence]
    changes = (of_setting(problem, "confidence", value) for value in lower)
    without = exclusions(problem, {refused.which}) if refused.what == "unstable" else ()
    yield from first_that_passes(chain(changes, without), finds_places, PLACES, tell=tell, most=len(lower) + 1)


# Remedies where no leg leads on, drawn trials fail, or the verification does.


def for_sailing(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """Less clearance, or a design without the run that no leg led to, with which every run is sailed.

    Each takes a plan, which is counted: none is begun that `REMEDY_WORK` leaves no work for.
    """
    budget, affords = _limit(refused.spent_s)
    asked = problem.settings.clearance_m
    halves = [float(f"{share * asked:.2g}") for share in SAILED_SHARES] if asked > 0 else []
    changes = [of_setting(problem, "clearance_m", value) for value in halves]
    names = {refused.which} - {"", "goal"}
    tries = chain(changes[:1], exclusions(problem, names) if names else (), changes[1:])
    yield from first_that_passes(
        tries,
        lambda other: first_sailed(other, budget) is not None,
        SAILED,
        tell=tell,
        most=MOST_PLANS,
        affords=affords,
    )


def _limit(plan_s: float) -> tuple[WorkBudget, Callable[[], bool]]:
    """The work budget of remedies where a refused plan took so much [s], and whether another plan fits into it.

    Without limit where no work was counted.
    """
    budget = WorkBudget(most_s=REMEDY_WORK * plan_s) if plan_s else WorkBudget()
    return budget, lambda: budget.spent_s + plan_s <= budget.most_s


def for_risk(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """Wider tolerances, a better forecast, a lower confidence, or a design without the worst run, if trials accept it.

    Each is planned anew before it is named, as it changes the room of runs; that is as much work as the refused plan.
    What that plan tells comes first: tolerances or a forecast with which few drawn trials of it fail as well are not
    planned with, nor is a design without the worst run where too many failed elsewhere. Tolerances are tried where too
    many trials were aborted. All is counted, and no more is begun than a trial that is planned takes.
    """
    first: Refused | None = refused.plan
    budget, affords = _limit(0.0 if first is None else first.spent_s)

    def passes(other: PlanProblem) -> bool:
        made = first_sailed(other, budget)
        return made is not None and accepted(other, *made, budget=budget)

    def hopeful(change: Change) -> Change:
        """The change, without a problem where with it few drawn trials refuse the refused plan, too."""
        if first is None or change.problem is None or not affords():
            return change
        tell(change.words)
        tolerance = change.problem.settings.start_tolerance
        water = replace(first.water, environment=change.problem.environment, start_tolerance=tolerance)
        likely = promising(change.problem, water, first.sailed, budget=budget)
        return change if likely else replace(change, problem=None)

    def without(names: set[str]) -> Iterator[Change]:
        """The design without the worst run, which is not made for nothing."""
        words = f"design.excluded with {', '.join(names)}: too many drawn trials fail elsewhere"
        if first is not None and not all(first.promises(name, problem.settings.confidence) for name in names):
            yield Change(words=words, problem=None)
        elif affords():
            yield from exclusions(problem, names)
        else:
            yield Change(words=words.partition(":")[0], problem=problem)

    names = {refused.which} - {"", "goal"}
    more = "the planner has tried more room" if len(refused.tried) > 1 else ""
    aborted = first is not None and first.risk.aborted > problem.settings.aborted_most
    tolerances, forecasts = map(hopeful, _tolerances(problem) if aborted else ()), map(hopeful, _forecasts(problem))
    lower = () if refused.confidence is None else (of_setting(problem, "confidence", refused.confidence),)
    tries = chain(tolerances, islice(forecasts, 1), lower, without(names) if names else (), forecasts)
    most = max(1, REPLANS + 1 - max(1, len(refused.tried)))
    yield from first_that_passes(tries, passes, ACCEPTED, more, tell=tell, most=most, affords=affords)


def _tolerances(problem: PlanProblem) -> Iterator[Change]:
    """Wider tolerances within which runs begin."""
    wider = (value for value in TOLERANCES if value > problem.settings.start_tolerance)
    return (of_setting(problem, "start_tolerance", value) for value in wider)


def _forecasts(problem: PlanProblem) -> Iterator[Change]:
    """Current and wind known twice as well, as far as they are uncertain and move the ship."""
    for key, name in (("current_to", "current_std_mps"), ("wind_to", "wind_std_mps")):
        std_mps = float(f"{getattr(problem.environment, name) / 2:.3g}")
        if std_mps > 0 and (key == "current_to" or problem.vessel.model.reads_air):
            better: dict[str, Any] = {name: std_mps}
            words = f"environment.{key}.std_mps = {std_mps:g} (a better forecast)"
            yield Change(words=words, problem=replace(problem, environment=replace(problem.environment, **better)))


def for_verification(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """Another seed, whose plan passes."""

    def passes(other: PlanProblem) -> bool:
        made = first_sailed(other, WorkBudget())
        try:
            return made is not None and verified(other, *made).passed
        except NoPlan:
            return False

    seeds = range(problem.seed + 1, problem.seed + 1 + MOST_PLANS)
    changes = (Change(words=f"--seed {seed}", problem=replace(problem, seed=seed)) for seed in seeds)
    yield from first_that_passes(changes, passes, VERIFIED, tell=tell, most=MOST_PLANS)


def advised(problem: PlanProblem, refused: NoPlan, progress: Progress = silent) -> NoPlan:
    """The refusal with what helps.

    Args:
        problem: that was refused, with the water in which it was.
    """
    progress(f"there is no plan: {refused.obstacle}", math.nan)
    check = CHECKS.get(refused.what)
    if check is None:
        refused.remedies = refused.remedies or (UNCHECKED,)
        return refused
    try:
        found = tuple(check(problem, refused, partial(_tell, progress)))
    except NoPlan as error:  # another obstacle behind this one
        found = (f"a remedy cannot be checked: {error.obstacle}",)
    refused.plan = None
    refused.remedies = (*found, *refused.remedies)
    return refused


def _tell(progress: Progress, tried: str) -> None:
    """Say what is tried; when that ends, nobody knows."""
    progress(f"there is no plan; trying whether this would help: {tried}", math.nan)


CHECKS: Mapping[str, Callable[[PlanProblem, NoPlan, Tell], Iterator[str]]] = {
    "berth": for_berth,
    "confidence": for_confidence,
    "lattice": for_lattice,
    "parted": for_parted,
    "passage": for_passage,
    "radius": for_settings,
    "risk": for_risk,
    "room": for_room,
    "sailing": for_sailing,
    "speed": for_settings,
    "unstable": for_confidence,
    "verification": for_verification,
}
"""Remedies by the kind of obstacle, as `NoPlan.what` names it."""
