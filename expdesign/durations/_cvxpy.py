"""The convex problem of any criterion and any limits, stated in cvxpy; the only importer of it, imported when needed.

A new limit is one expression in `_limits`, a new criterion one in `_hypograph`. The solver's status is not used:
`certificate` computes the gap from the problem alone.

Source: S. Diamond and S. Boyd, CVXPY: a Python-embedded modeling language for convex optimization, J. Mach. Learn. Res.
17 (2016), no. 83; P. J. Goulart and Y. Chen, Clarabel: an interior-point solver for conic programs with quadratic
objectives (2024), arXiv:2405.12762; linear matrix inequalities of the criteria: F. Pukelsheim, Optimal Design of
Experiments (2006), 3.2 (information matrices for subsystems), and S. Boyd and L. Vandenberghe, Convex Optimization
(2004), 7.5.
"""

from __future__ import annotations

import warnings
from typing import Any

import cvxpy as cp
import numpy as np

from expdesign.durations.concave import ConcaveProblem
from expdesign.durations.criteria import Indices, LogDet, LogTrace, Measure, Piece
from expdesign.durations.limits import Polytope
from expdesign.values import Array

# added to the diagonal of a curvature, as a share of its trace, to make it positive definite
CURVATURE_ROUNDING = 1e-14
SOLVER_TOLERANCE = 1e-11  # gap and feasibility tolerance of the conic solver
ALL = slice(None)


def conic_optimum(task: ConcaveProblem) -> tuple[Array, tuple[Array, ...]] | None:
    """Fractions (q,) near the optimum, and for each model a multiplier (d, d) for its certificate.

    Returns:
        None where the solver gives no numbers, e.g. because the floors cannot be kept.
    """
    w, values, held = cp.Variable(len(task.polytope.least)), [], []
    constraints = _limits(task.polytope, w)
    for piece, level in zip(task.objective.pieces, task.objective.levels, strict=True):
        value, conditions = _hypograph(piece, w)
        values.append(value - float(level))
        held.append(conditions)
        constraints += conditions
    for floor in task.floors:
        value, conditions = _hypograph(floor.pieces[0], w)
        constraints += [*conditions, value >= float(floor.levels[0])]
    stacked = cp.hstack(values)
    _solve(
        cp.Problem(cp.Maximize(cp.min(stacked) if task.objective.worst else cp.sum(stacked) / len(values)), constraints)
    )
    if w.value is None or not np.isfinite(w.value).all():
        return None
    found = [item[0].dual_value if item else None for item in held]
    pairs = zip(task.objective.pieces, found, strict=True)
    return w.value, tuple(_multiplier(piece, dual, w.value) for piece, dual in pairs)


def newton_step(
    task: ConcaveProblem, w: Array, *, chosen: Indices, mixture: Array, floor_prices: Array, gain: float
) -> Array | None:
    """A step (q,) of sequential quadratic programming under all limits.

    It maximises the quadratic model of the Lagrangian, with the floors and the models of a worst case to first order.

    Args:
        task: with smooth measures.
        w: (q,) where B is positive definite for every model.
        chosen: (c,) fractions that may change.
        mixture: (m,) weights of the models.
        gain: order of magnitude of what the step may gain. The solver's tolerances are absolute, so they are applied to
            shares of it.

    Returns:
        None where the solver gives no numbers.
    """
    pieces, floors = task.objective.pieces, [floor.pieces[0] for floor in task.floors]
    weighed = zip((*mixture, *floor_prices), (*pieces, *floors), strict=True)
    H = np.sum([weight * piece.curvature(w, chosen) for weight, piece in weighed if weight > 0], axis=0)
    H[np.diag_indices_from(H)] += CURVATURE_ROUNDING * np.trace(H)
    step, height = cp.Variable(len(chosen)), cp.Variable()
    fixed = np.array(w)
    fixed[chosen] = 0.0
    constraints = _limits(task.polytope, w[chosen] + step, chosen=chosen, fixed=fixed)
    tangents = [piece.tangent(w) for piece in pieces]
    heights = np.array([item.value for item in tangents]) - task.objective.levels
    tilts = np.array([item.slope[chosen] for item in tangents])
    if task.objective.worst:
        constraints.append(height <= (heights - heights.min()) + tilts @ step)
    else:
        constraints.append(height == tilts.mean(axis=0) @ step)
    for floor, piece in zip(task.floors, floors, strict=True):
        tangent = piece.tangent(w)
        constraints.append(tangent.value - float(floor.levels[0]) + tangent.slope[chosen] @ step >= 0)
    _solve(cp.Problem(cp.Maximize((height - cp.quad_form(step, cp.psd_wrap(H)) / 2) / gain), constraints))
    if step.value is None or not np.isfinite(step.value).all():
        return None
    whole = np.zeros(len(w))
    whole[chosen] = step.value
    return whole


def largest_least_eigenvalue(matrices: Array, prior: Array, polytope: Polytope) -> Array | None:
    """Fractions (q,) w that maximise the least eigenvalue of prior (d, d) + sum_q w_q B_q, B_q symmetric (q, d, d)."""
    w, d = cp.Variable(len(matrices)), len(prior)
    total = prior + cp.reshape(matrices.reshape(len(matrices), d * d).T @ w, (d, d), order="C")
    _solve(cp.Problem(cp.Maximize(cp.lambda_min((total + total.T) / 2)), _limits(polytope, w)))
    return None if w.value is None or not np.isfinite(w.value).all() else np.asarray(w.value)


def _limits(polytope: Polytope, w: Any, *, chosen: Indices | slice = ALL, fixed: Array | None = None) -> list[Any]:
    """All linear limits on the chosen fractions w (c,) beside fixed ones (q,), which are zero where chosen."""
    least, most, rows, rest = polytope.least, polytope.most, polytope.rows, 0.0 if fixed is None else fixed
    least, most, rows = least[chosen], np.maximum(most, least)[chosen], rows[:, chosen]
    limits = [cp.sum(w) == 1 - np.sum(rest), w >= least]
    bounded = np.flatnonzero(polytope.most[chosen] < 1.0)
    if len(bounded):
        limits.append(w[bounded] <= most[bounded])
    if len(rows):
        limits.append(rows @ w <= polytope.limits - np.sum(polytope.rows * rest, axis=1))
    return limits


def _hypograph(piece: Piece, w: Any) -> tuple[Any, list[Any]]:
    """A concave expression for a piece's value, and its constraints, the matrix inequality in M first."""
    count, d = piece.matrices.shape[:2]
    total = piece.prior + cp.reshape(piece.matrices.reshape(count, d * d).T @ w, (d, d), order="C")
    M = (total + total.T) / 2
    measure: Measure = piece.measure
    if isinstance(measure, LogDet):
        Q, R = np.linalg.qr(measure.L)
        offset = 2 * float(np.log(np.abs(np.diag(R))).sum())
        if measure.degree == d:
            return cp.log_det(M) - offset, []
        K = cp.Variable((measure.degree, measure.degree), symmetric=True)
        return cp.log_det(K) - offset, [M - Q @ K @ Q.T >> 0]  # the largest K with M >= L K L^T is V^-1
    size = float(np.linalg.norm(measure.L, 2))
    L, u = measure.L / size, cp.Variable()
    value = cp.log(u) - 2 * np.log(size)
    if isinstance(measure, LogTrace):
        W = cp.Variable((L.shape[1],) * 2, symmetric=True)
        return value, [cp.bmat([[M, u * L], [u * L.T, W]]) >> 0, cp.trace(W) <= u]  # W >= u^2 V, so u trace V <= 1
    return value, [M - u * (L @ L.T) >> 0]  # u V <= I


def _multiplier(piece: Piece, dual: Array | None, w: Array) -> Array:
    """The (d, d) block of a matrix inequality's dual solution that multiplies M, positive semidefinite, to scale."""
    d = len(piece.prior)
    if dual is None or not np.isfinite(dual).all():
        return np.eye(d)
    values, vectors = np.linalg.eigh((dual[:d, :d] + dual[:d, :d].T) / 2)
    G = (vectors * np.maximum(values, 0.0)) @ vectors.T
    size = float(np.sum(G * piece.matrix(w)))
    return np.asarray(G * piece.measure.degree / size) if size > 0 else np.eye(d)


def _solve(problem: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an inaccurate answer is judged by its certificate
        tolerance = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), SOLVER_TOLERANCE)
        try:
            problem.solve(solver=cp.CLARABEL, max_threads=1, **tolerance)  # more threads mostly wait for each other
        except cp.error.SolverError:
            return
