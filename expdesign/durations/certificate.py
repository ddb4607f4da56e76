"""Optimality certificates from equivalence theorems, computed from the problem alone.

For f(w) = log det B(w), B(w) = sum_q w_q B_q with B_q positive semidefinite, the sensitivities
d_q = trace(B(w)^-1 B_q) are the gradient of f, their w-weighted mean is the dimension, and concavity bounds every
other design by f(w) + max_q d_q - dimension.

In general every measure is bounded by linear functions of the information matrix (see `criteria.measures`), so every
model and every floor is bounded by a linear function of the fractions. Maximising under these bounds and the linear
limits is a linear programme. Its dual solution gives the mixture of the models and the multipliers of the limits. The
bound follows from these by weak duality, so it is valid for any mixture and any multipliers.

Source: J. Kiefer and J. Wolfowitz, The equivalence of two extremum problems, Canad. J. Math. 12 (1960), 363-366;
F. Pukelsheim, Optimal Design of Experiments (2006), 7.19-7.23 (general equivalence theorem) and 11 (mixtures).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from expdesign.durations.concave import ConcaveProblem
from expdesign.durations.criteria import SINGULAR, Tangent
from expdesign.durations.problem import DurationProblem
from expdesign.values import ASIDE, Array, sealed

LP_TOLERANCE = 1e-10  # feasibility and optimality tolerance of linear programmes


@sealed(mixture="m", prices="q")
class Certificate:
    """Proof that no feasible design is better by more than the gap.

    For any feasible v the criterion is at most `value` + slope (v - w), with the slope of the Lagrangian. The largest
    value of that over all feasible v is the bound.
    """

    kind: str  # the theorem, or why there is none
    value: float  # the criterion at the design, as a logarithm
    bound: float  # upper bound on the criterion of any feasible design; inf when there is no certificate
    degree: int  # doubling the information raises the value by degree x log 2
    level: float  # upper bound on every sensitivity less its price, reached where no limit on the time is active
    mixture: Array  # (m,) weights of the sampled models
    prices: Array  # (q,) part of each sensitivity that is due to limits
    multipliers: Mapping[str, float]  # Lagrange multiplier of every limit by name; zero for inactive limits
    # for recorded primitives, the log det guaranteed by the symmetric part; -inf when it is nowhere positive definite;
    # nan where the problem is convex
    guaranteed: float = float("nan")

    @property
    def gap(self) -> float:
        """bound - value."""
        return self.bound - self.value


@dataclass(frozen=True, kw_only=True)
class Solver:
    """What found optimal fractions."""

    name: str  # of the method, or of the solver
    versions: Mapping[str, str]  # of the packages that it is part of
    wall_s: float  # how long it took [s], with loading these packages where they were not there


@sealed(fractions="q", sensitivities="q")
class DurationDesign:
    """Optimal durations with their certificate."""

    problem: DurationProblem  # the duration problem
    fractions: Array  # (q,) optimal time fractions, sum 1; less where budgets make it better to leave time unused
    # (q,) gradient of the criterion; for D trace(B(w)^-1 B_q), at the optimum at most `dimension`, equal where w_q > 0
    sensitivities: Array
    log_det: float  # log det B at `fractions`, by the nominal model
    gap: float  # upper bound on the improvement by any other design, in the criterion's logarithm (for D in log det)
    repeats: tuple[int, ...]  # (q,) whole runs
    # efficiency of the whole runs by the criterion: the optimum reaches the same in this share of the time
    efficiency_repeats: float
    # the same for equal time on every primitive that is not excluded, whether other limits allow that or not
    efficiency_uniform: float
    certificate: Certificate  # proof of optimality
    note: str = ""  # a warning about the whole runs in one sentence, or ""
    # what found the fractions; the result does not depend on how long it took
    solver: Solver | None = field(default=None, metadata=ASIDE)

    @property
    def log_det_bound(self) -> float:
        """Upper bound on the log det of any design; inf unless the criterion is D of the nominal model."""
        own = self.problem.aim.criterion == "D" and self.problem.robust == "nominal"
        return self.log_det + self.gap if own else float("inf")

    @property
    def gap_relative(self) -> float:
        """The gap per degree of the criterion: a bound on the loss of efficiency."""
        return self.gap / self.certificate.degree

    @property
    def durations_s(self) -> Array:
        """(q,) time of each primitive before rounding [s]."""
        return np.asarray(self.fractions * self.problem.total_s)


def scaled(matrices: Array) -> tuple[Array, float]:
    """Matrices (q, d, d) with unit mean diagonal, and the log det of original less scaled matrices.

    Parameters span many orders of magnitude; a diagonal scaling changes no design and no sensitivity, only accuracy.
    """
    scale = np.sqrt(np.mean([np.diag(matrix) for matrix in matrices], axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    return matrices / np.outer(scale, scale), float(2 * np.log(scale).sum())


def whitened(matrices: Array) -> tuple[Array, float]:
    """Matrices (q, d, d) whose mean is the identity, and the log det of original less whitened matrices.

    A congruence changes no design and no sensitivity. This one gives the equal-share design condition number 1, so
    that nearly collinear parameters cost the solver no accuracy.

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


def certify(
    task: ConcaveProblem, w: Array, *, kind: str, multipliers: Sequence[Array] = ()
) -> tuple[Certificate, Array]:
    """The tightest bound at a design, and the criterion's sensitivities (q,) there.

    Args:
        w: (q,) the design.
        kind: the theorem, in words.
        multipliers: (d, d) for each model, tried in addition to the gradients; the bound is valid for any.

    Raises:
        numpy.linalg.LinAlgError: the design is singular, and no multipliers are given.
    """
    tried: list[tuple[Certificate, Array]] = []
    for given in ([None] * len(task.objective.pieces), multipliers):
        try:
            tangents = [piece.tangent(w, G) for piece, G in zip(task.objective.pieces, given, strict=bool(given))]
            floors = [_floor_tangent(floor.pieces[0].tangent(w), floor.levels[0]) for floor in task.floors]
        except np.linalg.LinAlgError:
            continue
        if tangents and all(np.isfinite(item.value) for item in (*tangents, *floors)):
            tried.append(_certified(task, w, tangents, floors, kind))
    if not tried:
        raise np.linalg.LinAlgError
    return min(tried, key=lambda pair: pair[0].bound)


def _floor_tangent(tangent: Tangent, level: float) -> Tangent:
    return Tangent(tangent.value - float(level), tangent.slope)


def _certified(
    task: ConcaveProblem, w: Array, tangents: Sequence[Tangent], floors: Sequence[Tangent], kind: str
) -> tuple[Certificate, Array]:
    polytope, values = task.polytope, np.array([item.value for item in tangents]) - task.objective.levels
    slopes = np.array([item.slope for item in tangents])
    mixture, prices, floor_prices = _dual(task, w, values, slopes, floors)
    own = mixture @ slopes
    value, slope = float(mixture @ values), own
    for floor, price in zip(floors, floor_prices, strict=True):
        value, slope = value + price * floor.value, slope + price * floor.slope
    net = slope - polytope.rows.T @ prices
    level = _level(task, w, net)
    net = np.where(w >= polytope.most - 1e-9, np.minimum(net, level), net)
    names = (*polytope.labels, *task.floor_names)
    certificate = Certificate(
        kind=kind,
        value=task.objective.value(w),
        bound=float(value - slope @ w + polytope.bound(slope, prices)),
        degree=task.objective.degree,
        level=level,
        mixture=mixture,
        prices=own - net,
        multipliers=dict(zip(names, (*prices.tolist(), *floor_prices.tolist()), strict=True)),
    )
    return certificate, own


def _dual(
    task: ConcaveProblem, w: Array, values: Array, slopes: Array, floors: Sequence[Tangent]
) -> tuple[Array, Array, Array]:
    """Weights (m,) of the models, multipliers (i,) of the rows and (j,) of the floors, by linear programming.

    The programme: the largest t with t <= values + slopes (v - w) for every model, or for their average, every floor's
    tangent at 0 or more, v in the polytope.
    """
    polytope, count = task.polytope, len(values)
    worst = task.objective.worst and count > 1
    if not (worst or len(polytope.rows) or floors):
        return np.full(count, 1.0 / count), np.zeros(0), np.zeros(0)
    heights, tilts = (values, slopes) if worst else (values.mean()[None], slopes.mean(axis=0)[None])
    models, rows = len(heights), len(polytope.rows)
    floor_slopes = np.array([item.slope for item in floors]).reshape(len(floors), len(w))
    A = np.block(
        [
            [-tilts, np.ones((models, 1))],
            [polytope.rows, np.zeros((rows, 1))],
            [-floor_slopes, np.zeros((len(floors), 1))],
        ]
    )
    b = np.r_[heights - tilts @ w, polytope.limits, [item.value - item.slope @ w for item in floors]]
    bounds = [*zip(polytope.least, np.maximum(polytope.most, polytope.least), strict=True), (None, None)]
    whole = np.r_[np.ones(len(w)), 0.0][None]
    options = {"primal_feasibility_tolerance": LP_TOLERANCE, "dual_feasibility_tolerance": LP_TOLERANCE}
    answer = scipy.optimize.linprog(
        np.r_[np.zeros(len(w)), -1.0], A, b, whole, [1.0], bounds, method="highs", options=options
    )
    dual = np.zeros(len(b)) if answer.status else np.maximum(-answer.ineqlin.marginals, 0.0)
    mixture = np.full(count, 1.0 / count)
    if worst and dual[:models].sum() > 0:
        mixture = dual[:models] / dual[:models].sum()
    return mixture, dual[models : models + rows], dual[models + rows :]


def _level(task: ConcaveProblem, w: Array, net: Array) -> float:
    """The net sensitivity of primitives whose time is at no bound."""
    least, most = task.polytope.least, task.polytope.most
    free = (w > least + 1e-6) & (w < np.where(most < 1.0, most - 1e-9, 2.0))
    if not free.any():
        return float(net[w > least - 1e-12].max())
    return float((w[free] * net[free]).sum() / w[free].sum())
