"""Gram matrices of whitened sensitivities, with initial states projected out and the random current integrated out.

These small matrices suffice for steps, covariances, score tests and likelihoods.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.diagnosis.data import Noise, random_current_covariance, whitened
from expdesign.diagnosis.fit.linear_model import Sensitivities
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class GramMatrices:
    """Inner products of whitened sensitivities, per window, initial states projected out.

    Attributes:
        XX: (w, c, c); Xe: (w, c); ee: (w,).
    """

    XX: Array
    Xe: Array
    ee: Array


def gram_matrices(found: Sensitivities, noise: Noise) -> GramMatrices:
    """Whiten, leave out samples that are not measured, project the initial states out."""
    e, S, seen = _whitened_starts(found, found.error, noise)
    w = len(e)
    X = (whitened(found.values, noise) * seen).reshape(len(found.values), w, e.shape[1])
    SS = np.swapaxes(S, 1, 2) @ S
    scale = np.trace(SS, axis1=1, axis2=2)[:, None, None] / SS.shape[1]
    SS = SS + (1e-9 * scale + 1e-12) * np.eye(SS.shape[1])
    XX, Xe, ee = [], [], []
    for index in range(w):
        A, b, B = X[:, index], e[index], S[index]
        AB = A @ B
        half = np.linalg.solve(SS[index], np.column_stack([AB.T, B.T @ b]))
        XX.append(A @ A.T - AB @ half[:, :-1])
        Xe.append(A @ b - AB @ half[:, -1])
        ee.append(b @ b - (B.T @ b) @ half[:, -1])
    return GramMatrices(XX=np.array(XX), Xe=np.array(Xe), ee=np.array(ee))


def _whitened_starts(found: Sensitivities, error: Array, noise: Noise) -> tuple[Array, Array, NDArray[np.bool_]]:
    """(w, rows) whitened error, (w, rows, 3) sensitivities to initial velocities, and (w, s, 4) whether it is measured.

    The first two are zero where nothing is measured.
    """
    rows = whitened(error, noise)
    seen = np.isfinite(rows)
    w = len(rows)
    S = np.moveaxis((whitened(found.starts, noise) * seen).reshape(len(found.starts), w, -1), 0, -1)
    return np.where(seen, rows, 0.0).reshape(w, -1), S, seen


def initial_state_steps(found: Sensitivities, error: Array, noise: Noise) -> Array:
    """(w, 3) change of the initial velocities that explains most of an error (w, s, 4)."""
    e, S, _ = _whitened_starts(found, error, noise)
    return np.stack([np.linalg.lstsq(B, b, rcond=None)[0] for B, b in zip(S, e, strict=True)])


@dataclass(frozen=True, kw_only=True, eq=False)
class MarginalInformation:
    """Information about the estimated effects once the random current is integrated out.

    Attributes:
        A: (c, c) information matrix.
        s: (c,) scores.
        each: (w, c) scores per window.
        quadratic: e' V^-1 e.
        log_det: of V beyond the white part.
    """

    A: Array
    s: Array
    each: Array
    quadratic: float
    log_det: float


def marginalised(grams: GramMatrices, found: Sensitivities, noise: Noise) -> MarginalInformation:
    """Integrate the random current out."""
    c = found.numbers
    A, s = grams.XX[:, :c, :c], grams.Xe[:, :c]
    if noise.current_std_mps == 0.0 or found.knot_count == 0:
        return MarginalInformation(
            A=A.sum(axis=0), s=s.sum(axis=0), each=s, quadratic=float(grams.ee.sum()), log_det=0.0
        )
    prior = current_prior(found, noise)
    ZZ, ZX, Ze = grams.XX[:, c:, c:] + np.linalg.inv(prior), grams.XX[:, c:, :c], grams.Xe[:, c:]
    solved = np.linalg.solve(ZZ, np.concatenate([ZX, Ze[..., None]], axis=2))
    each = s - np.einsum("wzc,wz->wc", ZX, solved[..., -1])
    log_det = np.linalg.slogdet(ZZ)[1].sum() + len(ZZ) * np.linalg.slogdet(prior)[1]
    return MarginalInformation(
        A=(A - np.swapaxes(ZX, 1, 2) @ solved[..., :-1]).sum(axis=0),
        s=each.sum(axis=0),
        each=each,
        quadratic=float(grams.ee.sum() - np.einsum("wz,wz->", Ze, solved[..., -1])),
        log_det=float(log_det),
    )


def current_prior(found: Sensitivities, noise: Noise) -> Array:
    """(z, z) covariance of the random current at its knots, north before east [m^2/s^2]."""
    unit = random_current_covariance(found.knot_count, found.spacing_s, noise.current_time_s)
    return np.asarray(noise.current_std_mps**2 * unit)


def information(found: Sensitivities, noise: Noise) -> MarginalInformation:
    """Marginal information of sensitivities under some noise."""
    return marginalised(gram_matrices(found, noise), found, noise)
