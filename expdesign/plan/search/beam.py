"""Order and placement of the runs: a beam search over continuous poses.

A partial plan is a pose with the runs still to do. The local planner of the ship proposes successors: legs and one more
run. Plans with equally many runs compete on repositioning time so far plus a heuristic: the path to the goal less the
largest displacement of the remaining runs, at transit speed, and what the best order of the remaining runs loses.
Clearances are looked up on a grid here; every leg and run is checked exactly later.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.errors import NoPlan
from expdesign.plan.local_planner import PartialPlans, SearchSpace, Successors
from expdesign.plan.search.heuristic import OrdersAhead, orders_ahead, path_exceeds_displacement
from expdesign.plan.search.local_search import ChainEnds, measured_s, polished
from expdesign.plan.search.successors import clear_successors, run_ends
from expdesign.plan.search.tuning import SEARCH
from expdesign.plan.values import Placement
from expdesign.values import Array


def place_runs(
    space: SearchSpace,
    repeats: Sequence[int],
    *,
    start: Array,
    exit_mps: float = 0.0,
    last: str = "",
    width: int = SEARCH.beam_width,
    orders: int = SEARCH.polished_orders,
) -> tuple[Placement, ...]:
    """Start poses of all runs in the order in which they are to be done.

    Args:
        space: the primitives and the water.
        repeats: runs of each of the space's primitives.
        start: (3,) pose where the search begins.
        exit_mps: surge speed there.
        last: name of the primitive that ends there, if any.
        width: partial plans kept.
        orders: of runs, of which the best plan is polished; 0 for none.

    Raises:
        NoPlan: some run does not fit anywhere the search can reach; the message names it and the place.
    """
    names = [item.name for item in space.footprints]
    beam = PartialPlans(
        pose=start[None],
        exit_mps=np.array([exit_mps]),
        last=np.array([names.index(last) if last in names else -1]),
        left=np.array([repeats]),
        cost_s=np.zeros(1),
        history=((),),
    )
    ahead = orders_ahead(space, repeats, made_good=path_exceeds_displacement(space, repeats, start))
    for _ in range(int(np.sum(repeats))):
        beam = _advance(space, beam, width, ahead)
    final_s = beam.cost_s + space.planner.to_goal_s(space, beam)
    best = int(np.argmin(final_s))
    if not np.isfinite(final_s[best]):
        raise NoPlan("no path to the goal from where the last run ends")
    runs, poses = _chain(beam, best)
    if orders:
        ends = ChainEnds(start=start, exit_mps=exit_mps, last=names.index(last) if last else -1)
        chains = [(runs, polished(space, runs, poses, ends)) for runs, poses in _different(beam, final_s, orders)]
        runs, poses = min(chains, key=lambda chain: measured_s(space, chain[0], chain[1], ends))
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


def _advance(space: SearchSpace, beam: PartialPlans, width: int, ahead: OrdersAhead) -> PartialPlans:
    """The best partial plans with one more run each."""
    wanted = [q for q in range(len(space.footprints)) if beam.left[:, q].any()]
    found = Successors.joined([part for q in wanted for part in space.planner.successors(space, beam, q)])
    cost = beam.cost_s[found.parent] + found.leg_s
    left = beam.left[found.parent].copy()
    left[np.arange(len(left)), found.primitive] -= 1
    end = run_ends(space, found.primitive, found.start)
    rest_s = _rest_s(space, end, left) + ahead.seconds(left, found.primitive)
    kept = _select(space, beam, found, end, left, cost + rest_s, width)
    if not len(kept):
        raise NoPlan(_what_blocks(space, beam))
    chosen = found[kept]
    return PartialPlans(
        pose=end[kept],
        exit_mps=np.array([space.footprints[q].exit_mps for q in chosen.primitive]),
        last=chosen.primitive,
        left=left[kept],
        cost_s=cost[kept],
        history=tuple(
            (*beam.history[parent], (int(q), start))
            for parent, q, start in zip(chosen.parent, chosen.primitive, chosen.start, strict=True)
        ),
    )


def _rest_s(space: SearchSpace, end: Array, left: np.ndarray) -> Array:
    """(n,) least repositioning time left, by the path to the goal and the displacement of the runs left [s]."""
    made_good_m = left @ np.array([run.displacement_m for run in space.footprints])
    helped_m = (space.goal[:2] - end[:, :2]) @ space.current_to / space.ship.transit_speed_mps
    ahead_m = space.goal_distance.to_goal(end[:, :2]) - made_good_m - helped_m
    return np.asarray(np.clip(ahead_m, 0.0, None) / space.ship.transit_speed_mps)


def _select(
    space: SearchSpace, beam: PartialPlans, found: Successors, end: Array, left: np.ndarray, total: Array, width: int
) -> np.ndarray:
    """Indices of the best successors whose leg and run are clear, at most one for each kind of place and remainder."""
    order = np.argsort(total, kind="stable")
    order = order[np.isfinite(total[order])]
    places = np.rint(end[:, :2] / (SEARCH.cell_hulls * space.hull_m)).astype(int)
    headings = np.rint(wrap_angle(end[:, 2]) / SEARCH.heading_rad).astype(int)
    kept: list[int] = []
    seen: set[tuple[int, ...]] = set()
    for first in range(0, len(order), SEARCH.checked_at_once):
        chunk = order[first : first + SEARCH.checked_at_once]
        for index in chunk[clear_successors(space, found[chunk])]:
            key = (*places[index], headings[index], *left[index])
            if key not in seen:
                seen.add(key)
                kept.append(int(index))
        if len(kept) >= width:
            break
    return np.array(kept[:width], dtype=int)


def _what_blocks(space: SearchSpace, beam: PartialPlans) -> str:
    """The largest run that is still to do, and where the search came to a halt."""
    waiting = [item for q, item in enumerate(space.footprints) if beam.left[:, q].any()]
    largest = max(waiting, key=lambda item: float((np.hypot(*item.discs.T) + item.room_m).max()))
    north, east = beam.pose[0, :2]
    lat, lon = space.frame.to_degrees(np.array([north, east]))
    return (
        f"no room for {largest.name!r}: it goes up to {np.hypot(*largest.discs.T).max():.4g} m from its start and "
        f"needs up to {largest.room_m.max():.4g} m round its centre line (hull, plan.clearance_m, and what the "
        "vessel's parameter_std and the forecast add at plan.confidence); the search stopped near "
        f"{lat:.5f}, {lon:.5f} with {int(beam.left[0].sum())} runs to go"
    )
