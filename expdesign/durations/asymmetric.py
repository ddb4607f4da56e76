"""Recorded or noisy primitives: B_q is not symmetric, and |det B(w)| is not concave in logarithm.

Its symmetric part gives a concave problem, and where sym B is positive definite det(sym B) <= |det B|, so the optimum
found for it is a value that is guaranteed. From there |det B| itself is improved by a local search, which proves
nothing. Where no fractions make sym B positive definite, only the local search is left.

Source: A. M. Ostrowski and O. Taussky, On the variation of the determinant of a positive definite matrix, Indagationes
Math. 13 (1951), 383-385; F. Ljungberg, doctoral thesis, Linköping University, (7.57), (7.9).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog, minimize

from expdesign.durations.concave import symmetric_part
from expdesign.durations.limits import Polytope
from expdesign.durations.problem import DurationProblem
from expdesign.errors import NotInformative
from expdesign.values import Array

STARTS = 20
"""Random starts of the local search where nothing better is known."""
CUTS = 200
"""Eigenvector cuts that may be needed to show that no fractions make sym B positive definite."""
POSITIVE = 1e-10
"""Least eigenvalue of a scaled matrix that counts as positive."""


def definite_start(problem: DurationProblem, polytope: Polytope) -> tuple[Array | None, float]:
    """Fractions (q,) that make sym B positive definite, or None; and the largest least eigenvalue there can be.

    Found by cutting planes: every eigenvector x of a least eigenvalue cuts off where x^T B(w) x <= 0. The linear
    programme's optimum bounds the least eigenvalue of every mixture, in parameters scaled to unit mean squares.
    """
    matrices, prior = _unit_scaled(problem)
    matrices, prior = symmetric_part(matrices), symmetric_part(prior)
    w = polytope.inside()
    w = np.asarray(polytope.least / max(polytope.least.sum(), 1e-300)) if w is None else w
    cuts: list[Array] = []
    offsets: list[float] = []
    bound = np.inf
    for _ in range(CUTS):
        values, vectors = np.linalg.eigh(prior + np.tensordot(w, matrices, axes=1))
        if values[0] > POSITIVE:
            return w, float(values[0])
        for x in vectors[:, values <= max(POSITIVE, values[0] + 1e-9)].T:
            cuts.append(np.einsum("i,qij,j->q", x, matrices, x))
            offsets.append(float(x @ prior @ x))
        w, bound = _best_of_cuts(polytope, np.array(cuts), np.array(offsets))
        if bound <= POSITIVE:
            return None, bound
    return None, bound


def _best_of_cuts(polytope: Polytope, cuts: Array, offsets: Array) -> tuple[Array, float]:
    """Fractions that maximise the least of the cuts, and that value."""
    q = cuts.shape[1]
    A = np.block([[-cuts, np.ones((len(cuts), 1))], [polytope.rows, np.zeros((len(polytope.rows), 1))]])
    b = np.r_[offsets, polytope.limits]
    bounds = [*zip(polytope.least, polytope.most, strict=True), (None, None)]
    answer = linprog(np.r_[np.zeros(q), -1.0], A, b, np.r_[np.ones(q), 0.0][None], [1.0], bounds, method="highs")
    return np.asarray(answer.x[:-1]), float(answer.x[-1])


def improved(problem: DurationProblem, polytope: Polytope, start: Array | None, *, seed: int = 0) -> Array:
    """Fractions (q,) with log |det B| no lower than at the start, by sequential quadratic programming.

    Args:
        problem: with matrices that need not be symmetric.
        polytope: limits.
        start: (q,), or None for `STARTS` random ones.
        seed: of the random starts.

    Raises:
        NotInformative: |det B| is zero wherever the search began.
    """
    q = len(problem.names)
    rng = np.random.default_rng(seed)
    starts = [start] if start is not None else [rng.dirichlet(np.ones(q)) for _ in range(STARTS)]
    matrices, prior = _unit_scaled(problem)

    def minus(w: Array) -> tuple[float, Array]:
        M = prior + np.tensordot(w, matrices, axes=1)
        value = np.linalg.slogdet(M)[1]
        if not np.isfinite(value):
            return 1e9, np.zeros(q)
        return -float(value), -np.einsum("ij,qji->q", np.linalg.inv(M), matrices)

    found = [start] if start is not None else []
    for w in starts:
        answer = minimize(
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
            "the recorded primitives do not inform about every parameter: the determinant is zero for every sharing "
            "that was tried",
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
    diagonal = np.abs(np.diagonal(problem.matrices, axis1=1, axis2=2)).mean(axis=0) + np.abs(np.diag(problem.prior))
    size = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    return problem.matrices / np.outer(size, size), problem.prior / np.outer(size, size)


def _keeps(w: Array, polytope: Polytope) -> bool:
    return bool((w <= polytope.most + 1e-9).all() and (polytope.rows @ w <= polytope.limits + 1e-8).all())
