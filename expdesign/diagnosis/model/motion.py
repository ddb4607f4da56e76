"""Simulation of all windows at once, and how small causes move it.

The response to a small cause is that of the linearised motion to the change of acceleration that the cause makes along
the simulated path; all causes share one linearisation, so hundreds of them cost little more than one simulation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model.extended import Extended
from expdesign.diagnosis.model.rates import rates
from expdesign.diagnosis.model.sensors import averaged, observed
from expdesign.diagnosis.model.surroundings import Surroundings, surroundings
from expdesign.values import Array

LARGEST_SPEED = 60.0
NUDGE = 1e-5
INNER, OUTER = {"theta", "term", "gain", "inertia", "asymmetry"}, {"lever", "gyro"}
"""Kinds of effects that change neither surroundings nor sensors, and those that change sensors alone."""
MOST_ROUNDS, LOST, NEAR, SETTLED = 12, 5.0, 3e-3, 1e-8
"""Of a simulation of all steps at once: rounds; growth of the change with which it is given up; change below which the
transition matrices need not be found anew; change with which it is done."""


ROLL_ANGLE, MOST_PARTS = 0.25, 16
"""Of a roll's oscillation that is followed in one part of a step [rad], and parts of a step."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A simulation of all windows.

    Attributes:
        ship: what was simulated.
        windows: the data it is set against.
        around: inputs and surroundings.
        states: (w, k, n) at integrator steps.
        turned: (w, k) heading since the start [rad].
        shown: (w, s, 4) what the sensors would show.
    """

    ship: Extended
    windows: Windows
    around: Surroundings
    states: Array
    turned: Array
    shown: Array

    @property
    def error(self) -> Array:
        """(w, s, 4) measured less simulated, nan where nothing is measured."""
        return np.asarray(self.windows.measured - self.shown)

    @property
    def diverged(self) -> bool:
        """A speed is out of all reason."""
        return not bool(np.abs(self.states).max() < LARGEST_SPEED)


def simulate_windows(ship: Extended, windows: Windows, start: Array, *, near: Linear | None = None) -> Motion:
    """Runge-Kutta of order four with inputs held over every step.

    Args:
        ship: model and effects.
        windows: w windows.
        start: (w, n) initial states.
        near: linearised motion of a ship alike, which makes it quicker and no different.
    """
    around = surroundings(ship, windows)
    with np.errstate(over="ignore", invalid="ignore"):
        states = None if near is None else _all_at_once(ship, windows, around, start, near)
        states = _step_by_step(ship, windows, around, start) if states is None else states
        turns = _rk4(ship, tuple(np.moveaxis(states[:, :-1], -1, 0)), around.before_last(), windows.step_s)[1]
    turned = np.zeros(states.shape[:2])
    turned[:, 1:] = np.cumsum(turns, axis=1)
    states = np.clip(np.nan_to_num(states, nan=1e3, posinf=1e3, neginf=-1e3), -1e3, 1e3)
    turned = np.nan_to_num(turned, nan=1e3, posinf=1e3, neginf=-1e3)
    shown = observed(ship, states, windows, turned)
    return Motion(ship=ship, windows=windows, around=around, states=states, turned=turned, shown=shown)


def _step_by_step(ship: Extended, windows: Windows, around: Surroundings, start: Array) -> Array:
    """(w, k, n)."""
    states = np.empty((len(start), windows.steps, ship.states))
    states[:, 0] = start
    x = tuple(start.T)
    for step in range(windows.steps - 1):
        x, _ = _rk4(ship, x, around.at(step), windows.step_s)
        states[:, step + 1] = np.stack(x, axis=-1)
    return states


def _all_at_once(ship: Extended, windows: Windows, around: Surroundings, start: Array, near: Linear) -> Array | None:
    """(w, k, n) by Newton's method for all steps as one system of equations, or None when that does not settle soon.

    Every step is made at once from where the last round left it; what they miss each other by is handed on by the
    transition matrices of the motion nearby. It ends where the steps join, which is what they do step by step.

    Source: P. Bellen and M. Zennaro, Journal of Computational and Applied Mathematics 25 (1989), 341-350.
    """
    states = near.motion.states
    if states.shape != (len(start), windows.steps, ship.states):
        return None
    middle, last, onward = around.before_last(), np.inf, near.onward
    for number in range(MOST_ROUNDS):
        made = np.stack(_rk4(ship, tuple(np.moveaxis(states[:, :-1], -1, 0)), middle, windows.step_s)[0], axis=-1)
        change = _handed_on(onward, start - states[:, 0], made - states[:, 1:])
        size = float(np.abs(change).max())
        if not size < min(LOST * last, LARGEST_SPEED):
            return None
        states, last = states + change, size
        if size < SETTLED:
            return states
        if size > NEAR and number < MOST_ROUNDS / 2:
            onward, _ = _transitions(_jacobian(ship, (states[:, :-1] + states[:, 1:]) / 2, middle), windows.step_s)
    return None


def _handed_on(onward: Array, first: Array, missed: Array) -> Array:
    """(w, k, n) what gaps (w, k - 1, n) between steps and at the start amount to."""
    change = np.empty((missed.shape[1] + 1, *first.shape, 1))
    change[0, ..., 0] = first
    gaps, matrices = np.moveaxis(missed, 1, 0)[..., None], np.ascontiguousarray(np.moveaxis(onward, 1, 0))
    for step, (matrix, gap) in enumerate(zip(matrices, gaps, strict=True)):
        np.add(matrix @ change[step], gap, out=change[step + 1])
    return np.moveaxis(change[..., 0], 0, 1)


def _rk4(ship: Extended, x: tuple[Array, ...], around: Surroundings, h: float) -> tuple[tuple[Array, ...], Array]:
    """The state one step on, and the heading gained; roll that is quick beside the step is followed in parts of it."""
    turn = 0.0 if ship.roll is None else 2 * math.pi * h / ship.roll.period_s
    parts = min(max(1, math.ceil(turn / ROLL_ANGLE)), MOST_PARTS)
    gained: Array | float = 0.0
    for part in range(parts):
        stages = [around.within((part + share) / parts - 0.5) for share in (0.0, 0.5, 1.0)]
        x, more = _rk4_part(ship, x, stages, h / parts)
        gained = gained + more
    return x, np.asarray(gained)


def _rk4_part(
    ship: Extended, x: tuple[Array, ...], around: Sequence[Surroundings], h: float
) -> tuple[tuple[Array, ...], Array]:
    """With surroundings at the beginning, in the middle and at the end."""
    begin, middle, end = around

    def ahead(slope: tuple[Array, ...], share: float) -> tuple[Array, ...]:
        return tuple(np.clip(a + share * h * b, -1e3, 1e3) for a, b in zip(x, slope, strict=True))

    k1 = rates(ship, x, begin)
    k2 = rates(ship, x2 := ahead(k1, 0.5), middle)
    k3 = rates(ship, x3 := ahead(k2, 0.5), middle)
    k4 = rates(ship, x4 := ahead(k3, 1.0), end)
    onward = tuple(a + h / 6 * (p + 2 * q + 2 * s + t) for a, p, q, s, t in zip(x, k1, k2, k3, k4, strict=True))
    return onward, h / 6 * (x[2] + 2 * x2[2] + 2 * x3[2] + x4[2])


@dataclass(frozen=True, kw_only=True, eq=False)
class Linear:
    """The linearised motion along a simulation.

    Attributes:
        motion: where.
        onward: (w, k - 1, n, n) transition over each step.
        driven: (w, k - 1, n, n) effect of a constant acceleration over each step.
        slopes: (w, k, n) rates along the path, of both ends of every step with its inputs, stacked (2, w, k - 1, n).
    """

    motion: Motion
    onward: Array
    driven: Array
    slopes: Array

    def picked(self, keep: NDArray[np.bool_]) -> Linear:
        """Only some of the windows, by a mask (w,)."""
        motion = replace(
            self.motion,
            windows=self.motion.windows.picked(keep),
            around=Surroundings({name: values[keep] for name, values in self.motion.around.items()}),
            states=self.motion.states[keep],
            turned=self.motion.turned[keep],
            shown=self.motion.shown[keep],
        )
        return Linear(motion=motion, onward=self.onward[keep], driven=self.driven[keep], slopes=self.slopes[:, keep])


def linearise(motion: Motion) -> Linear:
    """Transition matrices from finite differences of the rates, all steps at once."""
    ends = (motion.states[:, :-1], motion.states[:, 1:])
    around = motion.around.before_last()
    slopes = np.stack([_rates(motion.ship, end, around) for end in ends])
    jacobian = (_jacobian(motion.ship, ends[0], around) + _jacobian(motion.ship, ends[1], around)) / 2
    onward, driven = _transitions(jacobian, motion.windows.step_s)
    return Linear(motion=motion, onward=onward, driven=driven, slopes=slopes)


def _jacobian(ship: Extended, states: Array, around: Surroundings) -> Array:
    """(w, k, n, n) derivatives of the rates, by central differences."""
    n = ship.states
    jacobian = np.empty((*states.shape, n))
    for axis in range(n):
        step = np.zeros(n)
        step[axis] = NUDGE
        jacobian[..., axis] = (_rates(ship, states + step, around) - _rates(ship, states - step, around)) / (2 * NUDGE)
    return jacobian


def _transitions(jacobian: Array, h: float) -> tuple[Array, Array]:
    """Transition over a step, and the effect of a constant acceleration over it, to fourth order."""
    A = jacobian * h
    eye = np.eye(A.shape[-1])
    A2 = A @ A
    A3 = A2 @ A
    return eye + A + A2 / 2 + A3 / 6 + A3 @ A / 24, h * (eye + A / 2 + A2 / 6 + A3 / 24)


def _rates(ship: Extended, states: Array, around: Surroundings) -> Array:
    found = rates(ship, tuple(np.moveaxis(states, -1, 0)), around)
    return np.stack([np.broadcast_to(part, states.shape[:2]) for part in found], axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Push:
    """A small cause along a path.

    Attributes:
        force: (w, k - 1, n) change of the rates per unit of the cause, or None.
        sensor: (w, s, 4) change of what sensors show by themselves, or None.
    """

    force: Array | None
    sensor: Array | None


def push_of(linear: Linear, changed: Extended, per: float) -> Push:
    """What a change of effects does along the path, divided by `per`."""
    motion = linear.motion
    kinds = {key.split(":")[0] for key in _differing(motion.ship, changed)}
    sensor = force = np.zeros(1)
    if kinds - INNER:
        sensor = observed(changed, motion.states, motion.windows, motion.turned) - motion.shown
    if kinds - OUTER:
        known = not kinds - INNER and ("u_w" in motion.around or not any(part.reads_air for part in changed.parts))
        around = (motion.around if known else surroundings(changed, motion.windows)).before_last()
        ends = (motion.states[:, :-1], motion.states[:, 1:])
        force = np.mean([_rates(changed, end, around) for end in ends], axis=0) - linear.slopes.mean(axis=0)
    return Push(
        force=force / per if np.any(force) else None,
        sensor=sensor / per if np.any(sensor) else None,
    )


def _differing(one: Extended, other: Extended) -> set[str]:
    """Effects that two ships do not share."""
    keys = {*one.effects, *other.effects}
    return {key for key in keys if one.effects.get(key) != other.effects.get(key)}


def responses(linear: Linear, pushes: Sequence[Push]) -> Array:
    """(c, w, s, 4) how the shown channels answer each push, from undisturbed initial states.

    Answers of an unstable motion may grow beyond what numbers hold.
    """
    motion = linear.motion
    n = motion.ship.states
    w, k = motion.states.shape[:2]
    moved = np.zeros((len(pushes), w, k, n))
    forces = {index: push.force for index, push in enumerate(pushes) if push.force is not None}
    driven = list(forces)
    if driven:
        kicks = np.stack([np.einsum("wkij,wkj->wki", linear.driven, force) for force in forces.values()], axis=-1)
        x = np.zeros((w, n, len(driven)))
        path = np.zeros((k, w, n, len(driven)))
        with np.errstate(over="ignore", invalid="ignore"):
            for step in range(k - 1):
                x = linear.onward[:, step] @ x + kicks[:, step]
                path[step + 1] = x
        moved[driven] = np.moveaxis(path, (3, 1, 0, 2), (0, 1, 2, 3))
    with np.errstate(over="ignore", invalid="ignore"):
        result = _shown(linear, moved)
    for index, push in enumerate(pushes):
        if push.sensor is not None:
            result[index] += push.sensor
    return np.nan_to_num(result, nan=0.0, posinf=0.0, neginf=0.0)


def start_responses(linear: Linear) -> Array:
    """(3, w, s, 4) answers to unit initial velocities of every window; roll begins at rest."""
    motion = linear.motion
    w, k, n = motion.states.shape
    x = np.broadcast_to(np.eye(n)[:, :3], (w, n, 3)).copy()
    path = np.empty((k, w, n, 3))
    path[0] = x
    with np.errstate(over="ignore", invalid="ignore"):
        for step in range(k - 1):
            x = linear.onward[:, step] @ x
            path[step + 1] = x
        return _shown(linear, np.moveaxis(path, (3, 1, 0, 2), (0, 1, 2, 3)))


def _shown(linear: Linear, moved: Array) -> Array:
    """Changes of the channels for changes of the states (c, w, k, n); sensors are nearly linear in the states."""
    motion = linear.motion
    if not any(key.startswith(("heading", "lever", "gyro", "late")) for key in motion.ship.effects):
        windows = motion.windows
        values = moved[:, :, :: windows.steps_per_sample, :3]
        means = averaged(np.moveaxis(values, -1, 0), windows.rows_per_step)
        seen = [means[i] if n in windows.derived else values[..., i] for i, n in enumerate("uvr")]
        return np.stack([*seen, means[2]], axis=-1)
    size = 1e-4
    still = observed(motion.ship, motion.states, motion.windows)
    changes = [(observed(motion.ship, motion.states + size * part, motion.windows) - still) / size for part in moved]
    return np.array(changes).reshape(len(moved), *still.shape)
