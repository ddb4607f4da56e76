"""Transitions between runs, optimised in advance, so that the search knows their displacement and their time.

The least length of a leg on which the ship arrives at a run's entry without slowing down or circling depends on the
motion and the actuators at the end of the run before, for which there is no rule. Each pair of runs is optimised once,
in open calm water: the leg may end anywhere, and displacement counts as much as at transit speed.

For the time of legs of agile vessels there is a rule that optimised legs follow. Such a vessel moves as if pushed
equally in every direction while it turns, so a leg lasts about as long as the longer of two, a little longer where both
last equally long: a point that is accelerated from one velocity to the other over the leg's path, along it and across
it, and a turn on the spot. Before and after, actuators need time to get to work while the ship goes on as it did.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely

from expdesign.conventions import wrap_angle
from expdesign.memory import in_order
from expdesign.plan.chart import clearance_field
from expdesign.plan.control import AgileShip, SpeedChanges, to_work_s
from expdesign.plan.legs import LegTask, LegWater, free_leg
from expdesign.plan.local_planner.protocol import Pair, SearchSpace, TransitionTrials, TriedTransition
from expdesign.plan.runs import Footprint
from expdesign.plan.values import Placement
from expdesign.sea_area import as_multipolygon
from expdesign.simulation import CALM
from expdesign.values import Array
from expdesign.vessel import Vessel

# of the mean largest acceleration and of the yaw rate on the spot, that agile legs make use of. This and the next two
# are fitted to 540 optimised legs of three vessels, 20 m, 30 m and a model, between random places, headings and speeds:
# half of the ships' legs agree within three seconds, half of the model's within 0.4 s
ACCELERATION_SHARE, YAW_RATE_SHARE = 1.1, 0.7
TIME_POWER = 2.0  # exponent of the mean of the times of path and turn
SETTLING_SHARE = 1.2  # time to settle, in that of the actuators from nothing to full
# hull lengths that an agile leg needs to suit any place, heading and speed at its ends; shorter ones are optimised in
# advance
NEAR_HULLS = 1.5
TRANSITION_GUESS_HULLS = 0.5  # length of the leg with which the optimiser begins
OPEN_WATER_HULLS = 25.0  # of open water to every side of a transition that is tried


# How long legs of agile vessels take, for the search: a rule that optimised legs follow.

LENGTHS = np.array([0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9, 1.2, 1.5, 2.0, 2.7, 3.5, 5.0])
"""Lengths of transitions between runs, in hull lengths."""
GOING_ON = np.array([1.0, 1.1, 1.25])  # more of them, in how far the ship goes while it settles
TURNS = np.arange(16) * np.pi / 8  # turns in them, and courses from the heading before
COURSES = np.arange(24) * np.pi / 12
DIRECTIONS = np.arange(12) * np.pi / 6  # directions to go, from the heading before


@dataclass(frozen=True, kw_only=True)
class LegTimes:
    """What the rule needs."""

    speed_mps: float  # of long legs
    push_mps2: float  # acceleration in every direction
    swing_radps: float  # mean yaw rate of turns
    settle_s: float  # until actuators have got to work, at both ends together
    hull_m: float  # unit of length

    def step_s(self, step: Array, exit_mps: Array, entry_mps: Array) -> Array:
        """(...,) time of straight legs through open water [s].

        Args:
            step: (..., 3) forward m, starboard m and turn rad.
            exit_mps, entry_mps: speeds ahead, at the beginning and at the end.
        """
        turn = step[..., 2]
        course = np.arctan2(step[..., 1], step[..., 0])
        return self.seconds(np.hypot(step[..., 0], step[..., 1]), -course, turn - course, turn, exit_mps, entry_mps)

    def seconds(
        self, length_m: Array, first_rad: Array, last_rad: Array, turn_rad: Array, exit_mps: Array, entry_mps: Array
    ) -> Array:
        """(...,) time of legs along a path [s].

        Args:
            first_rad, last_rad: heading at the beginning and at the end, from the path's course there.
            turn_rad: from the one heading to the other.
            exit_mps, entry_mps: speeds ahead, at the beginning and at the end.
        """
        a, top, wait_s = self.push_mps2, self.speed_mps, self.settle_s / 2
        begins, ends = ((v * np.cos(x), v * np.sin(x)) for v, x in ((exit_mps, first_rad), (entry_mps, last_rad)))
        along = _least_s(length_m - wait_s * (begins[0] + ends[0]), begins[0], ends[0], a, top)
        across = _least_s(-wait_s * (begins[1] + ends[1]), begins[1], ends[1], a, top)
        turn_s = np.abs(wrap_angle(turn_rad)) / self.swing_radps
        return np.asarray(
            (np.maximum(along, across) ** TIME_POWER + turn_s**TIME_POWER) ** (1 / TIME_POWER) + self.settle_s
        )


def leg_times(vessel: Vessel, ship: AgileShip, changes: SpeedChanges) -> LegTimes:
    """The rule for a vessel."""
    return LegTimes(
        speed_mps=ship.transit_speed_mps,
        push_mps2=ACCELERATION_SHARE * changes.mean_mps2,
        swing_radps=YAW_RATE_SHARE * ship.spot_rate_radps,
        settle_s=SETTLING_SHARE * to_work_s(vessel),
        hull_m=vessel.length_m,
    )


def _least_s(distance: Array, first: Array, last: Array, a: float, top: float) -> Array:
    """Least time of a point over a distance in one dimension from one velocity to another [s]."""
    sign = np.where(distance >= (first + last) * np.abs(last - first) / (2 * a), 1.0, -1.0)
    distance, first, last = sign * distance, sign * first, sign * last
    ends = np.maximum(first, last)
    peak = np.maximum(np.sqrt(np.maximum(a * distance + (first**2 + last**2) / 2, 0.0)), ends)
    most = np.maximum(top, ends)
    cruise = (distance - (most**2 - (first**2 + last**2) / 2) / a) / most
    return np.asarray((2 * np.minimum(peak, most) - first - last) / a + np.maximum(cruise, 0.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Transitions:
    """Short legs between two runs in open water, through water, the heading before being zero."""

    step: Array  # (n, 3) forward m, starboard m, turn rad
    seconds: Array  # (n,) time


@lru_cache(maxsize=512)
def transitions(times: LegTimes, exit_mps: float, entry_mps: float, *, short: bool = True) -> Transitions:
    """The best legs between two speeds: for every turn and every direction to go, the one that loses least time.

    Unless they may be `short` they are `NEAR_HULLS` hull lengths long.
    """
    course, length, turn, seconds = _all_transitions(times, exit_mps, entry_mps, short)
    along = np.cos(course - DIRECTIONS[:, None, None, None]) * length / times.speed_mps
    lost = np.concatenate([seconds - along, seconds[None]]).reshape(len(DIRECTIONS) + 1, len(TURNS), -1)
    length_of, course_of = np.divmod(lost.argmin(axis=-1), len(COURSES))
    turn_of = np.arange(len(TURNS))
    # of equals to port and to starboard both are kept
    both = [(turn_of, length_of, course_of), (-turn_of % len(TURNS), length_of, -course_of % len(COURSES))]
    best = np.unique([np.ravel_multi_index((a + 0 * b, b, c), seconds.shape) for a, b, c in both])
    course, length, turn, seconds = (
        np.broadcast_to(grid, seconds.shape).ravel()[best] for grid in (course, length, turn, seconds)
    )
    return Transitions(step=np.stack([length * np.cos(course), length * np.sin(course), turn], axis=1), seconds=seconds)


def _all_transitions(
    times: LegTimes, exit_mps: float, entry_mps: float, short: bool
) -> tuple[Array, Array, Array, Array]:
    going_on_m = times.settle_s * (exit_mps + entry_mps) / 2
    lengths = np.r_[times.hull_m * LENGTHS, going_on_m * GOING_ON]
    lengths = lengths[short | (lengths >= NEAR_HULLS * times.hull_m)]
    turn, length, course = np.meshgrid(TURNS, lengths, COURSES, indexing="ij")
    step = np.stack([length * np.cos(course), length * np.sin(course), turn], axis=-1)
    seconds = times.step_s(step, np.array(exit_mps), np.array(entry_mps))
    return course, length, turn, seconds


@lru_cache(maxsize=512)
def transition_losses_s(times: LegTimes, exit_mps: float, entry_mps: float, *, short: bool = True) -> Array:
    """(turns, directions) least time that transitions lose against going on at full speed in a direction [s]."""
    course, length, _, seconds = _all_transitions(times, exit_mps, entry_mps, short)
    along = np.cos(course - DIRECTIONS[:, None, None, None]) * length / times.speed_mps
    return np.asarray((seconds - along).reshape(len(DIRECTIONS), len(TURNS), -1).min(axis=-1).T)


def nearest_direction(course_rad: float) -> int:
    """Index in `DIRECTIONS` of the one nearest to a course."""
    return int(np.abs(wrap_angle(DIRECTIONS - course_rad)).argmin())


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
    if np.hypot(*step[:2]) >= NEAR_HULLS * space.hull_m:
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
    away = TRANSITION_GUESS_HULLS * water.vessel.length_m
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
    length, half = water.vessel.length_m, OPEN_WATER_HULLS * water.vessel.length_m
    area = replace(
        water.area, water=as_multipolygon(shapely.box(-half, -half, half, half)), land=shapely.MultiPolygon()
    )
    field = clearance_field(area, resolution_m=length / 4)
    return replace(water, area=area, environment=CALM, field=field, clearance_m=0.0)
