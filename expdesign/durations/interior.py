"""Fractions at machine accuracy: an interior-point method on the primitives that matter.

    f_mu(w) + mu (sum log(w_q - least_q) + sum log slack + sum log(h_j(w) - c_j))

is maximised by Newton's method for a falling mu, under sum w = 1. Only a working set of primitives takes part; those
outside it that turn out to be worth more than they cost join it, until none is. The price of every limit is mu over its
slack. Nothing here proves anything: the certificate is made elsewhere, from the problem.

Source: S. Boyd and L. Vandenberghe, Convex Optimization (2004), chapter 11; multiplicative algorithm: S. D. Silvey,
D. M. Titterington and B. Torsney, An algorithm for optimal designs on a design space, Comm. Statist. A7 (1978),
1379-1389.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from expdesign.durations.constraints import TIGHT, Polytope
from expdesign.durations.objective import Indices, Objective
from expdesign.values import Array

WARM_UP = 30
"""Multiplicative steps that sort the primitives before the interior-point method; they are cheap."""
MIXED_IN = 0.02
"""Share of equal fractions mixed into every start, so that it lies inside."""
WARMTH = 1e-6
"""Share of equal fractions mixed into every such step: criteria about some parameters may lead to singular designs."""
SMALLEST_SET = 50
"""Primitives in the working set at least; also as many as may join at a time."""
NEWTON_STEPS = 60
"""Bound on the steps for one barrier; a handful is usual."""
CRUMB = 1e-7
"""Fractions below this are tried without."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """A concave problem over time fractions.

    Attributes:
        objective: what is maximised.
        polytope: linear limits, upper bounds of single fractions among the rows.
        floors: concave functions that must stay above zero.
        floor_names: of the floors.
    """

    objective: Objective
    polytope: Polytope
    floors: tuple[Objective, ...] = ()
    floor_names: tuple[str, ...] = ()

    @property
    def uppers(self) -> Indices:
        """Primitives with an upper bound of their own."""
        return np.flatnonzero((self.polytope.most < 1.0) & (self.polytope.most > self.polytope.least))

    @cached_property
    def rows(self) -> tuple[Array, Array]:
        """(j, q) and (j,): budgets, then single upper bounds."""
        eye = np.zeros((len(self.uppers), len(self.polytope.most)))
        eye[np.arange(len(self.uppers)), self.uppers] = 1.0
        limits = np.r_[self.polytope.limits, self.polytope.most[self.uppers]]
        return np.concatenate([self.polytope.rows, eye]), limits


@dataclass(frozen=True, kw_only=True, eq=False)
class Interior:
    """Where the method ended.

    Attributes:
        fractions: (q,).
        barrier: the last mu.
        prices: (i,) of the polytope's rows.
        floor_prices: (j,) of the floors.
    """

    fractions: Array
    barrier: float
    prices: Array
    floor_prices: Array


def climb(task: Task, start: Array, *, tolerance: float = 1e-10, rounds: int = 50) -> Interior:
    """The best fractions, to about `tolerance` per degree of the objective.

    Args:
        task: the problem.
        start: (q,) strictly inside the polytope, floors above zero.
        tolerance: what may be missing, per degree.
        rounds: how often the working set may grow.
    """
    least = task.polytope.least
    if not 1.0 - least.sum() > TIGHT:  # least times take everything
        return _ended(task, least / least.sum(), tolerance)
    chosen = _first_set(task, start)
    result = _solve(task, _restricted(task, start, chosen), chosen, tolerance / 2)
    for _ in range(rounds):
        joining = _joining(task, result, chosen, tolerance)
        if not len(joining):
            break
        chosen = np.r_[chosen, joining]
        result = _solve(task, _restricted(task, start, chosen), chosen, tolerance / 2)
    return _without_crumbs(task, result, chosen, tolerance)


def warmed(task: Task, start: Array) -> Array:
    """A start improved by multiplicative steps, where fractions only have to sum to one and nothing else is asked."""
    if not task.polytope.plain or task.floors:
        return start
    w = np.asarray((1.0 - MIXED_IN) * start + MIXED_IN / len(start))
    for _ in range(WARM_UP):
        slope = np.maximum(task.objective.tangent(w, 0.1).slope, 0.0)
        w = w * slope if task.objective.pieces[0].measure.degree > 1 else w * np.sqrt(slope)
        w = (1.0 - WARMTH) * w / w.sum() + WARMTH / len(w)
    return np.asarray((1.0 - MIXED_IN) * w + MIXED_IN / len(w))


def _first_set(task: Task, start: Array) -> Indices:
    """Primitives to begin with: those with the largest fractions, or all where limits tie them together."""
    free = np.flatnonzero(task.polytope.most > task.polytope.least)
    if not task.polytope.plain or task.floors:
        return free
    size = task.objective.pieces[0].prior.shape[0]
    first = free[np.argsort(-start[free])][: max(SMALLEST_SET, 4 * size)]
    return first if np.isfinite(task.objective.value(_restricted(task, start, first))) else free


def _restricted(task: Task, start: Array, chosen: Indices) -> Array:
    """The start with all time that is free on the chosen primitives."""
    w = np.array(task.polytope.least)
    spare = start[chosen] - w[chosen]
    w[chosen] += (1.0 - w.sum()) * spare / spare.sum()
    return w


def _joining(task: Task, result: Interior, chosen: Indices, tolerance: float) -> Indices:
    slope = _lagrangian_slope(task, result)
    worth = float(np.max(slope[chosen], initial=-np.inf))
    excess = slope - worth - tolerance * _degree(task)
    outside = np.setdiff1d(np.flatnonzero((task.polytope.most > task.polytope.least) & (excess > 0)), chosen)
    return outside[np.argsort(-excess[outside])[:SMALLEST_SET]]


def _lagrangian_slope(task: Task, result: Interior) -> Array:
    """(q,) slope of the objective and the floors, less the prices of budgets."""
    slope = task.objective.tangent(result.fractions, result.barrier).slope - task.polytope.rows.T @ result.prices
    for floor, price in zip(task.floors, result.floor_prices, strict=True):
        slope = slope + price * floor.tangent(result.fractions, result.barrier).slope
    return np.asarray(slope)


def _degree(task: Task) -> int:
    return task.objective.pieces[0].measure.degree


def _solve(task: Task, start: Array, chosen: Indices, tolerance: float) -> Interior:
    """The optimal fractions of the chosen primitives, each of them above its least."""
    rows, _ = task.rows
    count = len(chosen) + len(rows) + len(task.floors)
    degree = _degree(task)
    w, barrier = start, degree / count
    if len(chosen) > 1:
        while count * barrier > tolerance * degree:
            barrier /= 10
            w = _centred(task, w, chosen, barrier)
    return _ended(task, w, barrier)


def _ended(task: Task, w: Array, barrier: float) -> Interior:
    rows, limits = task.rows
    slack = np.maximum(limits - rows @ w, 1e-300)
    values = np.array([floor.value(w) for floor in task.floors])
    return Interior(
        fractions=w,
        barrier=barrier,
        prices=np.asarray(barrier / slack)[: len(task.polytope.rows)],
        floor_prices=barrier / np.maximum(values, 1e-300),
    )


def _centred(task: Task, w: Array, chosen: Indices, barrier: float) -> Array:
    """The barrier problem's maximum by Newton's method in relative steps of what exceeds the least fractions.

    Near the maximum, where the decrement is small against the barrier, full steps are safe, because the terms are
    self-concordant; farther away the step is halved until it gains.
    """
    for _ in range(NEWTON_STEPS):
        step, decrement, longest = _newton(task, w, chosen, barrier)
        length = min(1.0, 0.99 * longest)
        if decrement > 0.05 * barrier:
            value = _merit(task, w, chosen, barrier)
            while not _merit(task, w + length * step, chosen, barrier) >= value + 0.1 * length * decrement:
                length /= 2
                if length < 1e-10:
                    return w
        w = _on_simplex(task, w + length * step, chosen)
        if decrement < 1e-6 * barrier:
            break
    return w


def _on_simplex(task: Task, w: Array, chosen: Indices) -> Array:
    """Rounding taken off, in proportion to what exceeds the least fractions."""
    least = task.polytope.least
    result = np.array(least)
    above = w[chosen] - least[chosen]
    result[chosen] += above * (1.0 - least.sum()) / above.sum()
    return result


def _merit(task: Task, w: Array, chosen: Indices, barrier: float) -> float:
    rows, limits = task.rows
    slack = np.r_[w[chosen] - task.polytope.least[chosen], limits - rows @ w]
    if slack.min() <= 0:
        return -np.inf
    floors = np.array([floor.smooth(w, barrier) for floor in task.floors])
    if len(floors) and not floors.min() > 0:
        return -np.inf
    return task.objective.smooth(w, barrier) + barrier * float(np.log(slack).sum() + np.log(floors).sum())


def _newton(task: Task, w: Array, chosen: Indices, barrier: float) -> tuple[Array, float, float]:
    """The Newton step (q,) of the barrier problem, its squared decrement, and the longest length that stays inside."""
    above = w[chosen] - task.polytope.least[chosen]
    local = task.objective.local(w, chosen, barrier)
    slope, curvature = above * local.slope + barrier, above[:, None] * local.curvature * above
    for floor in task.floors:
        part = floor.local(w, chosen, barrier)
        price, tilt = barrier / part.value, above * part.slope
        slope = slope + price * tilt
        curvature = curvature + price * above[:, None] * part.curvature * above
        curvature = curvature + price / part.value * np.outer(tilt, tilt)
    rows, limits = task.rows
    walls = above * rows[:, chosen] / (limits - rows @ w)[:, None]
    slope = slope - barrier * walls.sum(axis=0)
    curvature = curvature + barrier * (walls.T @ walls) + barrier * np.eye(len(chosen))
    free, price = cho_solve(cho_factor(curvature), np.stack([slope, above], axis=1)).T
    relative = free - (above @ free) / (above @ price) * price
    step = np.zeros_like(w)
    step[chosen] = above * relative
    nearest = max(float(-relative.min()), float((walls @ relative).max(initial=0.0)), 1e-300)
    return step, float(relative @ curvature @ relative), 1.0 / nearest


def _without_crumbs(task: Task, result: Interior, chosen: Indices, tolerance: float) -> Interior:
    """The same with nothing where only the barrier kept a fraction above its least, if the optimum stands that."""
    above = result.fractions - task.polytope.least
    kept = chosen[above[chosen] > CRUMB]
    if len(kept) in (0, len(above)):
        return result
    start = _restricted(task, result.fractions, kept)
    rows, limits = task.rows
    inside = (limits - rows @ start).min(initial=1.0) > 0
    if not (inside and np.isfinite(_merit(task, start, kept, result.barrier))):
        return result
    barrier = tolerance * _degree(task) / (10 * (len(kept) + len(rows) + len(task.floors)))
    trimmed = _centred(task, start, kept, barrier) if len(kept) > 1 else start
    value, before = task.objective.value(trimmed), task.objective.value(result.fractions)
    better = value >= before - 10 * tolerance * _degree(task)
    return _ended(task, trimmed, barrier) if better else result
