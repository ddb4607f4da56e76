"""The whole runs of least cost that reach an accuracy, together with what is known.

    minimise  sum_q n_q c_q   subject to  f(K + sum_q n_q M_q) >= 0,  n_q whole numbers within limits

f is concave, so every supergradient G at any M gives a linear inequality that all solutions satisfy. They are added
until the solution of the linear program with whole numbers satisfies f itself (outer approximation). The bound is that
of the continuous problem. It is computed from the multipliers of its linear inequalities, scaled until they are dual
feasible, and so holds whatever the solver's accuracy.

Source: J. E. Kelley 1960; M. A. Duran and I. E. Grossmann 1986.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linprog, milp

from expdesign.errors import NoAnswer
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.tuning import TUNING
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Whole runs and what they cost.

    Attributes:
        repeats: (q,) whole runs, one at least.
        cost_s: of them.
        bound_s: no runs, whole or not, reach the accuracy for less.
    """

    repeats: tuple[int, ...]
    cost_s: float
    bound_s: float


def cheapest_runs(
    accuracy: Accuracy, matrices: Array, cost_s: Array, *, known: Array, fewest: Array, most: Array, level: float = 0.0
) -> Choice:
    """The cheapest whole runs that reach an accuracy.

    Args:
        accuracy: gives the margin f.
        matrices: (q, d, d) information of one whole run, summed over its samples.
        cost_s: (q,) of one whole run, more than 0.
        known: (d, d) information without runs.
        fewest, most: (q,) limits on runs.
        level: of f that is to be reached; 0 reaches the accuracy.

    Raises:
        NoAnswer: no runs within the limits reach it.
    """
    cuts = _Cuts(accuracy=accuracy, matrices=matrices, known=known, level=level)
    if accuracy.margin(cuts.information(most)) < level - TUNING.reached:
        _refuse(accuracy, cuts.information(most))
    cuts.add(most.astype(float))
    bound_s = _relaxed(cuts, cost_s, fewest, most)
    for _ in range(TUNING.cuts):
        A, b = cuts.rows
        found = milp(
            cost_s,
            constraints=LinearConstraint(A, lb=b),
            bounds=Bounds(fewest, most),
            integrality=np.ones(len(cost_s)),
            options={"mip_rel_gap": TUNING.choice_gap, "node_limit": TUNING.choice_nodes},
        )
        runs = most if found.x is None else np.rint(found.x)  # most reaches the level, and is thinned out below
        if accuracy.margin(cuts.information(runs)) >= level - TUNING.reached:
            break
        cuts.add(runs)
    else:
        runs = most
    runs = _without_spare(cuts, runs, cost_s, fewest)
    return Choice(repeats=tuple(int(n) for n in runs), cost_s=float(runs @ cost_s), bound_s=bound_s)


def _refuse(accuracy: Accuracy, information: Array) -> None:
    name = accuracy.scarcest(information)
    what = f"the standard deviation of {name}" if name else "the information"
    share = np.exp(accuracy.margin(information))
    raise NoAnswer(
        f"design.accuracy cannot be reached: {what} is the obstacle; with the most runs of every primitive there is "
        f"{share:.3g} times the information needed; other manoeuvres in the dictionary or better sensors would help"
    )


class _Cuts:
    """Linear inequalities A n >= b that all runs n with margin above the level satisfy."""

    def __init__(self, *, accuracy: Accuracy, matrices: Array, known: Array, level: float) -> None:
        self.accuracy, self.matrices, self.known, self.level = accuracy, matrices, known, level
        self._equal = self.information(np.ones(len(matrices)))
        self._A, self._b = [np.ones(len(matrices))], [1.0]  # a trial has a run

    def information(self, runs: Array) -> Array:
        """(d, d) of runs (q,), and what is known."""
        return np.asarray(self.known + np.tensordot(runs, self.matrices, axes=1))

    def add(self, runs: Array) -> None:
        """The inequality that is tangent at the information of given runs (q,), or near it where that is singular."""
        M, blend = self.information(runs), TUNING.blend
        while not np.isfinite(self.accuracy.margin(M)):
            M, blend = self.information(runs) + blend * self._equal, 10 * blend
        G = self.accuracy.supergradient(M)
        slope = self.matrices.reshape(len(self.matrices), -1) @ G.ravel()
        short = self.level - self.accuracy.margin(M) + float(np.sum(G * (M - self.known)))
        size = max(float(np.abs(slope).max()), np.finfo(float).tiny)
        self._A.append(slope / size)
        self._b.append(short / size)

    @property
    def rows(self) -> tuple[Array, Array]:
        """A (c, q) and b (c,)."""
        return np.array(self._A), np.array(self._b)


def _relaxed(cuts: _Cuts, cost_s: Array, fewest: Array, most: Array) -> float:
    """A bound on the cost of the continuous problem, which leaves its tangents among the cuts."""
    bound_s = float(fewest @ cost_s)
    for _ in range(TUNING.cuts):
        A, b = cuts.rows
        found = linprog(cost_s, A_ub=-A, b_ub=-b, bounds=np.column_stack([fewest, most]), method="highs")
        if found.x is None:
            break
        bound_s = max(bound_s, _dual_bound(A, b, cost_s, fewest, most, np.maximum(-found.ineqlin.marginals, 0.0)))
        if cuts.accuracy.margin(cuts.information(found.x)) >= cuts.level - TUNING.choice_gap / 10:
            break
        cuts.add(found.x)
    return bound_s


def _dual_bound(A: Array, b: Array, cost_s: Array, fewest: Array, most: Array, multipliers: Array) -> float:
    """Least cost within the limits by weak duality, for any multipliers that are not negative."""
    reduced = cost_s - multipliers @ A
    return float(multipliers @ b + np.where(reduced > 0, reduced * fewest, reduced * most).sum())


def _without_spare(cuts: _Cuts, runs: Array, cost_s: Array, fewest: Array) -> Array:
    """Runs (q,) without those that can be left out, dearest first."""
    runs = np.array(runs, dtype=float)
    for index in np.argsort(-cost_s):
        while runs[index] > fewest[index] and runs.sum() > 1:
            fewer = runs - np.eye(len(runs))[index]
            if cuts.accuracy.margin(cuts.information(fewer)) < cuts.level - TUNING.reached:
                break
            runs = fewer
    return runs
