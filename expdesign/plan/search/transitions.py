"""Joints between runs tried with optimised legs, so that the search knows where they lead and how long they take.

How short a leg may be without making the ship slow down, or circle, to arrive as the run asks depends on how actuators
stand and how the ship moves as the run before ends, which no rule tells. Each pair of runs is tried once, in open calm
water: the leg may end anywhere, and way made good counts as much as it would at full speed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from expdesign.conventions import wrap_angle
from expdesign.dictionary import Primitive
from expdesign.plan.chart import clearance_field
from expdesign.plan.legs import NEAR, LegTask, LegWater, joint
from expdesign.plan.search.state import SearchSpace, Stamp, TriedJoint
from expdesign.plan.values import Placement
from expdesign.plan.work_budget import Effort
from expdesign.sea_area import as_multipolygon
from expdesign.simulation import CALM
from expdesign.values import Array

GUESS = 0.5
"""Length of the leg that the optimiser begins with, in hull lengths."""
ROOM = 25.0
"""Hull lengths of open water to every side."""

Pair = tuple[str, str]


def pairs_of(placements: Sequence[Placement], last: str = "") -> list[Pair]:
    """Names of the runs before and after each joint, "" for start and goal, once each."""
    return list(dict.fromkeys(pairwise([last, *(item.primitive for item in placements), ""])))


def settled(
    space: SearchSpace,
    water: LegWater,
    primitives: Mapping[str, Primitive],
    pairs: Iterable[Pair],
    *,
    start: Array,
    carried: bool,
    effort: Effort | None = None,
) -> SearchSpace:
    """The same space with joints of pairs that had none.

    Args:
        space, water: as of the plan.
        primitives: the runs.
        pairs: of which runs.
        start: (3,) pose of the plan.
        carried: whether it matters how far joints lead.
        effort: that may be spent; joints that are not tried when it is are left to the rule.
    """
    open_water, tried = _open(water), dict(space.tried)
    for pair in pairs:
        if effort is not None and effort.exhausted:
            break
        if pair not in tried:
            course, turn = _wished(space, pair, start)
            task = replace(_task(pair, primitives, open_water, course, turn), effort=effort or Effort())
            wish = carried * np.array([np.cos(course), np.sin(course)])
            tried[pair] = _tried(space, open_water, pair, task, wish)
    return replace(space, tried=tried)


def _tried(space: SearchSpace, water: LegWater, pair: Pair, task: LegTask, wish: Array) -> TriedJoint | None:
    """The joint of a pair that loses least, way made good along `wish` (2,) counting as at full speed."""
    assert space.times is not None
    found = joint(task, water, wish / space.times.speed_mps)
    if found is None:
        return None
    seconds, step = found
    return TriedJoint(step=step, seconds=seconds, more_s=_more_s(space, pair, step, seconds))


def _more_s(space: SearchSpace, pair: Pair, step: Array, seconds: float) -> float:
    assert space.times is not None
    if np.hypot(*step[:2]) < NEAR * space.hull_m:
        return 0.0
    before, after = _stamps(space, pair)
    speeds = before.exit_mps if before else 0.0, after.entry_mps if after else 0.0
    return max(0.0, seconds - float(space.times.step_s(step, *np.array(speeds))))


def _stamps(space: SearchSpace, pair: Pair) -> tuple[Stamp | None, Stamp | None]:
    stamps = {item.name: item for item in space.stamps}
    return stamps.get(pair[0]), stamps.get(pair[1])


def _wished(space: SearchSpace, pair: Pair, start: Array) -> tuple[float, float]:
    """Course of the way that both runs carry the ship, and the turn between them, from the heading before."""
    before, after = _stamps(space, pair)
    way = np.diff(space.goal_way.way(start[:2]), axis=0)
    begins, ends = (float(np.arctan2(step[1], step[0])) for step in (way[0], way[-1]))
    course = before.way_ahead_rad if before else begins - float(start[2])
    turn = course - after.course_rad if after else course + float(space.goal[2]) - ends
    return float(wrap_angle(course)), float(wrap_angle(turn))


def _task(pair: Pair, primitives: Mapping[str, Primitive], water: LegWater, course: float, turn: float) -> LegTask:
    rest = np.zeros(len(water.vessel.limits))
    before, after = primitives.get(pair[0]), primitives.get(pair[1])
    given = rest[None] if before is None else before.commands.values
    away = GUESS * water.vessel.length_m
    return LegTask(
        start=np.r_[np.zeros(3), np.zeros(3) if before is None else before.exit_velocity],
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
    length = water.vessel.length_m
    box = shapely.box(*(-ROOM * length, -ROOM * length, ROOM * length, ROOM * length))
    area = replace(water.area, water=as_multipolygon(box), land=shapely.MultiPolygon())
    field = clearance_field(area, resolution_m=length / 4)
    return replace(water, area=area, environment=CALM, field=field, clearance_m=0.0)
