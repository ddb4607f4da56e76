"""How much of the simulation error a slowly varying force that nobody measured would account for.

The force is piecewise linear in time, in every equation of motion. Its size follows from generalised cross-validation,
so it does not follow the noise.

Source: G. H. Golub, M. Heath and G. Wahba, Technometrics 21 (1979), 215-223.
"""

from __future__ import annotations

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.data import channel_std, linear_basis, white_noise
from expdesign.diagnosis.fit.gram_matrices import GramMatrices, gram_matrices
from expdesign.diagnosis.fit.linear_model import Sensitivities, build_sensitivities
from expdesign.diagnosis.fit.tuning import TUNING
from expdesign.diagnosis.motion import Disturbance, LinearisedMotion
from expdesign.values import Array


def unmeasured_force_share(linear: LinearisedMotion, outputs: tuple[str, ...]) -> Array:
    """(n,) share of the root mean square error of every output that the force takes away; 0 for nothing."""
    motion = linear.motion
    shape = (*motion.states.shape[:1], motion.states.shape[1] - 1, motion.states.shape[2])
    basis = linear_basis(shape[1], motion.windows.step_s, TUNING.force_spacing_s)
    columns = [OUTPUTS.index(name) for name in outputs]
    found = build_sensitivities(
        linear, [_pushing(axis, row, shape) for axis in columns for row in basis], random_current=False
    )
    size = channel_std(found.error)
    grams = gram_matrices(found, white_noise(np.where(size > 0, size, np.inf)))
    still = np.zeros((shape[0], len(found.values)))
    before, after = (_rms(found, grams, effects)[columns] for effects in (still, _smoothed(found, grams)))
    return np.asarray(np.maximum(1.0 - after / np.where(before > 0, before, 1.0), 0.0))


def _pushing(axis: int, row: Array, shape: tuple[int, ...]) -> Disturbance:
    force = np.zeros(shape)
    force[..., axis] = row
    return Disturbance(force=force, sensor=None)


def _smoothed(found: Sensitivities, grams: GramMatrices) -> Array:
    """(w, c) forces in every window, as strong as generalised cross-validation allows."""
    scale = np.sqrt(np.maximum(np.einsum("wcc->c", grams.XX) / len(grams.XX), 1e-300))
    values, vectors = np.linalg.eigh(grams.XX / np.outer(scale, scale))
    values = np.maximum(values, 0.0)
    along = np.einsum("wcz,wc->wz", vectors, grams.Xe / scale)
    rows = int(np.isfinite(found.error).sum())
    best: tuple[float, float] = (np.inf, 0.0)
    for penalty in TUNING.force_penalties:
        shrunk = values / (values + penalty)
        explained = (along**2 / (values + penalty) * (2.0 - shrunk)).sum()
        freedom = shrunk.sum() + grams.effect_starts.shape[0] * grams.effect_starts.shape[1]
        left = float((grams.ee.sum() - explained) / max(rows - freedom, 1.0) ** 2)
        best = min(best, (left, penalty))
    return np.asarray(np.einsum("wcz,wz->wc", vectors, along / (values + best[1])) / scale)


def _rms(found: Sensitivities, grams: GramMatrices, effects: Array) -> Array:
    """(4,) root mean square error once the forces and the initial velocities that go with them are taken away."""
    starts = grams.initial_state_steps(effects)
    rest = found.error - np.einsum("wc,cwsn->wsn", effects, found.values)
    rest = rest - np.einsum("wn,nwsk->wsk", starts, found.starts)
    seen = np.isfinite(rest)
    squares = np.where(seen, rest, 0.0) ** 2
    return np.asarray(np.sqrt(squares.sum(axis=(0, 1)) / np.maximum(seen.sum(axis=(0, 1)), 1)))
