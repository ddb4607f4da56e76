"""The continuous planner: place, sail, check; where a leg or a run fails, place the rest anew."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely

from expdesign.dictionary import Primitive
from expdesign.durations import DurationDesign
from expdesign.errors import NoPlan
from expdesign.plan.area import SeaArea
from expdesign.plan.capability import capability
from expdesign.plan.checks import verify_plan
from expdesign.plan.doors import check_ends
from expdesign.plan.drawn_trials import Trials
from expdesign.plan.field import ClearanceField, clearance_field, narrowest_passage
from expdesign.plan.footprint import covering_discs, swept_area
from expdesign.plan.goal_ways import build_goal_ways
from expdesign.plan.joint_trials import pairs_of, settled
from expdesign.plan.lattice import LatticePlan, search_lattice
from expdesign.plan.lattice_moves import build_lattice
from expdesign.plan.leg_times import leg_times
from expdesign.plan.leg_values import last_state, nearest_turns
from expdesign.plan.legs import LegTask, LegWater, find_leg, leg_trajectory
from expdesign.plan.lower_bound import reposition_bound_s
from expdesign.plan.placement import is_carried, place_runs
from expdesign.plan.realised import realised_efficiencies
from expdesign.plan.recovery import displaced, recover
from expdesign.plan.safety import broken_promise, promised, trials_for, worst_leg
from expdesign.plan.search_space import SearchSpace, Stamp, refusing, stamp
from expdesign.plan.speed_changes import leg_end
from expdesign.plan.timeline import Timeline
from expdesign.plan.uncertainty import stray_m
from expdesign.plan.values import Leg, Placement, Plan, PlanSettings, Promise, Verification
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import CALM, Environment, to_body
from expdesign.values import Array, seal
from expdesign.vessel import NUMPY, Vessel

Progress = Callable[[str, float], None]
GOAL = "goal"
TRY_S = 2.0
"""Seconds of the time budget that count as one try of another place: effort is counted, so that a slow machine finds
the same plan as a fast one."""
JOINT_TRIALS, TRIAL_WIDTH = 4, 100
"""Plans whose joints are tried before the search proper, and partial plans kept for them."""
LAST_RESORT = 10.0
"""Time budgets by the clock after which the search ends whatever the count."""

SAILED = 1
"""Sets the chance of drawn trials apart from that of other draws of the same seed."""
REPLANS, WIDER = 2, 1.4
"""Plans made anew, with so much more room where trials of the last one leave the water, before giving up."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanProblem:
    """A trial to be planned.

    Attributes:
        vessel, area, environment, settings: who, where, in what, and with which wishes.
        primitives: of the dictionary, in the design's order.
        design: gives the number of runs of each.
        start, goal: (3,) poses; the ship starts and ends at rest through the water.
        seed: of everything drawn.
    """

    vessel: Vessel
    area: SeaArea
    environment: Environment
    settings: PlanSettings
    primitives: tuple[Primitive, ...]
    design: DurationDesign
    start: Array
    goal: Array
    seed: int = 0

    def __post_init__(self) -> None:
        seal(self, start="3", goal="3")


def plan_trial(problem: PlanProblem, *, progress: Progress = lambda what, share: None) -> Plan:
    """One continuous, verified trial from start to goal with every run the design asks for.

    Raises:
        NoPlan: no way, no room, or no dynamically feasible leg; the message names what and where.
    """
    progress("measuring the water", 0.0)
    water = leg_water(problem)
    check_ends(problem.start, problem.goal, water)
    space = _with_joints(problem, water, _search_space(problem, water), progress)
    for replan in range(REPLANS + 1):
        line = _sail_all(problem, water, space, progress)
        sailed = line.joined(sample_time_s=problem.vessel.sample_time_s, names=problem.vessel.model.inputs)
        progress("verifying", 0.85)
        verification = _verified(problem, *sailed)
        progress("sailing drawn trials", 0.9)
        promise, trials = _promised(problem, water, *sailed, attempt=replan)
        broken = broken_promise(promise, trials, sailed[2], problem.area, confidence=problem.settings.confidence)
        if not broken:
            return _finished(problem, water, *sailed, verification=verification, promise=promise)
        if replan == REPLANS or not trials.left.any():
            more = "; more plan.clearance_m helps" if trials.left.any() else ""
            raise NoPlan(f"the plan found does not keep its promise: {broken}{more}")
        water, space = _wider(problem, water, space, trials, sailed[2], broken)
    raise AssertionError("the last plan is returned or refused")


def lattice_reference(problem: PlanProblem, *, spacing_m: float, suboptimality: float = 0.02) -> LatticePlan:
    """The same runs on a state lattice, for comparison: its costs are seconds of repositioning at transit speed.

    Changes of speed and the current are left out there, which favours the lattice.

    Raises:
        NoPlan: the lattice is too coarse for the water, or there is no way.
    """
    space = _search_space(problem, leg_water(problem))
    counts = [_repeats(problem)[item.name] for item in space.stamps]
    lattice = build_lattice(space, counts, problem.start, spacing_m=spacing_m)
    return search_lattice(lattice, suboptimality=suboptimality)


def _verified(problem: PlanProblem, commands: Commands, trajectory: Trajectory, legs: tuple[Leg, ...]) -> Verification:
    verification = verify_plan(
        problem.vessel,
        problem.area,
        problem.environment,
        commands=commands,
        trajectory=trajectory,
        legs=legs,
        clearance_m=problem.settings.clearance_m,
        primitives={item.name: item for item in problem.primitives},
        repeats=_repeats(problem),
        start=problem.start,
        goal=problem.goal,
    )
    if not verification.verified:
        raise NoPlan("the plan found does not pass its own verification: " + "; ".join(verification.problems))
    return verification


def _promised(
    problem: PlanProblem,
    water: LegWater,
    commands: Commands,
    trajectory: Trajectory,
    legs: tuple[Leg, ...],
    *,
    attempt: int,
) -> tuple[Promise, Trials]:
    """What the trial as sailed comes to; no ship is the same that runs keep room for, or that an attempt failed for."""
    rng = np.random.default_rng((problem.seed, SAILED, attempt))
    draws = trials_for(problem.settings.confidence)
    return promised(water, commands=commands, trajectory=trajectory, legs=legs, rng=rng, draws=draws)


def _wider(
    problem: PlanProblem,
    water: LegWater,
    space: SearchSpace,
    trials: Trials,
    legs: tuple[Leg, ...],
    broken: str,
) -> tuple[LegWater, SearchSpace]:
    """More room where trials leave the water most: for that run, or for all legs.

    Raises:
        NoPlan: with more room there is no way at all.
    """
    worst = legs[worst_leg(trials)]
    if worst.kind == "primitive":
        stamps = tuple(
            replace(item, room_m=WIDER * item.room_m) if item.name == worst.name else item for item in space.stamps
        )
        return water, replace(space, stamps=stamps)
    wide = replace(water, clearance_m=water.clearance_m + (WIDER - 1.0) * problem.vessel.length_m)
    try:
        found = _search_space(problem, wide)
    except NoPlan:
        raise NoPlan(f"{broken}; and there is no way to the goal that keeps farther off") from None
    return wide, replace(found, stamps=space.stamps, tried=space.tried)


def _finished(
    problem: PlanProblem,
    water: LegWater,
    commands: Commands,
    trajectory: Trajectory,
    legs: tuple[Leg, ...],
    *,
    verification: Verification,
    promise: Promise,
) -> Plan:
    sailed = {"commands": commands, "trajectory": trajectory, "legs": legs}
    placed, realised = realised_efficiencies(problem.vessel, problem.design, problem.environment, **sailed)  # type: ignore[arg-type]
    return Plan(
        area=problem.area,
        **sailed,  # type: ignore[arg-type]
        reposition_bound_s=_reposition_bound_s(problem, water),
        leave_water_probability=promise.left,
        leave_water_by_leg=tuple(leg.left for leg in promise.legs),
        design_efficiency_placed=placed,
        design_efficiency_realised=realised,
        verification=verification,
        promise=promise,
    )


def _repeats(problem: PlanProblem) -> dict[str, int]:
    return dict(zip(problem.design.problem.names, problem.design.repeats, strict=True))


def leg_water(problem: PlanProblem) -> LegWater:
    """Who sails, in what, where: what all legs of the problem share."""
    ship = capability(problem.vessel, problem.settings, current_mps=float(np.hypot(*problem.environment.current_to)))
    # a ship that stands the turns of the runs stands them on legs
    turns = [item.trajectory.velocity[:, 0] * item.trajectory.velocity[:, 2] for item in _used(problem)]
    lateral = max([ship.lateral_mps2, *(float(np.abs(turn).max()) for turn in turns)])
    return LegWater(
        vessel=problem.vessel,
        environment=problem.environment,
        ship=replace(ship, lateral_mps2=lateral),
        area=problem.area,
        clearance_m=problem.settings.clearance_m,
        field=clearance_field(problem.area, resolution_m=problem.vessel.length_m / 8),
    )


def _used(problem: PlanProblem) -> list[Primitive]:
    repeats = _repeats(problem)
    return [item for item in problem.primitives if repeats[item.name]]


def _search_space(problem: PlanProblem, water: LegWater) -> SearchSpace:
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


def _recoveries(problem: PlanProblem, water: LegWater) -> Array | None:
    """What follows each run before a ship with a helm goes straight, in calm water; None for others."""
    if water.ship.approach is None:
        return None
    calm = replace(water, environment=CALM)
    runs = [(last_state(item.trajectory), item.commands.values) for item in _used(problem)]
    scales = {"sample_time_s": problem.vessel.sample_time_s, "hull_m": problem.vessel.length_m}
    checks = [recover(state, calm.remembered(values), calm) for state, values in runs]
    return np.array([displaced(check, water.ship, **scales) for check in checks])


def _stamps(problem: PlanProblem, grid: ClearanceField) -> tuple[Stamp, ...]:
    """The runs with the room they need: the promised clearance, or where truths may stray farther, that far.

    The chance of straying is shared out evenly over all runs, so that together they keep the wished confidence.
    """
    vessel, used = problem.vessel, _repeats(problem)
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


def _sail_all(problem: PlanProblem, water: LegWater, space: SearchSpace, progress: Progress) -> Timeline:
    line = Timeline(begin=_at_rest(problem, problem.start), begin_inputs=np.zeros(len(problem.vessel.limits)))
    left = _repeats(problem)
    budget_s = problem.settings.time_budget_s
    total, deadline, tries = sum(left.values()), time.monotonic() + LAST_RESORT * budget_s, 0
    queue: list[Placement] = []
    stuck = ""
    while sum(left.values()) or not _sail_home(problem, water, line):
        if not sum(left.values()):  # all runs are done, but no way leads home: do the last one elsewhere
            undone = line.undo_run()
            space, queue, stuck = refusing(space, line.last, undone), [], "no leg leads from the last run to the goal"
            left[undone.primitive] += 1
        tries += bool(stuck)
        if stuck and (tries > budget_s / TRY_S or time.monotonic() > deadline):
            raise NoPlan(f"no plan within plan.time_budget_s = {budget_s:g}, {tries} places were tried: {stuck}")
        if not queue:
            progress("placing runs", _share(total, left))
            queue = _placed(space, left, line, stuck)
        placement = queue.pop(0)
        stuck = _sail_run(problem, water, line, placement)
        if stuck:
            space, queue = refusing(space, line.last, placement), []
            continue
        left[placement.primitive] -= 1
        progress(f"sailing {placement.primitive}", _share(total, left))
    return line


def _with_joints(problem: PlanProblem, water: LegWater, space: SearchSpace, progress: Progress) -> SearchSpace:
    """The space with the joints tried that plans would use, for vessels whose joints are the search's own."""
    counts = [_repeats(problem)[item.name] for item in space.stamps]
    runs = {item.name: item for item in _used(problem)}
    for number in range(JOINT_TRIALS if space.times is not None else 0):
        progress("trying joints between runs", 0.01 * (number + 1))
        try:
            placements = place_runs(space, counts, start=problem.start, width=TRIAL_WIDTH)
        except NoPlan:  # the search proper keeps more, and says what is impossible
            break
        pairs = pairs_of(placements)
        if all(pair in space.tried for pair in pairs):
            break
        carried = is_carried(space, counts, problem.start)
        space = settled(space, water, runs, pairs, start=problem.start, carried=carried)
    return space


def _share(total: int, left: dict[str, int]) -> float:
    return 0.05 + 0.8 * (total - sum(left.values())) / max(total, 1)


def _placed(space: SearchSpace, left: dict[str, int], line: Timeline, stuck: str) -> list[Placement]:
    counts = [left[item.name] for item in space.stamps]
    try:
        return list(place_runs(space, counts, start=line.state[:3], exit_mps=float(line.state[3]), last=line.last))
    except NoPlan as error:
        raise NoPlan(f"{error}; before that, {stuck}" if stuck else str(error)) from None


def _sail_run(problem: PlanProblem, water: LegWater, line: Timeline, placement: Placement) -> str:
    """Sail to a placement and do its run; what stands in the way, or "" when both were done."""
    primitive = next(item for item in problem.primitives if item.name == placement.primitive)
    entry = _through_water(problem, placement.pose, primitive.entry_velocity)
    lat, lon = problem.area.frame.to_degrees(placement.pose[:2])
    where = f"{primitive.name!r} near {lat:.5f}, {lon:.5f}"
    leg = _leg(problem, water, line, entry, primitive.entry_inputs)
    if leg is None:
        return f"no leg leads to {where}"
    track = leg_trajectory(water, line.state, leg, line.given)
    arrived = np.r_[track.pose[-1], track.velocity[-1]]
    turned = nearest_turns(problem.vessel, primitive.entry_inputs, leg[-1]) - primitive.entry_inputs
    values = primitive.commands.values + turned
    run = leg_trajectory(water, arrived, values, water.remembered(np.concatenate([line.given, leg])))
    if not shapely.contains_properly(water.safe, swept_area(run.pose, problem.vessel.hull_b)):
        return f"the run {where} leaves safe water"
    line.sail("reposition", primitive.name, leg, track)
    line.sail("primitive", primitive.name, values, run)
    return ""


def _sail_home(problem: PlanProblem, water: LegWater, line: Timeline) -> bool:
    """Sail the last leg; whether there is one."""
    leg = _leg(problem, water, line, _at_rest(problem, problem.goal), np.zeros(len(problem.vessel.limits)))
    if leg is not None:
        line.sail("reposition", GOAL, leg, leg_trajectory(water, line.state, leg, line.given))
    return leg is not None


def _leg(problem: PlanProblem, water: LegWater, line: Timeline, end: Array, end_inputs: Array) -> Array | None:
    """Commands (k, m) from where the timeline ends, or None."""
    start, wait = line.state, line.begin_inputs[None]
    if not line.stretches and not water.prompt:
        # what actuators deliver before the first sample is told by its commands: begin with what stood
        start = last_state(leg_trajectory(water, start, wait, wait))
    task = LegTask(
        start=start,
        end=end,
        start_inputs=line.inputs,
        end_inputs=end_inputs,
        seed=problem.seed + len(line.stretches) + 1,
        before=water.remembered(line.given),
    )
    leg = find_leg(task, water)
    return leg if leg is None or line.stretches or water.prompt else np.concatenate([wait, leg])


def _through_water(problem: PlanProblem, pose: Array, velocity: Array) -> Array:
    """(6,) state at a pose with a velocity (3,) through the forecast's mean current."""
    u_c, v_c = to_body(problem.environment.current_to, pose[2], NUMPY)
    return np.asarray(np.r_[pose, velocity + np.array([u_c, v_c, 0.0])])


def _at_rest(problem: PlanProblem, pose: Array) -> Array:
    return _through_water(problem, pose, np.zeros(3))


def _reposition_bound_s(problem: PlanProblem, water: LegWater) -> float:
    return reposition_bound_s(
        problem.vessel,
        problem.area,
        problem.environment,
        clearance_m=problem.settings.clearance_m,
        primitives=problem.primitives,
        repeats=_repeats(problem),
        ends=(problem.start, problem.goal),
        transit_mps=water.ship.transit_speed_mps,
        yaw_rate_radps=water.ship.spot_rate_radps + water.ship.yaw_rate_radps,
    )
