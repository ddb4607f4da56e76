"""The whole runs of least cost that reach an accuracy, together with what is known.

    minimise  sum_q n_q c_q - s   subject to  f(K + sum_q n_q M_q) >= 0,  n_q whole numbers within limits,
                                              0 <= s <= sum_q n_q s_q,  s <= time of the way

s is the time of transit that the runs' own way made good saves, as far as there is a way to go. f is concave, so every
supergradient G at any M gives a linear inequality that all solutions satisfy. They are added until the solution of the
linear program without whole numbers satisfies f itself (outer approximation). Its cost is a bound, which is computed
from the multipliers of the linear inequalities by weak duality, and so holds whatever the solver's accuracy. Whole runs
are found from its runs by exchanges, see `whole_runs`.

Source: J. E. Kelley 1960; A. F. Veinott 1967 for cuts where the way to inner points meets the boundary.

Whole runs that reach an accuracy at little cost, from those of the continuous problem.

Runs of the continuous problem are rounded up, which reaches the accuracy, as more runs never tell less. Then up to
three runs at a time are left out or exchanged for at most two others, by the cheapest exchange that still reaches it,
until none is cheaper. The tangent of the margin f at the present runs bounds f at all others, since f is concave; so
most exchanges are ruled out without computing f.

On the choices of the shortest day off Helsinki, 24 manoeuvres, it found the costs of a mixed-integer program by outer
approximation in a twentieth of the time. It proves nothing; the bound is that of the continuous problem.

Source: A. C. Atkinson, A. N. Donev and R. D. Tobias, Optimum Experimental Designs, with SAS (2007), 12.6, for
exchanges.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from expdesign.errors import NoAnswer
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.prices import MOST_RUNS, Offer
from expdesign.shortest_day.tuning import TUNING
from expdesign.values import Array, seal

LEAST_LEVEL, LEVEL_HALVINGS = -4.0, 12  # least margin of a day of a given length, and steps in search of the largest
CUTS = 200  # most linear bounds on the accuracy in the choice of runs, not whole
TANGENTS = 60  # most of them carried over to a like choice
HALVINGS = 12  # of the way to inner runs, in search of the boundary
REACHED = 1e-9  # shortfall of the accuracy's margin that counts as reached
EXCHANGED = 24  # most manoeuvres of which runs are left out, and put in, in the search for whole runs


# Whole runs that reach an accuracy at little cost, from those of the continuous problem.


def exchanged(accuracy: Accuracy, offer: Offer, runs: Array, level: float) -> Array:
    """(q,) whole runs that reach a level of the margin and cost no more than whole runs (q,) that reach it."""
    while (better := next(_cheaper(accuracy, offer, runs, level), None)) is not None:
        runs = better
    return runs


def _cheaper(accuracy: Accuracy, offer: Offer, runs: Array, level: float) -> Iterator[Array]:
    """(q,) runs one exchange away that reach the level and are cheaper, the cheapest first."""
    least = level - REACHED
    M = offer.information(runs)
    slope = offer.matrices.reshape(len(offer.matrices), -1) @ accuracy.supergradient(M).ravel()
    out, put = _exchanges(offer, runs, slope)

    def after(each: Array) -> Array:
        """(o, i) sum over the runs after every exchange."""
        return np.asarray(runs @ each + put @ each - (out @ each)[:, None])

    cost_s = after(offer.cost_s) - np.minimum(after(offer.saved_s), offer.way_s)
    tangent = accuracy.margin(M) + after(slope) - runs @ slope
    kept = np.nonzero((cost_s < offer.total_s(runs) * (1 - TUNING.choice_gap)) & (tangent >= least))
    order = np.argsort(cost_s[kept], kind="stable")
    for left, taken in zip(*(places[order] for places in kept), strict=True):
        other = runs + put[taken] - out[left]
        if other.any() and accuracy.margin(offer.information(other)) >= least:
            yield other


def _exchanges(offer: Offer, runs: Array, slope: Array) -> tuple[Array, Array]:
    """(o, q) up to three runs to leave out and (i, q) at most two to put in, within the limits.

    Of many manoeuvres only those are left out that tell least in their time, and those put in that tell most.
    """
    order = np.argsort(slope / offer.cost_s, kind="stable")
    spare = order[runs[order] > offer.fewest[order]][:EXCHANGED]
    free = order[runs[order] < offer.most[order]][::-1][:EXCHANGED]
    out, put = _multisets(spare, (1, 2, 3), len(runs)), _multisets(free, (0, 1, 2), len(runs))
    return out[(runs - out >= offer.fewest).all(axis=1)], put[(runs + put <= offer.most).all(axis=1)]


def _multisets(places: NDArray[np.int64], sizes: Sequence[int], count: int) -> Array:
    """(m, q) how often each of q runs is in every multiset of these places and sizes."""
    some = [chosen for size in sizes for chosen in combinations_with_replacement(places.tolist(), size)]
    counts = np.zeros((len(some), count))
    for row, chosen in zip(counts, some, strict=True):
        np.add.at(row, np.array(chosen, dtype=int), 1.0)
    return counts


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Whole runs and what they cost."""

    repeats: tuple[int, ...]  # (q,) whole runs, one at least
    cost_s: float  # of them, less what they save
    bound_s: float  # no runs, whole or not, reach the accuracy for less
    tangents: tuple[Tangent, ...] = field(default=(), repr=False, compare=False)  # on the margin, see `Relaxed`


@dataclass(frozen=True, kw_only=True, eq=False)
class Tangent:
    """A linear bound on the margin of an accuracy: f(M) <= <slope, M> + offset, for all runs, costs and levels."""

    slope: Array  # (d, d)
    offset: float  # of the margin

    def __post_init__(self) -> None:
        seal(self, slope="d d")


@dataclass(frozen=True, kw_only=True, eq=False)
class Relaxed:
    """The continuous problem's solution."""

    runs: Array  # (q,) not whole
    bound_s: float  # no runs, whole or not, cost less
    worth: Array  # (d, d) what information is worth at the margin: trace(G M) seconds
    worth_of_saved: float  # of a second of transit saved, from 0 to 1
    tangents: tuple[Tangent, ...] = ()  # on the margin, with which a like problem is soon solved


def cheapest_runs(accuracy: Accuracy, offer: Offer, *, level: float = 0.0, tangents: Sequence[Tangent] = ()) -> Choice:
    """Whole runs that reach an accuracy at little cost.

    Args:
        accuracy: gives the margin f.
        offer: runs and their costs.
        level: of f that is to be reached; 0 reaches the accuracy.
        tangents: of earlier choices for the same accuracy.

    Raises:
        NoAnswer: no runs within the limits reach it.
    """
    relaxed = cheapest_shares(accuracy, offer, level=level, tangents=tangents)
    runs = np.clip(np.ceil(relaxed.runs - TUNING.choice_gap), offer.fewest, offer.most)
    if not runs.any() or accuracy.margin(offer.information(runs)) < level:
        runs = np.minimum(runs + 1.0, offer.most)
    runs = exchanged(accuracy, offer, runs, level)
    return Choice(
        repeats=tuple(int(n) for n in runs),
        cost_s=offer.total_s(runs),
        bound_s=relaxed.bound_s,
        tangents=relaxed.tangents,
    )


def cheapest_shares(
    accuracy: Accuracy, offer: Offer, *, level: float = 0.0, tangents: Sequence[Tangent] = ()
) -> Relaxed:
    """The cheapest runs, whole or not, and what information and way are worth at the margin; see `cheapest_runs`.

    Raises:
        NoAnswer: no runs within the limits reach it.
    """
    return _relaxed(_Cuts(accuracy=accuracy, offer=offer, level=level, tangents=tangents))


def fullest_level(accuracy: Accuracy, offer: Offer, most_s: float) -> float:
    """The largest level of the margin f that runs, whole or not, reach at a cost of `most_s`.

    Levels are searched from `LEAST_LEVEL` to that of the most runs; the least where even it costs more.
    """
    low, high = LEAST_LEVEL, accuracy.margin(offer.information(offer.most))
    tangents: tuple[Tangent, ...] = ()
    for _ in range(LEVEL_HALVINGS):
        middle = (low + high) / 2
        try:
            found = cheapest_shares(accuracy, offer, level=middle, tangents=tangents)
        except NoAnswer:
            high = middle
            continue
        tangents = found.tangents
        low, high = (middle, high) if found.bound_s <= most_s else (low, middle)
    return low


def shares_costs_s(accuracy: Accuracy, offer: Offer, levels: Sequence[float]) -> Array:
    """(n,) least cost of runs, whole or not, that reach levels; inf where none do [s]."""
    costs_s, tangents = np.full(len(levels), np.inf), tuple[Tangent, ...]()
    for place, level in enumerate(levels):
        try:
            found = cheapest_shares(accuracy, offer, level=level, tangents=tangents)
        except NoAnswer:
            continue
        costs_s[place], tangents = found.bound_s, found.tangents
    return costs_s


def _refuse(accuracy: Accuracy, information: Array) -> None:
    name, margin = accuracy.scarcest(information), accuracy.margin(information)
    most = f"with {MOST_RUNS} runs of every manoeuvre, or as many as the limits on durations allow"
    if not name:
        raise NoAnswer(
            f"design.accuracy cannot be reached: {most}, there is {np.exp(margin):.3g} times the information needed; "
            "other manoeuvres in the dictionary or better sensors would help"
        )
    raise NoAnswer(
        f"design.accuracy cannot be reached: the standard deviation of {name} is at best {np.exp(-margin / 2):.3g} "
        f"times the one asked for, {most}; a sensor with {np.exp(margin / 2):.3g} of the noise would do, or "
        "manoeuvres in the dictionary that excite it more"
    )


class _Cuts:
    """Linear inequalities A x >= b that all x = (runs n, time saved s) with margin above the level satisfy."""

    def __init__(self, *, accuracy: Accuracy, offer: Offer, level: float, tangents: Sequence[Tangent] = ()) -> None:
        """The inequality of the time saved, tangents known already, and a first one.

        Raises:
            NoAnswer: the most runs do not reach the level.
        """
        self.accuracy, self.offer, self.level = accuracy, offer, level
        most = offer.information(offer.most)
        if accuracy.margin(most) < level - REACHED:
            _refuse(accuracy, most)
        count = len(offer.cost_s)
        self.cost_s = np.r_[offer.cost_s, -1.0]
        self.bounds = np.r_[offer.fewest, 0.0], np.r_[offer.most, max(offer.way_s, 0.0)]
        self.inner = self._moved(offer.fewest, offer.most, min(level + 1.0, accuracy.margin(most)))
        self._A, self._b = [np.r_[offer.saved_s, -1.0], np.r_[np.ones(count), 0.0]], [0.0, 1.0]  # a trial has a run
        self._gradients = [np.zeros_like(most)] * 2
        self.tangents = list[Tangent]()
        for tangent in tangents:
            self._keep(tangent)
        self.add(offer.fewest)

    def add(self, runs: Array) -> None:
        """The inequality that is tangent where the way from runs (q,) that fall short to inner ones meets the level."""
        M = self.offer.information(self._reaching(runs))
        G = self.accuracy.supergradient(M)
        self._keep(Tangent(slope=G, offset=self.accuracy.margin(M) - float(np.sum(G * M))))

    def _keep(self, tangent: Tangent) -> None:
        matrices, G = self.offer.matrices, tangent.slope
        slope = matrices.reshape(len(matrices), -1) @ G.ravel()
        short = self.level - tangent.offset - float(np.sum(G * self.offer.known))
        self.tangents.append(tangent)
        size = max(float(np.abs(slope).max()), np.finfo(float).tiny)
        self._A.append(np.r_[slope / size, 0.0])
        self._b.append(short / size)
        self._gradients.append(G / size)

    def _reaching(self, runs: Array) -> Array:
        """Runs (q,) themselves where they nearly reach the level, else the first to do so on the way to the inner ones.

        At runs that tell far too little, information is nearly singular, and a tangent there says next to nothing.
        """
        return self._moved(runs, self.inner, self.level - TUNING.choice_gap)

    def _moved(self, runs: Array, inner: Array, level: float) -> Array:
        """The first runs that reach a level, from given ones to inner ones that do, on a grid of the way between.

        The margin is concave, so it rises where it is below the level. Its excess is interpolated between both ends of
        what is left, by the Illinois rule; where it is infinite, what is left is halved.
        """

        def excess(part: int) -> float:
            return self.accuracy.margin(self.offer.information(runs + part / most * (inner - runs))) - level

        most = 2**HALVINGS
        low, high, below = 0, most, excess(0)
        if below >= 0:
            return runs
        above, last = excess(most), 0
        while high - low > 1:
            share = below / (below - above) if np.isfinite(below) and above > 0 else 0.5
            middle = min(max(low + round(share * (high - low)), low + 1), high - 1)
            if (found := excess(middle)) >= 0:
                high, above, below = middle, found, below / (2 if last > 0 else 1)
            else:
                low, below, above = middle, found, above / (2 if last < 0 else 1)
            last = 1 if found >= 0 else -1
        return np.asarray(runs + high / most * (inner - runs))

    @property
    def rows(self) -> tuple[Array, Array]:
        """A (c, q + 1) and b (c,)."""
        return np.array(self._A), np.array(self._b)

    def worth(self, multipliers: Array) -> Array:
        """(d, d) of information, by the multipliers of the rows."""
        return np.asarray(np.tensordot(multipliers, np.array(self._gradients), axes=1))


def _relaxed(cuts: _Cuts) -> Relaxed:
    """The continuous problem, which leaves its tangents among the cuts."""
    offer, (low, high) = cuts.offer, cuts.bounds
    best = Relaxed(runs=offer.most, bound_s=-np.inf, worth=np.zeros_like(offer.known), worth_of_saved=0.0)
    for _ in range(CUTS):
        A, b = cuts.rows
        found = linprog(cuts.cost_s, A_ub=-A, b_ub=-b, bounds=np.column_stack([low, high]), method="highs")
        if found.x is None:
            break
        multipliers, runs = np.maximum(-found.ineqlin.marginals, 0.0), found.x[:-1]
        bound_s = max(best.bound_s, _dual_bound(A, b, cuts, multipliers))
        best = Relaxed(
            runs=runs,
            bound_s=bound_s,
            worth=cuts.worth(multipliers),
            worth_of_saved=min(float(multipliers[0]), 1.0),
            tangents=tuple(cuts.tangents[-TANGENTS:]),
        )
        if cuts.accuracy.margin(offer.information(runs)) >= cuts.level - TUNING.choice_gap / 10:
            break
        cuts.add(runs)
    return best


def _dual_bound(A: Array, b: Array, cuts: _Cuts, multipliers: Array) -> float:
    """Least cost within the limits by weak duality, for any multipliers that are not negative."""
    reduced, (low, high) = cuts.cost_s - multipliers @ A, cuts.bounds
    return float(multipliers @ b + np.where(reduced > 0, reduced * low, reduced * high).sum())
