"""The cheapest order of things of which there are several alike, by what is left and what was last."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.values import Array

MOST_COUNTS = 20_000
"""Combinations of what may be left for which it is worked out."""


def cheapest_orders(pairs: Array, home: Array, counts: Sequence[int]) -> Array | None:
    """(combinations, q) least cost of all orders of what is left, by what was last; None where there are too many.

    Args:
        pairs: (q, q) cost from one to the next.
        home: (q,) cost after the last.
        counts: how many of each there are.
    """
    sizes = np.array(counts) + 1
    if np.prod(sizes.astype(float)) > MOST_COUNTS:
        return None
    base = place_values(counts)
    table = np.zeros((int(np.prod(sizes)), len(home)))
    table[0] = home
    for code in range(1, len(table)):
        some = np.flatnonzero(code // base % sizes)
        table[code] = (pairs[:, some] + table[code - base[some], some]).min(axis=1)
    return table


def place_values(counts: Sequence[int]) -> np.ndarray:
    """(q,) what one of each adds to the number of a combination."""
    return np.asarray(np.r_[1, np.cumprod(np.array(counts) + 1)[:-1]].astype(int))
