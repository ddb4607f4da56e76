"""From a rough design to one at machine accuracy: an interior-point method on the primitives that matter.

log det B(w) + mu sum_q log w_q is maximised by Newton's method for a falling mu; at its maximum every sensitivity is at
most dimension + (number of primitives) mu. Only a working set of primitives takes part; those outside that turn out
with a sensitivity above the dimension join it, until none does.

Source: S. Boyd and L. Vandenberghe, Convex Optimization (2004), chapter 11; multiplicative algorithm: S. D. Silvey,
D. M. Titterington and B. Torsney, An algorithm for optimal designs on a design space, Comm. Statist. A7 (1978),
1379-1389.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from expdesign.durations.certificate import log_det, sensitivities
from expdesign.values import Array

WARM_UP = 30
"""Multiplicative steps that sort the primitives before the interior-point method; they are cheap and never lose."""
MIXED_IN = 0.02
"""Share of equal fractions mixed into every start, so that it lies inside."""
SMALLEST_SET = 50
"""Primitives in the working set at least; also as many as may join at a time."""
NEWTON_STEPS = 60
"""Bound on the steps for one barrier; a handful is usual."""


def polish(matrices: Array, fractions: Array, *, tolerance: float = 1e-10, rounds: int = 50) -> Array:
    """Fractions (q,) improved until max d_q - dimension is below `tolerance` x dimension, or rounds run out.

    Args:
        matrices: (q, d, d) whitened B_q.
        fractions: (q,) start on the simplex; B of it may be singular.
        tolerance: relative certificate to reach.
        rounds: how often the working set may grow.
    """
    size = matrices.shape[1]
    weights = _inside(fractions)
    for _ in range(WARM_UP):
        weights = weights * sensitivities(matrices, weights)
        weights = weights / weights.sum()
    chosen = _largest(matrices, weights)
    for _ in range(rounds):
        weights = np.zeros(len(matrices))
        weights[chosen] = _interior(matrices[chosen], tolerance=tolerance / 2)
        excess = sensitivities(matrices, weights) - size * (1.0 + tolerance)
        worst = np.argsort(-excess)[:SMALLEST_SET]
        joining = np.setdiff1d(worst[excess[worst] > 0], chosen)
        if not len(joining):
            break
        chosen = np.r_[chosen, joining]
    return _without_crumbs(matrices, weights, tolerance)


def _inside(fractions: Array) -> Array:
    return np.asarray((1.0 - MIXED_IN) * fractions + MIXED_IN / len(fractions))


def _largest(matrices: Array, weights: Array) -> NDArray[np.intp]:
    """Indices of the primitives with the largest weights, enough of them to inform about everything."""
    order = np.argsort(-weights)
    first = order[: max(SMALLEST_SET, 4 * matrices.shape[1])]
    alone = np.zeros_like(weights)
    alone[first] = 1.0 / len(first)
    return first if np.isfinite(log_det(matrices, alone)) else order


def _interior(matrices: Array, *, tolerance: float) -> Array:
    """The optimal fractions of all given primitives, each of them positive."""
    count, size = len(matrices), matrices.shape[1]
    weights, barrier = np.full(count, 1.0 / count), size / count
    while count * barrier > tolerance * size:
        barrier = barrier / 10
        weights = _centre(matrices, weights, barrier)
    return weights


def _centre(matrices: Array, weights: Array, barrier: float) -> Array:
    """Maximise log det B(w) + barrier x sum log w under sum w = 1 by Newton's method in relative steps dw / w.

    Near the maximum, where the decrement is small against the barrier, full steps are safe, because both terms are
    self-concordant; farther away the step is halved until it gains.
    """
    for _ in range(NEWTON_STEPS):
        step, decrement = _newton(matrices, weights, barrier)
        length = min(1.0, 0.99 / max(-float(step.min()), 1e-300))
        if decrement > 0.05 * barrier:
            value = _merit(matrices, weights, barrier)
            while _merit(matrices, weights * (1 + length * step), barrier) < value + 0.1 * length * decrement:
                length /= 2
                if length < 1e-10:
                    return weights
        weights = weights * (1 + length * step)
        weights = weights / weights.sum()
        if decrement < 1e-6 * barrier:
            break
    return weights


def _merit(matrices: Array, weights: Array, barrier: float) -> float:
    sign, value = np.linalg.slogdet(np.tensordot(weights, matrices, axes=1))
    return float(value + barrier * np.log(weights).sum()) if sign > 0 else -np.inf


def _newton(matrices: Array, weights: Array, barrier: float) -> tuple[Array, float]:
    """The Newton step dw / w (q,) of the barrier problem and its squared decrement."""
    root = np.linalg.inv(np.linalg.cholesky(np.tensordot(weights, matrices, axes=1)))
    parts = weights[:, None, None] * (root @ matrices @ root.T)
    slope = np.trace(parts, axis1=1, axis2=2) + barrier
    flat = parts.reshape(len(parts), -1)
    curvature = flat @ flat.T + barrier * np.eye(len(parts))
    free, price = cho_solve(cho_factor(curvature), np.stack([slope, weights], axis=1)).T
    step = free - (weights @ free) / (weights @ price) * price
    return step, float(step @ curvature @ step)


def _without_crumbs(matrices: Array, weights: Array, tolerance: float) -> Array:
    """The same with zero where only the barrier kept a fraction above it, if the certificate stands that."""
    kept = np.flatnonzero(weights > 1e-7)
    trimmed = np.zeros_like(weights)
    alone = weights[kept] / weights[kept].sum()
    trimmed[kept] = alone
    if len(kept) == len(weights) or not np.isfinite(log_det(matrices, trimmed)):
        return weights
    trimmed[kept] = _centre(matrices[kept], alone, tolerance * matrices.shape[1] / (10 * len(kept)))
    gap, before = (float(sensitivities(matrices, w).max()) / matrices.shape[1] - 1 for w in (trimmed, weights))
    return trimmed if gap <= max(before, 10 * tolerance) else weights
