"""Local planner of force-steered ships that hardly turn at rest: the shortest curves of bounded curvature.

They are sailed at transit speed, and many lengths are found at once.

Source: L. E. Dubins, On curves of minimal length with a constraint on average curvature, American Journal of
Mathematics 79 (1957), 497-516; in the normal form of A. M. Shkel and V. Lumelsky, Classification of the Dubins set,
Robotics and Autonomous Systems 34 (2001), 179-202.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.chart import polyline_length
from expdesign.plan.control import DubinsShip
from expdesign.plan.legs import FoundLeg, LegTask, LegWater, curved_leg, dubins_curve
from expdesign.plan.local_planner.arcs import (
    Departures,
    arc_successors,
    between,
    moved,
    path_points,
    path_successors,
    ways_on,
)
from expdesign.plan.local_planner.protocol import LegEnds, Pair, PartialPlans, SearchSpace, Successors, TransitionTrials
from expdesign.values import Array

# of the shortest path to the goal, in hull lengths; the whole path is always tried too
PATH_STRETCHES = (5.0, 12.0, 25.0, 50.0, 100.0)


def dubins_m(start: Array, end: Array, *, radius_m: float) -> Array:
    """(...,) lengths of the shortest Dubins curves between poses (..., 3) and (..., 3), obstacles ignored [m]."""
    step = (end[..., :2] - start[..., :2]) / radius_m
    d, theta = np.hypot(step[..., 0], step[..., 1]), np.arctan2(step[..., 1], step[..., 0])
    a, b = start[..., 2] - theta, end[..., 2] - theta
    a, b = np.stack([a, -a]), np.stack([b, -b])  # words that begin to the left, and their mirror images
    sin_a, sin_b, cos_a, cos_b = np.sin(a), np.sin(b), np.cos(a), np.cos(b)
    cos_ab, ahead = np.cos(a - b), d + sin_a - sin_b
    with np.errstate(invalid="ignore"):  # a word that does not reach is nan
        same = np.sqrt(_square(2 + d**2 - 2 * cos_ab + 2 * d * (sin_a - sin_b)))  # left, straight, left
        other = np.sqrt(_square(d**2 - 2 + 2 * cos_ab + 2 * d * (sin_a + sin_b)))  # left, straight, right
        back = 2 * np.pi - np.arccos((6 - d**2 + 2 * cos_ab + 2 * d * (sin_b - sin_a)) / 8)  # left, right, left
        to = np.arctan2(cos_b - cos_a, ahead)
        across = np.arctan2(-cos_a - cos_b, d + sin_a + sin_b) - np.arctan2(-2.0, other)
        first = _turn(np.stack([to - a, across - a, to - a + back / 2]))
        last = _turn(np.stack([b - to, across - b, b - a - first[2] + back]))
        length = first + np.stack([same, other, back]) + last
    return np.asarray(radius_m * np.fmin.reduce(length, axis=(0, 1)))


def _square(value: Array) -> Array:
    """Squares; a tiny negative one is that of a straight of no length."""
    return np.where(np.abs(value) < 1e-12, 0.0, np.where(value < 0, np.nan, value))


def _turn(angle: Array) -> Array:
    """Angles as turns to one side, from 0 to less than 2 pi; rounding does not make a whole turn of none."""
    turn = angle - 2 * np.pi * np.floor(angle / (2 * np.pi))  # six times as fast as a remainder, of nan fifty times
    return np.where(turn > 2 * np.pi - 1e-9, 0.0, turn)


@dataclass(frozen=True, kw_only=True, eq=False)
class DubinsPlanner:
    """Legs are Dubins curves; changes of speed take the time of the mean acceleration."""

    ship: DubinsShip  # speeds and turns

    @property
    def transition_trials(self) -> int:
        """None: legs are long enough for the rule."""
        return 0

    def check_ends(self, start: Array, goal: Array, water: LegWater) -> None:
        """Nothing: such ships leave and reach any place."""

    def leg(self, task: LegTask, water: LegWater) -> FoundLeg | None:
        """Along a Dubins path, or None."""
        return None if water.parted(task.start[:2], task.end[:2]) else curved_leg(task, water)

    def with_transitions(self, space: SearchSpace, pairs: Sequence[Pair], trials: TransitionTrials) -> SearchSpace:
        """The space itself."""
        return space

    def successors(self, space: SearchSpace, plans: PartialPlans) -> list[Successors]:
        """Arcs, and stretches of the path to the goal."""
        points, radius_m, found = path_points(space, plans.pose, PATH_STRETCHES), self.ship.turning_radius_m, []
        for q in plans.wanted:
            able, change_s = plans.able(q), self._change_s(plans.exit_mps, space.footprints[q].entry_mps)
            run_up_m = space.hull_m + np.array([space.more_run_up_m(int(last), q) for last in plans.last[able]])
            departures = Departures(pose=plans.pose, wait_s=change_s)
            found.append(arc_successors(space, departures, able, q, run_up_m))
            found.append(path_successors(space, departures, able, q, points, turning_radius_m=radius_m))
        return found

    def ways_on(self, space: SearchSpace, primitive: np.ndarray, start: Array, end: Array) -> np.ndarray:
        """(n,) whether arcs lead to the run-ups of runs, and on from their ends."""
        found = ways_on(space, moved(start, np.array([[-space.hull_m, 0.0, 0.0]])), backwards=True)
        found[found] = ways_on(space, end[found])
        return found

    def leg_s(self, space: SearchSpace, ends: LegEnds, froms: Array, tos: Array, bends: Array) -> Array:
        """(n,) time of the Dubins curve, or of the path with bends where that is longer [s]."""
        froms, tos = np.broadcast_arrays(froms, tos)
        run_ups = moved(tos, np.array([[-space.hull_m, 0.0, 0.0]]))
        length_m = dubins_m(froms, run_ups, radius_m=self.ship.turning_radius_m) + space.hull_m
        if len(bends):
            ahead, behind = bends[0] - froms[:, :2], tos[:, :2] - bends[-1]
            length_m = np.maximum(length_m, np.hypot(*ahead.T) + polyline_length(bends) + np.hypot(*behind.T))
        helped_m = (tos[:, :2] - froms[:, :2]) @ space.current_to / self.ship.transit_speed_mps
        sail_s = np.maximum(length_m - helped_m, 0.0) / self.ship.transit_speed_mps
        return np.asarray(sail_s + self._change_s(np.array(ends.exit_mps), ends.entry_mps))

    def leg_path(self, space: SearchSpace, before: int, start: Array, end: Array) -> Array:
        """(k, 2) places along the Dubins curve and the run-up."""
        run_up = moved(end[None], np.array([[-space.hull_m, 0.0, 0.0]]))[0]
        curve = dubins_curve(start, run_up, radius_m=self.ship.turning_radius_m, spacing_m=space.field.cell_m)
        return np.concatenate([curve[:, :2], between(run_up, end, space.field.cell_m)])

    def to_goal_s(self, space: SearchSpace, plans: PartialPlans) -> Array:
        """(b,) time of the path to the goal and of the turns at its ends [s]."""
        away = space.goal[:2] - plans.pose[:, :2]
        direct = np.arctan2(away[:, 1], away[:, 0])
        turns = np.abs(wrap_angle(plans.pose[:, 2] - direct)) + np.abs(wrap_angle(space.goal[2] - direct))
        length_m = space.goal_distance.to_goal(plans.pose[:, :2]) + self.ship.turning_radius_m * turns
        return np.asarray(length_m / self.ship.transit_speed_mps)

    def least_m(self, space: SearchSpace, pair: Pair) -> float:
        """None."""
        return 0.0

    def losses_s(self, space: SearchSpace, *, made_good: bool) -> tuple[Array, Array]:
        """Changes of speed."""
        exits, entries = (
            np.array([getattr(run, end) for run in space.footprints]) for end in ("exit_mps", "entry_mps")
        )
        return self._change_s(exits[:, None], entries), self._change_s(exits, 0.0)

    def _change_s(self, exit_mps: Array, entry_mps: Array | float) -> Array:
        return np.asarray(np.abs(exit_mps - entry_mps) / self.ship.acceleration_mps2)
