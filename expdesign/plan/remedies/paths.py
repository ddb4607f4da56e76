"""Remedies where no path leads through, a berth cannot be left or reached, or the ship cannot do what is asked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely

from expdesign.errors import NoPlan
from expdesign.plan.assembly import (
    leg_water,
    ship_on_legs,
)
from expdesign.plan.legs import LegWater, escapes
from expdesign.plan.problem import PlanProblem
from expdesign.plan.remedies.changes import NONE, REST, Tell, largest, rounded_up, with_settings
from expdesign.plan.tuning import PLAN


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

    for turn_deg in (turn * side for turn in PLAN.turns_deg for side in (1, -1)):
        heading_deg = round(float(np.degrees(pose[2])) + turn_deg) % 360
        if free(np.radians(heading_deg), water):
            yield f"{refused.which}.heading_deg = {heading_deg} has such a path; {REST}"
            return
    clearance_m = largest(lambda value: free(pose[2], replace(water, clearance_m=value)), problem.settings.clearance_m)
    if clearance_m is not None:
        yield f"with plan.clearance_m = {clearance_m:g} there is such a path; {REST}"
        return
    for key, radius in (("plan.turning_radius_m", share * water.ship.turning_radius_m) for share in PLAN.tighter):
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
    return tuple(rounded_up(share * problem.current_mps) for share in PLAN.faster if problem.current_mps > 0)


def _capable(problem: PlanProblem) -> bool:
    try:
        return ship_on_legs(problem) is not None
    except NoPlan:
        return False
