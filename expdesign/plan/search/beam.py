"""Order and placement of the runs: a beam search over continuous poses.

A partial plan is a pose with the runs still to do. It is continued by a leg (an arc and a straight, a stretch of the
shortest way to the goal, or, for agile vessels, a joint: a short leg to any side with any turn) and one more run. Plans
with equally many runs compete on repositioning time so far plus a bound on what is left: the way to the goal less the
farthest that the remaining runs can carry the ship, at transit speed. Clearances are looked up on a grid here; every
leg and run is checked exactly later.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.errors import NoPlan
from expdesign.plan.legs import NEAR, HelmTimes
from expdesign.plan.search.heuristic import OrdersAhead, helmed_orders_ahead, orders_ahead
from expdesign.plan.search.local_search import ChainEnds, measured_s, polished
from expdesign.plan.search.state import PartialPlans, SearchSpace
from expdesign.plan.search.successors import Options, clear_options, continuations, joined, run_ends
from expdesign.plan.values import Placement
from expdesign.values import Array

POLISHED = 6
"""Orders of runs of which the best plan is polished; the best one then counts."""
CHUNK = 4096
"""Options checked for clearance at a time."""


def place_runs(
    space: SearchSpace,
    repeats: Sequence[int],
    *,
    start: Array,
    exit_mps: float = 0.0,
    last: str = "",
    width: int = 400,
    orders: int = POLISHED,
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
    names = [item.name for item in space.stamps]
    beam = PartialPlans(
        pose=start[None],
        exit_mps=np.array([exit_mps]),
        last=np.array([names.index(last) if last in names else -1]),
        left=np.array([repeats]),
        cost_s=np.zeros(1),
        history=((),),
    )
    ahead = _orders(space, repeats, start)
    for _ in range(int(np.sum(repeats))):
        beam = _advance(space, beam, width, ahead)
    final_s = beam.cost_s + _leg_to_goal_s(space, beam)
    best = int(np.argmin(final_s))
    if not np.isfinite(final_s[best]):
        raise NoPlan("no way to the goal from where the last run ends")
    runs, poses = _chain(beam, best)
    if orders and (space.times is not None or space.helm_times is not None):
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


def _orders(space: SearchSpace, repeats: Sequence[int], start: Array) -> OrdersAhead | None:
    """What orders lose, for vessels for which that is known."""
    carried = is_carried(space, repeats, start)
    if space.helm_times is not None:
        return helmed_orders_ahead(space, space.helm_times, repeats, carried=carried)
    return None if space.times is None else orders_ahead(space, space.times, repeats, carried=carried)


def is_carried(space: SearchSpace, repeats: Sequence[int], start: Array) -> bool:
    """Whether the way to the goal is longer than what runs can carry the ship."""
    carried_m = sum(
        count * float(np.hypot(*item.displacement[:2])) for item, count in zip(space.stamps, repeats, strict=True)
    )
    return bool(space.goal_way.to_goal(start[None, :2])[0] > carried_m)


def _advance(space: SearchSpace, beam: PartialPlans, width: int, ahead: OrdersAhead | None) -> PartialPlans:
    """The best partial plans with one more run each."""
    options = joined(
        [part for q in range(len(space.stamps)) if beam.left[:, q].any() for part in continuations(space, beam, q)]
    )
    cost = beam.cost_s[options.parent] + options.leg_s
    left = beam.left[options.parent].copy()
    left[np.arange(len(left)), options.primitive] -= 1
    end = run_ends(space, options.primitive, options.start)
    rest_s = _rest_s(space, end, left) + (0.0 if ahead is None else ahead.seconds(left, options.primitive))
    kept = _select(space, beam, options, end, left, cost + rest_s, width)
    if not len(kept):
        raise NoPlan(_what_blocks(space, beam))
    chosen = options[kept]
    return PartialPlans(
        pose=end[kept],
        exit_mps=np.array([space.stamps[q].exit_mps for q in chosen.primitive]),
        last=chosen.primitive,
        left=left[kept],
        cost_s=cost[kept],
        history=tuple(
            (*beam.history[parent], (int(q), start))
            for parent, q, start in zip(chosen.parent, chosen.primitive, chosen.start, strict=True)
        ),
    )


def _rest_s(space: SearchSpace, end: Array, left: np.ndarray) -> Array:
    """(n,) repositioning time still needed at least, by the way to the goal and what the runs left can carry [s]."""
    carried = left @ np.array([np.hypot(*item.displacement[:2]) for item in space.stamps])
    helped_m = (space.goal[:2] - end[:, :2]) @ space.current_to / space.ship.transit_speed_mps
    ahead_m = space.goal_way.to_goal(end[:, :2]) - carried - helped_m
    return np.asarray(np.clip(ahead_m, 0.0, None) / space.ship.transit_speed_mps)


def _select(
    space: SearchSpace, beam: PartialPlans, options: Options, end: Array, left: np.ndarray, total: Array, width: int
) -> np.ndarray:
    """Indices of the best options whose leg and run are clear, at most one for each kind of place and remainder."""
    order = np.argsort(total, kind="stable")
    order = order[np.isfinite(total[order])]
    places = np.rint(end[:, :2] / (2 * space.hull_m)).astype(int)
    headings = np.rint(wrap_angle(end[:, 2]) / 0.4).astype(int)
    kept: list[int] = []
    seen: set[tuple[int, ...]] = set()
    for first in range(0, len(order), CHUNK):
        chunk = order[first : first + CHUNK]
        for index in chunk[clear_options(space, beam, options[chunk])]:
            key = (*places[index], headings[index], *left[index])
            if key not in seen:
                seen.add(key)
                kept.append(int(index))
        if len(kept) >= width:
            break
    return np.array(kept[:width], dtype=int)


def _leg_to_goal_s(space: SearchSpace, beam: PartialPlans) -> Array:
    """Estimated time of the last leg from where plans end to the goal [s]."""
    pose = beam.pose
    distance = space.goal_way.to_goal(pose[:, :2])
    if space.helm_times is not None:
        return _helmed_to_goal_s(space, space.helm_times, beam, distance)
    away = space.goal[:2] - pose[:, :2]
    direct = np.arctan2(away[:, 1], away[:, 0])
    first, last = pose[:, 2] - direct, space.goal[2] - direct
    if space.times is not None:
        helped_m = away @ space.current_to / space.times.speed_mps
        way_m, turn = np.maximum(distance - helped_m, 0.0), space.goal[2] - pose[:, 2]
        more_s = np.where(way_m < NEAR * space.hull_m, space.times.settle_s / 2, 0.0)  # may turn out to be too near
        more_s += np.array([space.more_s(int(last), -1) for last in beam.last])
        return space.times.seconds(way_m, first, last, turn, beam.exit_mps, np.zeros(1)) + more_s
    turns = np.abs(wrap_angle(first)) + np.abs(wrap_angle(last))
    return np.asarray((distance + space.ship.turning_radius_m * turns) / space.ship.transit_speed_mps)


def _helmed_to_goal_s(space: SearchSpace, times: HelmTimes, beam: PartialPlans, distance: Array) -> Array:
    """The same for ships with a helm."""
    found = np.zeros(len(beam.pose))
    for index, (last, exit_mps) in enumerate(zip(beam.last.tolist(), beam.exit_mps.tolist(), strict=True)):
        ends = beam.pose[index : index + 1], space.goal[None]
        open_s = times.between_s(*ends, space.off(last), exit_mps, 0.0, current_to=space.current_to)
        found[index] = max(float(open_s[0]), float(times.seconds(distance[index], exit_mps, 0.0)))
    return found


def _what_blocks(space: SearchSpace, beam: PartialPlans) -> str:
    """The largest run that is still to do, and where the search came to a halt."""
    waiting = [item for q, item in enumerate(space.stamps) if beam.left[:, q].any()]
    largest = max(waiting, key=lambda item: float((np.hypot(*item.discs.T) + item.room_m).max()))
    north, east = beam.pose[0, :2]
    lat, lon = space.frame.to_degrees(np.array([north, east]))
    return (
        f"no room for {largest.name!r}: it goes up to {np.hypot(*largest.discs.T).max():.4g} m from its start and "
        f"needs up to {largest.room_m.max():.4g} m round its centre line (hull, plan.clearance_m, and what the "
        "vessel's parameter_std and the forecast add at plan.confidence); the search stopped near "
        f"{lat:.5f}, {lon:.5f} with {int(beam.left[0].sum())} runs to go"
    )
