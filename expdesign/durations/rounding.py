"""From time fractions to whole runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.durations.certificate import log_det
from expdesign.durations.values import DurationProblem
from expdesign.errors import NoAnswer
from expdesign.values import Array

Indices = NDArray[np.intp]

LENT = 1e-6
"""Share of the optimal design lent to every set of runs, so that singular ones can be compared too."""
GAIN = 1e-9
"""Gains in log det below this count as rounding."""
PUSHES = 200
"""Primitives that are tried as pushes, those that would gain most per second first."""


def whole_runs(problem: DurationProblem, matrices: Array, fractions: Array) -> tuple[int, ...]:
    """Numbers of whole runs within the total time, by greedy addition and exchange on the determinant itself.

    The value of a set of runs is log det of B at its time shares plus p log of its time: information adds with time.
    Every primitive that is alone in informing about a parameter stays, since without it the value is minus infinity.
    The result is a local optimum; on problems small enough to try every set it was the best set whenever runs were of
    one length, else in nine cases out of ten, and never lost more than 3 % of efficiency to it.

    Args:
        problem: gives run lengths and the total time.
        matrices: (q, d, d) whitened B_q.
        fractions: (q,) optimal fractions, where the search starts.

    Raises:
        NoAnswer: no set of whole runs was found that fits the total time and informs about every parameter.
    """
    search = _Search.of(problem, matrices, fractions)
    runs = search.grown(np.floor(fractions / search.shares + 1e-9).astype(int))
    while (better := _exchanged(search, runs)) is not None:
        runs = better
    if not np.isfinite(value(problem, matrices, runs)):
        raise NoAnswer(
            f"design.total_s is {problem.total_s:g}: whole runs that inform about every parameter do not fit; the "
            f"shortest run takes {problem.run_s.min():g} s, the optimal design uses {int((fractions > 1e-6).sum())} "
            "primitives"
        )
    return tuple(int(n) for n in runs)


def value(problem: DurationProblem, matrices: Array, runs: Array) -> float:
    """log det of the information collected by whole runs, up to a constant; -inf when singular."""
    times = runs * problem.run_s
    used = float(times.sum())
    if used <= 0:
        return -np.inf
    return log_det(matrices, times / used) + len(problem.parameters) * float(np.log(used / problem.total_s))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Search:
    """What is the same for all sets of runs.

    Attributes:
        pieces: (q, d, d) share of one run in the total time, times B_q.
        shares: (q,) that share.
        lent: (d, d) a little of the optimal design.
        means: d - p, the rows of B that hold means.
    """

    pieces: Array
    shares: Array
    lent: Array
    means: int

    @staticmethod
    def of(problem: DurationProblem, matrices: Array, fractions: Array) -> _Search:
        shares = problem.run_s / problem.total_s
        return _Search(
            pieces=shares[:, None, None] * matrices,
            shares=shares,
            lent=LENT * np.tensordot(fractions, matrices, axes=1),
            means=problem.dimension - len(problem.parameters),
        )

    def total(self, runs: Array) -> Array:
        """(d, d) sum of the runs' pieces and what is lent."""
        return np.asarray(np.tensordot(runs, self.pieces, axes=1) + self.lent)

    def worth(self, totals: Array, used: Array) -> Array:
        """As `value`, for totals (..., d, d) of sets that take shares (...) of the time, but never infinite."""
        return np.asarray(np.linalg.slogdet(totals)[1] - self.means * np.log(used + LENT))

    def worth_of(self, runs: Array) -> float:
        """`worth` of one set of runs (q,)."""
        return float(self.worth(self.total(runs), runs @ self.shares))

    def fitting(self, runs: Array) -> Indices:
        """Indices of the primitives of which one more run fits."""
        return np.flatnonzero(self.shares <= 1.0 - runs @ self.shares + 1e-9)

    def after(self, total: Array, used: float, indices: Indices, sign: float) -> Array:
        """(c,) worth after one run of each indexed primitive is added (sign 1) or taken away (sign -1)."""
        return self.worth(total + sign * self.pieces[indices], used + sign * self.shares[indices])

    def grown(self, runs: Array) -> Array:
        """With runs added, always the one that gains most per second, while one fits."""
        while len(fits := self.fitting(runs)):
            gains = self.after(self.total(runs), float(runs @ self.shares), fits, 1.0) - self.worth_of(runs)
            runs = runs + _unit(int(fits[np.argmax(gains / self.shares[fits])]), runs)
        return runs

    def thinned(self, runs: Array, keep: int) -> Array:
        """With runs taken away until the rest fits, always the one that loses least per second; `keep` is left."""
        while (used := float(runs @ self.shares)) > 1.0 + 1e-9:
            spare = np.setdiff1d(np.flatnonzero(runs), keep)
            if not len(spare):
                return np.zeros_like(runs)
            losses = self.worth_of(runs) - self.after(self.total(runs), used, spare, -1.0)
            runs = runs - _unit(int(spare[np.argmin(losses / self.shares[spare])]), runs)
        return runs


def _exchanged(search: _Search, runs: Array) -> Array | None:
    """A better set of runs nearby, or None: the best swap of one run for one, else any push that helps."""
    target = search.worth_of(runs) + GAIN
    swap = _swapped(search, runs, target)
    if swap is not None:
        return search.grown(swap)
    if np.ptp(search.shares) < 1e-12:
        return None  # runs of one length: a push is a swap
    everything = np.arange(len(runs))
    added = search.after(search.total(runs), float(runs @ search.shares), everything, 1.0)
    for index in np.argsort(-(added - search.worth_of(runs)) / search.shares)[:PUSHES]:
        pushed = search.grown(search.thinned(runs + _unit(int(index), runs), int(index)))
        if search.worth_of(pushed) > target:
            return pushed
    return None


def _swapped(search: _Search, runs: Array, target: float) -> Array | None:
    """The best set above `target` that has one run in place of another."""
    best = None
    for out in np.flatnonzero(runs):
        left = runs - _unit(int(out), runs)
        fits = search.fitting(left)
        worths = search.after(search.total(left), float(left @ search.shares), fits, 1.0)
        if worths.max() > target:
            target, best = float(worths.max()), left + _unit(int(fits[np.argmax(worths)]), runs)
    return best


def _unit(index: int, runs: Array) -> Array:
    step = np.zeros_like(runs)
    step[index] = 1
    return step
