"""Local planner of agile ships: they turn where they are and go straight, or along the path to the goal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.chart import polyline_length
from expdesign.plan.control import AgileShip, leg_end
from expdesign.plan.legs import FoundLeg, LegTask, LegWater, agile_leg, curved_leg
from expdesign.plan.local_planner.arcs import PathPoints, all_round, between, moved, on_paths, path_points
from expdesign.plan.local_planner.protocol import (
    DRIFT_ROUNDS,
    Alike,
    LegEnds,
    Pair,
    PartialPlans,
    SearchSpace,
    Successors,
    TransitionTrials,
)
from expdesign.plan.local_planner.transitions import (
    NEAR_HULLS,
    TURNS,
    LegTimes,
    leg_times,
    nearest_direction,
    transition_losses_s,
    transitions,
    with_transitions,
)
from expdesign.plan.runs import Footprint
from expdesign.simulation import CALM
from expdesign.values import Array
from expdesign.vessel import Vessel

# stretches of the shortest path to the goal, in hull lengths; the whole path is always tried too
AGILE_PATH_STRETCHES = (1.5, 2.5, 4.0, 7.0, 12.0, 25.0, 50.0, 100.0)
# lengths of straight legs besides the best transitions, beyond the run-up, in hull lengths
AGILE_STRAIGHTS = (1.5, 2.5, 6.0)
# courses of those legs to a full turn, from the heading that the run before ends with, and headings of runs, from that
# heading or from the direction of the path
AGILE_COURSES, AGILE_HEADINGS = 6, 16
NEAR_PATH_HULLS = 10.0  # hull lengths along the path within which it is taken for a straight line
FAR_HULLS = 4.0  # hull lengths that are enough for any leg
TRANSITION_TRIALS = 4  # plans whose transitions are tried before the search proper


@dataclass(frozen=True, kw_only=True, eq=False)
class AgilePlanner:
    """Legs turn on the spot and follow the shortest path; short ones between runs are tried beforehand."""

    ship: AgileShip  # speeds and turns
    vessel: Vessel  # whose actuators accelerate it

    @cached_property
    def times(self) -> LegTimes:
        """The rule for leg times."""
        ship, rate = self.ship, self.ship.spot_rate_radps + self.ship.yaw_rate_radps
        end = leg_end(self.vessel, CALM, 0.0, None, top_mps=ship.transit_speed_mps, yaw_rate_radps=rate)
        return leg_times(self.vessel, ship, end.changes)

    @property
    def transition_trials(self) -> int:
        """The least length of a leg depends on the runs; it is found by optimisation."""
        return TRANSITION_TRIALS

    def check_ends(self, start: Array, goal: Array, water: LegWater) -> None:
        """Nothing: such ships leave and reach any place."""

    def leg(self, task: LegTask, water: LegWater) -> FoundLeg | None:
        """The shortest path with turns where the ship is, or else a Dubins curve, or None."""
        if water.parted(task.start[:2], task.end[:2]):
            return None
        found = agile_leg(task, water, self.ship)
        return curved_leg(task, water) if found is None else found

    def with_transitions(self, space: SearchSpace, pairs: Sequence[Pair], trials: TransitionTrials) -> SearchSpace:
        """The space with the transitions of these pairs tried."""
        return with_transitions(space, self.ship, self.times, pairs, trials)

    def successors(self, space: SearchSpace, plans: PartialPlans) -> list[Successors]:
        """Transitions, straight legs, and points of the path to the goal."""
        points = path_points(space, plans.pose, AGILE_PATH_STRETCHES)
        found: list[Successors] = []
        for q in plans.wanted:
            able = plans.able(q)
            alike = plans.alike(able)
            found += self._transitions(space, plans, able, q, alike)
            found.append(self._straights(space, plans, able, q, alike))
            found.append(self._on_path(space, plans, able, q, points))
        return found

    def ways_on(self, space: SearchSpace, primitive: np.ndarray, start: Array, end: Array) -> np.ndarray:
        """(n,) always: such ships turn on the spot."""
        return np.ones(len(start), dtype=bool)

    def leg_s(self, space: SearchSpace, ends: LegEnds, froms: Array, tos: Array, bends: Array) -> Array:
        """(n,) time of legs straight on, or along the path with bends [s]."""
        rule, more_s = self.times, space.more_s(ends.before, ends.after)
        speeds = np.array(ends.exit_mps), np.array(ends.entry_mps)
        away, turn = tos[..., :2] - froms[..., :2], tos[..., 2] - froms[..., 2]
        if len(bends):
            ahead, behind = bends[0] - froms[..., :2], tos[..., :2] - bends[-1]
            length_m = np.hypot(*ahead.T) + polyline_length(bends) + np.hypot(*behind.T)
            through_m = np.maximum(length_m - away @ space.current_to / rule.speed_mps, 0.0)
            first, last = (np.arctan2(step[..., 1], step[..., 0]) for step in (ahead, behind))
            found = rule.seconds(through_m, froms[..., 2] - first, tos[..., 2] - last, turn, *speeds) + more_s
            return found + space.going_round_s(ends.before, ends.after, found)
        leg_s = np.zeros(len(away))
        for _ in range(DRIFT_ROUNDS if space.current_to.any() else 1):
            step = away - leg_s[:, None] * space.current_to
            course = np.arctan2(step[..., 1], step[..., 0])
            angles = froms[..., 2] - course, tos[..., 2] - course, turn
            leg_s = rule.seconds(np.hypot(*step.T), *angles, *speeds) + more_s
        return leg_s + space.going_round_s(ends.before, ends.after, leg_s)

    def leg_path(self, space: SearchSpace, before: int, start: Array, end: Array) -> Array:
        """(k, 2) places on the straight line."""
        return between(start, end, space.field.cell_m)

    def to_goal_s(self, space: SearchSpace, plans: PartialPlans) -> Array:
        """(b,) time of the path to the goal and of the turns at its ends [s]."""
        pose, rule = plans.pose, self.times
        away = space.goal[:2] - pose[:, :2]
        direct = np.arctan2(away[:, 1], away[:, 0])
        helped_m = away @ space.current_to / rule.speed_mps
        path_m = np.maximum(space.goal_distance.to_goal(pose[:, :2]) - helped_m, 0.0)
        more_s = np.where(path_m < NEAR_HULLS * space.hull_m, rule.settle_s / 2, 0.0)  # may turn out to be too near
        more_s += np.array([space.more_s(int(last), -1) for last in plans.last])
        angles = pose[:, 2] - direct, space.goal[2] - direct, space.goal[2] - pose[:, 2]
        return rule.seconds(path_m, *angles, plans.exit_mps, np.zeros(1)) + more_s

    def least_m(self, space: SearchSpace, pair: Pair) -> float:
        """Length from which on a leg takes as long as the rule says [m]."""
        tried = space.tried.get(pair)
        tried_m = 0.0 if tried is None else float(np.hypot(*tried.step[:2]))
        return space.hull_m * float(np.clip(tried_m / space.hull_m, NEAR_HULLS, FAR_HULLS))

    def losses_s(self, space: SearchSpace, *, made_good: bool) -> tuple[Array, Array]:
        """Least losses of transitions.

        A run begins at a heading that makes good the ship's course, or at one that suits the transition better, at the
        price of the displacement lost.
        """
        runs = space.footprints
        pairs = [[self._loss_s(space, a, b, made_good=made_good) for b in runs] for a in runs]
        home = [self._home_s(run) + space.more_s(k, -1) for k, run in enumerate(runs)]
        return np.array(pairs), np.array(home)

    def _loss_s(self, space: SearchSpace, before: Footprint, after: Footprint, *, made_good: bool) -> float:
        """Least time lost between two runs that make good the same course."""
        tried = space.tried.get((before.name, after.name))
        lost = transition_losses_s(self.times, before.exit_mps, after.entry_mps, short=tried is None)
        if not made_good:
            return min(float(lost.min()), np.inf if tried is None else tried.seconds)
        course = before.course_from_end_rad
        off_course = wrap_angle(TURNS - course + after.course_rad)
        displaced_s = after.displacement_m / self.times.speed_mps
        least_s = float((lost[:, nearest_direction(course)] + displaced_s * (1 - np.cos(off_course))).min())
        if tried is None:
            return least_s
        least_s += tried.more_s
        made_good_m = float(tried.step[:2] @ np.array([np.cos(course), np.sin(course)]))
        return min(least_s, tried.seconds - made_good_m / self.times.speed_mps)

    def _home_s(self, last: Footprint) -> float:
        lost = transition_losses_s(self.times, last.exit_mps, 0.0)
        return float(lost[:, nearest_direction(last.course_from_end_rad)].min())

    def _transitions(
        self, space: SearchSpace, plans: PartialPlans, able: np.ndarray, q: int, alike: Alike
    ) -> list[Successors]:
        """Runs near the end of the one before, placed and headed as suits the transition."""
        found, entry = [], np.array(space.footprints[q].entry_mps)
        for (last, exit_mps), where in alike.items():
            tried, longer = space.tried.get(space.pair(last, q)), space.more_run_up_m(last, q)
            best = transitions(self.times, exit_mps, float(entry), short=tried is None)
            step, leg_s = best.step, best.seconds + space.more_s(last, q)
            if tried is not None:
                step, leg_s = np.vstack([step, tried.step]), np.r_[leg_s, tried.seconds]
            if longer:  # straight before the run
                step = step + longer * np.column_stack([np.cos(step[:, 2]), np.sin(step[:, 2]), 0 * leg_s])
                leg_s = self.times.step_s(step, np.array(exit_mps), entry) + space.more_s(last, q)
            leg_s = leg_s + space.going_round_s(last, q, leg_s)
            found.append(_stepped(space, plans, q, able[where], step, leg_s))
        return found

    def _straights(self, space: SearchSpace, plans: PartialPlans, able: np.ndarray, q: int, alike: Alike) -> Successors:
        """Straight legs to all sides, the run with any heading."""
        lengths = space.hull_m * np.array(AGILE_STRAIGHTS)
        grids = np.meshgrid(all_round(AGILE_COURSES), lengths, all_round(AGILE_HEADINGS), indexing="ij")
        course, length, heading = (grid.ravel() for grid in grids)
        step, leg_s = np.zeros((len(able), len(course), 3)), np.zeros((len(able), len(course)))
        for (last, exit_mps), where in alike.items():
            longer = length + space.more_run_up_m(last, q)
            steps = np.column_stack([longer * np.cos(course), longer * np.sin(course), heading])
            seconds = self.times.step_s(steps, np.array(exit_mps), np.array(space.footprints[q].entry_mps))
            seconds = seconds + space.more_s(last, q)
            step[where], leg_s[where] = steps, seconds + space.going_round_s(last, q, seconds)
        return _stepped(space, plans, q, able, step, leg_s)

    def _on_path(
        self, space: SearchSpace, plans: PartialPlans, able: np.ndarray, q: int, points: PathPoints
    ) -> Successors:
        """Runs at points of the path to the goal, with any heading."""
        plan, point = np.nonzero(points.exists[able])
        parent, turns = able[plan], all_round(AGILE_HEADINGS)
        pose, place = plans.pose[parent], points.place[parent, point]
        direction, along_m = points.direction_rad[parent, point], points.along_m[parent, point]
        away = place - pose[:, :2]
        to_point, near = np.arctan2(away[:, 1], away[:, 0]), along_m < NEAR_PATH_HULLS * space.hull_m
        first = pose[:, 2] - np.where(near, to_point, points.first_rad[parent])
        heading = direction[:, None] + turns
        helped_m = away @ space.current_to / self.times.speed_mps
        leg_s = self.times.seconds(
            np.maximum(along_m - helped_m, 0.0)[:, None],
            first[:, None],
            heading - np.where(near, to_point, direction)[:, None],
            heading - pose[:, 2:],
            plans.exit_mps[parent, None],
            np.array(space.footprints[q].entry_mps),
        )
        more_s = np.array([space.more_s(last, q) for last in range(-1, len(space.footprints))])
        leg_s += more_s[plans.last[parent] + 1, None]
        leg_s += np.where(plans.last[parent, None] >= 0, space.going_round_s(q, q, leg_s), 0.0)
        start = np.column_stack([np.repeat(place, len(turns), axis=0), heading.ravel()])
        return on_paths(space, q, plans.pose, np.repeat(parent, len(turns)), start, leg_s.ravel())


def _stepped(
    space: SearchSpace, plans: PartialPlans, q: int, able: np.ndarray, step: Array, leg_s: Array
) -> Successors:
    """Straight legs through water from where plans `able` (b,) end.

    Args:
        able: those that are continued.
        q: the run.
        step: (m, 3) or (b, m, 3) ahead m, to starboard m, turn rad.
        leg_s: (m,) or (b, m) time.
    """
    pose, run = plans.pose[able, None], space.footprints[q]
    start, end = moved(pose, step), moved(pose, moved(step, run.displacement))
    if space.current_to.any():
        start[..., :2] += leg_s[..., None] * space.current_to
        end[..., :2] += (leg_s[..., None] + run.duration_s) * space.current_to
    b, m, _ = start.shape
    return Successors(
        departure=plans.pose,
        parent=np.repeat(able, m),
        primitive=np.broadcast_to(q, b * m),
        start=start.reshape(-1, 3),
        end=end.reshape(-1, 3),
        leg_s=np.broadcast_to(leg_s, (b, m)).ravel(),
        turn=np.broadcast_to(np.nan, b * m),
        straight=np.broadcast_to(True, b * m),
    )
