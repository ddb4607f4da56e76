"""Simulation of all windows at once, and how long windows of unstable models may be."""

from __future__ import annotations

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.data import Windows, channel_std, cut_windows
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion.equations_of_motion import (
    parts_of_step,
    propagated,
    runge_kutta_step,
    state_jacobian,
    transition_matrices,
)
from expdesign.diagnosis.motion.inputs import ExogenousInputs, exogenous_inputs
from expdesign.diagnosis.motion.linearisation import (
    LARGEST_SPEED,
    NEWTON_TOLERANCE,
    LinearisedMotion,
    Motion,
    linearise,
    sensor_outputs,
    ship_velocities,
    start_responses,
)
from expdesign.signals import Record
from expdesign.values import Array

NEWTON_ROUNDS = 12  # of a simulation of all steps at once
NEWTON_DIVERGENCE = 5.0  # growth of the correction that counts as divergence
NEWTON_REFRESH = 3e-3  # correction above which the transition matrices are updated
NEWTON_SAFETY = 0.1  # share of the tolerance below which the next correction must lie not to be made
START_SAMPLES = 5  # samples that measured initial states are estimated from
FEWEST_START_SAMPLES = 3  # of them that are measured, for a state to be fitted to them
FEWEST_WINDOWS = 4  # into which data are cut
WINDOW_ROUNDS = 4  # of shortening the windows of an unstable model
FEWEST_WINDOW_SAMPLES = 30  # of shortened windows
LARGEST_GROWTH = 6.0  # of an error of the initial state within a window


def simulate_windows(
    ship: ExtendedModel, windows: Windows, start: Array, *, warm_start: LinearisedMotion | None = None
) -> Motion:
    """Runge-Kutta of order four with inputs held over every step.

    Args:
        windows: w windows.
        start: (w, n) initial states.
        warm_start: linearised motion of a similar ship; it speeds up the simulation and does not change it.
    """
    return _simulated(ship, windows, _exogenous_near(ship, windows, warm_start), start, warm_start)


def _simulated(
    ship: ExtendedModel,
    windows: Windows,
    exogenous: ExogenousInputs,
    start: Array,
    warm_start: LinearisedMotion | None = None,
) -> Motion:
    with np.errstate(over="ignore", invalid="ignore"):
        states = None if warm_start is None else _newton_from(ship, windows, exogenous, start, warm_start)
        states = _newton_from_measured(ship, windows, exogenous, start) if states is None else states
        states = _step_by_step(ship, windows, exogenous, start) if states is None else states
    return _motion(ship, windows, exogenous, states)


def simulate_nearby(ship: ExtendedModel, windows: Windows, start: Array, near: LinearisedMotion) -> Motion | None:
    """The simulation from a similar motion; None where Newton's method does not converge from there.

    A motion with another number of states is simulated step by step.
    """
    if near.motion.states.shape != (len(start), windows.steps, ship.states):
        return simulate_windows(ship, windows, start)
    exogenous = _exogenous_near(ship, windows, near)
    with np.errstate(over="ignore", invalid="ignore"):
        states = _newton_from(ship, windows, exogenous, start, near)
    return None if states is None else _motion(ship, windows, exogenous, states)


def _exogenous_near(ship: ExtendedModel, windows: Windows, near: LinearisedMotion | None) -> ExogenousInputs:
    known = None if near is None else (near.motion.ship, near.motion.exogenous)
    return exogenous_inputs(ship, windows, known=known)


def _motion(ship: ExtendedModel, windows: Windows, exogenous: ExogenousInputs, states: Array) -> Motion:
    """Heading and sensor outputs along the states."""
    with np.errstate(over="ignore", invalid="ignore"):
        turns = runge_kutta_step(
            ship, tuple(np.moveaxis(states[:, :-1], -1, 0)), exogenous.without_last_step, windows.step_s
        )[1]
    heading_change = np.zeros(states.shape[:2])
    heading_change[:, 1:] = np.cumsum(turns, axis=1)
    states = np.clip(np.nan_to_num(states, nan=1e3, posinf=1e3, neginf=-1e3), -1e3, 1e3)
    heading_change = np.nan_to_num(heading_change, nan=1e3, posinf=1e3, neginf=-1e3)
    predicted = sensor_outputs(ship, states, windows, heading_change)
    return Motion(
        ship=ship,
        windows=windows,
        exogenous=exogenous,
        states=states,
        heading_change=heading_change,
        predicted=predicted,
    )


def _step_by_step(ship: ExtendedModel, windows: Windows, exogenous: ExogenousInputs, start: Array) -> Array:
    """(w, k, n)."""
    states = np.empty((len(start), windows.steps, ship.states))
    states[:, 0] = start
    x = tuple(start.T)
    for step in range(windows.steps - 1):
        x, _ = runge_kutta_step(ship, x, exogenous.at(step), windows.step_s)
        states[:, step + 1] = np.stack(x, axis=-1)
    return states


def _newton_from(
    ship: ExtendedModel, windows: Windows, exogenous: ExogenousInputs, start: Array, near: LinearisedMotion
) -> Array | None:
    """(w, k, n) states by Newton's method from a similar motion; None where that does not converge."""
    if near.motion.states.shape != (len(start), windows.steps, ship.states):
        return None
    return _newton_over_all_steps(ship, windows, exogenous, start, near.motion.states, near.transition)


def _newton_from_measured(
    ship: ExtendedModel, windows: Windows, exogenous: ExogenousInputs, start: Array
) -> Array | None:
    """(w, k, n) states by Newton's method from the measured velocities, without roll; None without convergence."""
    states = np.zeros((len(start), windows.steps, ship.states))
    states[..., :3] = _measured_states(windows)
    transition = _transition(ship, windows, exogenous.without_last_step, states)
    return _newton_over_all_steps(ship, windows, exogenous, start, states, transition)


def _measured_states(windows: Windows) -> Array:
    """(w, k, 3) measured velocities at the integrator steps, the last measured one in gaps, zero before the first."""
    seen = np.isfinite(windows.measured[..., :3])
    sample = np.arange(seen.shape[1])[None, :, None]
    last = np.maximum.accumulate(np.where(seen, sample, -1), axis=1)
    held = np.take_along_axis(np.nan_to_num(windows.measured[..., :3]), np.maximum(last, 0), axis=1)
    return np.repeat(np.where(last < 0, 0.0, held), windows.steps_per_sample, axis=1)[:, : windows.steps]


def _newton_over_all_steps(
    ship: ExtendedModel, windows: Windows, exogenous: ExogenousInputs, start: Array, states: Array, transition: Array
) -> Array | None:
    """(w, k, n) states by Newton's method for all steps as one system of equations; None without convergence.

    Each iteration computes all steps from the last states and propagates the gaps between them by transition matrices
    of a similar motion (multiple shooting). At convergence the gaps vanish, and the result is the stepwise
    one. Corrections shrink by about the same factor each time, so the next one is known before it is made.

    Sources: P. Bellen and M. Zennaro, Journal of Computational and Applied Mathematics 25 (1989), 341-350; E. Hairer
    and G. Wanner, Solving Ordinary Differential Equations II (1996), IV.8, for when to end.
    """
    middle, last = exogenous.without_last_step, np.inf
    for number in range(NEWTON_ROUNDS):
        made = np.stack(
            runge_kutta_step(ship, tuple(np.moveaxis(states[:, :-1], -1, 0)), middle, windows.step_s)[0], axis=-1
        )
        change = propagated(transition, start - states[:, 0], made - states[:, 1:])
        size = float(np.abs(change).max())
        if not size < min(NEWTON_DIVERGENCE * last, LARGEST_SPEED):
            return None
        states, next_size = states + change, size * size / last if number else size
        if min(size, next_size / NEWTON_SAFETY) < NEWTON_TOLERANCE:
            return states
        last = size
        if size > NEWTON_REFRESH and number < NEWTON_ROUNDS / 2:
            transition = _transition(ship, windows, middle, states)
    return None


def _transition(ship: ExtendedModel, windows: Windows, middle: ExogenousInputs, states: Array) -> Array:
    """(w, k - 1, n, n) over each step, from the rates in its middle."""
    jacobian = state_jacobian(ship, (states[:, :-1] + states[:, 1:]) / 2, middle)
    return transition_matrices(jacobian, windows.step_s, parts_of_step(ship, windows.step_s))[0]


def initial_states(windows: Windows, states: int = 3) -> Array:
    """(w, n) state at the beginning of every window: a straight line through its first samples, without roll."""
    result = np.zeros((len(windows.batch), states))
    result[:, :3] = _first_line(windows)[0]
    return result


def _first_line(windows: Windows) -> tuple[Array, Array]:
    """(w, 3) value at the first sample and (w, 3) rise per sample of straight lines through the first samples."""
    rows = windows.measured[:, :START_SAMPLES, :3]
    seen = np.isfinite(rows)
    count = np.maximum(seen.sum(axis=1), 1)  # (w, 3)
    time = np.where(seen, np.arange(rows.shape[1], dtype=float)[:, None], 0.0)
    middle, mean = time.sum(axis=1) / count, np.where(seen, rows, 0.0).sum(axis=1) / count
    apart = np.where(seen, time - middle[:, None], 0.0)
    slope = (apart * np.where(seen, rows, 0.0)).sum(axis=1) / np.maximum((apart**2).sum(axis=1), 1e-300)
    slope = np.where(count >= FEWEST_START_SAMPLES, slope, 0.0)
    return np.where(count >= FEWEST_START_SAMPLES, mean - slope * middle, mean), slope


def simulate_from_measured(ship: ExtendedModel, windows: Windows, warm_start: LinearisedMotion | None = None) -> Motion:
    """Every window from the state that fits its first measurements; the motion of a similar ship speeds it up."""
    exogenous = _exogenous_near(ship, windows, warm_start)
    return _simulated(ship, windows, exogenous, _fitted_start(ship, windows, exogenous), warm_start)


def fitted_start(ship: ExtendedModel, windows: Windows) -> Array:
    """(w, n) initial states by least squares of the simulated first samples: no ship that accelerates moves in a line.

    What is not measured, and windows that diverge, begin as their first samples are (`initial_states`).
    """
    return _fitted_start(ship, windows, exogenous_inputs(ship, windows))


def _fitted_start(ship: ExtendedModel, windows: Windows, exogenous: ExogenousInputs) -> Array:
    """One step of Newton's method from the straight line, which is near."""
    head = windows.begun(START_SAMPLES)
    first, rise = _first_line(windows)
    modelled = np.isin(OUTPUTS, ship.model.outputs)
    line = np.zeros((len(first), head.steps, ship.states))
    for step in range(head.steps):
        now = ship_velocities(ship, first + rise * step / head.steps_per_sample)
        line[:, step, :3] = np.where(modelled, now, 0.0)
    inputs = exogenous.begun(head.steps)
    middle = inputs.without_last_step
    with np.errstate(over="ignore", invalid="ignore"):
        transition = _transition(ship, head, middle, line)
        made = runge_kutta_step(ship, tuple(np.moveaxis(line[:, :-1], -1, 0)), middle, head.step_s)[0]
        gaps = np.stack(made, axis=-1) - line[:, 1:]
        motion = _motion(ship, head, inputs, line + propagated(transition, np.zeros_like(line[:, 0]), gaps))
    seen = np.isfinite(motion.error[..., :3])
    fitted = (seen.sum(axis=1) >= FEWEST_START_SAMPLES) & modelled & ~motion.diverged_windows[:, None]  # (w, 3)
    weight = seen * np.array([1.0, 1.0, ship.length_m / 2.0])  # a yaw rate counts as the speed of the bow
    by_start = start_responses(motion, transition)[..., :3] * weight * fitted.T[:, :, None, None]
    table = np.nan_to_num(np.moveaxis(by_start, 0, -1), posinf=0.0, neginf=0.0).reshape(len(first), -1, 3)
    missed = (np.nan_to_num(motion.error[..., :3]) * weight).reshape(len(first), -1, 1)
    start = line[:, 0].copy()
    start[:, :3] += (np.linalg.pinv(table) @ missed)[..., 0]
    return start


def stable_windows(ship: ExtendedModel, record: Record) -> Windows:
    """Windows of a record: as long as possible, but at least a few, and short enough for an unstable model."""
    windows = longest_windows(ship, record)
    for _ in range(WINDOW_ROUNDS):
        stable_s = _stable_time(ship, windows)
        if stable_s >= windows.steps * windows.step_s:
            break
        windows = cut_windows(ship.model, record, longest_s=stable_s)
    return windows


def longest_windows(ship: ExtendedModel, record: Record) -> Windows:
    """Windows of a record for a stable model."""
    windows = cut_windows(ship.model, record)
    if len(windows.batch) >= FEWEST_WINDOWS:
        return windows
    total_s = sum(len(batch) * batch.sample_time_s for batch in record.batches)
    return cut_windows(ship.model, record, longest_s=total_s / FEWEST_WINDOWS)


def _stable_time(ship: ExtendedModel, windows: Windows) -> float:
    """Time until an error of an initial velocity, in measured standard deviations, grows too much [s]."""
    motion = simulate_from_measured(ship, windows)
    if motion.diverged:
        return windows.steps * windows.step_s / 2
    size = channel_std(windows.measured[..., :3])
    scale = np.where(size > 0, size, 1.0)
    by_start = start_responses(motion, linearise(motion).transition)
    answers = np.moveaxis(by_start[..., :3], 0, -1) * scale / scale[:, None]
    growth = np.linalg.norm(answers, axis=(2, 3)) / np.sqrt(3.0)
    unstable = (growth > LARGEST_GROWTH).any(axis=0)
    if not unstable.any():
        return windows.steps * windows.step_s
    return max(int(np.argmax(unstable)), FEWEST_WINDOW_SAMPLES) * windows.sample_s
