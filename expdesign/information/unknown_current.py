"""Information about a ship that is left where a steady current is unknown.

The current enters as two parameters more, c to north and to east, by the regressors of `estimation.regression.current`.
What remains about the ship's parameters is the Schur complement of their block. For runs of unknown heading the current
makes no difference: over evenly spread headings the products of J(psi), which turns with the ship, and the regressors,
which do not, are zero on average.

Source: F. Pukelsheim, Optimal Design of Experiments (2006), 3.10 for the information about a subsystem.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from expdesign.estimation.regression import STEADY_CURRENT, slopes
from expdesign.information.moments import signals_of
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Environment
from expdesign.values import Array
from expdesign.vessel import Vessel

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
        vessel: gives the terms.
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
