"""The continuous planner: place, sail, check; where a leg or a run fails, place the rest anew."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from expdesign.dictionary import Primitive
from expdesign.durations import DurationDesign
from expdesign.errors import NoPlan
from expdesign.plan.area import SeaArea
from expdesign.plan.capability import Capability, capability
from expdesign.plan.checks import verify_plan
from expdesign.plan.field import ROUTING_CELLS, ClearanceField, clearance_field, goal_field, narrowest_passage
from expdesign.plan.footprint import covering_discs, swept_area
from expdesign.plan.legs import LegTask, LegWater, find_leg, leg_trajectory
from expdesign.plan.placement import place_runs
from expdesign.plan.realised import realised_efficiency
from expdesign.plan.safety import leave_water_probability
from expdesign.plan.search_space import SearchSpace, Stamp, refusing, stamp
from expdesign.plan.uncertainty import stray_m
from expdesign.plan.values import Leg, Placement, Plan, PlanSettings
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Environment, to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel

Progress = Callable[[str, float], None]
GOAL = "goal"


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


@dataclass
class _Log:
    """What has been sailed so far."""

    state: Array
    inputs: Array
    last: str = ""
    exit_mps: float = 0.0
    commands: list[Array] = field(default_factory=list)
    states: list[Array] = field(default_factory=list)
    legs: list[Leg] = field(default_factory=list)

    def sail(self, kind: str, name: str, commands: Array, track: Trajectory) -> None:
        first = self.legs[-1].last if self.legs else 0
        self.legs.append(Leg(kind=kind, name=name, first=first, last=first + len(commands)))
        states = np.hstack([track.pose, track.velocity])
        self.commands.append(commands)
        self.states.append(states[1:])
        self.state, self.inputs = states[-1], commands[-1]


def plan_trial(problem: PlanProblem, *, progress: Progress = lambda what, share: None) -> Plan:
    """One continuous, verified trial from start to goal with every run the design asks for.

    Raises:
        NoPlan: no way, no room, or no dynamically feasible leg; the message names what and where.
    """
    progress("measuring the water", 0.0)
    water = _water(problem)
    space = _search_space(problem, water)
    log = _sail_all(problem, water, space, progress)
    commands = Commands(
        sample_time_s=problem.vessel.sample_time_s,
        names=problem.vessel.model.inputs,
        values=np.concatenate(log.commands),
    )
    begin = _at_rest(problem, problem.start)
    states = np.concatenate([begin[None], *log.states])
    trajectory = Trajectory(sample_time_s=commands.sample_time_s, pose=states[:, :3], velocity=states[:, 3:])
    progress("verifying", 0.9)
    return _finished(problem, water, commands, trajectory, tuple(log.legs))


def _finished(
    problem: PlanProblem, water: LegWater, commands: Commands, trajectory: Trajectory, legs: tuple[Leg, ...]
) -> Plan:
    vessel, area, environment = problem.vessel, problem.area, problem.environment
    sailed = {"commands": commands, "trajectory": trajectory, "legs": legs}
    verification = verify_plan(
        vessel,
        area,
        environment,
        commands=commands,
        trajectory=trajectory,
        legs=legs,
        clearance_m=problem.settings.clearance_m,
        primitives={item.name: item for item in problem.primitives},
        repeats=_repeats(problem),
    )
    if not verification.verified:
        raise NoPlan("the plan found does not pass its own verification: " + "; ".join(verification.problems))
    rng = np.random.default_rng(problem.seed)
    return Plan(
        area=area,
        **sailed,  # type: ignore[arg-type]
        reposition_bound_s=_reposition_bound_s(problem, water),
        leave_water_probability=leave_water_probability(vessel, area, environment, rng=rng, **sailed),  # type: ignore[arg-type]
        design_efficiency_realised=realised_efficiency(vessel, problem.design, environment, **sailed),  # type: ignore[arg-type]
        verification=verification,
    )


def _repeats(problem: PlanProblem) -> dict[str, int]:
    return dict(zip(problem.design.problem.names, problem.design.repeats, strict=True))


def _water(problem: PlanProblem) -> LegWater:
    return LegWater(
        vessel=problem.vessel,
        environment=problem.environment,
        ship=capability(problem.vessel, problem.settings),
        area=problem.area,
        clearance_m=problem.settings.clearance_m,
        field=clearance_field(problem.area, resolution_m=problem.vessel.length_m / 8),
    )


def _search_space(problem: PlanProblem, water: LegWater) -> SearchSpace:
    vessel, grid = problem.vessel, water.field
    margin = water.path_margin_m + grid.cell_m / 2
    way = goal_field(grid, problem.goal[:2], clearance_m=margin)
    if not np.isfinite(way.to_goal(problem.start[:2])):
        raise NoPlan(_no_way(problem, grid, margin))
    return SearchSpace(
        stamps=_stamps(problem, grid),
        frame=problem.area.frame,
        field=grid,
        goal_way=way,
        goal=problem.goal,
        ship=water.ship,
        hull_m=vessel.length_m,
        leg_margin_m=margin,
        current_to=problem.environment.current_to,
    )


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
    widest, place = narrowest_passage(grid, problem.start[:2], problem.goal[:2])
    lat, lon = problem.area.frame.to_degrees(place)
    if widest <= grid.cell_m / 2:
        return "the goal cannot be reached from the start: forbidden water lies between them on every way"
    return (
        f"the goal cannot be reached from the start: the widest way leaves {widest:.1f} m on each side near "
        f"{lat:.5f}, {lon:.5f}, while {needed_m:.1f} m are needed (plan.clearance_m = "
        f"{problem.settings.clearance_m:g}, the hull in a turn, and the chart grid)"
    )


def _sail_all(problem: PlanProblem, water: LegWater, space: SearchSpace, progress: Progress) -> _Log:
    log = _Log(state=_at_rest(problem, problem.start), inputs=np.zeros(len(problem.vessel.limits)))
    left = _repeats(problem)
    total, deadline = sum(left.values()), time.monotonic() + problem.settings.time_budget_s
    queue: list[Placement] = []
    stuck = ""
    while sum(left.values()):
        if not queue:
            if stuck and time.monotonic() > deadline:
                raise NoPlan(f"no plan within plan.time_budget_s = {problem.settings.time_budget_s:g}: {stuck}")
            progress("placing runs", _share(total, left))
            queue = list(_placed(space, left, log))
        placement = queue.pop(0)
        stuck = _sail_run(problem, water, log, placement)
        if stuck:
            space, queue = refusing(space, log.last, placement), []
            continue
        left[placement.primitive] -= 1
        progress(f"sailing {placement.primitive}", _share(total, left))
    _sail_home(problem, water, log)
    return log


def _share(total: int, left: dict[str, int]) -> float:
    return 0.05 + 0.8 * (total - sum(left.values())) / max(total, 1)


def _placed(space: SearchSpace, left: dict[str, int], log: _Log) -> Sequence[Placement]:
    counts = [left[item.name] for item in space.stamps]
    return place_runs(space, counts, start=log.state[:3], exit_mps=log.exit_mps, last=log.last)


def _sail_run(problem: PlanProblem, water: LegWater, log: _Log, placement: Placement) -> str:
    """Sail to a placement and do its run; what stands in the way, or "" when both were done."""
    primitive = next(item for item in problem.primitives if item.name == placement.primitive)
    entry = _through_water(problem, placement.pose, primitive.entry_velocity)
    lat, lon = problem.area.frame.to_degrees(placement.pose[:2])
    where = f"{primitive.name!r} near {lat:.5f}, {lon:.5f}"
    leg = find_leg(_task(problem, log, entry, primitive.entry_inputs), water)
    if leg is None:
        return f"no leg leads to {where}"
    track = leg_trajectory(water, log.state, leg)
    arrived = np.r_[track.pose[-1], track.velocity[-1]]
    values = primitive.commands.values + _whole_turns(leg[-1] - primitive.entry_inputs)
    run = leg_trajectory(water, arrived, values)
    if not shapely.contains_properly(water.safe, swept_area(run.pose, problem.vessel.hull_b)):
        return f"the run {where} leaves safe water"
    log.sail("reposition", primitive.name, leg, track)
    log.sail("primitive", primitive.name, values, run)
    log.last, log.exit_mps = primitive.name, float(run.velocity[-1, 0])
    return ""


def _sail_home(problem: PlanProblem, water: LegWater, log: _Log) -> None:
    task = _task(problem, log, _at_rest(problem, problem.goal), np.zeros(len(problem.vessel.limits)))
    leg = find_leg(task, water)
    if leg is None:
        lat, lon = problem.area.frame.to_degrees(log.state[:2])
        raise NoPlan(f"no leg leads from the last run, near {lat:.5f}, {lon:.5f}, to the goal")
    log.sail("reposition", GOAL, leg, leg_trajectory(water, log.state, leg))


def _task(problem: PlanProblem, log: _Log, end: Array, end_inputs: Array) -> LegTask:
    return LegTask(
        start=log.state, end=end, start_inputs=log.inputs, end_inputs=end_inputs, seed=problem.seed + len(log.legs) + 1
    )


def _whole_turns(difference: Array) -> Array:
    """The whole turns by which a leg left an azimuth away from the primitive's own angles."""
    return np.asarray(2 * np.pi * np.round(difference / (2 * np.pi)))


def _through_water(problem: PlanProblem, pose: Array, velocity: Array) -> Array:
    """(6,) state at a pose with a velocity (3,) through the forecast's mean current."""
    u_c, v_c = to_body(problem.environment.current_to, pose[2], NUMPY)
    return np.asarray(np.r_[pose, velocity + np.array([u_c, v_c, 0.0])])


def _at_rest(problem: PlanProblem, pose: Array) -> Array:
    return _through_water(problem, pose, np.zeros(3))


def _reposition_bound_s(problem: PlanProblem, water: LegWater) -> float:
    """No plan with these runs repositions in less: the way to the goal less all that runs can carry, at top speed.

    The way is measured for a hull that keeps the clearance abeam only. A cell counts as passable when any point nearer
    to it than to its neighbours could be: clearance changes no faster than distance.
    """
    coarse = water.field.thinned(ROUTING_CELLS)
    narrow = problem.settings.clearance_m + problem.vessel.beam_m / 2 - water.field.error_m - coarse.error_m / 2
    way = goal_field(coarse, problem.goal[:2], clearance_m=max(narrow, 0.0))
    current = float(np.hypot(*problem.environment.current_to))
    used = _repeats(problem)
    carried = sum(
        used[item.name] * (float(np.hypot(*item.displacement[:2])) + current * item.duration_s)
        for item in problem.primitives
    )
    ship: Capability = water.ship
    return max(0.0, way.lower_bound(problem.start[:2]) - carried) / (ship.top_speed_mps + current)
