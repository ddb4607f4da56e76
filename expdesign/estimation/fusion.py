"""Weighted fusion of independent estimates of the same parameters.

    P = (sum P_i^-1)^-1,   theta = P sum P_i^-1 theta_i

Source: F. Ljungberg, doctoral thesis, Linköping University, (7.61)-(7.63).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.errors import InputError
from expdesign.values import Array


def fuse(values: Sequence[Array], covariances: Sequence[Array]) -> tuple[Array, Array]:
    """Estimate (p,) and covariance (p, p) from independent estimates (p,) with covariances (p, p).

    Fusing pairwise, one after the other, gives the same: the recursive form needs no code of its own.

    Raises:
        InputError: nothing to fuse, or a covariance that is not positive definite.
    """
    if not values or len(values) != len(covariances):
        raise InputError(f"fusion needs as many covariances as estimates, found {len(covariances)} and {len(values)}")
    scale = np.sqrt(np.diag(covariances[0]))
    if not (scale > 0).all():
        raise InputError("fusion needs positive variances")
    information, weighted = np.zeros((len(scale),) * 2), np.zeros(len(scale))
    for theta, P in zip(values, covariances, strict=True):
        part = _inverse(P / np.outer(scale, scale))
        information += part
        weighted += part @ (theta / scale)
    fused = _inverse(information)
    return scale * (fused @ weighted), fused * np.outer(scale, scale)


def _inverse(matrix: Array) -> Array:
    symmetric = (matrix + matrix.T) / 2
    try:
        factor = np.linalg.inv(np.linalg.cholesky(symmetric))
    except np.linalg.LinAlgError:
        raise InputError("fusion needs positive definite covariances") from None
    return np.asarray(factor.T @ factor)
