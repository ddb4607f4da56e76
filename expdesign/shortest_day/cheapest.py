"""The whole runs of least cost that reach an accuracy, together with what is known.

    minimise  sum_q n_q c_q - s   subject to  f(K + sum_q n_q M_q) >= 0,  n_q whole numbers within limits,
                                              0 <= s <= sum_q n_q s_q,  s <= time of the way

s is the time of transit that the runs' own way made good saves, as far as there is a way to go. f is concave, so
without whole numbers an interior point finds the optimum to the last digits: what is chosen by its runs and by its
prices of information does not hang on rounding. Its cost is a bound, which is computed from the multipliers by weak
duality, and so holds whatever the accuracy. Where f has no second derivatives, as by E, tangents stand
for it, one more at a time. Whole runs are found from the optimum's runs by exchanges, see `exchanged`.

Source: S. Boyd and L. Vandenberghe, Convex Optimization (2004), 11.7, for the interior point; A. F. Veinott 1967 for
tangents where the way to inner points meets the boundary.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from expdesign.errors import NoAnswer
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.prices import MOST_RUNS, Offer
from expdesign.values import Array

CHOICE_GAP = 1e-3  # relative gap at which the choice of runs ends

LEAST_LEVEL, LEVEL_HALVINGS = -4.0, 12  # least margin of a day of a given length, and steps in search of the largest
CUTS = 200  # most linear bounds on an accuracy without second derivatives, in the choice of runs, not whole
HALVINGS = 12  # of the way to inner runs, in search of the boundary
# shares of the way from the fewest runs to the most at which inner runs are sought, and by how much of the margin the
# most runs are taken to be inside
INSIDE_SHARES, INSIDE = (0.5, 0.9, 0.99, 0.999, 1 - 1e-6), 1e-5
# most Newton steps to the cheapest runs, not whole, the gap at which they end in costs of a run, and the share of it
# that each aims for
NEWTON_STEPS, GAP, NEARER = 100, 1e-11, 0.1
EQUAL = 6  # decimals to which costs [s] are compared, so that rounding does not choose between equals
REACHED = 1e-9  # shortfall of the accuracy's margin that counts as reached
EXCHANGED = 24  # most manoeuvres of which runs are left out, and put in, in the search for whole runs


# Whole runs that reach an accuracy at little cost, from those of the continuous problem.
#
# Runs of the continuous problem are rounded up, which reaches the accuracy, as more runs never tell less. Then up to
# three runs at a time are left out or exchanged for at most two others, by the cheapest exchange that still reaches it,
# until none is cheaper. The tangent of the margin f at the present runs bounds f at all others, since f is concave; so
# most exchanges are ruled out without computing f.
#
# On the choices of the shortest day off Helsinki, 24 manoeuvres, it found the costs of a mixed-integer program by outer
# approximation in a twentieth of the time. It proves nothing; the bound is that of the continuous problem.
#
# Source: A. C. Atkinson, A. N. Donev and R. D. Tobias, Optimum Experimental Designs, with SAS (2007), 12.6, for
# exchanges.


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
    kept = np.nonzero((cost_s < offer.total_s(runs) * (1 - CHOICE_GAP)) & (tangent >= least))
    order = np.argsort(np.round(cost_s[kept], EQUAL), kind="stable")
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Relaxed:
    """The continuous problem's solution."""

    runs: Array  # (q,) not whole
    bound_s: float  # no runs, whole or not, cost less
    worth: Array  # (d, d) what information is worth at the margin: trace(G M) seconds
    worth_of_saved: float  # of a second of transit saved, from 0 to 1


def cheapest_runs(accuracy: Accuracy, offer: Offer, *, level: float = 0.0) -> Choice:
    """Whole runs that reach an accuracy at little cost.

    Args:
        accuracy: gives the margin f.
        offer: runs and their costs.
        level: of f that is to be reached; 0 reaches the accuracy.

    Raises:
        NoAnswer: no runs within the limits reach it.
    """
    relaxed = cheapest_shares(accuracy, offer, level=level)
    runs = np.clip(np.ceil(relaxed.runs - CHOICE_GAP), offer.fewest, offer.most)
    if not runs.any() or accuracy.margin(offer.information(runs)) < level:
        runs = np.minimum(runs + 1.0, offer.most)
    runs = exchanged(accuracy, offer, runs, level)
    return Choice(repeats=tuple(int(n) for n in runs), cost_s=offer.total_s(runs), bound_s=relaxed.bound_s)


def cheapest_shares(accuracy: Accuracy, offer: Offer, *, level: float = 0.0) -> Relaxed:
    """The cheapest runs, whole or not, and what information and way are worth at the margin; see `cheapest_runs`.

    Raises:
        NoAnswer: no runs within the limits reach it.
    """
    return _relaxed(_Relaxation(accuracy, offer, level))


def fullest_level(accuracy: Accuracy, offer: Offer, most_s: float) -> float:
    """The largest level of the margin f that runs, whole or not, reach at a cost of `most_s`.

    Levels are searched from `LEAST_LEVEL` to that of the most runs; the least where even it costs more.
    """
    low, high = LEAST_LEVEL, accuracy.margin(offer.information(offer.most))
    for _ in range(LEVEL_HALVINGS):
        middle = (low + high) / 2
        try:
            found = cheapest_shares(accuracy, offer, level=middle)
        except NoAnswer:
            high = middle
            continue
        low, high = (middle, high) if found.bound_s <= most_s else (low, middle)
    return low


def shares_costs_s(accuracy: Accuracy, offer: Offer, levels: Sequence[float]) -> Array:
    """(n,) least cost of runs, whole or not, that reach rising levels; inf where none do [s]."""
    costs_s = np.full(len(levels), np.inf)
    for place, level in enumerate(levels):
        with suppress(NoAnswer):
            costs_s[place] = cheapest_shares(accuracy, offer, level=level).bound_s
    return np.asarray(np.maximum.accumulate(costs_s))  # what bounds a level bounds those above it


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


class _Relaxation:
    """The continuous problem: minimise <cost, x> over x = (runs n, time saved s) with all of c(x) >= 0.

    The c are concave: what the margin is the least of, tangents in the place of what has no second derivatives, what
    the time saved and the number of runs obey, and the limits of x.
    """

    def __init__(self, accuracy: Accuracy, offer: Offer, level: float) -> None:
        """Raise NoAnswer where the most runs do not reach the level."""
        self.accuracy, self.offer = accuracy, offer
        most = accuracy.margin(offer.information(offer.most))
        if most < level - REACHED:
            _refuse(accuracy, offer.information(offer.most))
        self.level = min(level, most - INSIDE)
        self.cost_s = np.r_[offer.cost_s, -1.0]
        self.low, self.high = np.r_[offer.fewest, 0.0], np.r_[offer.most, max(offer.way_s, 0.0)]
        self.free = np.flatnonzero(self.high > self.low)
        has_run = np.r_[np.ones(len(offer.cost_s)), 0.0]
        self.A, self.b = np.array([np.r_[offer.saved_s, -1.0], has_run]), np.array([0.0, 1.0])
        self.cuts, self.offsets = list[Array](), list[float]()

    def add(self, runs: Array) -> None:
        """The tangent of the margin at runs (q,)."""
        M = self.offer.information(runs)
        self.cuts.append(self.accuracy.supergradient(M))
        self.offsets.append(self.accuracy.margin(M) - float(np.sum(self.cuts[-1] * M)))

    def inside(self) -> Array | None:
        """Some x with all c(x) > 0, or None."""
        for share in INSIDE_SHARES:
            x: Array = self.low + share * (self.high - self.low)
            x[-1] = min(float(x[-1]), share * float(self.offer.saved_s @ x[:-1]))
            if (self.constraints(x).c > 0).all():
                return x
        return None

    def constraints(self, x: Array) -> _Constraints:
        """The constraints at some x."""
        M, q = self.offer.information(x[:-1]), len(x) - 1
        parts = self.offer.matrices.reshape(q, -1)
        shares, gradients, curvatures = np.zeros(1), np.zeros((1, *M.shape)), np.zeros((0, q, q))
        if np.isfinite(self.accuracy.margin(M)):
            values, gradients, curvatures = self.accuracy.curved(M, self.offer.matrices)
            # the share of what is needed is concave as its logarithm is, and nearer to linear
            shares = np.exp(values - self.level)
            slopes = gradients.reshape(-1, M.size) @ parts.T
            curvatures = shares[:, None, None] * (curvatures - slopes[:, :, None] * slopes[:, None])
            gradients = shares[:, None, None] * gradients
        gradients = np.concatenate([gradients, np.array(self.cuts).reshape(-1, *M.shape)])
        tangents = [float(np.sum(G * M)) + offset for G, offset in zip(self.cuts, self.offsets, strict=True)]
        told = gradients.reshape(-1, M.size) @ parts.T
        needed = np.array([self.high[-1] > 0, self.low.sum() < 1])
        unit = np.eye(q + 1)[self.free]
        return _Constraints(
            c=np.concatenate(
                [
                    shares - 1.0,
                    np.array(tangents) - self.level,
                    (self.A @ x - self.b)[needed],
                    (x - self.low)[self.free],
                    (self.high - x)[self.free],
                ]
            ),
            slopes=np.concatenate([np.pad(told, ((0, 0), (0, 1))), self.A[needed], unit, -unit]),
            curvatures=np.pad(curvatures, ((0, 0), (0, 1), (0, 1))),
            gradients=gradients,
        )

    def bound_s(self, at: _Constraints, x: Array, y: Array) -> float:
        """Least cost by weak duality, for multipliers (m,) that are not negative of the constraints at x."""
        some = len(y) - 2 * len(self.free)
        reduced = self.cost_s - y[:some] @ at.slopes[:some]
        least = np.where(reduced > 0, reduced * self.low, reduced * self.high).sum()
        return float(least + y[:some] @ (at.slopes[:some] @ x - at.c[:some]))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Constraints:
    """Constraints c >= 0, the limits of x last."""

    c: Array  # (m,)
    slopes: Array  # (m, q + 1)
    curvatures: Array  # (k, q + 1, q + 1) minus the second derivatives of the first k
    gradients: Array  # (g, d, d) by the information, of the first g


def _interior(task: _Relaxation, x: Array) -> tuple[Array, Array]:
    """The solution (q + 1,) and the multipliers (m,) of its constraints, from some x inside them.

    Newton's method for the conditions of an optimum, in which what c_i has to spare times its multiplier is small
    instead of zero. What is spare is a number of its own, so that a step need not keep to curved constraints. Where
    there are several optima it ends in the midst of them.
    """
    free, size = task.free, float(np.abs(task.cost_s).max())
    cost, at = task.cost_s[free] / size, task.constraints(x)
    spare = at.c
    y = float(np.abs(cost @ x[free])) / (len(spare) * spare)
    for _ in range(NEWTON_STEPS):
        slopes, missing = at.slopes[:, free], at.c - spare
        gap, off = float(spare @ y), float(max(np.abs(cost - y @ slopes).max(), np.abs(missing).max()))
        if max(gap, off) < GAP:
            break
        small, bent = NEARER * max(gap, GAP) / len(y), at.curvatures[:, free][:, :, free]
        H = np.tensordot(y[: len(bent)], bent, axes=1) + slopes.T @ (slopes * (y / spare)[:, None])
        scale = 1.0 / np.sqrt(np.diag(H))
        wanted = (small - y * missing) / spare @ slopes - cost
        try:
            step = scale * np.linalg.solve(H * np.outer(scale, scale), scale * wanted)
        except np.linalg.LinAlgError:  # many tangents at nearly one place: no nearer in these numbers
            break
        grown = slopes @ step + missing
        rise = (small - y * grown) / spare - y
        length = min(1.0, 0.99 / max(float(np.max([-rise / y, -grown / spare])), 1e-300))
        x[free] += length * step
        y, spare, at = y + length * rise, spare + length * grown, task.constraints(x)
    return x, y * size


def _relaxed(task: _Relaxation) -> Relaxed:
    """The continuous problem's solution; where the margin has no second derivatives, by tangents, one more at a time.

    They are added where the way from runs that fall short to inner ones reaches the level.
    """
    offer, accuracy, inner = task.offer, task.accuracy, task.inside()
    best = Relaxed(runs=offer.most, bound_s=-np.inf, worth=np.zeros_like(offer.known), worth_of_saved=0.0)
    if inner is None:
        return best
    if not len(task.constraints(inner).curvatures):
        task.add(inner[:-1])
    for _ in range(CUTS):
        x, y = _interior(task, inner.copy())
        at = task.constraints(x)
        told = len(at.gradients)
        best = Relaxed(
            runs=x[:-1],
            bound_s=max(best.bound_s, task.bound_s(at, x, y)),
            worth=np.tensordot(y[:told], at.gradients, axes=1),
            worth_of_saved=min(float(y[told]), 1.0) if task.high[-1] > 0 else 0.0,
        )
        missing = task.level - accuracy.margin(offer.information(x[:-1]))
        if missing <= CHOICE_GAP / 10:
            break
        short, enough = x[:-1], inner[:-1]
        for _ in range(HALVINGS if missing > CHOICE_GAP else 0):
            middle = (short + enough) / 2
            reaches = accuracy.margin(offer.information(middle)) >= task.level
            short, enough = (short, middle) if reaches else (middle, enough)
        task.add(enough if missing > CHOICE_GAP else short)
    return best
