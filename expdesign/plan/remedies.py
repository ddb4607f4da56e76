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
    """A clearance or a confidence with which the runs find places, or the runs to leave out."""
    water = leg_water(problem, ship_on_legs(problem))
    planner, off_m = local_planner(water, problem.used), dispersions(problem)
    lacking = _without_place(open_space(problem, water, planner, off_m))
    asked = problem.settings.clearance_m

    def changed(**settings: float) -> PlanProblem:
        return _with(problem, **settings)

    def fits(clearance_m: float) -> bool:
        other = replace(water, clearance_m=clearance_m)
        return not _without_place(open_space(changed(clearance_m=clearance_m), other, planner, off_m))

    most = _largest(fits, asked) if lacking else asked
    for share in PLAN.clearance_shares if most is not None else ():
        clearance_m = float(f"{share * (most or 0.0):.2g}")
        if clearance_m < asked and _found(changed(clearance_m=clearance_m), off_m):
            yield f"with plan.clearance_m = {clearance_m:g} the search finds a place for every run; {REST}"
            return
    tried = ["plan.clearance_m down to 0"]
    for confidence in PLAN.lower_confidences:
        if confidence < problem.settings.confidence and any((off > asked).any() for off in off_m):
            tried.append(f"plan.confidence = {confidence:g}")
            if _found(changed(confidence=confidence)):
                yield f"with {tried[-1]} the search finds a place for every run; {REST}"
                return
    yield from _leaving_out(problem, lacking or {refused.which}, tried)


def _for_lattice(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """The other planner, if it finds places for the runs."""
    if _found(problem):
        yield f"with plan.planner = 'beam' the search finds a place for every run; {REST}"
    else:
        yield NONE.format("plan.planner = 'beam'")


def _leaving_out(problem: PlanProblem, lacking: set[str], tried: list[str]) -> Iterator[str]:
    """Runs without which the design exists, and the search finds a place for each of its runs."""
    if isinstance(problem.design, DurationDesign):
        limits = problem.design.problem.constraints
        water = leg_water(problem, ship_on_legs(problem))
        for _ in range(PLAN.most_left_out):
            excluded = (*limits.excluded, *sorted(lacking - set(limits.excluded)))
            try:
                task = replace(problem.design.problem, constraints=replace(limits, excluded=excluded))
                other = replace(problem, design=solve_durations(task))
                more = _without_place(open_space(other, water, local_planner(water, other.used)))
            except (InputError, NoAnswer):
                break
            if more:
                lacking = lacking | more
            elif _found(other):
                names = ", ".join(f'"{name}"' for name in excluded)
                yield f"with design.excluded = [{names}] the search finds a place for every run; {REST}"
                return
            else:
                break
        tried = [*tried, "design.excluded with " + ", ".join(sorted(lacking))]
    yield NONE.format(", ".join(tried)) + "; not tried: less design.total_s, wider [bounds] of the area"


def _found(problem: PlanProblem, off_m: Sequence[Array] | None = None) -> bool:
    """Whether a narrow search finds places for all runs."""
    try:
        draws_for(confidence_of_run(problem))
        water = leg_water(problem, ship_on_legs(problem))
        space = open_space(problem, water, local_planner(water, problem.used), off_m)
        if _without_place(space):
            return False
        repeats = [problem.repeats[run.name] for run in space.footprints]
        place_runs(space, repeats, start=problem.start, width=PLAN.transition_beam, orders=0)
    except NoPlan:
        return False
    return True


def _with(problem: PlanProblem, **settings: Any) -> PlanProblem:
    return replace(problem, settings=replace(problem.settings, **settings))


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
            ship = ship_on_legs(_with(problem, turning_radius_m=value))
        except NoPlan:
            break
        if free(pose[2], replace(water, ship=ship)):
            yield f"with {key} = {value:g} there is such a path; {REST}"
            return
    yield NONE.format(f"{refused.which}.heading_deg, plan.clearance_m down to 0, plan.turning_radius_m")


def _for_confidence(problem: PlanProblem, refused: NoPlan) -> Iterator[str]:
    """The largest confidence of those tried at which the room of runs can be estimated, and every run has a place."""
    tried = []
    for confidence in PLAN.lower_confidences:
        if confidence < problem.settings.confidence:
            tried.append(f"plan.confidence = {confidence:g}")
            if _found(_with(problem, confidence=confidence)):
                yield f"with {tried[-1]} the search finds a place for every run; {REST}"
                return
    if refused.what == "unstable":
        yield from _leaving_out(problem, {refused.which}, tried)
    else:
        yield NONE.format(", ".join(tried))


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
    "room": _for_room,
    "speed": _for_settings,
    "unstable": _for_confidence,
}
"""Remedies by the kind of obstacle, as `NoPlan.what` names it."""
