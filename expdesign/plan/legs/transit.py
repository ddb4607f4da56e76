"""The steady part of a long leg of a helm-steered ship: straight ahead at transit speed, with commands that hold it.

There is nothing to optimise about it. The program of a leg of a hundred hull lengths that contains it is large, and
IPOPT sometimes ends without an answer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.plan.control import HelmShip
from expdesign.plan.legs.tuning import LEGS
from expdesign.plan.legs.water import LegWater
from expdesign.simulation import to_body
from expdesign.values import Array, seal
from expdesign.vessel import NUMPY


@dataclass(frozen=True, kw_only=True, eq=False)
class Transit:
    """A steady part of a leg.

    Attributes:
        to: (i, 3) places and courses of the leg's path before it.
        states: (k + 1, 6) at every sample.
        commands: (k, m), all the same.
        on: (j, 3) places and courses of the path after it; the first is where the ship then is.
    """

    to: Array
    states: Array
    commands: Array
    on: Array

    def __post_init__(self) -> None:
        seal(self, to="i 3", states="n 6", commands="k m", on="j 3")


def steady_transit(path: Array, braking_m: float, water: LegWater, ship: HelmShip) -> Transit | None:
    """The longest straight of a path (k, 3), if it is long and the ship keeps its course and speed on it.

    Args:
        path: places and courses from the leg's start to its end.
        braking_m: length at its end on which the ship slows down.
        water, ship: of the leg.

    Returns:
        None where every straight is short, or wind turns or slows the ship.
    """
    hull_m = water.vessel.length_m
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))]
    first, last = _longest_straight(along, path[:, 2])
    gather_m = ship.transit_speed_mps**2 / (2.0 * ship.acceleration_mps2)
    begin = max(along[first], gather_m) + LEGS.transit_ends_hulls * hull_m
    end = min(along[last], along[-1] - braking_m) - LEGS.transit_ends_hulls * hull_m
    if end - begin < LEGS.transit_hulls * hull_m:
        return None
    course = float(path[first, 2])
    place = path[first, :2] + (begin - along[first]) * np.array([np.cos(course), np.sin(course)])
    start = _steady_state(place, course, water, ship)
    count = int((end - begin) / (float(np.hypot(*start[3:5])) * water.vessel.sample_time_s))
    commands = np.tile(ship.approach.inputs, (count, 1))
    states = water.states(start, commands)
    scale = np.r_[1.0, [ship.transit_speed_mps] * 2, ship.yaw_rate_radps]
    if (np.abs(states[-1] - start)[2:] > LEGS.arrival / 10 * scale).any():
        return None
    return Transit(
        to=np.vstack([path[along < begin], [*place, course]]),
        states=states,
        commands=commands,
        on=np.vstack([[*states[-1, :2], course], path[along > end]]),
    )


def _longest_straight(along: Array, course: Array) -> tuple[int, int]:
    """Indices of the points between which a path keeps its course longest."""
    bends = np.flatnonzero(np.abs(np.diff(course)) > LEGS.straight_rad)
    ends = np.r_[bends, len(course) - 1]  # a bend lies between its point and the next
    begins = np.r_[0, bends + 1]
    longest = int(np.argmax(along[ends] - along[begins]))
    return int(begins[longest]), int(ends[longest])


def _steady_state(place: Array, course: float, water: LegWater, ship: HelmShip) -> Array:
    """(6,) the ship at a place (2,) at transit speed through water, heading so that it makes good a course [rad]."""
    velocity, heading = np.zeros(3), course
    for _ in range(LEGS.heading_rounds):
        current = to_body(water.environment.current_to, heading, NUMPY)
        velocity = ship.approach.velocity + np.array([*current, 0.0])
        heading = course - float(np.arctan2(velocity[1], velocity[0]))
    return np.array([*place, heading, *velocity])
