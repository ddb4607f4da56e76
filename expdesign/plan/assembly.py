"""What planning begins with: the water that legs share, the runs with the room they need, the joints between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from expdesign.errors import NoPlan
from expdesign.plan.chart import ClearanceField, build_goal_ways, clearance_field, narrowest_passage
from expdesign.plan.control import capability, leg_end
from expdesign.plan.legs import LegWater, displaced, last_state, leg_times, recover
from expdesign.plan.problem import PlanProblem
from expdesign.plan.runs import stray_m
from expdesign.plan.search import SearchSpace, Stamp, is_carried, pairs_of, place_runs, settled, stamp
from expdesign.plan.values import Progress
from expdesign.plan.work_budget import Effort
from expdesign.simulation import CALM
from expdesign.values import Array
from expdesign.vessel.hull import covering_discs

JOINT_TRIALS, TRIAL_WIDTH = 4, 100
"""Plans whose joints are tried before the search proper, and partial plans kept for them."""
JOINTS_S = 30.0
"""Effort spent on trying joints, after which the rule for the time of legs has to do."""


def leg_water(problem: PlanProblem) -> LegWater:
    """Who sails, in what, where: what all legs of the problem share."""
    ship = capability(problem.vessel, problem.settings, current_mps=float(np.hypot(*problem.environment.current_to)))
    # a ship that stands the turns of the runs stands them on legs
    turns = [item.trajectory.velocity[:, 0] * item.trajectory.velocity[:, 2] for item in problem.used]
    lateral = max([ship.lateral_mps2, *(float(np.abs(turn).max()) for turn in turns)])
    return LegWater(
        vessel=problem.vessel,
        environment=problem.environment,
        ship=replace(ship, lateral_mps2=lateral),
        area=problem.area,
        clearance_m=problem.settings.clearance_m,
        field=clearance_field(problem.area, resolution_m=problem.vessel.length_m / 8),
    )


def search_space(problem: PlanProblem, water: LegWater) -> SearchSpace:
    """What the search for places works on.

    Raises:
        NoPlan: no way leads from start to goal; says where it is too narrow.
    """
    vessel, grid = problem.vessel, water.field
    margin = water.leg_margin_m + grid.cell_m / 2
    way = build_goal_ways(water.narrowest_ways, grid, problem.goal[:2])
    if way is None or not water.candidate_ways(problem.start[:2], problem.goal[:2]):
        raise NoPlan(_no_way(problem, grid, margin))
    ship = water.ship
    rate = ship.spot_rate_radps + ship.yaw_rate_radps
    changes = leg_end(vessel, CALM, 0.0, None, top_mps=ship.transit_speed_mps, yaw_rate_radps=rate).changes
    return SearchSpace(
        stamps=_stamps(problem, grid),
        frame=problem.area.frame,
        field=grid,
        goal_way=way,
        goal=problem.goal,
        ship=ship,
        times=leg_times(vessel, ship, changes) if ship.agile else None,
        hull_m=vessel.length_m,
        leg_margin_m=margin,
        current_to=problem.environment.current_to,
        recoveries=_recoveries(problem, water),
    )


def with_joints(problem: PlanProblem, water: LegWater, space: SearchSpace, progress: Progress) -> SearchSpace:
    """The space with the joints tried that plans would use, for vessels whose joints are the search's own."""
    counts = [problem.repeats[item.name] for item in space.stamps]
    runs, effort = {item.name: item for item in problem.used}, Effort(most_s=JOINTS_S)
    for number in range(JOINT_TRIALS if space.times is not None else 0):
        progress("trying joints between runs", 0.01 * (number + 1))
        try:
            placements = place_runs(space, counts, start=problem.start, width=TRIAL_WIDTH, orders=0)
        except NoPlan:  # the search proper keeps more, and says what is impossible
            break
        pairs = pairs_of(placements)
        if all(pair in space.tried for pair in pairs):
            break
        carried = is_carried(space, counts, problem.start)
        space = settled(space, water, runs, pairs, start=problem.start, carried=carried, effort=effort)
        if effort.exhausted:
            break
    return space


def _recoveries(problem: PlanProblem, water: LegWater) -> Array | None:
    """What follows each run before a ship with a helm goes straight, in calm water; None for others."""
    if water.ship.approach is None:
        return None
    calm = replace(water, environment=CALM)
    runs = [(last_state(item.trajectory), item.commands.values) for item in problem.used]
    scales = {"sample_time_s": problem.vessel.sample_time_s, "hull_m": problem.vessel.length_m}
    checks = [recover(state, calm.remembered(values), calm) for state, values in runs]
    return np.array([displaced(check, water.ship, **scales) for check in checks])


def _stamps(problem: PlanProblem, grid: ClearanceField) -> tuple[Stamp, ...]:
    """The runs with the room they need: the promised clearance, or where truths may stray farther, that far.

    The chance of straying is shared out evenly over all runs, so that together they keep the wished confidence.
    """
    vessel, used = problem.vessel, problem.repeats
    centres, disc_m = covering_discs(vessel.length_m, vessel.beam_m)
    confidence = 1.0 - (1.0 - problem.settings.confidence) / max(1, sum(used.values()))
    rng = np.random.default_rng(problem.seed)
    stamps = []
    for item in problem.primitives:
        if used[item.name]:
            stray = stray_m(vessel, item, problem.environment, centres_m=centres, confidence=confidence, rng=rng)
            room = disc_m + grid.cell_m / 2 + np.maximum(problem.settings.clearance_m, stray)
            stamps.append(stamp(item, room, length_m=vessel.length_m, beam_m=vessel.beam_m))
    return tuple(stamps)


def _no_way(problem: PlanProblem, grid: ClearanceField, needed_m: float) -> str:
    ends = shapely.points(problem.start[1::-1]), shapely.points(problem.goal[1::-1])
    if not any(shapely.contains(part, ends).all() for part in problem.area.water.geoms):
        return "the goal cannot be reached from the start: forbidden water lies between them on every way"
    widest, place = narrowest_passage(grid, problem.start[:2], problem.goal[:2])
    lat, lon = problem.area.frame.to_degrees(place)
    if widest <= grid.error_m or widest > needed_m:  # too little for the grid to tell, or lost in simplifying the shore
        return (
            f"the goal cannot be reached from the start in a chart grid of {grid.cell_m:.3g} m and by a simplified "
            f"shore: if there is a way, also near {lat:.5f}, {lon:.5f}, give the area smaller [bounds]"
        )
    return (
        f"the goal cannot be reached from the start: the widest way leaves {widest:.1f} m on each side near "
        f"{lat:.5f}, {lon:.5f}, while {needed_m:.1f} m are needed (plan.clearance_m = "
        f"{problem.settings.clearance_m:g}, the hull in a turn, and the chart grid)"
    )
