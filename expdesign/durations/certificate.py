"""The equivalence theorem: what any design is worth, computed from the problem alone.

For f(w) = log det B(w), B(w) = sum_q w_q B_q with B_q positive semidefinite, the sensitivities
d_q = trace(B(w)^-1 B_q) are the gradient of f, their w-weighted mean is the dimension, and concavity bounds every
other design by f(w) + max_q d_q - dimension.

Source: J. Kiefer and J. Wolfowitz, The equivalence of two extremum problems, Canad. J. Math. 12 (1960), 363-366.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from expdesign.values import Array


def scaled(matrices: Array) -> tuple[Array, float]:
    """Matrices (q, d, d) with unit mean diagonal, and what the scaling took off every log det.

    Parameters span many orders of magnitude; a diagonal scaling changes no design and no sensitivity, only accuracy.
    """
    scale = np.sqrt(np.mean([np.diag(matrix) for matrix in matrices], axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    return matrices / np.outer(scale, scale), float(2 * np.log(scale).sum())


def log_det(matrices: Array, fractions: Array) -> float:
    """log det of sum_q w_q B_q, or -inf when it is not positive definite."""
    total = np.tensordot(fractions, matrices, axes=1)
    sign, value = np.linalg.slogdet(total)
    return float(value) if sign > 0 and np.linalg.eigvalsh(total)[0] > 0 else -np.inf


def sensitivities(matrices: Array, fractions: Array) -> Array:
    """(q,) d_q = trace(B(w)^-1 B_q).

    Raises:
        numpy.linalg.LinAlgError: B(w) is not positive definite.
    """
    factor = cho_factor(np.tensordot(fractions, matrices, axes=1))
    inverse = cho_solve(factor, np.eye(matrices.shape[1]))
    return np.asarray(np.einsum("ij,qji->q", inverse, matrices))
