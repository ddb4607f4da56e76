"""Transitions between runs, optimised in advance, so that the search knows their displacement and their time.

The least length of a leg on which the ship arrives at a run's entry without slowing down or circling depends on the
motion and the actuators at the end of the run before, for which there is no rule. Each pair of runs is optimised once,
in open calm water: the leg may end anywhere, and displacement counts as much as at transit speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from expdesign.conventions import wrap_angle
from expdesign.memory import in_order
from expdesign.plan.chart import clearance_field
from expdesign.plan.control import AgileShip
from expdesign.plan.legs import LegTask, LegWater, free_leg
from expdesign.plan.local_planner.agile_times import LegTimes
from expdesign.plan.local_planner.protocol import Pair, SearchSpace, TransitionTrials, TriedTransition
from expdesign.plan.local_planner.tuning import LOCAL
from expdesign.plan.runs import Footprint
from expdesign.plan.values import Placement
from expdesign.sea_area import as_multipolygon
from expdesign.simulation import CALM
from expdesign.values import Array


def pairs_of(placements: Sequence[Placement]) -> list[Pair]:
    """Names of the runs before and after each leg, "" for start and goal, once each."""
    return list(dict.fromkeys(pairwise(["", *(item.primitive for item in placements), ""])))


def with_transitions(
    space: SearchSpace, ship: AgileShip, times: LegTimes, pairs: Sequence[Pair], trials: TransitionTrials
) -> SearchSpace:
    """The space with transitions of pairs that had none, as far as the budget goes.

    Each is optimised on its own. Their work is counted in the order of the pairs, so the result does not depend on the
    number of processes.
    """
    if trials.budget.exhausted:
        return space
    water, tried = _open(trials.water), dict(space.tried)
    fresh = [pair for pair in pairs if pair not in tried]
    tasks = (_desired_leg(space, pair, trials, times, water) for pair in fresh)
    results = in_order(_optimised, (water, ship), tasks)
    for number, pair in enumerate(fresh):
        if trials.budget.exhausted:
            break
        trials.progress("trying transitions between runs", (number + 1) / (len(fresh) + 1))
        found, spent_s = next(results)
        tried[pair] = None if found is None else _tried(space, times, pair, trials, *found)
        trials.budget.spent_s += spent_s
    return replace(space, tried=tried)


def _desired_leg(
    space: SearchSpace, pair: Pair, trials: TransitionTrials, times: LegTimes, water: LegWater
) -> tuple[LegTask, Array]:
    """The task of a transition, and the value of displacement."""
    course, turn = _desired(space, pair, trials.start)
    worth = trials.made_good * np.array([np.cos(course), np.sin(course)]) / times.speed_mps
    return _task(pair, trials, water, course, turn), worth


def _optimised(
    water: LegWater, ship: AgileShip, task: LegTask, worth: Array
) -> tuple[tuple[float, Array] | None, float]:
    """Time and end of a transition, or None, and the work it took."""
    return free_leg(task, water, ship, worth), task.budget.spent_s


def _tried(
    space: SearchSpace, times: LegTimes, pair: Pair, trials: TransitionTrials, seconds: float, step: Array
) -> TriedTransition:
    more_s = 0.0
    if np.hypot(*step[:2]) >= LOCAL.near_hulls * space.hull_m:
        before, after = _runs(space, pair)
        speeds = before.exit_mps if before else float(trials.under_way[0][0]), after.entry_mps if after else 0.0
        more_s = max(0.0, seconds - float(times.step_s(step, *np.array(speeds))))
    return TriedTransition(step=step, seconds=seconds, more_s=more_s)


def _runs(space: SearchSpace, pair: Pair) -> tuple[Footprint | None, Footprint | None]:
    runs = {item.name: item for item in space.footprints}
    return runs.get(pair[0]), runs.get(pair[1])


def _desired(space: SearchSpace, pair: Pair, start: Array) -> tuple[float, float]:
    """Course that both runs make good, and the turn between them, from the heading before."""
    before, after = _runs(space, pair)
    path = np.diff(space.goal_distance.path(start[:2]), axis=0)
    begins, ends = (float(np.arctan2(step[1], step[0])) for step in (path[0], path[-1]))
    course = before.course_from_end_rad if before else begins - float(start[2])
    turn = course - after.course_rad if after else course + float(space.goal[2]) - ends
    return float(wrap_angle(course)), float(wrap_angle(turn))


def _task(pair: Pair, trials: TransitionTrials, water: LegWater, course: float, turn: float) -> LegTask:
    rest, (velocity, standing) = np.zeros(len(water.vessel.limits)), trials.under_way
    before, after = trials.primitives.get(pair[0]), trials.primitives.get(pair[1])
    given = standing[None] if before is None else before.commands.values
    away = LOCAL.transition_guess_hulls * water.vessel.length_m
    return LegTask(
        start=np.r_[np.zeros(3), velocity if before is None else before.exit_velocity],
        end=np.r_[
            away * np.cos(course), away * np.sin(course), turn, np.zeros(3) if after is None else after.entry_velocity
        ],
        start_inputs=given[-1],
        end_inputs=rest if after is None else after.entry_inputs,
        seed=0,
        before=water.remembered(given),
    )


def _open(water: LegWater) -> LegWater:
    """Open calm water for the same ship."""
    length, half = water.vessel.length_m, LOCAL.open_water_hulls * water.vessel.length_m
    area = replace(
        water.area, water=as_multipolygon(shapely.box(-half, -half, half, half)), land=shapely.MultiPolygon()
    )
    field = clearance_field(area, resolution_m=length / 4)
    return replace(water, area=area, environment=CALM, field=field, clearance_m=0.0)
