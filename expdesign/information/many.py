"""Information of many candidate runs at once: the matrices of `moments`, without primitives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.information.disturbed import current_slopes
from expdesign.information.moments import HEADINGS, RUNS_AT_ONCE, rows_of, signals_of
from expdesign.simulation import Environment, deliver, simulate_many, to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel
from expdesign.vessel.structures import Signals


def bordered_runs(
    vessel: Vessel,
    commands: Array,
    velocity: Array,
    names: Sequence[str],
    *,
    environment: Environment,
    mean_subtraction: str,
    standing: Array | None = None,
    courses: Array | None = None,
) -> tuple[Array, Array]:
    """B (n, d, d) of many runs, and their motion through calm water (n, k + 1, 3).

    The same numbers as `score_primitives` and `durations.bordered` give run by run; nan where a run diverges. With
    courses, of runs along these, and (n, d + 2, d + 2), as of `unknown_current.bordered_by_current`, where the forecast
    leaves a steady current unknown.

    Args:
        vessel: nominal.
        commands: (n, k, m) commands of each run.
        velocity: (n, 3) entry velocities through water.
        names: parameters to estimate.
        environment: mean current and wind; information is averaged over headings in them, or over the courses.
        mean_subtraction: "none", "batch" or "complete".
        standing: (n, m) commands before the first sample; None for those of the first sample.
        courses: (c,) that runs make good through calm water [rad]; None where they are unknown.
    """
    start = (velocity, commands[:, 0] if standing is None else standing)
    given = deliver(
        vessel.responses, commands.transpose(1, 2, 0), sample_time_s=vessel.sample_time_s, standing=start[1].T
    )[:, 0]
    calm = _states(vessel, commands, start, Environment(), np.zeros((1, 1)))[0]
    if courses is not None:
        away = calm[-1, :, :2] - calm[0, :, :2]
        headings = courses[:, None] - np.arctan2(away[:, 1], away[:, 0])
    else:
        headings = 2 * np.pi * np.arange(HEADINGS)[:, None] / HEADINGS
    beside, pieces = courses is not None and environment.current_std_mps > 0, list[Array]()
    if courses is None and environment.isotropic:
        pieces.append(_matrices(vessel, calm, given, names, environment, mean_subtraction, beside_current=False))
        headings = headings[:0]
    at_once = max(1, RUNS_AT_ONCE // len(commands))
    for first in range(0, len(headings), at_once):
        for states in _states(vessel, commands, start, environment, headings[first : first + at_once]):
            pieces.append(_matrices(vessel, states, given, names, environment, mean_subtraction, beside_current=beside))
    return np.mean(pieces, axis=0), calm[..., 3:].transpose(1, 0, 2)


def _states(
    vessel: Vessel, commands: Array, start: tuple[Array, Array], environment: Environment, headings: Array
) -> Array:
    """(h, k + 1, n, 6) states from velocities (n, 3) through water, standing commands (n, m), headings (h, n or 1)."""
    count, runs = len(headings), len(commands)
    heading = np.broadcast_to(headings, (count, runs)).ravel()
    current_b = np.stack([*to_body(environment.current_to, heading, NUMPY), np.zeros(count * runs)], axis=1)
    states = simulate_many(
        vessel,
        np.tile(commands, (count, 1, 1)),
        pose=np.column_stack([np.zeros((count * runs, 2)), heading]),
        velocity=np.tile(start[0], (count, 1)) + current_b,
        current_to=np.tile(environment.current_to, (count * runs, 1)),
        wind_to=np.tile(environment.wind_to, (count * runs, 1)),
        parameters=np.tile(vessel.model.parameters, (count * runs, 1)),
        standing=np.tile(start[1], (count, 1)),
    )
    return np.moveaxis(states.reshape(len(states), count, runs, -1), 1, 0)


def _matrices(
    vessel: Vessel,
    states: Array,
    given: Array,
    names: Sequence[str],
    environment: Environment,
    mean_subtraction: str,
    *,
    beside_current: bool,
) -> Array:
    model = vessel.model
    with np.errstate(invalid="ignore", over="ignore"):
        table = signals_of(model, tuple(np.moveaxis(states[:-1], -1, 0)), given.swapaxes(0, 1), environment)
        rows = rows_of(model, table, (len(states) - 1, states.shape[1]))  # (all, k, n)
        chosen = [model.names.index(name) for name in names]
        equations = [model.terms[index].equation for index in chosen]
        kept = rows[chosen].transpose(2, 0, 1)  # (n, p, k)
        same = np.array([[a == b for b in equations] for a in equations])
        member = np.array([[equation == output for output in model.outputs] for equation in equations])
        if mean_subtraction == "batch":
            kept = kept - kept.mean(axis=2, keepdims=True)
        X = np.where(same, kept @ kept.transpose(0, 2, 1) / kept.shape[2], 0.0)
        Y = np.where(member, kept.mean(axis=2)[:, :, None], 0.0)
    found = X
    if mean_subtraction == "complete":
        unit = np.broadcast_to(np.eye(len(model.outputs)), (len(X), len(model.outputs), len(model.outputs)))
        found = _block(X, Y, unit)
    if not beside_current:
        return found
    with np.errstate(invalid="ignore", over="ignore"):
        J = _current_rows(vessel, table, states[:-1, :, 2])
        if mean_subtraction == "batch":
            J = J - J.mean(axis=2, keepdims=True)
        of = [model.outputs.index(equation) for equation in equations]
        cross = np.concatenate([kept[:, p : p + 1] @ J[:, of[p]] for p in range(len(of))], axis=1) / J.shape[2]
        if mean_subtraction == "complete":
            cross = np.concatenate([cross, J.mean(axis=2)], axis=1)
        return _block(found, cross, (J.swapaxes(2, 3) @ J).sum(axis=1) / J.shape[2])


def _current_rows(vessel: Vessel, table: Signals, heading_rad: Array) -> Array:
    """(n, outputs, k, 2) regressors of the current, of runs at headings (k, n)."""
    signals = {name: np.broadcast_to(values, heading_rad.shape).ravel() for name, values in table.items()}
    found = current_slopes(vessel, signals, heading_rad.ravel())
    return found.reshape(*heading_rad.shape, *found.shape[1:]).transpose(1, 2, 0, 3)


def _block(A: Array, B: Array, C: Array) -> Array:
    """(n, a + c, a + c) block matrices [A B; B' C]."""
    return np.concatenate([np.concatenate([A, B], axis=2), np.concatenate([B.transpose(0, 2, 1), C], axis=2)], axis=1)
