"""Equivalence theorems: what any design is worth, computed from the problem alone.

For f(w) = log det B(w), B(w) = sum_q w_q B_q with B_q positive semidefinite, the sensitivities
d_q = trace(B(w)^-1 B_q) are the gradient of f, their w-weighted mean is the dimension, and concavity bounds every
other design by f(w) + max_q d_q - dimension. The same goes for every concave criterion, with limits at their prices,
and for the average or the least over several models with a mixture of their tangents.

Source: J. Kiefer and J. Wolfowitz, The equivalence of two extremum problems, Canad. J. Math. 12 (1960), 363-366;
F. Pukelsheim, Optimal Design of Experiments (2006), 7.19-7.23 (general equivalence theorem) and 11 (mixtures).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from expdesign.durations.interior import Interior, Task
from expdesign.durations.objective import SINGULAR
from expdesign.durations.values import Certificate
from expdesign.values import Array

BLURS = (1.0, 10.0, 100.0)
"""Multiples of the last barrier that are tried for the mixture of tangents; every one gives a valid bound."""


def scaled(matrices: Array) -> tuple[Array, float]:
    """Matrices (q, d, d) with unit mean diagonal, and what the scaling took off every log det.

    Parameters span many orders of magnitude; a diagonal scaling changes no design and no sensitivity, only accuracy.
    """
    scale = np.sqrt(np.mean([np.diag(matrix) for matrix in matrices], axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    return matrices / np.outer(scale, scale), float(2 * np.log(scale).sum())


def whitened(matrices: Array) -> tuple[Array, float]:
    """Matrices (q, d, d) whose mean is the identity, and what the transformation took off every log det.

    Any congruence leaves designs and sensitivities as they are. This one makes the equal-share design perfectly
    conditioned, so that nearly collinear parameters cost the solver no accuracy.

    Raises:
        numpy.linalg.LinAlgError: the mean is not positive definite.
    """
    diagonal, offset = scaled(matrices)
    factor = np.linalg.cholesky(diagonal.mean(axis=0))
    inverse = np.linalg.inv(factor)
    white = inverse @ diagonal @ inverse.T
    return (white + white.transpose(0, 2, 1)) / 2, offset + 2 * float(np.log(np.diag(factor)).sum())


def log_det(matrices: Array, fractions: Array) -> float:
    """log det of sum_q w_q B_q, or -inf when it is singular to working precision.

    The matrices should be scaled or whitened: singular means an eigenvalue below `SINGULAR` times the largest.
    """
    eigenvalues = np.linalg.eigvalsh(np.tensordot(fractions, matrices, axes=1))
    return float(np.log(eigenvalues).sum()) if eigenvalues[0] > SINGULAR * eigenvalues[-1] else -np.inf


def sensitivities(matrices: Array, fractions: Array) -> Array:
    """(q,) d_q = trace(B(w)^-1 B_q).

    Raises:
        numpy.linalg.LinAlgError: B(w) is not positive definite.
    """
    factor = cho_factor(np.tensordot(fractions, matrices, axes=1))
    inverse = cho_solve(factor, np.eye(matrices.shape[1]))
    return np.asarray(np.einsum("ij,qji->q", inverse, matrices))


def certify(task: Task, found: Interior, *, kind: str) -> tuple[Certificate, Array]:
    """The best bound that tangents at a design give, and the criterion's sensitivities (q,) there.

    Args:
        task: the problem.
        found: the design, with guesses of the limits' prices; the bound holds whatever they are.
        kind: the theorem, in words.

    Raises:
        numpy.linalg.LinAlgError: the design is singular.
    """
    tried = [_certified(task, found, blur * found.barrier, kind) for blur in BLURS]
    return min(tried, key=lambda pair: pair[0].bound)


def _certified(task: Task, found: Interior, blur: float, kind: str) -> tuple[Certificate, Array]:
    w, polytope = found.fractions, task.polytope
    tangent = task.objective.tangent(w, blur)
    value, slope = tangent.value, np.array(tangent.slope)
    for floor, price in zip(task.floors, found.floor_prices, strict=True):
        bound = floor.tangent(w, blur)
        value, slope = value + price * bound.value, slope + price * bound.slope
    bounds = {polytope.bound(slope, prices): prices for prices in (found.prices, polytope.prices(slope))}
    prices = bounds[min(bounds)]
    net = slope - polytope.rows.T @ prices
    level = _level(task, w, net)
    net = np.where(w >= polytope.most - 1e-9, np.minimum(net, level), net)
    names = (*polytope.labels, *task.floor_names)
    certificate = Certificate(
        kind=kind,
        value=task.objective.value(w),
        bound=float(value - slope @ w + min(bounds)),
        degree=task.objective.pieces[0].measure.degree,
        level=level,
        mixture=tangent.mixture,
        prices=tangent.slope - net,
        multipliers=dict(zip(names, (*prices.tolist(), *found.floor_prices.tolist()), strict=True)),
    )
    return certificate, tangent.slope


def _level(task: Task, w: Array, net: Array) -> float:
    """The net sensitivity of primitives whose time is free to move both ways."""
    least, most = task.polytope.least, task.polytope.most
    free = (w > least + 1e-6) & (w < np.where(most < 1.0, most - 1e-9, 2.0))
    if not free.any():
        return float(net[w > least - 1e-12].max())
    return float((w[free] * net[free]).sum() / w[free].sum())
