"""Legs of ships that are steered by a helm: straight off, arcs that the ship can turn on, straight into the next run.

First the ship recovers from what it was doing: counter helm ends the turn, the engines go to transit speed. The search
for places allows for the lengths that it turns and drifts meanwhile. From there the path is a Dubins curve of the
ship's own turning radius between straights: one to accelerate, one in which the turn decays and, before a goal, the
ship stops. Optimisation starts from steady turns along it. The last part before a run is the run-up of the standard
trials: steady speed, helm as it holds the course, engines as the run begins with.

Long straights are not optimised, see `transit`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from expdesign.conventions import whole_turns
from expdesign.plan.chart import polyline_length
from expdesign.plan.control import APPROACH_HULLS, SETTLING_HULLS, HelmShip
from expdesign.plan.legs._ompl import dubins_curve
from expdesign.plan.legs.dubins import find_path
from expdesign.plan.legs.optimise import solve_leg
from expdesign.plan.legs.problem import LegProblem, leg_problem
from expdesign.plan.legs.recovery import STRAIGHT_OFF_HULLS, Recovery, recover
from expdesign.plan.legs.transit import long_straight
from expdesign.plan.legs.water import (
    ARRIVAL,
    FoundLeg,
    LegPath,
    LegTask,
    LegWater,
    acceptable,
    gathers_speed,
    nearest_turns,
    through_water,
)
from expdesign.simulation import Helm
from expdesign.values import Array
from expdesign.vessel import Vessel

SLOW_SHARE = 0.3  # transit speeds below which a helm-steered ship is about to accelerate from rest or to stop
# shares tried of `STRAIGHT_OFF_HULLS`, of the hull lengths to settle before a run-up, and of the stopping distance
# before a goal
STRAIGHTS = (
    (1.0, 2.0, 1.0),
    (1.0, 1.0, 0.7),
    (0.5, 0.5, 0.4),
    (0.0, 0.0, 0.1),
)
# shares of the room beside a path that legs may use, the next where a leg leaves the water: nodes slip along a path, to
# where there is less room
ROOM_SHARES = (1.0, 0.25)
HELM_NODE = 0.25  # time between nodes of helm-steered legs, in that of a hull length at transit speed
EASED_HULLS = 1.0  # hull lengths over which their first guess eases into turns


def helm_leg(task: LegTask, water: LegWater, ship: HelmShip) -> FoundLeg | None:
    """From one state to the other, the run-up to a run included, or None."""
    before_run, samples = _run_up(task, water)
    tail = np.tile(task.end_inputs, (samples, 1))
    check = recover(task.start, task.past, water, ship)
    for straights in _shortest_first(check.states[-1], before_run, water, ship):
        path = _path(before_run, water, straights)
        if path is None:
            continue
        turned = whole_turns(path.points[-1, 2] - task.end[2])
        end = np.r_[task.end[:2], task.end[2] + turned, task.end[3:]]
        for share in ROOM_SHARES:
            values = _along(path.points, before_run, water, ship, check, share)
            if values is None:
                break
            whole = np.concatenate([values, tail + (values[-1] - task.end_inputs)])
            if acceptable(task.start, end, water, whole, task.past):
                return FoundLeg(commands=whole, source=path.source)
    return None


def _along(path: Array, task: LegTask, water: LegWater, ship: HelmShip, check: Recovery, share: float) -> Array | None:
    """Commands (k, m) along a path (j, 3): optimised, but for a long straight.

    None where none are found in a share of the room beside the path.
    """
    braking_m = ship.stopping_m if _stops(task, water) else 0.0
    transit = long_straight(path, braking_m, water, ship)
    if transit is None:
        problem = _problem(task, water, ship, check, path, share)
        doubtful = problem.guesses == 1 and task.budget.spent_s > 0.0  # one such attempt on a leg is enough
        return None if doubtful else solve_leg(problem, water)
    begin = replace(task, end=transit.start, end_inputs=ship.approach.inputs)
    before = solve_leg(_problem(begin, water, ship, check, transit.to, share), water)
    held = None if before is None else transit.held(task, before, water, ship)
    if before is None or held is None:
        return None
    commands, state = held
    past = water.remembered(np.concatenate([task.past, before, commands]))
    rest = replace(task, start=state, start_inputs=past[-1], before=past)
    at_once = Recovery(states=state[None], commands=np.empty((0, len(past[-1]))))
    after = solve_leg(_problem(rest, water, ship, at_once, transit.on_from(state), share), water)
    return None if after is None else np.concatenate([before, commands, after])


def _stops(task: LegTask, water: LegWater) -> bool:
    """Whether the ship is to stop at the leg's end."""
    return _speed_mps(water, task.end) < SLOW_SHARE * water.ship.transit_speed_mps


def _speed_mps(water: LegWater, state: Array) -> float:
    """Speed through water at a state (6,)."""
    return float(np.hypot(*through_water(water.environment, state)[:2]))


def _run_up(task: LegTask, water: LegWater) -> tuple[LegTask, int]:
    """The leg up to the run-up, and the samples of that: none before a goal, or where wind would turn the ship."""
    vessel, speed = water.vessel, _speed_mps(water, task.end)
    samples = int(np.ceil(APPROACH_HULLS * vessel.length_m / max(speed, 1e-9) / vessel.sample_time_s))
    if _stops(task, water):
        return task, 0
    states = water.states(task.end, np.tile(task.end_inputs, (samples, 1)))
    scale = np.r_[1.0, [water.ship.transit_speed_mps] * 2, water.ship.yaw_rate_radps]
    if (np.abs(states[-1] - task.end)[2:] > ARRIVAL / 10 * scale).any():
        return task, 0
    moved = (states[-1] - states[0])[:2]
    return replace(task, end=np.r_[task.end[:2] - moved, task.end[2:]]), samples


@dataclass(frozen=True, kw_only=True, eq=False)
class Straights:
    """Where the straights of a path begin and end."""

    # first, last: (3,) places and courses of the leg's ends
    first: Array
    last: Array
    # off_m, into_m: lengths of the straights
    off_m: float
    into_m: float

    @property
    def inner(self) -> tuple[Array, Array]:
        """(3,) where the curve between the straights begins, and where it ends."""
        return _moved(self.first, self.off_m), _moved(self.last, -self.into_m)

    def length_m(self, radius_m: float) -> float:
        """Length of the path where nothing is in the way [m]."""
        curve = dubins_curve(*self.inner, radius_m=radius_m, spacing_m=radius_m / 4)
        return self.off_m + polyline_length(curve[:, :2]) + self.into_m


def _shortest_first(start: Array, task: LegTask, water: LegWater, ship: HelmShip) -> list[Straights]:
    """Candidates: of paths hardly longer than the shortest those with the longest straights, then others.

    Not those that need a full circle for lack of length: another place for the run is better.
    """
    length, radius = water.vessel.length_m, ship.turning_radius_m
    first, last = _course_pose(start, water), _course_pose(task.end, water)
    stopping = _stops(task, water)
    tries = [
        Straights(
            first=first,
            last=last,
            off_m=off * STRAIGHT_OFF_HULLS * length,
            into_m=stop * ship.stopping_m if stopping else settle * SETTLING_HULLS * length,
        )
        for off, settle, stop in STRAIGHTS
    ]
    lengths = [item.length_m(radius) for item in tries]
    longer = np.maximum(np.array(lengths) - min(lengths) - radius / 2, 0.0)
    return [tries[index] for index in np.argsort(longer, kind="stable") if longer[index] < 2 * radius]


def _path(task: LegTask, water: LegWater, straights: Straights) -> LegPath | None:
    """Places and courses (k, 3) from the leg's start to its end, or None where the water has no such path."""
    begin, end = straights.inner
    middle = find_path(replace(task, start=np.r_[begin, task.start[3:]], end=np.r_[end, task.end[3:]]), water)
    if middle is None:
        return None
    length, end = water.vessel.length_m, np.r_[end[:2], middle.points[-1, 2]]
    parts = (
        _straight(straights.first, straights.off_m, length),
        middle.points,
        _straight(end, straights.into_m, length),
    )
    path = np.concatenate(parts)
    apart = np.hypot(*np.diff(path[:, :2], axis=0).T) > 1e-9
    return LegPath(points=path[np.r_[True, apart]], source=middle.source)


def _course_pose(state: Array, water: LegWater) -> Array:
    """(3,) place and course over ground of a state (6,); heading for course where it hardly moves."""
    if _speed_mps(water, state) < SLOW_SHARE * water.ship.transit_speed_mps:
        return np.asarray(state[:3])
    return np.asarray(state[:3] + np.array([0.0, 0.0, np.arctan2(state[4], state[3])]))


def _moved(pose: Array, ahead_m: float) -> Array:
    return np.asarray(pose + ahead_m * np.array([np.cos(pose[2]), np.sin(pose[2]), 0.0]))


def _straight(pose: Array, length_m: float, hull_m: float) -> Array:
    """(k, 3) poses straight on from a pose."""
    along = np.linspace(0.0, length_m, int(np.ceil(6 * length_m / hull_m)) + 1)
    return np.stack([_moved(pose, float(ahead)) for ahead in along])


def _problem(task: LegTask, water: LegWater, ship: HelmShip, check: Recovery, path: Array, share: float) -> LegProblem:
    """The leg along a path (j, 3) in a share of the room beside it."""
    states, inputs, places, duration_s = _guess(task, water, ship, check, path)
    turned = whole_turns(states[-1, 2] - task.end[2])
    inputs[0], inputs[-1] = task.start_inputs, _last_inputs(task, water.vessel, ship.approach.helm, inputs[-1])
    wide = leg_problem(
        task,
        water,
        end=np.r_[task.end[:2], task.end[2] + turned, task.end[3:]],
        states=states,
        inputs=inputs,
        path=places,
        duration_s=duration_s,
        turning_rate_radps=ship.yaw_rate_radps,
        node_s=HELM_NODE * water.vessel.length_m / ship.transit_speed_mps,
    )
    narrow = replace(wide, room_port_m=share * wide.room_port_m, room_starboard_m=share * wide.room_starboard_m)
    if _stops(task, water) or gathers_speed(states, duration_s, task, water, ship):
        return narrow
    return replace(narrow, guesses=1)


def _last_inputs(task: LegTask, vessel: Vessel, helm: Helm, guessed: Array) -> Array:
    """(m,) commands at a leg's end, azimuths by the shortest turn from where they stood before they turned round.

    Where engines are stopped for good, thrusters stay where they stopped the ship.
    """
    standing = helm.turned_back(guessed[None])[0]
    last = nearest_turns(vessel, task.end_inputs, standing)
    return last if task.end_inputs[~vessel.angles].any() else last + (guessed - standing)


def _guess(
    task: LegTask, water: LegWater, ship: HelmShip, check: Recovery, path: Array
) -> tuple[Array, Array, Array, float]:
    """States (j + 1, 6), commands (j + 1, m), places with courses (j + 1, 3) at even times, and the time they take."""
    time_s, states, inputs, course = _steady_along(check.states[-1], task.end, ship, path)
    standing = check.commands[-1] if len(check.commands) else task.start_inputs
    inputs += nearest_turns(water.vessel, inputs[0], standing) - inputs[0]
    lead_s = np.arange(len(check.commands)) * water.vessel.sample_time_s
    before = check.states[:-1]
    drift = np.where(before[:, 3] > 0, np.arctan2(before[:, 4], np.maximum(before[:, 3], 1e-9)), 0.0)
    time_s = np.r_[lead_s, len(lead_s) * water.vessel.sample_time_s + time_s]
    states, inputs = np.vstack([before, states]), np.vstack([check.commands, inputs])
    course = np.r_[before[:, 2] + drift, course]
    nodes = int(np.clip(np.ceil(time_s[-1] * ship.transit_speed_mps / (0.5 * water.vessel.length_m)), 24, 160))
    even = np.linspace(0.0, time_s[-1], nodes + 1)
    whole = np.column_stack([states, course, inputs])
    rows = np.stack([np.interp(even, time_s, column) for column in whole.T], axis=1)
    return rows[:, :6], rows[:, 7:], rows[:, [0, 1, 6]], float(time_s[-1])


def _steady_along(start: Array, end: Array, ship: HelmShip, path: Array) -> tuple[Array, Array, Array, Array]:
    """Times (k,), states (k, 6), commands (k, m) and courses (k,) along a path from one state (6,) to another.

    Every point is in the steady turn of its place, slowed down by it; sway, yaw rate and helm are those of the turn.
    """
    approach = ship.approach
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))]
    bend = _eased(along, path[:, 2], EASED_HULLS * approach.helm.vessel.length_m)
    helm, slowed, drift = _turn_at(ship, bend)
    speed = _speeds((start, end), ship, along, slowed * ship.transit_speed_mps)
    time_s = np.r_[0.0, np.cumsum(np.diff(along) * 2 / (speed[1:] + speed[:-1]))]
    states = np.column_stack(
        [path[:, :2], path[:, 2] - drift, speed * np.cos(drift), speed * np.sin(drift), bend * speed]
    )
    orders = _engine_orders(ship, speed, np.gradient(speed, time_s))
    steps_s, angles = np.diff(time_s, prepend=0.0), approach.angle_rad + approach.starboard * helm
    inputs = approach.helm.followed(orders, angles, steps_s, before=max(float(orders[0]), 0.0))
    return time_s, states, inputs, path[:, 2]


def _eased(along: Array, course: Array, window_m: float) -> Array:
    """(k,) curvature of a path, averaged over a window [1/m]."""
    ahead, astern = np.clip(along + window_m / 2, 0, along[-1]), np.clip(along - window_m / 2, 0, along[-1])
    turned = np.interp(ahead, along, course) - np.interp(astern, along, course)
    return np.asarray(turned / np.maximum(ahead - astern, 1e-9))


def _turn_at(ship: HelmShip, curvature: Array) -> tuple[Array, Array, Array]:
    """(k,) helm from the approach's, share of its speed that is left, and drift of steady turns of these curvatures."""
    approach = ship.approach
    u, v = approach.velocity[:2]
    straight = (0.0, 0.0, 1.0, float(np.arctan2(v, u)))
    rows = [
        (
            np.sign(turn.yaw_rate_radps) / turn.radius_m,
            turn.helm_rad,
            turn.speed_mps / approach.speed_mps,
            turn.drift_rad,
        )
        for turn in ship.turns
    ]
    table = np.array(sorted([straight, *rows]))
    helm, slowed, drift = (np.interp(curvature, table[:, 0], column) for column in table[:, 1:].T)
    return helm, slowed, drift


def _speeds(ends: tuple[Array, Array], ship: HelmShip, along: Array, most: Array) -> Array:
    """(k,) speeds along the path between two states (6,) that acceleration, turns and stopping allow [m/s]."""
    first, last = (float(np.hypot(*state[3:5])) for state in ends)
    braking = ship.transit_speed_mps**2 / (2 * max(ship.stopping_m, 1e-9))
    gathered = np.sqrt(first**2 + 2 * ship.acceleration_mps2 * along)
    stopping = np.sqrt(last**2 + 2 * braking * (along[-1] - along))
    return np.asarray(np.maximum(np.minimum(np.minimum(most, gathered), stopping), 0.15 * ship.transit_speed_mps))


def _engine_orders(ship: HelmShip, speed: Array, gain: Array) -> Array:
    """(k,) engine orders that would hold speeds and change them at rates `gain` [m/s2], roughly."""
    approach = ship.approach
    braking = ship.transit_speed_mps**2 / (2 * max(ship.stopping_m, 1e-9))
    holding = approach.drive * speed / ship.transit_speed_mps
    change = np.where(gain > 0, gain / ship.acceleration_mps2, gain / braking)
    return np.asarray(np.clip(holding + change, -1.0, 1.0))
