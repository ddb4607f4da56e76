"""The sample that tells most by a multiplier, over all motions of a class: a number found, and one proved.

With B(x) the information of one sample and G positive semidefinite, <G, B(x)> is a convex function of the regressors.
Over a box they are an affine function of its coordinates but for an error. A convex function of an affine one is
largest at a corner of the box, and of an affine function of the force at a corner of the forces. So

    <G, B(x)> <= (sqrt(max over corners of the affine part) + sqrt(e^T |G| e))^2

with the errors e, for all x in the box. Boxes where this is much above the best sample found are halved.

Source: A. H. Land and A. G. Doig 1960 (branch and bound); combined here.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.shortest_day.bounds.motions import Motions
from expdesign.shortest_day.bounds.tuning import TUNING
from expdesign.values import Array, seal

Indices = NDArray[np.intp]


@dataclass(frozen=True, kw_only=True, eq=False)
class Richest:
    """The largest <G, B(x)>.

    Attributes:
        found: of a sample found.
        bound: no sample of the class has more.
        points: (c, d) samples of which some have the most, and `found` is the best.
    """

    found: float
    bound: float
    points: Array

    def __post_init__(self) -> None:
        seal(self, points="c d")


def richest_sample(motions: Motions, multiplier: Array, *, most_boxes: int = TUNING.boxes) -> Richest:
    """The largest <G, B(x)> over a class of motions.

    Args:
        motions: the class.
        multiplier: (k, k) G, positive semidefinite, for the columns of `Motions.rows`.
        most_boxes: work limit; the bound holds with any.
    """
    G = multiplier * motions.equations
    monomials = _monomials(motions.forces)
    boxes = _bounded(motions, G, monomials, *_first_boxes(motions))
    found, left = _samples(boxes), most_boxes * 16 / max(16, 2 ** len(motions.low))  # the work goes with the corners
    while left > 0:
        order = np.flatnonzero(boxes.bounds > found.best * (1 + TUNING.box_gap))
        if not len(order):
            break
        order = order[np.argsort(-boxes.bounds[order])[: TUNING.boxes_at_once]]
        left -= 2 * len(order)
        new = _bounded(motions, G, monomials, *_halved(boxes, order, motions.high - motions.low))
        new = replace(new, bounds=np.minimum(new.bounds, np.tile(boxes.bounds[order], 2)))
        found, boxes = found.with_more(_samples(new)), boxes.without(order).with_more(new)
    bound = max(found.best, float(boxes.bounds.max(initial=0.0))) * (1 + TUNING.rounding)
    return Richest(found=found.best, bound=bound, points=found.points)


def sample_values(motions: Motions, multiplier: Array, rows: Array) -> Array:
    """(b, f) <G, B> at points with rows (4, b, k), for every corner of the forces."""
    return _quadratic(rows, multiplier * motions.equations) @ _monomials(motions.forces)


def _monomials(forces: Array) -> Array:
    """(16, f) products of (1, force) with itself."""
    t = np.concatenate([np.ones((len(forces), 1)), forces], axis=1)
    return np.asarray((t[:, :, None] * t[:, None, :]).reshape(len(forces), 16).T)


def _quadratic(rows: Array, G: Array) -> Array:
    """(b, 16) rows (4, b, k) by G by rows."""
    return np.asarray(np.einsum("ibk,jbk->bij", rows @ G, rows).reshape(-1, 16))


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
        order = np.argsort(-values, kind="stable")[: TUNING.kept_points]
        return _Samples(np.concatenate([self.points, more.points])[order], values[order])


def _samples(boxes: _Boxes) -> _Samples:
    order = np.argsort(-boxes.values, kind="stable")[: TUNING.kept_points]
    return _Samples(boxes.points[order], boxes.values[order])


def _bounded(motions: Motions, G: Array, monomials: Array, centres: Array, halves: Array) -> _Boxes:
    """Boxes with upper bounds; the sample of each is at the corner where its bound is reached."""
    middle, slopes, error = motions.affine_rows(centres, halves)
    most = np.r_[1.0, np.abs(motions.forces).max(axis=0)]
    e = np.tensordot(most, error, axes=1)
    rest = np.einsum("bk,bk->b", e @ np.abs(G), e)
    top, points = np.full(len(centres), -np.inf), centres.copy()
    for signs in itertools.product((-1.0, 1.0), repeat=len(slopes)):
        corner = middle + np.tensordot(np.array(signs), slopes, axes=1)
        values = (_quadratic(corner, G) @ monomials).max(axis=1)
        points = np.where((values > top)[:, None], centres + np.array(signs) * halves, points)
        top = np.maximum(top, values)
    values = (_quadratic(motions.rows(points), G) @ monomials).max(axis=1)
    bounds = (np.sqrt(np.maximum(top, 0.0)) + np.sqrt(rest)) ** 2
    return _Boxes(centres, halves, bounds, points, values)


def _first_boxes(motions: Motions) -> tuple[Array, Array]:
    """Centres and half sides (b, d): velocities are parted at zero, where moduli bend, other sides in up to eight."""
    edges, others = [], len(motions.low) - 3
    parts = int(min(8.0, max(2.0, (TUNING.first_boxes / 8) ** (1 / max(others, 1)))))
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
