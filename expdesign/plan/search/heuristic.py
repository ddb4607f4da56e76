"""Least loss of the legs between the remaining runs, in their best order: distinguishes good orders early."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.plan.bounds import cheapest_orders, place_values
from expdesign.plan.local_planner import SearchSpace
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class OrdersAhead:
    """Least losses by what is left and what was last.

    Attributes:
        base: (q,) place values that number the combinations of runs left.
        lost_s: (combinations, q) by the last run; (q, 1) by the next one where there are too many combinations.
    """

    base: np.ndarray
    lost_s: Array

    def seconds(self, left: np.ndarray, last: np.ndarray) -> Array:
        """(...,) time lost from plans with runs left (..., q) after runs (...,)."""
        if self.lost_s.shape[1] == 1 and len(self.lost_s) == left.shape[-1]:
            return np.asarray(left @ self.lost_s[:, 0])
        return np.asarray(self.lost_s[left @ self.base, last])


def orders_ahead(space: SearchSpace, repeats: Sequence[int], *, made_good: bool) -> OrdersAhead:
    """Least sums over the best orders.

    Args:
        space: the runs, and how legs between them lose time.
        repeats: of each run.
        made_good: whether displacement towards the goal counts, as the path is longer than that of all runs.
    """
    pairs, home = space.planner.losses_s(space, made_good=made_good)
    table = cheapest_orders(pairs, home, repeats)
    if table is None:
        return OrdersAhead(base=np.ones(len(repeats), dtype=int), lost_s=pairs.min(axis=0)[:, None])
    return OrdersAhead(base=place_values(repeats), lost_s=table)


def path_exceeds_displacement(space: SearchSpace, repeats: Sequence[int], start: Array) -> bool:
    """Whether the path to the goal is longer than what all runs can make good."""
    made_good_m = sum(count * run.displacement_m for run, count in zip(space.footprints, repeats, strict=True))
    return bool(space.goal_distance.to_goal(start[None, :2])[0] > made_good_m)
