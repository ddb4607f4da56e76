"""Whole runs that reach an accuracy at little cost, from those of the continuous problem.

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
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.offer import Offer
from expdesign.shortest_day.tuning import TUNING
from expdesign.values import Array


def exchanged(accuracy: Accuracy, offer: Offer, runs: Array, level: float) -> Array:
    """(q,) whole runs that reach a level of the margin and cost no more than whole runs (q,) that reach it."""
    while (better := next(_cheaper(accuracy, offer, runs, level), None)) is not None:
        runs = better
    return runs


def _cheaper(accuracy: Accuracy, offer: Offer, runs: Array, level: float) -> Iterator[Array]:
    """(q,) runs one exchange away that reach the level and are cheaper, the cheapest first."""
    least = level - TUNING.reached
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
    spare = order[runs[order] > offer.fewest[order]][: TUNING.exchanged]
    free = order[runs[order] < offer.most[order]][::-1][: TUNING.exchanged]
    out, put = _multisets(spare, (1, 2, 3), len(runs)), _multisets(free, (0, 1, 2), len(runs))
    return out[(runs - out >= offer.fewest).all(axis=1)], put[(runs + put <= offer.most).all(axis=1)]


def _multisets(places: NDArray[np.int64], sizes: Sequence[int], count: int) -> Array:
    """(m, q) how often each of q runs is in every multiset of these places and sizes."""
    some = [chosen for size in sizes for chosen in combinations_with_replacement(places.tolist(), size)]
    counts = np.zeros((len(some), count))
    for row, chosen in zip(counts, some, strict=True):
        np.add.at(row, np.array(chosen, dtype=int), 1.0)
    return counts
