"""Information that is left where current and wind are unknown: their parameters are estimated besides the ship's.

The regressors of the disturbances are those of the estimator (`estimation.regression`), in noise-free runs on evenly
spread headings, because the heading of a run is not known before the plan. What remains about the ship's parameters is
the Schur complement of the other block, and a criterion about the ship alone is D_s. A steady current is two
parameters, c to north and to east. For runs of unknown heading it makes no difference: over evenly spread headings the
products of J(psi), which turns with the ship, and the regressors, which do not, are zero on average.

Source: F. Pukelsheim, Optimal Design of Experiments (2006), 3.10 for the information about a subsystem; F. Ljungberg,
doctoral thesis, Linköping University, (5.63)-(5.76), (7.50)-(7.57).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.errors import Diverged
from expdesign.estimation.regression import (
    STEADY_CURRENT,
    Layout,
    batch_signs,
    build_layout,
    measured_table,
    model_for,
    slopes,
)
from expdesign.information.moments import (
    HEADINGS,
    RUNS_AT_ONCE,
    PrimitiveInformation,
    log_det_or_none,
    rows_of,
    signals_of,
)
from expdesign.information.scoring import score_primitives
from expdesign.signals import Batch, Commands, Record, Trajectory
from expdesign.simulation import CALM, Environment, deliver, delivered, simulate_many, to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel
from expdesign.vessel.structures import Signals

UNSEEN_CURRENT = 1e-9  # correlation matrices' relative eigenvalue below which a current is not told from the means


def current_rows(vessel: Vessel, trajectory: Trajectory, commands: Commands, environment: Environment) -> Array:
    """(k, n, 2) J at every command's start, in units of the noise of each equation.

    Equations count alike where the noise of one is not stated.
    """
    k = len(commands)
    pose, velocity = trajectory.pose[:k], trajectory.velocity[:k]
    table = signals_of(vessel.model, (*pose.T, *velocity.T), commands.values.T, environment)
    return current_slopes(vessel, {name: np.broadcast_to(values, k) for name, values in table.items()}, pose[:, 2])


def current_slopes(vessel: Vessel, signals: Mapping[str, Array], heading_rad: Array) -> Array:
    """(k, n, 2) J, as of `current_rows`, for signals (k,) of terms at headings (k,)."""
    moved = slopes(vessel.model, vessel.model.parameters, {**signals, "psi": heading_rad})
    return np.asarray(moved.transpose(1, 2, 0) / _noise(vessel)[:, None])


def bordered_by_current(vessel: Vessel, M: Array, rows: Array, J: Array, parameters: Sequence[str], mean: str) -> Array:
    """(d + 2, d + 2) information about parameters, means and a steady current.

    Args:
        M: (d, d) sum over samples with the current known, as of `durations.bordered_moments`.
        rows: (k, all) values of terms.
        J: (k, n, 2) from `current_rows`.
        parameters: names of the p estimated ones.
        mean: subtraction, "none", "batch" or "complete".
    """
    model = vessel.model
    chosen = [model.names.index(name) for name in parameters]
    outputs = [model.outputs.index(model.terms[index].equation) for index in chosen]
    own = rows[:, chosen]
    if mean == "batch":
        own, J = own - own.mean(axis=0), J - J.mean(axis=0)
    cross = np.einsum("kp,kpc->pc", own, J[:, outputs])
    if mean == "complete":
        cross = np.concatenate([cross, J.sum(axis=0)])
    return np.block([[M, cross], [cross.T, np.einsum("knc,knd->cd", J, J)]])


def beside_current(whole: Array, parameters: int) -> Array:
    """(d, d) information that is left where the current is unknown; that of the means stays.

    Args:
        whole: (d + 2, d + 2) sum of `bordered_by_current`.
        parameters: number p of them; d - p means follow, then the current.

    Concave in `whole`, and zero between parameters and means, as both are eliminated at once: in data with one heading
    current and means cannot be distinguished.
    """
    p, d = parameters, len(whole) - len(STEADY_CURRENT)
    left = np.zeros((d, d))
    left[p:, p:] = whole[p:d, p:d]
    left[:p, :p] = whole[:p, :p] - whole[:p, p:] @ _pseudo_inverse(whole[p:, p:]) @ whole[p:, :p]
    return left


def slope_of_whole(whole: Array, parameters: int, slope: Array) -> Array:
    """(d + 2, d + 2) derivative by the whole information of what has derivative `slope` (d, d) by `beside_current`."""
    p, d = parameters, len(slope)
    left = np.concatenate([np.eye(p), -whole[:p, p:] @ _pseudo_inverse(whole[p:, p:])], axis=1)
    found = left.T @ slope[:p, :p] @ left
    found[p:d, p:d] += slope[p:, p:]
    return np.asarray(found)


def curved_beside_current(whole: Array, parameters: int, parts: Array) -> tuple[Callable[[Array], Array], Array]:
    """How `beside_current` changes with the weights of parts (c, d + 2, d + 2).

    Returns:
        a function from the derivative (p, p) of a measure by what is left about the ship's parameters to what its
        curvature gains, minus the second derivatives (c, c), and the first derivatives (c, d, d).
    """
    p, d = parameters, len(whole) - len(STEADY_CURRENT)
    inverse = _pseudo_inverse(whole[p:, p:])
    left = np.concatenate([np.eye(p), -whole[:p, p:] @ inverse], axis=1)
    seen = left @ parts  # (c, p, d + 2)
    moved = np.zeros((len(parts), d, d))
    moved[:, p:, p:] = parts[:, p:d, p:d]
    moved[:, :p, :p] = seen @ left.T
    rest = seen[:, :, p:]

    def gained(slope: Array) -> Array:
        told = slope @ rest @ inverse
        return np.asarray(2 * told.reshape(len(parts), -1) @ rest.reshape(len(parts), -1).T)

    return gained, moved


def _pseudo_inverse(M: Array) -> Array:
    """Pseudo-inverse of a positive semidefinite matrix, by its correlations."""
    scale = np.sqrt(np.diag(M))
    scale = np.where(scale > 0, scale, 1.0)
    inverse = np.linalg.pinv(M / np.outer(scale, scale), rcond=UNSEEN_CURRENT, hermitian=True)
    return np.asarray(inverse / np.outer(scale, scale))


def _noise(vessel: Vessel) -> Array:
    """(n,) noise variance of each output's equation, see `equation_noise`."""
    sensors, model = vessel.sensors, vessel.model
    of = {"u": sensors.velocity_mps, "v": sensors.velocity_mps, "r": sensors.yaw_rate_radps}
    noise = np.array([of[name] for name in model.outputs])
    return (
        np.sqrt(2.0) * noise * model.time_scale_s / vessel.sample_time_s if (noise > 0).all() else np.ones(len(noise))
    )


@dataclass(frozen=True, kw_only=True)
class AugmentedInformation:
    """A dictionary scored with nuisance regressors."""

    information: tuple[PrimitiveInformation, ...]  # of each primitive, about all columns
    parameters: tuple[str, ...]  # names of all columns: parameters of the ship, then of the disturbances
    interest: tuple[str, ...]  # names of the ship's parameters that are estimated
    equations: tuple[str, ...]  # of all columns


def score_augmented(
    vessel: Vessel,
    primitives: Sequence[Primitive],
    *,
    predictor: str,
    environment: Environment = CALM,
    fixed_parameters: Sequence[str] = (),
    mean_subtraction: str = "complete",
) -> AugmentedInformation:
    """Information of every primitive about the ship's parameters and the nuisance parameters of a predictor.

    Args:
        predictor: one with nuisance regressors, see `estimation.predictors`.
        environment: mean current and wind.
        fixed_parameters: held at the nominal values.
        mean_subtraction: "none", "batch" or "complete".

    Raises:
        UnknownName: no such predictor, parameter or mean subtraction.
        InputError: every parameter is fixed, or a term is of third order.
        Diverged: the nominal model is unstable.
    """
    basic = score_primitives(
        vessel,
        primitives,
        environment=environment,
        fixed_parameters=fixed_parameters,
        mean_subtraction=mean_subtraction,
    )
    batches = _measured(vessel, primitives, environment)
    record = Record(batches=tuple(batches))
    model = model_for(vessel.model, record)
    layout = build_layout(model, record, predictor=predictor, fixed=fixed_parameters)
    found = [_moments(layout, batch) for batch in batches]
    information = []
    for number, item in enumerate(basic):
        own = found[number * HEADINGS : (number + 1) * HEADINGS]
        X, Y = np.mean([X for X, _ in own], axis=0), np.mean([Y for _, Y in own], axis=0)
        YZ = np.mean([Y @ Y.T for _, Y in own], axis=0)
        taken = {"none": np.zeros_like(X), "batch": YZ, "complete": Y @ Y.T}[mean_subtraction]
        alone = log_det_or_none(X - taken, np.diag(X))
        information.append(replace(item, X=X, Y=Y, Z=Y, YZ=YZ, log_det_alone=alone))
    equation = {term.name: term.equation for term in model.terms}
    return AugmentedInformation(
        information=tuple(information),
        parameters=layout.names,
        interest=layout.parameters,
        equations=(*(equation[name] for name in layout.parameters), *(item.equation for item in layout.nuisance)),
    )


def _measured(vessel: Vessel, primitives: Sequence[Primitive], environment: Environment) -> list[Batch]:
    """Noise-free runs of every primitive on every heading, in this order, as they would be measured.

    Runs of one length are simulated together. Inputs are what the actuators deliver.
    """
    headings = 2 * np.pi * np.arange(HEADINGS) / HEADINGS
    current_b = np.stack(to_body(environment.current_to, headings, NUMPY), axis=1)
    pose = np.pad(headings[:, None], ((0, 0), (2, 0)))
    lengths: dict[tuple[int, float], list[int]] = {}
    for index, primitive in enumerate(primitives):
        commands = primitive.commands
        lengths.setdefault((len(commands), commands.sample_time_s), []).append(index)
    found: dict[int, list[Batch]] = {}
    for members in lengths.values():
        some = [primitives[index] for index in members]
        states = simulate_many(
            vessel,
            np.repeat([primitive.commands.values for primitive in some], HEADINGS, axis=0),
            pose=np.tile(pose, (len(some), 1)),
            velocity=np.concatenate([item.entry_velocity + np.pad(current_b, ((0, 0), (0, 1))) for item in some]),
            current_to=np.tile(environment.current_to, (len(some) * HEADINGS, 1)),
            wind_to=np.tile(environment.wind_to, (len(some) * HEADINGS, 1)),
            parameters=np.tile(vessel.model.parameters, (len(some) * HEADINGS, 1)),
            standing=np.repeat([primitive.entry_inputs for primitive in some], HEADINGS, axis=0),
        )
        for place, index in enumerate(members):
            own = states[:-1, place * HEADINGS : (place + 1) * HEADINGS]
            if not np.isfinite(own).all():
                raise Diverged(
                    f"vessel {vessel.name!r}: the model is unstable under the commands of {some[place].name!r}"
                )
            found[index] = [_batch(vessel, some[place], own[:, heading], environment) for heading in range(HEADINGS)]
    return [batch for index in range(len(primitives)) for batch in found[index]]


def _batch(vessel: Vessel, primitive: Primitive, states: Array, environment: Environment) -> Batch:
    """One run from its states (k, 6)."""
    pose, velocity = states[:, :3], states[:, 3:]
    wind_b = np.stack(to_body(environment.wind_to, pose[:, 2], NUMPY), axis=1)
    return Batch(
        name=primitive.name,
        sample_time_s=primitive.commands.sample_time_s,
        input_names=primitive.commands.names,
        inputs=delivered(vessel, primitive.commands, standing=primitive.entry_inputs).values,
        velocity=velocity,
        pose=pose,
        wind=velocity[:, :2] - wind_b,
    )


def _moments(layout: Layout, batch: Batch) -> tuple[Array, Array]:
    table = measured_table(layout.model, batch, wind_measured=layout.predictor.wind)
    rows = layout.rows(table, batch_signs(layout.nuisance, table), used=slice(None), scale=1.0)  # (k, n, p)
    return np.einsum("kni,knj->ij", rows, rows) / len(rows), rows.mean(axis=0).T


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
        commands: (n, k, m) commands of each run.
        velocity: (n, 3) entry velocities through water.
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
