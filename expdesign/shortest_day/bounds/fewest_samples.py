"""No day is shorter: a lower bound on the time in which any motion of a class tells what is needed.

Let f be the margin of an accuracy, concave in information, and B(x) the information of one sample. For a supergradient
G of f at any M, and a day of N samples that reaches the accuracy,

    0 <= f(sum_k B(x_k)) <= f(M) - <G, M> + sum_k <G, B(x_k)>    so    N >= (<G, M> - f(M)) / max_x <G, B(x)>

It holds for every M, and for every average of such inequalities. The best M is that of the measure over samples that
tells most per time, by the equivalence theorem. The measure is searched, the maximum over x is proved (`richest`).

Source: J. Kiefer and J. Wolfowitz, The equivalence of two extremum problems, Canad. J. Math. 12 (1960), 363-366;
S. D. Silvey, D. M. Titterington and B. Torsney, An algorithm for optimal designs on a finite design space, Commun.
Statist. A7 (1978), 1379-1389 (weights); combined here.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from expdesign.errors import InputError
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.bounds.motions import Motions
from expdesign.values import Array, sealed

ROUNDS = 40  # of adding samples to a measure

FIRST_BOXES = 4096  # about as many to begin with, at most
BOXES = 200_000  # most that a class of motions is parted into, where the bound is proved; fewer above four dimensions
FEW_BOXES = 20_000  # the same while the measure is searched
BOXES_AT_ONCE = 2000  # that are halved together
BOX_GAP = 0.02  # relative gap at which halving ends
KEPT_POINTS = 100  # best samples found, which the next measure may use
ROUNDING = 1e-9  # share by which the largest value is raised for the rounding of numbers
SAMPLES = 1500  # drawn from a class of motions for the first measure
STEPS = 15  # of its weights in a round
GAP = 0.01  # relative gap at which the measure is good enough
ADDED = 40  # most samples added in a round
ADDED_WEIGHT = 0.1  # of all of them
LEAST_WEIGHT = 1e-4  # of a sample, as a share of an equal one; others are left out
SEARCHES = 5  # for the sample that tells most, each with a better measure


# The sample that tells most by a multiplier, over all motions of a class: a number found, and one proved.
#
# With B(x) the information of one sample and G positive semidefinite, <G, B(x)> is a convex function of the regressors.
# Over a box they are an affine function of its coordinates but for an error. A convex function of an affine one is
# largest at a corner of the box, and of an affine function of the force at a corner of the forces. So
#
#     <G, B(x)> <= (sqrt(max over corners of the affine part) + sqrt(e^T |G| e))^2
#
# with the errors e, for all x in the box. Boxes where this is much above the best sample found are halved.
#
# Source: A. H. Land and A. G. Doig 1960 (branch and bound); combined here.

Indices = NDArray[np.intp]

HALF = np.triu_indices(4)  # pairs of (1, force): products are symmetric


@sealed(points="c d")
class Richest:
    """The largest <G, B(x)>."""

    found: float  # of a sample found
    bound: float  # no sample of the class has more
    points: Array  # (c, d) samples of which some have the most, and `found` is the best


def richest_sample(motions: Motions, multiplier: Array, *, most_boxes: int = BOXES) -> Richest:
    """The largest <G, B(x)> over a class of motions.

    Args:
        motions: the class.
        multiplier: (k, k) G, positive semidefinite, for the columns of `Motions.rows`.
        most_boxes: work limit; the bound holds with any.
    """
    G = multiplier * motions.equations
    boxes = _bounded(motions, G, *_first_boxes(motions))
    found, left = _samples(boxes), most_boxes * 16 / max(16, 2 ** len(motions.low))  # the work goes with the corners
    while left > 0:
        order = np.flatnonzero(boxes.bounds > found.best * (1 + BOX_GAP))
        if not len(order):
            break
        order = order[np.argsort(-boxes.bounds[order])[:BOXES_AT_ONCE]]
        left -= 2 * len(order)
        new = _bounded(motions, G, *_halved(boxes, order, motions.high - motions.low))
        new = replace(new, bounds=np.minimum(new.bounds, np.tile(boxes.bounds[order], 2)))
        found, boxes = found.with_more(_samples(new)), boxes.without(order).with_more(new)
    bound = max(found.best, float(boxes.bounds.max(initial=0.0))) * (1 + ROUNDING)
    return Richest(found=found.best, bound=bound, points=found.points)


def sample_values(motions: Motions, multiplier: Array, rows: Array) -> Array:
    """(b, f) <G, B> at points with rows (4, b, k), for every corner of the forces."""
    products = _products(rows.swapaxes(0, 1), multiplier * motions.equations)
    return products[:, *HALF] @ _monomials(motions.forces)


def _monomials(forces: Array) -> Array:
    """(10, f) products of (1, force) with itself, those of two different ones twice."""
    t = np.concatenate([np.ones((len(forces), 1)), forces], axis=1).T
    return np.asarray(t[HALF[0]] * t[HALF[1]] * np.where(HALF[0] == HALF[1], 1.0, 2.0)[:, None])


def _products(rows: Array, G: Array) -> Array:
    """(b, n, n) rows (b, n, k) by G by rows."""
    return np.asarray((rows @ G) @ rows.swapaxes(1, 2))


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Boxes with centres and half sides (b, d), upper bounds (b,), and samples (b, d) in them with values (b,)."""

    centres: Array
    halves: Array
    bounds: Array
    points: Array
    values: Array

    def without(self, order: Indices) -> _Boxes:
        return _Boxes(*(np.delete(item, order, axis=0) for item in vars(self).values()))

    def with_more(self, more: _Boxes) -> _Boxes:
        pairs = zip(vars(self).values(), vars(more).values(), strict=True)
        return _Boxes(*(np.concatenate(pair) for pair in pairs))


@dataclass(frozen=True, eq=False)
class _Samples:
    """The best samples (c, d) so far with their values (c,), best first."""

    points: Array
    values: Array

    @property
    def best(self) -> float:
        return float(self.values[0])

    def with_more(self, more: _Samples) -> _Samples:
        values = np.concatenate([self.values, more.values])
        order = np.argsort(-values, kind="stable")[:KEPT_POINTS]
        return _Samples(np.concatenate([self.points, more.points])[order], values[order])


def _samples(boxes: _Boxes) -> _Samples:
    order = np.argsort(-boxes.values, kind="stable")[:KEPT_POINTS]
    return _Samples(boxes.points[order], boxes.values[order])


def _bounded(motions: Motions, G: Array, centres: Array, halves: Array) -> _Boxes:
    """Boxes with upper bounds; the sample of each is at the corner where its bound is reached."""
    rows, error = motions.affine_rows(centres, halves)
    most = np.r_[1.0, np.abs(motions.forces).max(axis=0)]
    e = np.tensordot(most, error, axes=1)
    rest = np.einsum("bk,bk->b", e @ np.abs(G), e)
    # a corner's rows are those of (1, signs): its products follow from theirs
    b, d = centres.shape
    products = _products(rows.reshape(b, 4 * (d + 1), -1), G)
    products = products.reshape(b, 4, d + 1, 4, d + 1)[:, HALF[0], :, HALF[1]].reshape(10 * b, (d + 1) ** 2)
    monomials, top, best = _monomials(motions.forces), np.full(b, -np.inf), np.zeros((b, d))
    for signs in itertools.product((-1.0, 1.0), repeat=d):
        both = np.outer(np.r_[1.0, signs], np.r_[1.0, signs]).ravel()
        values = ((products @ both).reshape(10, b).T @ monomials).max(axis=1)
        best[values > top] = signs
        top = np.maximum(top, values)
    points = centres + best * halves
    values = sample_values(motions, G, motions.rows(points)).max(axis=1)
    bounds = (np.sqrt(np.maximum(top, 0.0)) + np.sqrt(rest)) ** 2
    return _Boxes(centres, halves, bounds, points, values)


def _first_boxes(motions: Motions) -> tuple[Array, Array]:
    """Centres and half sides (b, d): velocities are parted at zero, where moduli bend, other sides in up to eight."""
    edges, others = [], len(motions.low) - 3
    parts = int(min(8.0, max(2.0, (FIRST_BOXES / 8) ** (1 / max(others, 1)))))
    for side, (low, high) in enumerate(zip(motions.low, motions.high, strict=True)):
        parted = [low, *([0.0] if low < 0 < high else []), high] if side < 3 else np.linspace(low, high, parts + 1)
        edges.append(np.array(parted))
    grids = [np.meshgrid(*parts, indexing="ij") for parts in ([e[:-1] for e in edges], [e[1:] for e in edges])]
    lows, highs = (np.stack([axis.ravel() for axis in grid], axis=1) for grid in grids)
    return (lows + highs) / 2, (highs - lows) / 2


def _halved(boxes: _Boxes, order: Indices, whole: Array) -> tuple[Array, Array]:
    """Both halves of chosen boxes, across their longest side as a share of the whole."""
    centres, halves = boxes.centres[order], boxes.halves[order].copy()
    at, across = np.arange(len(order)), np.argmax(halves / np.where(whole > 0, whole, 1.0), axis=1)
    halves[at, across] /= 2
    step = np.zeros_like(halves)
    step[at, across] = halves[at, across]
    return np.concatenate([centres - step, centres + step]), np.tile(halves, (2, 1))


@sealed(multiplier="k k")
class SampleBound:
    """The fewest samples that reach an accuracy."""

    least: float  # no motion of the class reaches it with fewer; proved
    estimate: float  # the same if no sample tells more than those found; not proved
    enough: float  # samples that a measure over the class needs, whether a motion can follow it or not
    # (k, k) G for the columns of `Motions.rows`: the information of all that is accurate enough has <G, M> >= 1
    multiplier: Array


def fewest_samples(
    accuracy: Accuracy, motions: Motions, *, mean_subtraction: str, most_boxes: int = BOXES
) -> SampleBound | None:
    """The fewest samples of any motion of a class that reach an accuracy.

    Args:
        motions: the class.
        mean_subtraction: "none", "batch" or "complete".
        most_boxes: work limit of the proof; the bound holds with any.

    Returns:
        None where samples of the class do not inform about every parameter.

    Raises:
        InputError: the accuracy is reached by what is known before.
    """
    if accuracy.margin(np.zeros_like(accuracy.prior)) >= 0:
        raise InputError("the accuracy is reached without any sample")
    search = _Search(accuracy=accuracy, motions=motions, mean_subtraction=mean_subtraction)
    for _ in range(SEARCHES):
        measured = search.measured()
        if measured is None:
            return None
        multiplier, enough = measured
        richest = richest_sample(motions, multiplier, most_boxes=min(most_boxes, FEW_BOXES))
        if richest.found * enough < 1 + 2 * GAP:
            break
        search.add(richest)
    proved = richest_sample(motions, multiplier, most_boxes=most_boxes)
    return SampleBound(
        least=1.0 / proved.bound,
        estimate=1.0 / max(proved.found, richest.found),
        enough=enough,
        multiplier=multiplier,
    )


class _Search:
    """A measure over samples of a class, made better by turns."""

    def __init__(self, *, accuracy: Accuracy, motions: Motions, mean_subtraction: str) -> None:
        self.accuracy, self.motions, self.mean_subtraction = accuracy, motions, mean_subtraction
        rng = np.random.default_rng(0)
        self.rows = motions.rows(_drawn(motions, rng))
        force = motions.forces[rng.integers(len(motions.forces), size=self.rows.shape[1])]
        self.active = _with_force(self.rows, force)
        self.weights = np.full(len(self.active), 1.0 / len(self.active))
        self.samples = 1.0

    def add(self, richest: Richest) -> None:
        """Samples that the measure may use."""
        self.rows = np.concatenate([self.rows, self.motions.rows(richest.points)], axis=1)

    def measured(self) -> tuple[Array, float] | None:
        """A multiplier (k, k), with <G, M> >= 1 for all that is accurate enough, and the measure's own samples."""
        enough, cuts = np.inf, list[Array]()
        for _ in range(ROUNDS):
            cuts = []
            for _ in range(STEPS):
                M = self._information()
                margin = self.accuracy.margin(self.samples * self._centred(M))
                if not np.isfinite(margin):
                    return None
                self.samples *= np.exp(-margin)
                cuts.append(self._cut(M))
                self._reweigh(cuts[-1])
            enough = self.samples
            if self._extended(cuts[-1]):
                break
        return self._mixed(cuts), float(enough)

    def _information(self) -> Array:
        """(k, k) per sample, means beside the parameters."""
        return np.asarray(self.motions.equations * (self.active.T @ (self.weights[:, None] * self.active)))

    def _centred(self, M: Array) -> Array:
        """(d, d) what the accuracy counts: as it is bordered by the design."""
        p = len(self.motions.parameters)
        if self.mean_subtraction == "complete":
            return M
        if self.mean_subtraction == "batch":
            return np.asarray(M[:p, :p] - M[:p, p:] @ M[p:, :p])
        return M[:p, :p]

    def _cut(self, M: Array) -> Array:
        """(k, k) G of the inequality <G, M> >= 1, from the supergradient at the samples collected.

        Batches are centred each on its own means, which leaves no more than centring on any other.
        """
        p, here = len(self.motions.parameters), self.samples * self._centred(M)
        G = self.accuracy.supergradient(here)
        least = float(np.sum(G * here)) - self.accuracy.margin(here)
        if self.mean_subtraction == "complete":
            return np.asarray(G / least)
        C = M[:p, p:] if self.mean_subtraction == "batch" else np.zeros_like(M[:p, p:])
        return np.asarray(np.block([[G, -G @ C], [-C.T @ G, C.T @ G @ C]]) / least)

    def _reweigh(self, G: Array) -> None:
        values = np.einsum("ak,ak->a", self.active @ (G * self.motions.equations), self.active)
        power = 1.0 if self.accuracy.scarcest(self.samples * self._centred(self._information())) == "" else 0.5
        weights = self.weights * np.maximum(values, 0.0) ** power
        weights /= weights.sum()
        kept = weights > LEAST_WEIGHT / len(weights)
        self.active, self.weights = self.active[kept], weights[kept] / weights[kept].sum()

    def _extended(self, G: Array) -> bool:
        """Adds the samples that tell most; whether the measure was good enough without."""
        values = sample_values(self.motions, G, self.rows)
        best = values.max(axis=1)
        if best.max() * self.samples < 1 + GAP:
            return True
        chosen = np.argsort(-best)[:ADDED]
        chosen = chosen[best[chosen] * self.samples > 1]
        force = self.motions.forces[values[chosen].argmax(axis=1)]
        self.active = np.concatenate([self.active, _with_force(self.rows[:, chosen], force)])
        more = np.full(len(chosen), ADDED_WEIGHT / len(chosen))
        self.weights = np.concatenate([(1 - ADDED_WEIGHT) * self.weights, more])
        return False

    def _mixed(self, cuts: list[Array]) -> Array:
        """(k, k) the average of inequalities whose largest value over the samples is least."""
        values = np.array([sample_values(self.motions, G, self.rows).max(axis=1) for G in cuts])
        size = values.max()
        found = linprog(
            np.r_[np.zeros(len(cuts)), 1.0],
            A_ub=np.c_[values.T / size, -np.ones(values.shape[1])],
            b_ub=np.zeros(values.shape[1]),
            A_eq=np.r_[np.ones(len(cuts)), 0.0][None],
            b_eq=[1.0],
            method="highs",
        )
        shares = np.eye(len(cuts))[-1] if found.x is None else np.maximum(found.x[:-1], 0.0)
        return np.asarray(np.tensordot(shares / shares.sum(), np.array(cuts), axes=1))


def _with_force(rows: Array, force: Array) -> Array:
    """(b, k) rows (4, b, k) under a force (b, 3) each."""
    return np.asarray(rows[0] + np.einsum("bi,ibk->bk", force, rows[1:]))


def _drawn(motions: Motions, rng: np.random.Generator) -> Array:
    """(b, d) samples of the class: even inside it, or at its limits, coordinate by coordinate."""
    shape = (SAMPLES, len(motions.low))
    inside = rng.uniform(motions.low, motions.high, shape)
    ends = np.where(rng.random(shape) < 0.5, motions.low, motions.high)
    return np.asarray(np.where(rng.random(shape) < 0.5, ends, inside))
