"""From time fractions to whole runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.durations.collected import Collected, merged_nuisance, sees_everything
from expdesign.durations.concave import limits_of
from expdesign.durations.limits import TIGHT, Polytope
from expdesign.durations.problem import DurationProblem
from expdesign.errors import NoAnswer
from expdesign.values import Array

Indices = NDArray[np.intp]
Totals = tuple[Array, ...]
"""(..., d, d) information collected, for each model."""

LENT = 1e-6
"""Share of the optimal design lent to every set of runs, so that singular ones can be compared too."""
GAIN = 1e-9
"""Gains below this count as rounding."""
FAINT, FAINT_GAIN = 1e-9, 1e-6
"""Share of equal times lent besides where the optimal design is itself this close to singular, as only criteria about
some of the parameters allow; and what then counts as rounding."""
NAMED = 3
"""Pairs of merged regressors that a note names."""
PUSHES = 200
"""Primitives that are tried as pushes, those that would gain most per second first."""


def whole_runs(problem: DurationProblem, fractions: Array) -> tuple[int, ...]:
    """Numbers of whole runs within the total time and the limits, by greedy addition and exchange on the criterion.

    The value of a set of runs is the criterion of the information they collect. Every primitive that is alone in
    informing about a parameter stays, since without it the value is minus infinity. The result is a local optimum; on
    problems small enough to try every set it was the best set whenever runs were of one length, else in nine cases out
    of ten, and never lost more than 3 % of efficiency to it.

    Args:
        problem: gives run lengths, the total time and the limits.
        fractions: (q,) optimal fractions, where the search starts.

    Raises:
        NoAnswer: no set of whole runs was found that keeps the limits and informs about every parameter.
    """
    search = _Search.of(problem, fractions)
    runs = _searched(search, search.rounded(fractions))
    if not search.informative(runs) and problem.symmetric:
        # The criterion may do without what has to be estimated along: from the runs best for everything, exchange
        # only what leaves that seen.
        everything = _Search.of(replace(problem, aim=replace(problem.aim, criterion="D")), fractions)
        runs = _searched(everything, everything.rounded(fractions))
        if search.informative(runs):
            runs = _searched(search, runs, accepted=search.informative)
    if not search.informative(runs):
        raise NoAnswer(
            f"design.total_s is {problem.total_s:g}: whole runs that inform about every parameter do not fit; the "
            f"shortest run takes {problem.run_s.min():g} s, the optimal design uses {int((fractions > 1e-6).sum())} "
            "primitives" + (" (least and most times and budgets counted)" if not search.polytope.plain else "")
        )
    return tuple(int(n) for n in runs)


def _anything(runs: Array) -> bool:
    return True


def _searched(search: _Search, runs: Array, *, accepted: Callable[[Array], bool] = _anything) -> Array:
    """The local optimum (q,) by exchanges from given runs, among sets that are accepted."""
    best = search.worth_of(runs)
    while (better := _exchanged(search, runs, accepted)) is not None:
        gained = search.worth_of(better)
        if not gained > best:  # rounding in nearly singular sums; without this the exchange could go round in circles
            break
        runs, best = better, gained
    return runs


def note_on_runs(problem: DurationProblem, runs: Array) -> str:
    """What the estimator will merge after whole runs (q,), in a sentence, or ""."""
    pairs = merged_nuisance(problem, runs * problem.run_s / problem.total_s) if problem.nuisance else ()
    if not pairs:
        return ""
    shown = "; ".join(f"{one} with {other}" for one, other in pairs[:NAMED])
    more = f" and {len(pairs) - NAMED} more" if len(pairs) > NAMED else ""
    return (
        f"in these whole runs {len(pairs)} regressors of disturbances coincide with others, and the estimator merges "
        f"them: {shown}{more}"
    )


def efficiency_of_shares(problem: DurationProblem, fractions: Array, shares: Array) -> float:
    """Efficiency of other shares (q,) of the total time."""
    return Collected.of(problem).efficiency(shares, fractions)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Search:
    """What is the same for all sets of runs.

    Attributes:
        problem: what is asked.
        collected: the criterion.
        pieces: for each model (q, d, d) share of one run in the total time, times B_q.
        shares: (q,) that share.
        lent: for each model (d, d) prior and a little of the optimal design, or of equal shares where that is singular.
        gain: what an exchange must gain at least.
        polytope: limits.
        fewest, most_runs: (q,) least and most runs.
    """

    problem: DurationProblem
    collected: Collected
    pieces: Totals
    shares: Array
    lent: Totals
    gain: float
    polytope: Polytope
    fewest: NDArray[np.int64]
    most_runs: NDArray[np.int64]

    @staticmethod
    def of(problem: DurationProblem, fractions: Array) -> _Search:
        collected, polytope = Collected.of(problem), limits_of(problem)
        shares = np.asarray(problem.run_s / problem.total_s)
        most = np.where(polytope.most < 1.0, polytope.most, np.inf) / shares
        faint = FAINT if collected.symmetric and _nearly_singular(collected, fractions) else 0.0
        return _Search(
            problem=problem,
            collected=collected,
            pieces=tuple(shares[:, None, None] * piece.matrices for piece in collected.pieces),
            shares=shares,
            lent=tuple(
                piece.prior
                + LENT * np.tensordot(fractions, piece.matrices, axes=1)
                + faint * np.eye(problem.dimension)  # equal shares, in whitened coordinates
                for piece in collected.pieces
            ),
            gain=FAINT_GAIN if faint else GAIN,
            polytope=polytope,
            fewest=np.ceil(polytope.least / shares - 1e-9).astype(int),
            most_runs=np.floor(np.minimum(most, 1e9) + 1e-9).astype(int),
        )

    def totals(self, runs: Array) -> Totals:
        """Sum of the runs' pieces and what is lent, for each model."""
        return tuple(np.tensordot(runs, P, axes=1) + L for P, L in zip(self.pieces, self.lent, strict=True))

    def worth_of(self, runs: Array) -> float:
        """Value of one set of runs (q,), never infinite."""
        return float(self.collected.compared(tuple(total[None] for total in self.totals(runs)))[0])

    def after(self, totals: Totals, indices: Indices, sign: float) -> Array:
        """(c,) worth after one run of each indexed primitive is added (sign 1) or taken away (sign -1)."""
        moved = tuple(total + sign * P[indices] for total, P in zip(totals, self.pieces, strict=True))
        return self.collected.compared(moved)

    def allowed(self, runs: Array) -> bool:
        """Whether runs keep the time and all limits."""
        shares = runs * self.shares
        return bool(
            shares.sum() <= 1.0 + 1e-9
            and (runs >= self.fewest).all()
            and (runs <= self.most_runs).all()
            and (self.polytope.rows @ shares <= self.polytope.limits + 2 * TIGHT).all()
        )

    def informative(self, runs: Array) -> bool:
        """Whether runs keep the limits and inform about every parameter without anything lent."""
        return self.allowed(runs) and sees_everything(self.problem, self.collected, runs * self.shares)

    def rounded(self, fractions: Array) -> Array:
        """Fractions rounded down to allowed runs, then filled up."""
        runs = np.maximum(np.floor(fractions / self.shares + 1e-9).astype(int), self.fewest)
        return self.grown(self.thinned(np.minimum(runs, np.maximum(self.most_runs, self.fewest)), -1))

    def fitting(self, runs: Array) -> Indices:
        """Indices of the primitives of which one more run fits."""
        used = runs * self.shares
        fits = (self.shares <= 1.0 - used.sum() + 1e-9) & (runs < self.most_runs)
        left = self.polytope.limits + TIGHT - self.polytope.rows @ used
        fits &= (self.polytope.rows * self.shares <= left[:, None]).all(axis=0)
        return np.flatnonzero(fits)

    def grown(self, runs: Array) -> Array:
        """With runs added, always the one that gains most per second, while one fits."""
        while len(fits := self.fitting(runs)):
            gains = self.after(self.totals(runs), fits, 1.0) - self.worth_of(runs)
            runs = runs + _unit(int(fits[np.argmax(gains / self.shares[fits])]), runs)
        return runs

    def thinned(self, runs: Array, keep: int) -> Array:
        """With runs taken away until the limits hold, always the one that loses least per second; `keep` is left."""
        while not self.allowed(runs):
            spare = np.setdiff1d(np.flatnonzero(runs > self.fewest), keep)
            if not len(spare):
                return np.array(self.fewest)
            losses = self.worth_of(runs) - self.after(self.totals(runs), spare, -1.0)
            runs = runs - _unit(int(spare[np.argmin(losses / self.shares[spare])]), runs)
        return runs


def _exchanged(search: _Search, runs: Array, accepted: Callable[[Array], bool]) -> Array | None:
    """A better set of runs nearby, or None: the best swap of one run for one, else any push that helps."""
    target = search.worth_of(runs) + search.gain
    swap = _swapped(search, runs, target, accepted)
    if swap is not None:
        filled = search.grown(swap)
        return filled if accepted(filled) else swap
    if np.ptp(search.shares) < 1e-12 and search.polytope.plain:
        return None  # runs of one length: a push is a swap
    everything = np.flatnonzero(runs < search.most_runs)
    added = search.after(search.totals(runs), everything, 1.0)
    for place in np.argsort(-(added - search.worth_of(runs)) / search.shares[everything])[:PUSHES]:
        index = int(everything[place])
        pushed = search.thinned(runs + _unit(index, runs), index)
        if not search.allowed(pushed):
            continue
        if search.worth_of(pushed := search.grown(pushed)) > target and accepted(pushed):
            return pushed
    return None


def _swapped(search: _Search, runs: Array, target: float, accepted: Callable[[Array], bool]) -> Array | None:
    """The best set above `target` that has one run in place of another."""
    best = None
    for out in np.flatnonzero(runs > search.fewest):
        left = runs - _unit(int(out), runs)
        fits = search.fitting(left)
        if not len(fits):
            continue
        worths = search.after(search.totals(left), fits, 1.0)
        for place in np.argsort(-worths):
            if not worths[place] > target:
                break
            if accepted(swapped := left + _unit(int(fits[place]), runs)):
                target, best = float(worths[place]), swapped
                break
    return best


def _nearly_singular(collected: Collected, shares: Array) -> bool:
    values = [np.linalg.eigvalsh(total) for total in collected.totals(shares)]
    return any(item[0] < LENT * item[-1] for item in values)


def _unit(index: int, runs: Array) -> Array:
    step = np.zeros_like(runs)
    step[index] = 1
    return step
