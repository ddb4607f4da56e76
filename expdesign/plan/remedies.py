"""Remedies of a refusal: changes of one key for which the test that failed passes, each checked by that test.

What takes a whole plan to check is not tried, and the refusal says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from expdesign.durations import DurationDesign, solve_durations
from expdesign.errors import InputError, NoAnswer, NoPlan
from expdesign.plan.assembly import confidence_of_run, dispersions, leg_water, open_space, ship_on_legs
from expdesign.plan.feasibility import place_of
from expdesign.plan.legs import LegWater, escapes
from expdesign.plan.local_planner import SearchSpace, local_planner
from expdesign.plan.problem import PlanProblem
from expdesign.plan.runs import draws_for
from expdesign.plan.search import place_runs
from expdesign.plan.tuning import PLAN
from expdesign.plan.values import PlanSettings
from expdesign.values import Array

NONE = "no single change of those tried helps ({})"
REST = "the rest of the plan was not tried with it"


def advised(problem: PlanProblem, refused: NoPlan) -> NoPlan:
    """The refusal with what helps.

    Args:
        problem: that was refused, with the water in which it was.
        refused: by the planner.
    """
    check = CHECKS.get(refused.what)
    if check is None or refused.remedies:
        return refused
    try:
        found = tuple(check(problem, refused))
    except NoPlan as error:  # another obstacle behind this one
        found = (f"a remedy cannot be checked: {error.obstacle}",)
    refused.remedies = found
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
    """A clearance with which every run has a place, a confidence, or the runs to leave out."""
    water = leg_water(problem, ship_on_legs(problem))
    planner, off_m = local_planner(water, problem.used), dispersions(problem)
    space = open_space(problem, water, planner, off_m)
    lacking = _without_place(space)
    if not lacking:
        yield (
            "each run by itself has a place, so no single change of those tried helps; not tried: less design.total_s, "
            "more plan.time_budget_s, the other plan.planner, wider [bounds] of the area"
        )
        return
    asked, tried = problem.settings.clearance_m, ["plan.clearance_m down to 0"]

    def fits(off_m: Sequence[Array], clearance_m: float) -> bool:
        changed = replace(problem, settings=replace(problem.settings, clearance_m=clearance_m))
        other = replace(water, clearance_m=clearance_m)
        return not _without_place(open_space(changed, other, planner, off_m))

    clearance_m = _largest(lambda value: fits(off_m, value), asked)
    if clearance_m is not None:
        yield f"with plan.clearance_m = {clearance_m:g} every run has a place; {REST}"
        return
    for confidence in PLAN.lower_confidences:
        if confidence < problem.settings.confidence and any((off > asked).any() for off in off_m):
            tried.append(f"plan.confidence = {confidence:g}")
            lower = replace(problem, settings=replace(problem.settings, confidence=confidence))
            if fits(dispersions(lower), asked):
                yield f"with plan.confidence = {confidence:g} every run has a place; {REST}"
                return
    yield from _leaving_out(problem, water, lacking, tried)


def _for_lattice(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """The other planner, if it finds places for the runs."""
    water = leg_water(problem, ship_on_legs(problem))
    space = open_space(problem, water, local_planner(water, problem.used))
    repeats = [problem.repeats[run.name] for run in space.footprints]
    try:
        place_runs(space, repeats, start=problem.start, width=PLAN.transition_beam, orders=0)
    except NoPlan:
        yield NONE.format("plan.planner = 'beam'")
    else:
        yield f"with plan.planner = 'beam' every run has a place; {REST}"


def _leaving_out(problem: PlanProblem, water: LegWater, lacking: set[str], tried: list[str]) -> Iterator[str]:
    """Runs without which the design exists, and each of its runs has a place."""
    if isinstance(problem.design, DurationDesign):
        limits = problem.design.problem.constraints
        for _ in range(PLAN.most_left_out):
            excluded = (*limits.excluded, *sorted(lacking - set(limits.excluded)))
            try:
                task = replace(problem.design.problem, constraints=replace(limits, excluded=excluded))
                other = replace(problem, design=solve_durations(task))
                more = _without_place(open_space(other, water, local_planner(water, other.used)))
            except (InputError, NoAnswer):
                break
            if not more:
                names = ", ".join(f'"{name}"' for name in excluded)
                yield f"with design.excluded = [{names}] the design has only runs that have a place; {REST}"
                return
            lacking |= more
        tried.append("design.excluded with all runs that have none")
    yield NONE.format(", ".join(tried)) + "; not tried: wider [bounds] of the area, another chart"


def _without_place(space: SearchSpace) -> set[str]:
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
            ship = ship_on_legs(replace(problem, settings=replace(problem.settings, turning_radius_m=value)))
        except NoPlan:
            break
        if free(pose[2], replace(water, ship=ship)):
            yield f"with {key} = {value:g} there is such a path; {REST}"
            return
    yield NONE.format(f"{refused.which}.heading_deg, plan.clearance_m down to 0, plan.turning_radius_m")


def _for_confidence(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """The largest confidence, and the most runs, that can be estimated."""
    runs = sum(problem.repeats.values())

    def possible(confidence: float) -> bool:
        asked = replace(problem, settings=replace(problem.settings, confidence=confidence))
        try:
            return draws_for(confidence_of_run(asked)) > 0
        except NoPlan:
            return False

    steps = np.array([confidence for confidence in PLAN.lower_confidences if confidence < problem.settings.confidence])
    found = next((float(value) for value in steps if possible(value)), None)
    if found is None:
        yield NONE.format("plan.confidence")
    else:
        yield f"with plan.confidence = {found:g} the room of {runs} runs can be estimated; {REST}"


def _for_settings(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """Speeds and radii that the ship is capable of."""
    asked = problem.settings
    key = "transit_speed_mps" if refused.what == "speed" else "turning_radius_m"
    for value in (None, *(_speeds(problem) if refused.what == "speed" else ())):
        settings = _settings(asked, key, value)
        if settings != asked and _capable(problem, settings):
            change = f"without plan.{key}" if value is None else f"with plan.{key} = {value:g}"
            yield f"{change} the vessel is capable of what is asked; {REST}"
            return
    yield NONE.format(f"plan.{key}")


def _settings(settings: PlanSettings, key: str, value: float | None) -> PlanSettings:
    changed: dict[str, Any] = {key: value}
    return replace(settings, **changed)


def _speeds(problem: PlanProblem) -> tuple[float, ...]:
    """Speeds faster than the mean current, the slowest first [m/s]."""
    return tuple(_up(share * problem.current_mps) for share in PLAN.faster if problem.current_mps > 0)


def _capable(problem: PlanProblem, settings: PlanSettings) -> bool:
    try:
        return ship_on_legs(replace(problem, settings=settings)) is not None
    except NoPlan:
        return False


def _for_unstable(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """A confidence at which drawn runs are stable often enough, or the run left out."""
    tried = []
    for confidence in PLAN.lower_confidences:
        if confidence < problem.settings.confidence:
            tried.append(f"plan.confidence = {confidence:g}")
            changed = replace(problem, settings=replace(problem.settings, confidence=confidence))
            if _stable(changed):
                yield f"with plan.confidence = {confidence:g} so few are unstable that the plan can be tried; {REST}"
                return
    water = leg_water(problem, ship_on_legs(problem))
    yield from _leaving_out(problem, water, {refused.which}, tried)


def _stable(problem: PlanProblem) -> bool:
    try:
        return bool(dispersions(problem))
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
    "room": _for_room,
    "speed": _for_settings,
    "unstable": _for_unstable,
}
"""Remedies by the kind of obstacle, as `NoPlan.what` names it."""
