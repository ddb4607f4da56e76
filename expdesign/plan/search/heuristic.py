"""What the joints between runs still to be done lose at least, in the best order: tells good orders apart early.

Every run is taken to begin at a heading that lets it carry the ship the way it has to go, or at one that suits the
joint better at the price of what it then carries less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.bounds import cheapest_orders, place_values
from expdesign.plan.legs import TURNS, WISHES, HelmTimes, LegTimes, joint_lost_s
from expdesign.plan.search.state import SearchSpace, Stamp, TriedJoint
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
        """(n,) time lost from plans with runs left (n, q) after runs (n,)."""
        if self.lost_s.shape[1] == 1 and len(self.lost_s) == left.shape[1]:
            return np.asarray(left @ self.lost_s[:, 0])
        return np.asarray(self.lost_s[left @ self.base, last])


def orders_ahead(space: SearchSpace, times: LegTimes, repeats: Sequence[int], *, carried: bool) -> OrdersAhead:
    """The table for runs and their counts; `carried` when the way is longer than what they can carry the ship."""
    stamps = space.stamps
    pairs = np.array(
        [[_joint_s(a, b, times, space.tried.get((a.name, b.name)), carried=carried) for b in stamps] for a in stamps]
    )
    home = np.array([_home_s(a, times) + space.more_s(k, -1) for k, a in enumerate(stamps)])
    return _tabled(pairs, home, repeats)


def helmed_orders_ahead(space: SearchSpace, times: HelmTimes, repeats: Sequence[int], *, carried: bool) -> OrdersAhead:
    """The same for ships with a helm: what changes of speed lose."""
    stamps = space.stamps
    pairs = np.array([[times.lost_s(a.exit_mps, b.entry_mps, carried=carried) for b in stamps] for a in stamps])
    home = np.array([times.lost_s(a.exit_mps, 0.0, carried=carried) for a in stamps])
    return _tabled(pairs, home, repeats)


def _tabled(pairs: Array, home: Array, repeats: Sequence[int]) -> OrdersAhead:
    """Least sums over the best orders from pairs (q, q), the run before in rows, and ways home (q,)."""
    table = cheapest_orders(pairs, home, repeats)
    if table is None:
        return OrdersAhead(base=np.ones(len(repeats), dtype=int), lost_s=pairs.min(axis=0)[:, None])
    return OrdersAhead(base=place_values(repeats), lost_s=table)


def _joint_s(before: Stamp, after: Stamp, times: LegTimes, tried: TriedJoint | None, *, carried: bool) -> float:
    """Least time lost between two runs that carry the ship one way."""
    lost = joint_lost_s(times, before.exit_mps, after.entry_mps, short=tried is None)
    if not carried:
        return min(float(lost.min()), np.inf if tried is None else tried.seconds)
    astray = wrap_angle(TURNS - before.way_ahead_rad + after.course_rad)
    carry_s = float(np.hypot(*after.displacement[:2])) / times.speed_mps
    least_s = float((lost[:, _nearest(before)] + carry_s * (1 - np.cos(astray))).min())
    if tried is None:
        return least_s
    least_s += tried.more_s
    way = np.array([np.cos(before.way_ahead_rad), np.sin(before.way_ahead_rad)])
    return min(least_s, tried.seconds - float(tried.step[:2] @ way) / times.speed_mps)


def _home_s(last: Stamp, times: LegTimes) -> float:
    return float(joint_lost_s(times, last.exit_mps, 0.0)[:, _nearest(last)].min())


def _nearest(run: Stamp) -> int:
    return int(np.abs(wrap_angle(WISHES - run.way_ahead_rad)).argmin())
