"""From a rough design to one at machine accuracy: Newton steps on the support, multiplicative steps around them.

Source: multiplicative algorithm: S. D. Silvey, D. M. Titterington and B. Torsney, An algorithm for optimal designs on
a design space, Comm. Statist. A7 (1978), 1379-1389.
"""

from __future__ import annotations

import numpy as np

from expdesign.durations.certificate import log_det, sensitivities
from expdesign.values import Array


def polish(matrices: Array, fractions: Array, *, tolerance: float = 1e-10, rounds: int = 200) -> Array:
    """Fractions (q,) improved until max d_q - dimension is below `tolerance` x dimension, or no step helps.

    Args:
        matrices: (q, d, d) scaled B_q.
        fractions: (q,) start with positive definite B(w).
        tolerance: relative certificate to reach.
        rounds: largest number of alternations.
    """
    size = matrices.shape[1]
    weights = 0.999 * fractions + 0.001 / len(fractions)
    best, best_gap = weights, np.inf
    for _ in range(rounds):
        for _ in range(20):
            weights = weights * sensitivities(matrices, weights) / size
            weights = weights / weights.sum()
        weights = _newton(matrices, _trimmed(matrices, weights))
        gap = float(sensitivities(matrices, weights).max()) / size - 1.0
        if gap < best_gap:
            best, best_gap = weights, gap
        if best_gap < tolerance:
            break
        weights = 0.9 * weights + 0.1 * _towards_best(matrices, weights)
    return best


def _trimmed(matrices: Array, weights: Array) -> Array:
    """Without primitives that are on their way out: little weight and a sensitivity below the dimension."""
    slack = matrices.shape[1] - sensitivities(matrices, weights)
    kept = np.where((weights < 1e-3) & (slack > 1e-9 * matrices.shape[1]), 0.0, weights)
    kept = kept / kept.sum()
    return kept if np.isfinite(log_det(matrices, kept)) else weights


def _towards_best(matrices: Array, weights: Array) -> Array:
    vertex = np.zeros_like(weights)
    vertex[np.argmax(sensitivities(matrices, weights))] = 1.0
    return np.asarray(0.01 * vertex + 0.99 * weights)


def _newton(matrices: Array, weights: Array, *, steps: int = 40) -> Array:
    """Newton's method for the support's weights under sum w = 1, staying positive and never losing log det."""
    value = log_det(matrices, weights)
    for _ in range(steps):
        support = np.flatnonzero(weights > 0)
        inverse = np.linalg.inv(np.tensordot(weights, matrices, axes=1))
        parts = inverse @ matrices[support]  # (s, d, d)
        gradient = np.trace(parts, axis1=1, axis2=2)
        hessian = np.einsum("aij,bji->ab", parts, parts)  # of minus log det
        s = len(support)
        system = np.block([[hessian, np.ones((s, 1))], [np.ones((1, s)), np.zeros((1, 1))]])
        step = np.linalg.lstsq(system, np.r_[gradient, 0.0], rcond=1e-13)[0][:s]
        reach = min(1.0, *(-w / d for w, d in zip(weights[support], step, strict=True) if d < 0), 1.0)
        moved = weights.copy()
        while reach > 1e-12:
            moved[support] = np.clip(weights[support] + reach * step, 0.0, None)
            moved[support[moved[support] < 1e-15]] = 0.0
            moved /= moved.sum()
            if (trial := log_det(matrices, moved)) >= value - 1e-14 * abs(value):
                break
            reach /= 2
        else:
            return weights
        small = np.abs(moved - weights).max() < 1e-15
        weights, value = moved, trial
        if small:
            break
    return weights
