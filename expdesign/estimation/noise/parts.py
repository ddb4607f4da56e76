"""Parts that noise may consist of: white, of the sensors, and slow ones, with their covariances in time.

The formula and its sources stand in `components`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.estimation.noise.timeline import Stretch, Turn
from expdesign.estimation.regression import Integers
from expdesign.estimation.tuning import TUNING
from expdesign.values import Array

WHITE, SENSOR = 0, 1
"""Places of the quick parts among the variances; slow ones follow."""
MEMORIES = 2.0 ** np.arange(1, 11)
"""Memories of slow parts [samples], at most the longest stretch; one more part lasts for ever."""


@dataclass(frozen=True)
class Slow:
    """A disturbance that lasts.

    Attributes:
        memory: how long [samples].
        turning: whether it keeps its side of the chart while the ship turns, not its side of the ship.
    """

    memory: float
    turning: bool = False


def slow_parts(parts: Sequence[Stretch]) -> tuple[Slow, ...]:
    """Slow parts that noise may have in stretches so long; those of the chart only where headings are known."""
    longest = max(part.samples for part in parts)
    memories = MEMORIES[longest >= MEMORIES].tolist()
    turns = any(part.turn is not None and np.ptp(part.turn) > TUNING.rounding for part in parts)
    ship, chart = [Slow(memory) for memory in (*memories, np.inf)], [Slow(memory, turning=True) for memory in memories]
    return (*ship, *chart) if turns else tuple(ship)


def alternatives(slow: Sequence[Slow], ordinates: int) -> list[tuple[Integers, float]]:
    """Parts that noise may consist of, and what they must earn: no slow ones, those of the ship, those of the chart."""
    quick = np.arange(2)
    kinds = [2 + np.flatnonzero([part.turning == kind for part in slow]) for kind in (False, True)]
    earned = np.log(ordinates) / 2
    return [(quick, 0.0), *((np.append(quick, kind), earned) for kind in kinds if len(kind))]


def directions_of(variances: Array, slow: Sequence[Slow]) -> tuple[Array, Array]:
    """How variances (2 + m,) may be wrong: directions (2 + m, d), and what is known about each beforehand (d,).

    The parts that are there may be larger or smaller, and slow ones may have the memory of their neighbours: what lasts
    long is known much worse than by the size of a part whose memory is given.
    """
    there = np.flatnonzero(variances)
    columns, before = list(np.eye(len(variances))[there]), [0.0] * len(there)
    for place in there[there > SENSOR].tolist():
        turning = slow[place - 2].turning
        ends = [other for other in (place - 1, place, place + 1) if 0 <= other - 2 < len(slow)]
        ends = [other for other in ends if slow[other - 2].turning == turning]
        if len(ends) > 1:
            column = np.zeros(len(variances))
            column[[ends[0], ends[-1]]] = np.array([-1.0, 1.0]) * variances[place] / (ends[-1] - ends[0])
            columns.append(column)
            before.append(TUNING.memory_doublings**-2.0)
    return np.reshape(columns, (-1, len(variances))).T, np.array(before)


def covariance_along(directions: tuple[Array, Array], information: Array) -> Array:
    """Covariance (q, q) of variances with this information (q, q) that are wrong in these `directions` only."""
    T, before = directions
    own = T.T @ information @ T + np.diag(before)
    size = np.sqrt(np.diag(own))
    size[size == 0] = 1.0
    return np.asarray(T @ (np.linalg.pinv(own / np.outer(size, size), hermitian=True) / np.outer(size, size)) @ T.T)


def filtered(index: int, slow: Sequence[Slow], W: Array, turn: Turn | None = None) -> Array:
    """(t, p) covariance matrix of a part, with unit variance, times W (t, p), under headings exp(i psi) (t,)."""
    if index == WHITE:
        return W
    if index == SENSOR:
        result = 2.0 * W
        result[1:] -= W[:-1]
        result[:-1] -= W[1:]
        return result
    part = slow[index - 2]
    if not part.turning:
        return _remembered(W, part.memory)
    assert turn is not None  # without headings there are no turning parts
    c, s = turn.real[:, None], turn.imag[:, None]
    return np.asarray(c * _remembered(c * W, part.memory) + s * _remembered(s * W, part.memory))


def _remembered(W: Array, memory: float) -> Array:
    keep = np.exp(-1.0 / memory)
    past = scipy.signal.lfilter([1.0], [1.0, -keep], W, axis=0)
    return np.asarray(past + scipy.signal.lfilter([1.0], [1.0, -keep], W[::-1], axis=0)[::-1] - W)
