"""Joints between runs tried with optimised legs, so that the search knows how long they take to settle.

A joint that is a little too short makes a ship slow down, or circle, to arrive as the run asks; how short that is
depends on how actuators stand and how the ship moves as the run before ends. Each pair of runs is tried once, in open
calm water, as the search would join them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from expdesign.conventions import wrap_angle
from expdesign.dictionary import Primitive
from expdesign.plan.area import as_multipolygon
from expdesign.plan.field import clearance_field
from expdesign.plan.leg_times import LegTimes, joints
from expdesign.plan.leg_values import LegTask, LegWater
from expdesign.plan.legs import find_leg
from expdesign.plan.search_space import SearchSpace
from expdesign.plan.values import Placement
from expdesign.simulation import CALM
from expdesign.values import Array

LONGER = (1.0, 1.6, 2.6, 4.2)
"""Times to settle that are tried, in those of the rule."""
GOOD = 1.15
"""A leg that takes so much of the rule's time is as good as the rule."""
NEAR = 3.0
"""Hull lengths up to which a leg is a joint."""
ROOM = 25.0
"""Hull lengths of open water to every side."""

Pair = tuple[str, str]


@dataclass(frozen=True, kw_only=True, eq=False)
class Joint:
    """A joint of a plan.

    Attributes:
        pair: names of the run before, "" for the start, and after.
        step: (3,) forward m, starboard m and turn from the pose where the one ends to that where the other begins.
    """

    pair: Pair
    step: Array


def joints_of(space: SearchSpace, start: Array, last: str, placements: Sequence[Placement]) -> list[Joint]:
    """Joints of placements after a run that ended at a pose (3,), the first of each pair."""
    found: dict[Pair, Joint] = {}
    stamps = {item.name: item for item in space.stamps}
    for placement in placements:
        step = _from(start, placement.pose)
        pair = (last, placement.primitive)
        if np.hypot(*step[:2]) <= NEAR * space.hull_m and pair not in found:
            found[pair] = Joint(pair=pair, step=step)
        run = stamps[placement.primitive]
        last, start = run.name, _to(placement.pose, run.displacement)
        start[:2] += space.current_to * run.duration_s
    return list(found.values())


def settled(
    space: SearchSpace,
    water: LegWater,
    primitives: Mapping[str, Primitive],
    tried: Sequence[Joint],
    *,
    carried: bool,
    seed: int,
) -> SearchSpace:
    """The same space with the time to settle of joints that had none, from legs.

    Args:
        space, water: as of the plan.
        primitives: the runs.
        tried: joints of a plan.
        carried: whether it matters how far joints lead.
        seed: of the path search.
    """
    assert space.times is not None
    open_water, known = _open(water), dict(space.settle_s)
    for joint in tried:
        if joint.pair not in known:
            leg_s = _legs(joint.pair, primitives, open_water, seed)
            known[joint.pair] = _settle_s(space, space.times, joint, leg_s, carried=carried)
    return replace(space, settle_s=known)


def _settle_s(
    space: SearchSpace, times: LegTimes, joint: Joint, leg_s: Callable[[Array], float], *, carried: bool
) -> float:
    """The time to settle with which the joint that the rule then asks for loses least."""
    before, after = ({item.name: item for item in space.stamps}.get(name) for name in joint.pair)
    assert after is not None
    best = (np.inf, times.settle_s)
    for longer in LONGER:
        rule = replace(times, settle_s=longer * times.settle_s)
        found = joints(rule, before.exit_mps if before else 0.0, after.entry_mps)
        course = joint.step[:2] / max(float(np.hypot(*joint.step[:2])), 1e-9)
        ahead_s = found.step[:, :2] @ course / times.speed_mps
        astray = np.abs(wrap_angle(found.step[:, 2] - joint.step[2]))
        alike = np.flatnonzero(astray <= astray.min() + 1e-6)
        row = alike[int(np.argmin(found.seconds[alike] - ahead_s[alike]))]
        spent_s = leg_s(found.step[row])
        best = min(best, (spent_s - carried * float(ahead_s[row]), rule.settle_s))
        if spent_s <= GOOD * found.seconds[row]:
            break
    return best[1]


def _legs(pair: Pair, primitives: Mapping[str, Primitive], water: LegWater, seed: int) -> Callable[[Array], float]:
    """Time of the optimised leg between two runs, by its step; infinite where there is none."""
    rest = np.zeros(len(water.vessel.limits))
    before, after = primitives.get(pair[0]), primitives[pair[1]]
    velocity = np.zeros(3) if before is None else before.exit_velocity
    given = rest[None] if before is None else before.commands.values

    def leg_s(step: Array) -> float:
        task = LegTask(
            start=np.r_[0.0, 0.0, 0.0, velocity],
            end=np.r_[step, after.entry_velocity],
            start_inputs=given[-1],
            end_inputs=after.entry_inputs,
            seed=seed,
            before=water.remembered(given),
        )
        values = find_leg(task, water)
        return np.inf if values is None else len(values) * water.vessel.sample_time_s

    return leg_s


def _open(water: LegWater) -> LegWater:
    """Open calm water for the same ship."""
    length = water.vessel.length_m
    box = shapely.box(*(-ROOM * length, -ROOM * length, ROOM * length, ROOM * length))
    area = replace(water.area, water=as_multipolygon(box), land=shapely.MultiPolygon())
    field = clearance_field(area, resolution_m=length / 4)
    return replace(water, area=area, environment=CALM, field=field, clearance_m=0.0)


def _from(pose: Array, other: Array) -> Array:
    """(3,) step from a pose to another."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    north, east = other[:2] - pose[:2]
    return np.array([c * north + s * east, c * east - s * north, float(wrap_angle(other[2] - pose[2]))])


def _to(pose: Array, step: Array) -> Array:
    """(3,) pose a step away."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([pose[0] + c * step[0] - s * step[1], pose[1] + s * step[0] + c * step[1], pose[2] + step[2]])
