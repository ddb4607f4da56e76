"""Information of many candidate runs at once: the matrices of `moments`, without primitives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.information.moments import rows_of, signals_of
from expdesign.information.tuning import TUNING
from expdesign.simulation import Environment, deliver, simulate_many, to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel


def bordered_runs(
    vessel: Vessel,
    commands: Array,
    velocity: Array,
    names: Sequence[str],
    *,
    environment: Environment,
    mean_subtraction: str,
    standing: Array | None = None,
) -> tuple[Array, Array]:
    """B (n, d, d) of many runs, and their motion through calm water (n, k + 1, 3).

    The same numbers as `score_primitives` and `durations.bordered` give run by run; nan where a run diverges.

    Args:
        vessel: nominal.
        commands: (n, k, m) commands of each run.
        velocity: (n, 3) entry velocities through water.
        names: parameters to estimate.
        environment: mean current and wind; information is averaged over headings in them.
        mean_subtraction: "none", "batch" or "complete".
        standing: (n, m) commands before the first sample; None for those of the first sample.
    """
    start = (velocity, commands[:, 0] if standing is None else standing)
    given = deliver(
        vessel.responses, commands.transpose(1, 2, 0), sample_time_s=vessel.sample_time_s, standing=start[1].T
    )[:, 0]
    calm = _states(vessel, commands, start, Environment(), 0.0)
    if environment.isotropic:
        pieces = [_matrices(vessel, calm, given, names, Environment(), mean_subtraction)]
    else:
        pieces = []
        for heading in 2 * np.pi * np.arange(TUNING.headings) / TUNING.headings:
            states = _states(vessel, commands, start, environment, float(heading))
            pieces.append(_matrices(vessel, states, given, names, environment, mean_subtraction))
    return np.mean(pieces, axis=0), calm[..., 3:].transpose(1, 0, 2)


def _states(
    vessel: Vessel, commands: Array, start: tuple[Array, Array], environment: Environment, heading: float
) -> Array:
    """(k + 1, n, 6) from entry velocities (n, 3) through water and standing commands (n, m)."""
    runs = len(commands)
    current_b = np.array([*to_body(environment.current_to, heading, NUMPY), 0.0])
    return simulate_many(
        vessel,
        commands,
        pose=np.tile([0.0, 0.0, heading], (runs, 1)),
        velocity=start[0] + current_b,
        current_to=np.tile(environment.current_to, (runs, 1)),
        wind_to=np.tile(environment.wind_to, (runs, 1)),
        parameters=np.tile(vessel.model.parameters, (runs, 1)),
        standing=start[1],
    )


def _matrices(
    vessel: Vessel,
    states: Array,
    given: Array,
    names: Sequence[str],
    environment: Environment,
    mean_subtraction: str,
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
        X = np.where(same, kept @ kept.transpose(0, 2, 1) / kept.shape[2], 0.0)
        Y = np.where(member, kept.mean(axis=2)[:, :, None], 0.0)
    if mean_subtraction == "none":
        return np.asarray(X)
    if mean_subtraction == "batch":
        return np.asarray(X - Y @ Y.transpose(0, 2, 1))
    unit = np.broadcast_to(np.eye(len(model.outputs)), (len(X), len(model.outputs), len(model.outputs)))
    return np.concatenate(
        [np.concatenate([X, Y], axis=2), np.concatenate([Y.transpose(0, 2, 1), unit], axis=2)], axis=1
    )
