"""Legs of agile vessels: turn and accelerate, follow the path, turn and slow down.

Short legs, straight ones of some length, and both ends of long ones are optimised. The middle of a long leg is tracked
in closed loop.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from expdesign.conventions import whole_turns, wrap_angle
from expdesign.plan.chart import polyline_length
from expdesign.plan.control import AgileShip, Helmsman, Reference
from expdesign.plan.legs.optimise import solve_leg, solve_transition
from expdesign.plan.legs.problem import LegProblem, hull_discs, leg_problem
from expdesign.plan.legs.water import CORRIDOR_HULLS, FoundLeg, LegTask, LegWater, acceptable, nearest_turns
from expdesign.values import Array
from expdesign.vessel import commands_for, required_push

GUESS_NODES = 40  # of first guesses of agile legs
TRANSITION_NODES = 24  # of optimised transitions at most
WHOLE_SAMPLES = 100.0  # up to which straight agile legs are optimised as a whole
REMEMBERED_COMMANDS = 5000  # that are looked back at while steering
BEND_RADII = (1.5, 0.8, 0.4)  # lengths over which bends of agile legs' paths are rounded, in turning radii


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """A path with rounded bends."""

    points: Array  # (k, 2) north/east

    @property
    def along_m(self) -> Array:
        """(k,) distance from the first point."""
        return np.asarray(np.r_[0.0, np.cumsum(np.hypot(*np.diff(self.points, axis=0).T))])

    @property
    def length_m(self) -> float:
        """Length [m]."""
        return polyline_length(self.points)

    def at(self, along_m: Array) -> Array:
        """(n, 3) places and courses at distances (n,)."""
        along = self.along_m
        course = np.unwrap(np.arctan2(*np.diff(self.points, axis=0).T[::-1]))
        middle = (along[1:] + along[:-1]) / 2
        columns = [np.interp(along_m, along, column) for column in self.points.T]
        return np.column_stack([*columns, np.interp(along_m, middle, course)])


def agile_leg(task: LegTask, water: LegWater, ship: AgileShip) -> FoundLeg | None:
    """From one state to the other, or None."""
    for path in water.candidate_paths(task.start[:2], task.end[:2]):
        line = _line(water, path.points)
        first_m, last_m = _end_lengths(task, water, ship, line)
        short = line.length_m < first_m + last_m + 2 * water.vessel.length_m
        brief_m = WHOLE_SAMPLES * water.vessel.sample_time_s * water.ship.transit_speed_mps
        whole = short or (len(path.points) == 2 and line.length_m < brief_m)  # loses less time, where it is small
        values = _optimised(task, water, ship, line) if whole else None
        if values is None and not short:
            values = _in_parts(task, water, ship, line, first_m, last_m)
        if values is not None:
            return FoundLeg(commands=values, source=path.source)
    return None


def _line(water: LegWater, path: Array) -> Line:
    """A path with its bends rounded as widely as the water allows."""
    for share in BEND_RADII:
        window_m = share * water.ship.turning_radius_m
        line = rounded(path, window_m=window_m, spacing_m=water.vessel.length_m / 6)
        if share == BEND_RADII[-1] or len(path) < 3 or water.holds(line.at(line.along_m)):
            break
    return line


def rounded(path: Array, *, window_m: float, spacing_m: float) -> Line:
    """A path (k, 2) with its bends rounded by a moving average, its ends kept."""
    steps = np.hypot(*np.diff(path, axis=0).T)
    along = np.r_[0.0, np.cumsum(steps)]
    if along[-1] < 1e-6:
        return Line(points=np.array([path[0], path[0] + 1e-6]))
    even = np.linspace(0.0, along[-1], max(2, int(np.ceil(along[-1] / spacing_m))) + 1)
    half = np.minimum(window_m / 2, np.minimum(even, along[-1] - even))
    columns = []
    for values in path.T:
        mean = (_integral(along, values, even + half) - _integral(along, values, even - half)) / np.maximum(
            2 * half, 1e-12
        )
        columns.append(np.where(half > 1e-9, mean, np.interp(even, along, values)))
    return Line(points=np.stack(columns, axis=1))


def _integral(along: Array, values: Array, where: Array) -> Array:
    """(n,) integral of a piecewise linear function from the first of its knots to places (n,)."""
    steps = np.maximum(np.diff(along), 1e-12)
    sums = np.r_[0.0, np.cumsum(steps * (values[1:] + values[:-1]) / 2)]
    k = np.clip(np.searchsorted(along, where, side="right") - 1, 0, len(along) - 2)
    part = where - along[k]
    return np.asarray(sums[k] + part * (values[k] + (values[k + 1] - values[k]) / steps[k] * part / 2))


def _end_lengths(task: LegTask, water: LegWater, ship: AgileShip, line: Line) -> tuple[float, float]:
    course = line.at(np.array([0.0, line.length_m]))[:, 2]
    turns = float(task.start[2] - course[0]), float(task.end[2] - course[1])
    first_m, last_m = (ship.departure_m(turn, water.vessel.length_m) for turn in turns)
    return first_m, last_m


def _in_parts(
    task: LegTask, water: LegWater, ship: AgileShip, line: Line, first_m: float, last_m: float
) -> Array | None:
    track, inputs = _steady(water, line, first_m, line.length_m - last_m, task.start[2])
    departure = replace(task, end=track[0], end_inputs=inputs)
    first = _optimised(departure, water, ship, _cut(line, 0.0, first_m))
    if first is None:
        return None
    given = np.concatenate([task.past, first])
    middle, state = _steered(water, Reference(states=track), water.states(task.start, first, task.past)[-1], given)
    given = water.remembered(np.concatenate([given, middle]))
    arrival = replace(task, start=state, start_inputs=middle[-1], before=given)
    last = _optimised(arrival, water, ship, _cut(line, line.length_m - last_m, line.length_m))
    if last is None:
        return None
    values = np.concatenate([first, middle, last])
    turned = water.states(task.start, values, task.past)[-1, 2]
    whole = whole_turns(turned - task.end[2])
    end = np.r_[task.end[:2], task.end[2] + whole, task.end[3:]]
    return values if acceptable(task.start, end, water, values, task.past) else None


def _cut(line: Line, first_m: float, last_m: float) -> Line:
    """The stretch of a line between two distances."""
    along = line.along_m
    inner = along[(along > first_m + 1e-9) & (along < last_m - 1e-9)]
    return Line(points=line.at(np.r_[first_m, inner, last_m])[:, :2])


def _steady(water: LegWater, line: Line, first_m: float, last_m: float, heading: float) -> tuple[Array, Array]:
    """States (k + 1, 6) at every sample on the middle of a path at transit speed, and commands that hold the first."""
    vessel, transit = water.vessel, water.ship.transit_speed_mps
    current = water.environment.current_to
    fine = np.arange(first_m, last_m, vessel.length_m / 12)
    course = line.at(fine)[:, 2]
    ahead = np.stack([np.cos(course), np.sin(course)], axis=1)
    along = ahead @ current
    across = ahead[:, 0] * current[1] - ahead[:, 1] * current[0]
    over_ground = along + np.sqrt(np.maximum(transit**2 - across**2, 1e-6))
    time_s = np.r_[0.0, np.cumsum(np.diff(fine) * 2 / (over_ground[1:] + over_ground[:-1]))]
    samples = np.arange(0.0, time_s[-1], vessel.sample_time_s)
    place = line.at(np.interp(samples, time_s, fine))
    ground = np.interp(samples, time_s, over_ground)[:, None] * np.stack([np.cos(place[:, 2]), np.sin(place[:, 2])], 1)
    through = ground - current
    pointing = np.unwrap(np.arctan2(through[:, 1], through[:, 0]))  # bow into the stream
    pointing += whole_turns(heading - pointing[0])
    c, s = np.cos(pointing), np.sin(pointing)
    yaw_rate = np.gradient(pointing, vessel.sample_time_s)
    states = np.column_stack(
        [place[:, :2], pointing, ground[:, 0] * c + ground[:, 1] * s, ground[:, 1] * c - ground[:, 0] * s, yaw_rate]
    )
    relative = np.r_[np.hypot(*through[0]), 0.0, yaw_rate[0]]
    push = required_push(vessel.model, relative, np.zeros(3))
    return states, commands_for(vessel.model, push[None], sample_time_s=vessel.sample_time_s)[0]


def _steered(water: LegWater, reference: Reference, state: Array, before: Array) -> tuple[Array, Array]:
    """Closed-loop commands (k, m) along a reference, and the state they end in, after commands (h, m)."""
    helm = Helmsman(vessel=water.vessel, environment=water.environment, ship=water.ship)
    sample, given, first = np.zeros(1), list(water.remembered(before)), len(water.remembered(before))
    states = state[None]
    while sample[0] < len(reference.states) - 1:
        sample = sample + np.maximum(reference.pace(sample, states, water.vessel.length_m / 2), 0.2)
        row = helm.commands(reference.at(sample), states, given[-1][None])
        past = None if water.prompt else water.remembered(np.array(given[-REMEMBERED_COMMANDS:]))
        states = water.states(states[0], row, past)[-1:]
        given.append(row[0])
    return np.array(given[first:]), states[0]


def _optimised(task: LegTask, water: LegWater, ship: AgileShip, line: Line) -> Array | None:
    """The fastest leg in the water beside a line; where there is none, one that the whole water happens to hold."""
    problems = list(_problems(task, water, ship, line))
    for problem in (*problems, *(_unbounded(problem) for problem in problems if problem.bounded)):
        values = solve_leg(problem, water)
        if values is not None and acceptable(problem.start, problem.end, water, values, task.past):
            return values
    return None


def _unbounded(problem: LegProblem) -> LegProblem:
    """The same leg in open water."""
    free = np.full(len(problem.path), np.inf)
    circle = np.r_[problem.circle[:2], np.inf]
    return replace(problem, room_port_m=free, room_starboard_m=free, circle=circle)


def _problems(task: LegTask, water: LegWater, ship: AgileShip, line: Line) -> Iterator[LegProblem]:
    """First guesses: the short turn, then, for large turns, the opposite one; each in its region of free water."""
    turn = float(wrap_angle(task.end[2] - task.start[2]))
    turns = [turn] if abs(turn) < np.pi / 2 else [turn, turn - np.copysign(2 * np.pi, turn)]
    for angle in turns:
        yield _problem(task, water, ship, line, angle)


def free_leg(task: LegTask, water: LegWater, ship: AgileShip, displacement_value: Array) -> tuple[float, Array] | None:
    """Time and end pose (3,) of the leg that gains most from a state, in open water, or None.

    Args:
        task: its end gives heading, motion and commands; its place is only a first guess.
        water: open water.
        displacement_value: (2,) value of displacement to north and east [s/m]; zero where any end will do.
    """
    line = _line(water, np.stack([task.start[:2], task.end[:2]]))
    problems = (
        replace(problem, displacement_value=displacement_value, node_s=problem.duration_s / TRANSITION_NODES)
        for problem in _problems(task, water, ship, line)
    )
    found = [answer for problem in problems if (answer := solve_transition(problem)) is not None]
    return min(found, key=lambda answer: answer[0] - float(displacement_value @ answer[1][:2]), default=None)


def _problem(task: LegTask, water: LegWater, ship: AgileShip, line: Line, turn: float) -> LegProblem:
    duration_s = _duration_s(task, ship, line, turn)
    states = _guess(task, line, turn, duration_s)
    path = line.at(np.linspace(0.0, line.length_m, GUESS_NODES + 1))
    problem = leg_problem(
        task,
        water,
        end=states[-1],
        states=states,
        inputs=_guessed_inputs(task, water, states, duration_s),
        path=path,
        duration_s=duration_s,
        turning_rate_radps=ship.turn_rate_radps,
    )
    arm, margin = hull_discs(water)
    circle = _circle(water, line, arm, margin)
    if circle is not None:
        free = np.full(len(path), np.inf)
        return replace(problem, room_port_m=free, room_starboard_m=free, circle=circle)
    sticking = max(abs(arm * np.sin(task.start[2] - path[0, 2])), abs(arm * np.sin(task.end[2] - path[-1, 2])))
    return replace(
        problem,
        room_port_m=np.maximum(problem.room_port_m, 1.02 * sticking),
        room_starboard_m=np.maximum(problem.room_starboard_m, 1.02 * sticking),
    )


def _circle(water: LegWater, line: Line, arm: float, margin_m: float) -> Array | None:
    """A circle of free water that leaves the discs of a hull on a short line room to turn, or None.

    Its radius is infinite where the shore is as far off as a corridor is wide: such legs do not depend on the chart.
    """
    middle = line.at(np.array([line.length_m / 2]))[0, :2]
    radius = float(water.field.at(middle)) - margin_m
    needed = float(np.hypot(*(line.points - middle).T).max()) + arm + water.vessel.length_m / 3
    if radius >= needed + CORRIDOR_HULLS * water.vessel.length_m:
        radius = np.inf
    return np.r_[middle, radius] if radius >= needed else None


def _duration_s(task: LegTask, ship: AgileShip, line: Line, turn: float) -> float:
    course = line.at(np.array([0.0, line.length_m]))[:, 2]
    spot_s, path_s = 1.3 * abs(turn) / ship.swing_radps, line.length_m / ship.transit_speed_mps
    if line.length_m > 0.1 * ship.turning_radius_m:
        path_s += float(ship.turn_loss_s(task.start[2] - course[0], task.end[2] - course[1]))
    return max(path_s, spot_s) + float(ship.speed_loss_s(task.start[3], task.end[3]))


def _guess(task: LegTask, line: Line, turn: float, duration_s: float) -> Array:
    """(j + 1, 6) states along a line, the heading turning evenly, velocities fitting the places."""
    share = np.linspace(0.0, 1.0, GUESS_NODES + 1)[:, None]
    ends = np.stack([task.start, task.end])
    c, s = np.cos(ends[:, 2]), np.sin(ends[:, 2])
    tangents = duration_s * np.stack([ends[:, 3] * c - ends[:, 4] * s, ends[:, 3] * s + ends[:, 4] * c], axis=1)
    smooth = 3 * share**2 - 2 * share**3
    place = line.at(smooth[:, 0] * line.length_m)[:, :2] + (task.start[:2] - line.points[0]) * (1 - smooth)
    place += (share - 2 * share**2 + share**3) * tangents[0] + (share**3 - share**2) * tangents[1]
    heading = task.start[2] + smooth[:, 0] * turn
    step_s = duration_s / GUESS_NODES
    motion = np.gradient(place, step_s, axis=0)
    c, s = np.cos(heading), np.sin(heading)
    states = np.column_stack(
        [
            place,
            heading,
            motion[:, 0] * c + motion[:, 1] * s,
            motion[:, 1] * c - motion[:, 0] * s,
            np.gradient(heading, step_s),
        ]
    )
    states[0] = task.start
    states[-1] = np.r_[task.end[:2], heading[-1], task.end[3:]]
    return np.asarray(states)


def _guessed_inputs(task: LegTask, water: LegWater, states: Array, duration_s: float) -> Array:
    """Commands (j + 1, m) that would give the guessed motion."""
    vessel, step_s = water.vessel, duration_s / GUESS_NODES
    push = required_push(vessel.model, states[1:, 3:], np.gradient(states[:, 3:], step_s, axis=0)[1:])
    values = commands_for(vessel.model, push, sample_time_s=step_s, before=task.start_inputs)
    inputs = np.vstack([task.start_inputs, values])
    inputs[-1] = nearest_turns(vessel, task.end_inputs, inputs[-2])
    return inputs
