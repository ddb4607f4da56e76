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

SINGULAR = 1e-13
"""Eigenvalues below this, relative to the largest, are rounding."""


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
