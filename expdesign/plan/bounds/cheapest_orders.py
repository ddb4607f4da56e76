"""The cheapest order of runs with repetitions, by dynamic programming over the remaining counts and the last run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.plan.bounds.tuning import BOUNDS
from expdesign.values import Array


def cheapest_orders(pairs: Array, home: Array, counts: Sequence[int]) -> Array | None:
    """(combinations, q) least cost over all orders of the remaining runs, by the last run; None for too many.

    Args:
        pairs: (q, q) cost from one to the next.
        home: (q,) cost after the last.
        counts: of each run.
    """
    sizes = np.array(counts) + 1
    if np.prod(sizes.astype(float)) > BOUNDS.order_states:
        return None
    base = place_values(counts)
    table = np.zeros((int(np.prod(sizes)), len(home)))
    table[0] = home
    for code in range(1, len(table)):
        some = np.flatnonzero(code // base % sizes)
        table[code] = (pairs[:, some] + table[code - base[some], some]).min(axis=1)
    return table


def place_values(counts: Sequence[int]) -> np.ndarray:
    """(q,) what one of each run adds to the index of a combination."""
    return np.asarray(np.r_[1, np.cumprod(np.array(counts) + 1)[:-1]].astype(int))
