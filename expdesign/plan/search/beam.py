"""Order and placement of the runs: a beam search over continuous poses.

A partial plan is a pose with the runs still to do. The local planner of the ship proposes successors: legs and one more
run. Plans with equally many runs compete on repositioning time so far plus a heuristic: the path to the goal less the
largest displacement of the remaining runs, at transit speed, and what the best order of the remaining runs loses.
Clearances are looked up on a grid here; every leg and run is checked exactly later.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.errors import NoRoom
from expdesign.plan.bounds import cheapest_orders, place_values
from expdesign.plan.local_planner import Departure, PartialPlans, SearchSpace, Successors
from expdesign.plan.search.local_search import EQUAL, clear_successors, polished
from expdesign.plan.values import Placement, WorkBudget
from expdesign.processes import in_order
from expdesign.progress import Progress, silent
from expdesign.values import Array

BEAM_WIDTH = 400  # partial plans kept
PLACING_SHARE = 0.6  # of the work before orders are polished, for progress
POLISHED_ORDERS = 6  # orders of runs of which the best plan is polished; the best one then counts
CHECKED_AT_ONCE, SORTED_AT_ONCE = 1024, 8192  # successors checked for clearance at a time, and sorted
CELL_HULLS, HEADING_RAD = 2.0, 0.4  # places of which one successor is kept: their size in hull lengths, and in heading


@dataclass(frozen=True, kw_only=True, eq=False)
class OrdersAhead:
    """Least losses by what is left and what was last."""

    base: np.ndarray  # (q,) place values that number the combinations of runs left
    lost_s: Array  # (combinations, q) by the last run; (q, 1) by the next one where there are too many combinations

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


def place_runs(
    space: SearchSpace,
    repeats: Sequence[int],
    departure: Departure,
    *,
    width: int = BEAM_WIDTH,
    orders: int = POLISHED_ORDERS,
    budget: WorkBudget | None = None,
    progress: Progress = silent,
) -> tuple[Placement, ...]:
    """Start poses of all runs in the order in which they are to be done.

    Args:
        repeats: runs of each of the space's primitives.
        departure: where the search begins.
        width: partial plans kept.
        orders: of runs, of which the best plan is polished; 0 for none.
        progress: told each run that is placed, and each order that is polished.

    Raises:
        NoPlan: some run does not fit anywhere the search can reach; the message names it and the place.
    """
    beam = PartialPlans(
        pose=departure.pose[None],
        exit_mps=np.array([departure.exit_mps]),
        last=np.array([departure.last]),
        left=np.array([repeats]),
        cost_s=np.zeros(1),
        history=((),),
    )
    budget = budget or WorkBudget()
    ahead = orders_ahead(space, repeats, made_good=path_exceeds_displacement(space, repeats, departure.pose))
    count = int(np.sum(repeats))
    for number in range(count):
        progress(f"placing run {number + 1} of {count}", PLACING_SHARE * number / count)
        beam = _advance(space, beam, width, ahead, budget)
    final_s = np.round(beam.cost_s + space.planner.to_goal_s(space, beam), EQUAL)
    best = int(np.argmin(final_s))
    if not np.isfinite(final_s[best]):
        raise NoRoom("no path to the goal from where the last run ends", place=beam.pose[best, :2])
    runs, poses = _chain(beam, best)
    if orders:
        chains = list(_different(beam, final_s, orders))
        better = []
        for found in in_order(polished, (space, departure), chains):
            better.append(found)
            progress(
                "moving runs closer to each other", 1.0 - (1.0 - PLACING_SHARE) * (1.0 - len(better) / len(chains))
            )
        budget.placed(0, sum(found.moves for found in better))
        best = int(np.argmin([round(found.seconds, EQUAL) for found in better]))
        runs, poses = chains[best][0], better[best].poses
    names = [item.name for item in space.footprints]
    return tuple(Placement(primitive=names[q], pose=pose) for q, pose in zip(runs, poses, strict=True))


def _different(beam: PartialPlans, final_s: Array, count: int) -> Iterator[tuple[list[int], Array]]:
    """The best plans, each with another order of runs."""
    seen: set[tuple[int, ...]] = set()
    for index in np.argsort(final_s, kind="stable"):
        runs, poses = _chain(beam, int(index))
        if not np.isfinite(final_s[index]) or len(seen) == count:
            break
        if tuple(runs) not in seen:
            seen.add(tuple(runs))
            yield runs, poses


def _chain(beam: PartialPlans, index: int) -> tuple[list[int], Array]:
    """(n,) runs and (n, 3) poses of a plan."""
    history = beam.history[index]
    return [q for q, _ in history], np.array([pose for _, pose in history]).reshape(-1, 3)


def _advance(
    space: SearchSpace, beam: PartialPlans, width: int, ahead: OrdersAhead, budget: WorkBudget
) -> PartialPlans:
    """The best partial plans with one more run each."""
    found = space.planner.successors(space, beam)
    budget.placed(sum(map(len, found)))
    left = beam.left[:, None] - np.eye(len(space.footprints), dtype=int)  # (b, q, q) after each next run
    totals_s = _totals_s(space, beam, found, left, ahead)
    chosen = _select(space, found, left, totals_s, width)
    if not len(chosen):  # the grid may not know of a way that is there
        chosen = _select(space, found, left, totals_s, width, closed=True)
    if not len(chosen):
        raise _what_blocks(space, beam)
    return PartialPlans(
        pose=chosen.end,
        exit_mps=np.array([space.footprints[q].exit_mps for q in chosen.primitive]),
        last=chosen.primitive,
        left=left[chosen.parent, chosen.primitive],
        cost_s=beam.cost_s[chosen.parent] + chosen.leg_s,
        history=tuple(
            (*beam.history[parent], (int(q), start))
            for parent, q, start in zip(chosen.parent, chosen.primitive, chosen.start, strict=True)
        ),
    )


def _totals_s(
    space: SearchSpace, beam: PartialPlans, found: Sequence[Successors], left: np.ndarray, ahead: OrdersAhead
) -> Array:
    """(n,) least repositioning time of plans that go on with successors, of which runs (b, q, q) are left [s].

    After them at least that of the path to the goal less the displacement of the runs left, and what their order loses.
    """
    speed_mps = space.ship.transit_speed_mps
    made_good_m = left @ np.array([run.displacement_m for run in space.footprints])
    lost_s = ahead.seconds(left.clip(0), np.arange(len(space.footprints)))
    totals = []
    for part in found:
        next_run, place = (part.parent, part.primitive), part.end[:, :2]
        helped_m = (space.goal[:2] - place) @ space.current_to / speed_mps
        ahead_m = space.goal_distance.to_goal(place) - made_good_m[next_run] - helped_m
        rest_s = np.clip(ahead_m, 0.0, None) / speed_mps + lost_s[next_run]
        totals.append(beam.cost_s[part.parent] + part.leg_s + rest_s)
    return np.round(np.concatenate(totals), EQUAL)


def _select(
    space: SearchSpace,
    found: Sequence[Successors],
    left: np.ndarray,
    totals_s: Array,
    width: int,
    *,
    closed: bool = False,
) -> Successors:
    """The best successors whose leg and run are clear, at most one for each kind of place and remainder."""
    kept: list[int] = []
    seen: set[tuple[int, ...]] = set()
    for rows in _in_order(totals_s, CHECKED_AT_ONCE):
        some = Successors.chosen(found, rows)
        clear = clear_successors(space, some, closed=closed)
        some, rows = some[clear], rows[clear]
        places = np.rint(some.end[:, :2] / (CELL_HULLS * space.hull_m)).astype(int)
        headings = np.rint(wrap_angle(some.end[:, 2]) / HEADING_RAD).astype(int)
        kinds = np.column_stack([places, headings, left[some.parent, some.primitive]])
        for row, kind in zip(rows.tolist(), map(tuple, kinds.tolist()), strict=True):
            if kind not in seen:
                seen.add(kind)
                kept.append(row)
        if len(kept) >= width:
            break
    return Successors.chosen(found, np.array(kept[:width], dtype=int))


def _in_order(values: Array, at_once: int) -> Iterator[np.ndarray]:
    """Indices of finite values, the least first and equals as they come, so many at once."""
    left = np.flatnonzero(np.isfinite(values))
    while len(left):
        count = min(SORTED_AT_ONCE, len(left))
        among = values[left] <= np.partition(values[left], count - 1)[count - 1]
        some = left[among]
        order = some[np.argsort(values[some], kind="stable")]
        yield from (order[first : first + at_once] for first in range(0, len(order), at_once))
        left = left[~among]


def _what_blocks(space: SearchSpace, beam: PartialPlans) -> NoRoom:
    """The largest run that is still to do, and where the search came to a halt."""
    waiting = [item for q, item in enumerate(space.footprints) if beam.left[:, q].any()]
    largest = max(waiting, key=lambda item: float((np.hypot(*item.discs.T) + item.room_m).max()))
    place = beam.pose[0, :2]
    lat, lon = space.frame.to_degrees(place)
    return NoRoom(
        f"no room for {largest.name!r}: {largest.needs}; the search stopped near {lat:.5f}, {lon:.5f} with "
        f"{int(beam.left[0].sum())} runs to go",
        what="room",
        which=largest.name,
        place=place,
    )
