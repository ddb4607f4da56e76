"""From time fractions to whole runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from expdesign.durations.concave import Collected, informs_about_all, limits_of, merged_nuisance
from expdesign.durations.limits import LOOSENING, Polytope
from expdesign.durations.problem import DurationProblem
from expdesign.errors import NoAnswer
from expdesign.values import Array

ADDED_SHARE = 1e-6  # share of the optimal design added to every set of runs, so that singular ones compare
LEAST_GAIN = 1e-9  # gains of an exchange below this are rounding
EQUAL_SHARE = 1e-9  # share of equal times added where the optimal design itself is nearly singular
LEAST_GAIN_NEARLY_SINGULAR = 1e-6  # `LEAST_GAIN` there
NAMED_PAIRS = 3  # pairs of merged regressors that a note names
INSERTIONS = 200  # primitives, best gain per second first, tried in an exchange of one run for several
Indices = NDArray[np.intp]
Totals = tuple[Array, ...]
"""(..., d, d) information collected, for each model."""


def whole_runs(problem: DurationProblem, fractions: Array) -> tuple[int, ...]:
    """Numbers of whole runs within the total time and the limits, by greedy addition and exchange on the criterion.

    The value of a set of runs is the criterion of their information. The only primitive with information about a
    parameter is never dropped, because the value without it is minus infinity. The result is a local optimum. Against
    complete enumeration of small problems it was the global one whenever runs were of one length, else in nine cases
    of ten, and the loss of efficiency was at most 3 %.

    Args:
        problem: gives run lengths, the total time and the limits.
        fractions: (q,) optimal fractions, where the search starts.

    Raises:
        NoAnswer: no set of whole runs was found that satisfies the limits and informs about every parameter.
    """
    search = _Search.of(problem, fractions)
    runs = _searched(search, search.rounded(fractions))
    if not search.informative(runs) and problem.symmetric:
        # A criterion about some parameters may leave others without information: start from the runs that are best
        # for all parameters, and accept only exchanges that keep them identifiable.
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


def runs_above_floors(
    problem: DurationProblem, starts: Iterable[Array], shortfall: Callable[[Array], float]
) -> tuple[int, ...]:
    """As `whole_runs`, of which shares of the time (q,) must keep every least information.

    Rounded fractions are changed run by run until nothing is missing, and then exchanged for a better criterion among
    runs that keep it.

    Args:
        starts: fractions (q,); the first that leads to such runs is where the search begins.
        shortfall: of shares of the time, 0 where everything is kept.

    Raises:
        NoAnswer: no fractions lead to runs that keep it and inform about every parameter.
    """
    for fractions in starts:
        search = _Search.of(problem, fractions)
        runs = _completed(search, search.rounded(fractions), shortfall)
        if search.informative(runs) and shortfall(runs * search.shares) == 0.0:
            found = _searched(search, runs, accepted=partial(_informative_and_kept, search, shortfall))
            return tuple(int(n) for n in found)
    names = ", ".join(item.name for item in problem.floors)
    raise NoAnswer(
        f"design.total_s is {problem.total_s:g}: shares of that time keep {names}, but no whole runs were found that "
        "do; with a little more design.total_s they may"
    )


def _completed(search: _Search, runs: Array, shortfall: Callable[[Array], float]) -> Array:
    """Runs (q,) after the insertions of a run for others that leave least missing, while they help."""
    missing = shortfall(runs * search.shares)
    while missing > 0.0:
        tried = [_inserted(search, runs, int(index), shortfall) for index in np.flatnonzero(runs < search.most_runs)]
        left = [shortfall(item * search.shares) for item in tried]
        if not left or not min(left) < missing:
            break
        runs, missing = tried[int(np.argmin(left))], min(left)
    return runs


def _inserted(search: _Search, runs: Array, index: int, shortfall: Callable[[Array], float]) -> Array:
    """Runs with one more of a primitive, and without those others that are missed least until the limits hold."""
    changed = runs + _unit(index, runs)
    while not search.allowed(changed):
        spare = np.setdiff1d(np.flatnonzero(changed > search.fewest), index)
        if not len(spare):
            return runs
        without = [changed - _unit(int(other), runs) for other in spare]
        losses = [(shortfall(item * search.shares), -search.value_of(item)) for item in without]
        changed = without[min(range(len(losses)), key=losses.__getitem__)]
    return changed


def _informative_and_kept(search: _Search, shortfall: Callable[[Array], float], runs: Array) -> bool:
    return search.informative(runs) and shortfall(runs * search.shares) == 0.0


def _any_runs(runs: Array) -> bool:
    return True


def _searched(search: _Search, runs: Array, *, accepted: Callable[[Array], bool] = _any_runs) -> Array:
    """The local optimum (q,) by exchanges from given runs, among sets that are accepted."""
    best = search.value_of(runs)
    while (better := _exchanged(search, runs, accepted)) is not None:
        gained = search.value_of(better)
        if not gained > best:  # rounding in nearly singular sums could make the exchange cycle
            break
        runs, best = better, gained
    return runs


def note_on_runs(problem: DurationProblem, runs: Array) -> str:
    """A sentence about the regressors that the estimator will merge after whole runs (q,), or ""."""
    pairs = merged_nuisance(problem, runs * problem.run_s / problem.total_s) if problem.nuisance else ()
    if not pairs:
        return ""
    shown = "; ".join(f"{one} with {other}" for one, other in pairs[:NAMED_PAIRS])
    more = f" and {len(pairs) - NAMED_PAIRS} more" if len(pairs) > NAMED_PAIRS else ""
    return (
        f"in these whole runs {len(pairs)} regressors of disturbances coincide with others, and the estimator merges "
        f"them: {shown}{more}"
    )


def efficiency_of_shares(problem: DurationProblem, fractions: Array, shares: Array) -> float:
    """Efficiency of other shares (q,) of the total time."""
    return Collected.of(problem).efficiency(shares, fractions)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Search:
    """The quantities common to all sets of runs."""

    problem: DurationProblem  # the duration problem
    collected: Collected  # the criterion
    pieces: Totals  # for each model (q, d, d) share of one run in the total time, times B_q
    shares: Array  # (q,) that share
    # for each model (d, d) prior and a small share of the optimal design, and of equal shares where that is nearly
    # singular
    added: Totals
    gain: float  # least gain of an exchange
    polytope: Polytope  # limits
    # fewest, most_runs: (q,) least and most runs
    fewest: NDArray[np.int64]
    most_runs: NDArray[np.int64]

    @staticmethod
    def of(problem: DurationProblem, fractions: Array) -> _Search:
        collected, polytope = Collected.of(problem), limits_of(problem)
        shares = np.asarray(problem.run_s / problem.total_s)
        most = np.where(polytope.most < 1.0, polytope.most, np.inf) / shares
        small = EQUAL_SHARE if collected.symmetric and _nearly_singular(collected, fractions) else 0.0
        return _Search(
            problem=problem,
            collected=collected,
            pieces=tuple(shares[:, None, None] * piece.matrices for piece in collected.pieces),
            shares=shares,
            added=tuple(
                piece.prior
                + ADDED_SHARE * np.tensordot(fractions, piece.matrices, axes=1)
                + small * np.eye(len(piece.prior))  # equal shares, in whitened coordinates
                for piece in collected.pieces
            ),
            gain=LEAST_GAIN_NEARLY_SINGULAR if small else LEAST_GAIN,
            polytope=polytope,
            fewest=np.ceil(polytope.least / shares - 1e-9).astype(int),
            most_runs=np.floor(np.minimum(most, 1e9) + 1e-9).astype(int),
        )

    def totals(self, runs: Array) -> Totals:
        """Information of the runs plus `added`, for each model."""
        return tuple(np.tensordot(runs, P, axes=1) + L for P, L in zip(self.pieces, self.added, strict=True))

    def value_of(self, runs: Array) -> float:
        """Value of one set of runs (q,), never infinite."""
        return float(self.collected.regular_values(tuple(total[None] for total in self.totals(runs)))[0])

    def after(self, totals: Totals, indices: Indices, sign: float) -> Array:
        """(c,) values after one run of each indexed primitive is added (sign 1) or removed (sign -1)."""
        moved = tuple(total + sign * P[indices] for total, P in zip(totals, self.pieces, strict=True))
        return self.collected.regular_values(moved)

    def allowed(self, runs: Array) -> bool:
        """Whether runs satisfy the total time and all limits."""
        shares = runs * self.shares
        return bool(
            shares.sum() <= 1.0 + 1e-9
            and (runs >= self.fewest).all()
            and (runs <= self.most_runs).all()
            and (self.polytope.rows @ shares <= self.polytope.limits + 2 * LOOSENING).all()
        )

    def informative(self, runs: Array) -> bool:
        """Whether runs satisfy the limits and inform about every parameter by themselves."""
        return self.allowed(runs) and informs_about_all(self.problem, self.collected, runs * self.shares)

    def rounded(self, fractions: Array) -> Array:
        """Fractions rounded down to allowed runs, then filled up."""
        runs = np.maximum(np.floor(fractions / self.shares + 1e-9).astype(int), self.fewest)
        return self.filled_up(self.trimmed(np.minimum(runs, np.maximum(self.most_runs, self.fewest)), -1))

    def fitting(self, runs: Array) -> Indices:
        """Indices of the primitives of which one more run fits."""
        used = runs * self.shares
        fits = (self.shares <= 1.0 - used.sum() + 1e-9) & (runs < self.most_runs)
        left = self.polytope.limits + LOOSENING - self.polytope.rows @ used
        fits &= (self.polytope.rows * self.shares <= left[:, None]).all(axis=0)
        return np.flatnonzero(fits)

    def filled_up(self, runs: Array) -> Array:
        """Runs with others added while one fits, best gain per second first."""
        while len(fits := self.fitting(runs)):
            gains = self.after(self.totals(runs), fits, 1.0) - self.value_of(runs)
            runs = runs + _unit(int(fits[np.argmax(gains / self.shares[fits])]), runs)
        return runs

    def trimmed(self, runs: Array, keep: int) -> Array:
        """Runs with others removed until the limits hold, least loss per second first; `keep` stays."""
        while not self.allowed(runs):
            spare = np.setdiff1d(np.flatnonzero(runs > self.fewest), keep)
            if not len(spare):
                return np.array(self.fewest)
            losses = self.value_of(runs) - self.after(self.totals(runs), spare, -1.0)
            runs = runs - _unit(int(spare[np.argmin(losses / self.shares[spare])]), runs)
        return runs


def _exchanged(search: _Search, runs: Array, accepted: Callable[[Array], bool]) -> Array | None:
    """A better set of runs, or None: the best swap of one run for one, else an insertion that replaces several."""
    target = search.value_of(runs) + search.gain
    swap = _swapped(search, runs, target, accepted)
    if swap is not None:
        filled = search.filled_up(swap)
        return filled if accepted(filled) else swap
    if np.ptp(search.shares) < 1e-12 and search.polytope.plain:
        return None  # runs of one length: an insertion is a swap
    everything = np.flatnonzero(runs < search.most_runs)
    added = search.after(search.totals(runs), everything, 1.0)
    for place in np.argsort(-(added - search.value_of(runs)) / search.shares[everything])[:INSERTIONS]:
        index = int(everything[place])
        inserted = search.trimmed(runs + _unit(index, runs), index)
        if not search.allowed(inserted):
            continue
        if search.value_of(inserted := search.filled_up(inserted)) > target and accepted(inserted):
            return inserted
    return None


def _swapped(search: _Search, runs: Array, target: float, accepted: Callable[[Array], bool]) -> Array | None:
    """The best set above `target` that has one run in place of another."""
    best = None
    for out in np.flatnonzero(runs > search.fewest):
        left = runs - _unit(int(out), runs)
        fits = search.fitting(left)
        if not len(fits):
            continue
        values = search.after(search.totals(left), fits, 1.0)
        for place in np.argsort(-values):
            if not values[place] > target:
                break
            if accepted(swapped := left + _unit(int(fits[place]), runs)):
                target, best = float(values[place]), swapped
                break
    return best


def _nearly_singular(collected: Collected, shares: Array) -> bool:
    values = [np.linalg.eigvalsh(total) for total in collected.totals(shares)]
    return any(item[0] < ADDED_SHARE * item[-1] for item in values)


def _unit(index: int, runs: Array) -> Array:
    step = np.zeros_like(runs)
    step[index] = 1
    return step
