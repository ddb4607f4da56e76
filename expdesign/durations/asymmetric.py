"""Recorded or noisy primitives: B_q is not symmetric, and |det B(w)| is not concave in logarithm.

The symmetric part gives a concave problem. Where sym B is positive definite, det(sym B) <= |det B|, so its optimum is
a guaranteed value. A local search from there improves |det B| itself, without a certificate. Where no fractions make
sym B positive definite, only the local search remains.

Source: A. M. Ostrowski and O. Taussky, On the variation of the determinant of a positive definite matrix, Indagationes
Math. 13 (1951), 383-385; F. Ljungberg, doctoral thesis, Linköping University, (7.57), (7.9).
"""

from __future__ import annotations

import numpy as np
import scipy

from expdesign.durations.concave import symmetric_part, unit_scaling
from expdesign.durations.limits import Polytope
from expdesign.durations.problem import DurationProblem
from expdesign.durations.tuning import TUNING
from expdesign.errors import NotInformative
from expdesign.values import Array


def definite_start(problem: DurationProblem, polytope: Polytope) -> Array | None:
    """Fractions (q,) that make sym B positive definite, or None where there are none."""
    from expdesign.durations.maximise._cvxpy import largest_least_eigenvalue

    matrices, prior = (symmetric_part(item) for item in _unit_scaled(problem))
    w = largest_least_eigenvalue(matrices, prior, polytope)
    if w is None:
        return None
    w = polytope.tidied(w)
    return w if np.linalg.eigvalsh(prior + np.tensordot(w, matrices, axes=1))[0] > TUNING.definite else None


def improved(problem: DurationProblem, polytope: Polytope, start: Array | None) -> Array:
    """Fractions (q,) with log |det B| no lower than at the start, by sequential quadratic programming.

    Args:
        problem: with matrices that need not be symmetric.
        polytope: limits.
        start: (q,), or None for `Tuning.starts` random ones.

    Raises:
        NotInformative: |det B| is zero wherever the search began.
    """
    q = len(problem.names)
    rng = np.random.default_rng(0)
    starts = [start] if start is not None else [rng.dirichlet(np.ones(q)) for _ in range(TUNING.starts)]
    matrices, prior = _unit_scaled(problem)

    def minus(w: Array) -> tuple[float, Array]:
        M = prior + np.tensordot(w, matrices, axes=1)
        value = np.linalg.slogdet(M)[1]
        if not np.isfinite(value):
            return 1e9, np.zeros(q)
        return -float(value), -np.einsum("ij,qji->q", np.linalg.inv(M), matrices)

    found = [start] if start is not None else []
    for w in starts:
        answer = scipy.optimize.minimize(
            minus,
            w,
            jac=True,
            method="SLSQP",
            bounds=list(zip(polytope.least, polytope.most, strict=True)),
            constraints=[
                {"type": "eq", "fun": lambda v: v.sum() - 1.0, "jac": lambda v: np.ones(q)},
                *(
                    {"type": "ineq", "fun": lambda v, r=r, c=c: c - r @ v, "jac": lambda v, r=r: -r}
                    for r, c in zip(polytope.rows, polytope.limits, strict=True)
                ),
            ],
            options={"maxiter": 500, "ftol": 1e-13},
        )
        found.append(polytope.tidied(answer.x))
    values = [-minus(w)[0] if _keeps(w, polytope) else -np.inf for w in found]
    if max(values) <= -1e9:
        raise NotInformative(
            "the recorded primitives do not inform about every parameter: the determinant is zero for all fractions "
            "that were tried",
            parameters=problem.parameters,
        )
    return found[int(np.argmax(values))]


def log_abs_det(problem: DurationProblem, fractions: Array, *, symmetric: bool = False) -> float:
    """log |det B(w)| in physical scale, or of the symmetric part; -inf where that is not positive definite."""
    M = problem.prior + np.tensordot(fractions, problem.matrices, axes=1)
    size = np.sqrt(np.where(np.abs(np.diag(M)) > 0, np.abs(np.diag(M)), 1.0))
    scaled = M / np.outer(size, size)
    if symmetric:
        values = np.linalg.eigvalsh(symmetric_part(scaled))
        return float(np.log(values).sum() + 2 * np.log(size).sum()) if values[0] > 0 else -np.inf
    return float(np.linalg.slogdet(scaled)[1] + 2 * np.log(size).sum())


def _unit_scaled(problem: DurationProblem) -> tuple[Array, Array]:
    """(q, d, d) and (d, d) with unit mean magnitude on the diagonal."""
    size = unit_scaling(problem)
    return problem.matrices / np.outer(size, size), problem.prior / np.outer(size, size)


def _keeps(w: Array, polytope: Polytope) -> bool:
    return bool((w <= polytope.most + 1e-9).all() and (polytope.rows @ w <= polytope.limits + 1e-8).all())
