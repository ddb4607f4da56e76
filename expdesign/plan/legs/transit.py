"""The steady part of a long leg of a helm-steered ship: straight ahead at transit speed.

There is nothing to optimise on it, and IPOPT sometimes ends without an answer for a leg of a hundred hull lengths.
Commands that hold course and speed are constant where the ship keeps both by herself. One that does not, as she is
unstable on her course or wind turns her, is steered along by the helmsman, and the commands are those that he gives.
"""

from __future__ import annotations

import numpy as np

from expdesign.plan.control import HelmShip, Helmsman, over_ground
from expdesign.plan.legs.water import ARRIVAL, LegTask, LegWater
from expdesign.simulation import to_body
from expdesign.values import Array, sealed
from expdesign.vessel import NUMPY

TRANSIT_HULLS = 20.0  # shortest straight that is not optimised, in hull lengths
TRANSIT_ENDS_HULLS = 6.0  # of straights before and after it that are optimised with the rest of the leg
STRAIGHT_RAD = 1e-6  # change of course from point to point of a path from which on it bends
HEADING_ROUNDS = 8  # of the search for the heading that makes good a course in a current
ASTRAY_HULLS = 1.0  # farthest from the straight that a helmsman may end, in hull lengths


@sealed(to="i 3", start="6", on="j 3")
class Transit:
    """A long straight of a leg's path."""

    to: Array  # (i, 3) places and courses of the path before it, and of its begin
    start: Array  # (6,) the ship at its begin, at transit speed, heading so that she makes good the course
    count: int  # samples that it takes
    sample_time_s: float  # of them
    on: Array  # (j, 3) places and courses of the path after it

    def held(self, task: LegTask, before: Array, water: LegWater, ship: HelmShip) -> tuple[Array, Array] | None:
        """Commands (k, m) of the straight after those of the leg before it (b, m), and the state (6,) at its end.

        None where the helmsman does not keep the ship on it.
        """
        steady = np.tile(ship.approach.inputs, (self.count, 1))
        kept = steady + (before[-1] - ship.approach.inputs)
        planned = water.states(self.start, steady)[-1]
        sailed = water.states(task.start, np.concatenate([before, kept]), task.past)[-1]  # small errors may have grown
        scale = np.r_[1.0, [ship.transit_speed_mps] * 2, ship.yaw_rate_radps]
        if all((np.abs(state - self.start)[2:] <= ARRIVAL / 10 * scale).all() for state in (planned, sailed)):
            return kept, planned
        past = np.concatenate([task.past, before])
        commands, reached = self._steered(water.states(task.start, before, task.past)[-1], past, water)
        astray = np.hypot(*(reached - self._at(self.count))[:2]) > ASTRAY_HULLS * water.vessel.length_m
        return None if astray else (commands, reached)

    def on_from(self, state: Array) -> Array:
        """(j + 1, 3) places and courses of the path after it, from where the ship is."""
        return np.vstack([[*state[:2], self.to[-1, 2]], self.on])

    def _at(self, samples: float) -> Array:
        """(6,) the steady ship so many samples after the begin."""
        moved: Array = over_ground(self.start[None])[0] * (samples * self.sample_time_s)
        return np.concatenate([self.start[:2] + moved, self.start[2:]])

    def _steered(self, state: Array, past: Array, water: LegWater) -> tuple[Array, Array]:
        """Commands (k, m) of a helmsman who keeps a ship at a state (6,) on the straight, and the state at its end."""
        helm = Helmsman(vessel=water.vessel, environment=water.environment, ship=water.ship)
        rows = past
        for sample in range(1, self.count + 1):
            given = None if water.prompt else water.delivered(water.remembered(rows))[None]
            row = helm.commands(self._at(sample)[None], state[None], rows[-1:], delivered=given)
            state = water.states(state, row, rows[-1:] if water.prompt else water.remembered(rows))[-1]
            rows = np.concatenate([rows, row])
        return rows[len(past) :], state


def long_straight(path: Array, braking_m: float, water: LegWater, ship: HelmShip) -> Transit | None:
    """The longest straight of a path (k, 3) that is sailed at transit speed; None where every one is short.

    Args:
        path: places and courses from the leg's start to its end.
        braking_m: length at its end on which the ship slows down.
    """
    hull_m = water.vessel.length_m
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))]
    first, last = _longest_straight(along, path[:, 2])
    gather_m = ship.transit_speed_mps**2 / (2.0 * ship.acceleration_mps2)
    begin = max(along[first], gather_m) + TRANSIT_ENDS_HULLS * hull_m
    end = min(along[last], along[-1] - braking_m) - TRANSIT_ENDS_HULLS * hull_m
    if end - begin < TRANSIT_HULLS * hull_m:
        return None
    course = float(path[first, 2])
    place = path[first, :2] + (begin - along[first]) * np.array([np.cos(course), np.sin(course)])
    start = _steady_state(place, course, water, ship)
    return Transit(
        to=np.vstack([path[along < begin], [*place, course]]),
        start=start,
        count=int((end - begin) / (float(np.hypot(*start[3:5])) * water.vessel.sample_time_s)),
        sample_time_s=water.vessel.sample_time_s,
        on=path[along > end],
    )


def _longest_straight(along: Array, course: Array) -> tuple[int, int]:
    """Indices of the points between which a path keeps its course longest."""
    bends = np.flatnonzero(np.abs(np.diff(course)) > STRAIGHT_RAD)
    ends = np.r_[bends, len(course) - 1]  # a bend lies between its point and the next
    begins = np.r_[0, bends + 1]
    longest = int(np.argmax(along[ends] - along[begins]))
    return int(begins[longest]), int(ends[longest])


def _steady_state(place: Array, course: float, water: LegWater, ship: HelmShip) -> Array:
    """(6,) the ship at a place (2,) at transit speed through water, heading so that it makes good a course [rad]."""
    velocity, heading = np.zeros(3), course
    for _ in range(HEADING_ROUNDS):
        current = to_body(water.environment.current_to, heading, NUMPY)
        velocity = ship.approach.velocity + np.array([*current, 0.0])
        heading = course - float(np.arctan2(velocity[1], velocity[0]))
    return np.array([*place, heading, *velocity])
