"""Information about effects inverted in units of their own, so that what is found does not depend on SI units.

A tanker turns at milliradians a second. In SI units her data have 1e17 times the information about a coefficient of u
that they have about one of r^3, whose standard error may still be a fifth of it. An inverse that takes so small a part
of a matrix for rounding takes that coefficient for known exactly. So every matrix is inverted in units in which each
effect alone has information one; what is small there, other effects imitate.
"""

from __future__ import annotations

import numpy as np
import scipy

from expdesign.values import Array

LEAST_PIVOT = 1e-6  # of a matrix with a unit diagonal that counts as regular: the size of a direction beside all others
LEAST_EIGENVALUE = LEAST_PIVOT**2  # of such a matrix; what is below it is rounding


def covariance_of(A: Array) -> Array:
    """(c, c) covariance of effects of information A (c, c).

    A direction that data do not tell has a large variance, of `1 / LEAST_EIGENVALUE` in own units, not none.
    """
    values, directions = _directions(A)
    root = directions / np.sqrt(np.maximum(values, LEAST_EIGENVALUE))
    return np.asarray(root @ root.T)


def pseudo_inverse_of(A: Array) -> Array:
    """(c, c) inverse of information A (c, c) among the directions that data tell, zero along others.

    For what effects imitate: a direction that data do not tell imitates nothing. As variances these zeros are wrong.
    """
    values, directions = _directions(A)
    told = values > LEAST_EIGENVALUE
    return np.asarray((directions[:, told] / values[told]) @ directions[:, told].T)


def solution_of(A: Array, b: Array) -> Array:
    """x (c,) of A x = b by Cholesky's method, in own units; of a singular A the shortest one there."""
    if len(b) and (np.diag(A) > 0).all():
        size = _sizes(A)
        root, x, failed = scipy.linalg.lapack.dposv(A / np.outer(size, size), b / size)
        if not failed and np.diag(root).min() > LEAST_PIVOT:
            return np.asarray(x / size)
    return np.asarray(pseudo_inverse_of(A) @ b)


def _directions(A: Array) -> tuple[Array, Array]:
    """(c,) eigenvalues in own units, and (c, c) their directions, in the units of A, side by side."""
    size = _sizes(A)
    values, vectors = np.linalg.eigh(A / np.outer(size, size))
    return values, vectors / size[:, None]


def _sizes(A: Array) -> Array:
    """(c,) square roots of the information about each effect alone; one where there is none."""
    own = np.diag(A)
    return np.sqrt(np.where(own > 0, own, 1.0))
