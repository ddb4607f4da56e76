"""The only door to cvxpy: maximise log det of a weighted sum of positive semidefinite matrices."""

from __future__ import annotations

import warnings

import cvxpy as cp
import numpy as np

from expdesign.values import Array


def maximise_log_det(matrices: Array) -> Array | None:
    """Weights (q,) on the simplex that roughly maximise log det sum_q w_q B_q, or None if the solver gives none.

    The matrices (q, d, d) should be scaled to unit diagonal. The solver's status is not looked at: the caller
    certifies the weights from the problem.
    """
    count, size = len(matrices), matrices.shape[1]
    weights = cp.Variable(count, nonneg=True)
    flat = matrices.reshape(count, size * size).T
    total = cp.reshape(flat @ weights, (size, size), order="C")
    problem = cp.Problem(cp.Maximize(cp.log_det((total + total.T) / 2)), [cp.sum(weights) == 1])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an inaccurate answer is a start for the polish, its status no news
            problem.solve(solver=cp.CLARABEL)
    except cp.error.SolverError:
        return None
    if weights.value is None or not np.isfinite(weights.value).all():
        return None
    clipped = np.clip(weights.value, 0.0, None)
    return np.asarray(clipped / clipped.sum())
