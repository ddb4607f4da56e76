"""Sailing a trial run by run; where a leg or a run fails, the rest is placed anew."""

from __future__ import annotations

import time

import numpy as np

from expdesign.errors import NoPlan
from expdesign.plan.legs import LegTask, LegWater, find_leg, last_state, leg_trajectory, nearest_turns
from expdesign.plan.problem import PlanProblem
from expdesign.plan.search import SearchSpace, place_runs, refusing
from expdesign.plan.timeline import Timeline
from expdesign.plan.values import Placement, Progress
from expdesign.plan.work_budget import Effort
from expdesign.values import Array

GOAL = "goal"
TRY_S = 2.0
"""Seconds of the time budget that one try of another place costs at least: effort is counted, so that a slow machine
finds the same plan as a fast one."""
LEG_S = 40.0
"""Effort after which a leg that is not found yet counts as none."""
LAST_RESORT = 5.0
"""Time budgets by the clock after which a search that is stuck ends whatever the count."""


def sail_all(
    problem: PlanProblem,
    water: LegWater,
    space: SearchSpace,
    progress: Progress,
    *,
    stated: LegWater,
    effort: Effort,
) -> Timeline:
    """Every run and leg from start to goal.

    Args:
        problem: the trial.
        water: that legs are to keep to.
        space: that runs are placed in.
        progress: told how much is sailed.
        stated: the water that runs are to keep to, with the clearance that is promised.
        effort: counts what legs cost.

    Raises:
        NoPlan: there is no place for a run, or none was found with all the tries; says what stood in the way.
    """
    line = Timeline(begin=problem.at_rest(problem.start), begin_inputs=np.zeros(len(problem.vessel.limits)))
    left = problem.repeats
    budget_s = problem.settings.time_budget_s
    total, deadline, tries = sum(left.values()), time.monotonic() + LAST_RESORT * budget_s, 0
    queue: list[Placement] = []
    stuck, lost_s, spent_s = "", 0.0, effort.spent_s
    while sum(left.values()) or not _sail_home(problem, water, line, effort):
        if not sum(left.values()):  # all runs are done, but no way leads home: do the last one elsewhere
            undone = line.undo_run()
            space, queue, stuck = refusing(space, line.last, undone), [], "no leg leads from the last run to the goal"
            left[undone.primitive] += 1
        tries += bool(stuck)
        lost_s += max(TRY_S, effort.spent_s - spent_s) * bool(stuck)
        spent_s = effort.spent_s
        if stuck and (lost_s > budget_s or time.monotonic() > deadline):
            raise NoPlan(f"no plan within plan.time_budget_s = {budget_s:g}, {tries} places were tried: {stuck}")
        if not queue:
            progress("placing runs", _share(total, left))
            queue = _placed(space, left, line, stuck)
        placement = queue.pop(0)
        stuck = _sail_run(problem, water, line, placement, stated=stated, effort=effort)
        if stuck:
            space, queue = refusing(space, line.last, placement), []
            continue
        left[placement.primitive] -= 1
        progress(f"sailing {placement.primitive}", _share(total, left))
    return line


def _share(total: int, left: dict[str, int]) -> float:
    return 0.05 + 0.8 * (total - sum(left.values())) / max(total, 1)


def _placed(space: SearchSpace, left: dict[str, int], line: Timeline, stuck: str) -> list[Placement]:
    counts = [left[item.name] for item in space.stamps]
    try:
        return list(place_runs(space, counts, start=line.state[:3], exit_mps=float(line.state[3]), last=line.last))
    except NoPlan as error:
        raise NoPlan(f"{error}; before that, {stuck}" if stuck else str(error)) from None


def _sail_run(
    problem: PlanProblem,
    water: LegWater,
    line: Timeline,
    placement: Placement,
    *,
    stated: LegWater,
    effort: Effort,
) -> str:
    """Sail to a placement and do its run; what stands in the way, or "" when both were done."""
    primitive = next(item for item in problem.used if item.name == placement.primitive)
    entry = problem.under_way(placement.pose, primitive.entry_velocity)
    lat, lon = problem.area.frame.to_degrees(placement.pose[:2])
    where = f"{primitive.name!r} near {lat:.5f}, {lon:.5f}"
    leg = _leg(problem, water, line, entry, primitive.entry_inputs, effort)
    if leg is None:
        return f"no leg leads to {where}"
    track = leg_trajectory(water, line.state, leg, line.given)
    turned = nearest_turns(problem.vessel, primitive.entry_inputs, leg[-1]) - primitive.entry_inputs
    values = primitive.commands.values + turned
    run = leg_trajectory(water, last_state(track), values, water.remembered(np.concatenate([line.given, leg])))
    if not stated.holds(run.pose):
        return f"the run {where} leaves safe water"
    line.sail("reposition", primitive.name, leg, track)
    line.sail("primitive", primitive.name, values, run)
    return ""


def _sail_home(problem: PlanProblem, water: LegWater, line: Timeline, effort: Effort) -> bool:
    """Sail the last leg; whether there is one."""
    leg = _leg(problem, water, line, problem.at_rest(problem.goal), np.zeros(len(problem.vessel.limits)), effort)
    if leg is not None:
        line.sail("reposition", GOAL, leg, leg_trajectory(water, line.state, leg, line.given))
    return leg is not None


def _leg(
    problem: PlanProblem, water: LegWater, line: Timeline, end: Array, end_inputs: Array, effort: Effort
) -> Array | None:
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
        effort=Effort(most_s=LEG_S),
    )
    leg = find_leg(task, water)
    effort.spent_s += task.effort.spent_s
    return leg if leg is None or line.stretches or water.prompt else np.concatenate([wait, leg])
