"""Order and placement of the runs: a beam search over continuous poses.

A partial plan is a pose with the runs still to do. It is continued by a leg (an arc and a straight, or a stretch of
the shortest way to the goal) and one more run. Plans with equally many runs compete on repositioning time so far plus
a bound on what is left: the way to the goal less the farthest that the remaining runs can carry the ship, at transit
speed. Clearances are looked up on a grid here; every leg and run is checked exactly later.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.dictionary import Primitive
from expdesign.errors import NoPlan
from expdesign.plan.area import LocalFrame
from expdesign.plan.capability import Capability
from expdesign.plan.field import ClearanceField, GoalField
from expdesign.plan.footprint import covering_discs, disc_points, thinned_poses
from expdesign.plan.values import Placement
from expdesign.values import Array

TURNS = np.deg2rad([0, 15, -15, 30, -30, 50, -50, 75, -75, 105, -105, 140, -140, 180, -180])
STRAIGHTS = np.array([0.0, 2.0, 6.0])
"""Straight after a turn, beyond the run-up, in hull lengths."""
WAYS = np.array([5.0, 12.0, 25.0, 50.0, 100.0])
"""Stretches of the shortest way to the goal, in hull lengths; the whole way is always tried too."""
WAY_OFFSETS = np.deg2rad([0, 30, -30, 60, -60, 90, -90, 135, -135, 180])
CHUNK = 4096


@dataclass(frozen=True, kw_only=True, eq=False)
class Stamp:
    """A primitive as the search sees it.

    Attributes:
        name: of the primitive.
        discs: (n, 2) forward/starboard centres of the discs that cover its swept hull [m].
        times_s: (n,) when the hull is there [s].
        room_m: (n,) clearance that each disc centre needs [m].
        displacement: (3,) forward m, starboard m, turn rad through water.
        duration_s: of one run [s].
        entry_mps, exit_mps: surge speed at its ends.
    """

    name: str
    discs: Array
    times_s: Array
    room_m: Array
    displacement: Array
    duration_s: float
    entry_mps: float
    exit_mps: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchSpace:
    """What the search looks up.

    Attributes:
        stamps: the primitives to place.
        frame: for messages.
        field, goal_way: clearance and the way to the goal.
        goal: (3,) pose.
        ship: speeds and turns on legs.
        hull_m: hull length [m].
        leg_margin_m: clearance that leg centre lines need on the grid [m].
        current_to: (2,) mean current [m/s].
        run_up: extra straight before a run, by (name before, name) in hull lengths; grows where a leg failed.
        refused: (b, 3) start poses that turned out unreachable or unsafe; none is tried near them again.
    """

    stamps: tuple[Stamp, ...]
    frame: LocalFrame
    field: ClearanceField
    goal_way: GoalField
    goal: Array
    ship: Capability
    hull_m: float
    leg_margin_m: float
    current_to: Array
    run_up: Mapping[tuple[str, str], float] = dataclasses.field(default_factory=dict)
    refused: Array = dataclasses.field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Beam:
    """Partial plans with equally many runs.

    Attributes:
        pose: (b, 3) where they end; exit_mps (b,) how fast; last (b,) index of the last primitive, -1 at the start.
        left: (b, q) runs still to do.
        cost_s: (b,) repositioning time so far.
        history: per plan, its (primitive index, start pose) so far.
    """

    pose: Array
    exit_mps: Array
    last: np.ndarray
    left: np.ndarray
    cost_s: Array
    history: tuple[tuple[tuple[int, Array], ...], ...]


def stamp(primitive: Primitive, room_m: Array, *, length_m: float, beam_m: float) -> Stamp:
    """Reduce a primitive to what the search needs; `room_m` (k + 1,) is the clearance for discs at each sample."""
    centres, _ = covering_discs(length_m, beam_m)
    pose = primitive.trajectory.pose
    kept = thinned_poses(pose, reach_m=length_m / 2, spacing_m=length_m / 4)
    return Stamp(
        name=primitive.name,
        discs=disc_points(pose[kept], centres).reshape(-1, 2),
        times_s=np.repeat(kept * primitive.trajectory.sample_time_s, len(centres)),
        room_m=np.repeat(room_m[kept], len(centres)),
        displacement=primitive.displacement,
        duration_s=primitive.duration_s,
        entry_mps=float(primitive.entry_velocity[0]),
        exit_mps=float(primitive.exit_velocity[0]),
    )


def place_runs(
    space: SearchSpace, repeats: Sequence[int], *, start: Array, exit_mps: float = 0.0, last: str = "", width: int = 400
) -> tuple[Placement, ...]:
    """Start poses of all runs in the order in which they are to be done.

    Args:
        space: the primitives and the water.
        repeats: runs of each of the space's primitives.
        start: (3,) pose where the search begins.
        exit_mps: surge speed there.
        last: name of the primitive that ends there, if any.
        width: partial plans kept.

    Raises:
        NoPlan: some run does not fit anywhere the search can reach; the message names it and the place.
    """
    names = [item.name for item in space.stamps]
    beam = _Beam(
        pose=start[None],
        exit_mps=np.array([exit_mps]),
        last=np.array([names.index(last) if last in names else -1]),
        left=np.array([repeats]),
        cost_s=np.zeros(1),
        history=((),),
    )
    for _ in range(int(np.sum(repeats))):
        beam = _advance(space, beam, width)
    final_s = beam.cost_s + _leg_to_goal_s(space, beam.pose)
    best = int(np.argmin(final_s))
    if not np.isfinite(final_s[best]):
        raise NoPlan("no way to the goal from where the last run ends")
    return tuple(Placement(primitive=names[q], pose=pose) for q, pose in beam.history[best])


def _advance(space: SearchSpace, beam: _Beam, width: int) -> _Beam:
    """The best partial plans with one more run each."""
    options = [
        part for q in range(len(space.stamps)) if beam.left[:, q].any() for part in _continuations(space, beam, q)
    ]
    parent, primitive, start, leg_s, turn = (np.concatenate(column) for column in zip(*options, strict=True))
    end = _ends(space, primitive, start)
    cost = beam.cost_s[parent] + leg_s
    left = beam.left[parent].copy()
    left[np.arange(len(left)), primitive] -= 1
    carried = left @ np.array([np.hypot(*item.displacement[:2]) for item in space.stamps])
    ahead_m = space.goal_way.to_goal(end[:, :2]) - carried
    total = cost + np.clip(ahead_m, 0.0, None) / space.ship.transit_speed_mps
    kept = _select(space, beam, (parent, primitive, start, end, turn), left, total, width)
    if not len(kept):
        raise NoPlan(_what_blocks(space, beam))
    return _Beam(
        pose=end[kept],
        exit_mps=np.array([space.stamps[q].exit_mps for q in primitive[kept]]),
        last=primitive[kept],
        left=left[kept],
        cost_s=cost[kept],
        history=tuple((*beam.history[parent[i]], (int(primitive[i]), start[i])) for i in kept),
    )


_Columns = tuple[Array, Array, Array, Array, Array]


def _continuations(space: SearchSpace, beam: _Beam, q: int) -> list[_Columns]:
    """(parent, primitive, start pose, leg time, turn) of every way to begin primitive q after each partial plan."""
    able = np.flatnonzero(beam.left[:, q] > 0)
    runup = np.array([_run_up(space, int(last), q) for last in beam.last[able]])
    change_s = np.abs(beam.exit_mps[able] - space.stamps[q].entry_mps) / space.ship.acceleration_mps2
    return [_arcs(space, beam, able, q, runup, change_s), _transits(space, beam, able, q, change_s)]


def _run_up(space: SearchSpace, last: int, q: int) -> float:
    """Straight before a run [m]: one hull length to settle, more after failures."""
    before = space.stamps[last].name if last >= 0 else ""
    return space.hull_m * (1.0 + space.run_up.get((before, space.stamps[q].name), 0.0))


def _arcs(space: SearchSpace, beam: _Beam, able: np.ndarray, q: int, runup: Array, change_s: Array) -> _Columns:
    turn, extra = (grid.ravel() for grid in np.meshgrid(TURNS, STRAIGHTS * space.hull_m))
    pose = np.repeat(beam.pose[able], len(turn), axis=0)
    turns, straight = np.tile(turn, len(able)), np.tile(extra, len(able)) + np.repeat(runup, len(turn))
    length = space.ship.turning_radius_m * np.abs(turns) + straight
    leg_s = length / space.ship.transit_speed_mps + np.repeat(change_s, len(turn))
    start = _arc_end(pose, turns, straight, space.ship.turning_radius_m)
    parent = np.repeat(able, len(turn))
    return parent, np.full(len(parent), q), start, leg_s, turns


def _arc_end(pose: Array, turn: Array, straight: Array, radius: float) -> Array:
    """Poses after an arc and a straight; the b-frame end of an arc is R (sin |turn|, +-(1 - cos turn))."""
    forward = radius * np.sin(np.abs(turn)) + straight * np.cos(turn)
    starboard = np.sign(turn) * radius * (1 - np.cos(turn)) + straight * np.sin(turn)
    return _moved(pose, np.stack([forward, starboard, turn], axis=1))


def _moved(pose: Array, step: Array) -> Array:
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    north = pose[:, 0] + c * step[:, 0] - s * step[:, 1]
    east = pose[:, 1] + s * step[:, 0] + c * step[:, 1]
    return np.stack([north, east, pose[:, 2] + step[:, 2]], axis=1)


def _transits(space: SearchSpace, beam: _Beam, able: np.ndarray, q: int, change_s: Array) -> _Columns:
    parents, starts, times = [], [], []
    for index, wait in zip(able, change_s, strict=True):
        points, along = _way_points(space, beam.pose[index])
        if not len(points):
            continue
        heading = np.arctan2(points[:, 3], points[:, 2])
        first = np.abs(wrap_angle(heading[:1] - beam.pose[index, 2]))
        for offset in WAY_OFFSETS:
            length = along + space.ship.turning_radius_m * (abs(offset) + first)
            starts.append(np.column_stack([points[:, :2], heading + offset]))
            times.append(length / space.ship.transit_speed_mps + wait)
            parents.append(np.full(len(points), index))
    if not starts:
        return np.zeros(0, int), np.zeros(0, int), np.zeros((0, 3)), np.zeros(0), np.zeros(0)
    parent = np.concatenate(parents)
    return parent, np.full(len(parent), q), np.concatenate(starts), np.concatenate(times), np.full(len(parent), np.nan)


def _way_points(space: SearchSpace, pose: Array) -> tuple[Array, Array]:
    """Rows (north, east, direction north, direction east) along the way to the goal, and their distances along it."""
    way = space.goal_way.way(pose[:2])
    if len(way) < 3:
        return np.zeros((0, 4)), np.zeros(0)
    steps = np.hypot(*np.diff(way, axis=0).T)
    along = np.r_[0.0, np.cumsum(steps)] / np.sqrt(1.0824)
    wished = np.r_[WAYS * space.hull_m, along[-1]]
    at = np.searchsorted(along, wished[wished <= along[-1]]).clip(1, len(way) - 1)
    back = np.maximum(at - 5, 0)
    ahead = np.minimum(at + 5, len(way) - 1)
    return np.column_stack([way[at], way[ahead] - way[back]]), along[at]


def _ends(space: SearchSpace, primitive: np.ndarray, start: Array) -> Array:
    steps = np.array([item.displacement for item in space.stamps])[primitive]
    end = _moved(start, steps)
    end[:, :2] += space.current_to * np.array([item.duration_s for item in space.stamps])[primitive][:, None]
    return end


def _select(
    space: SearchSpace, beam: _Beam, options: _Columns, left: np.ndarray, total: Array, width: int
) -> np.ndarray:
    """Indices of the best options whose leg and run are clear, at most one for each kind of place and remainder."""
    parent, primitive, start, end, turn = options
    order = np.argsort(total, kind="stable")
    order = order[np.isfinite(total[order])]
    kept: list[int] = []
    seen: set[tuple[int, ...]] = set()
    for first in range(0, len(order), CHUNK):
        chunk = order[first : first + CHUNK]
        clear = _clear(space, beam.pose[parent[chunk]], primitive[chunk], start[chunk], turn[chunk])
        clear &= space.field.at(end[chunk, :2]) >= space.leg_margin_m
        for index in chunk[clear]:
            place = np.rint(end[index, :2] / (2 * space.hull_m)).astype(int)
            key = (*place, int(np.rint(wrap_angle(end[index, 2]) / 0.4)), *left[index])
            if key not in seen:
                seen.add(key)
                kept.append(int(index))
        if len(kept) >= width:
            break
    return np.array(kept[:width], dtype=int)


def _clear(space: SearchSpace, pose: Array, primitive: np.ndarray, start: Array, turn: Array) -> np.ndarray:
    """Whether the arcs and the runs of some options keep their margins on the grid."""
    clear = space.field.at(start[:, :2]) >= space.leg_margin_m
    for bad in space.refused:
        near = np.hypot(*(start[:, :2] - bad[:2]).T) < space.hull_m / 2
        clear &= ~(near & (np.abs(wrap_angle(start[:, 2] - bad[2])) < 0.2))
    arcs = np.flatnonzero(clear & ~np.isnan(turn))
    clear[arcs] = _arcs_clear(space, pose[arcs], turn[arcs], start[arcs])
    for q in np.unique(primitive[clear]):
        some = np.flatnonzero(clear & (primitive == q))
        item = space.stamps[q]
        c, s = np.cos(start[some, 2])[:, None], np.sin(start[some, 2])[:, None]
        north = start[some, :1] + c * item.discs[:, 0] - s * item.discs[:, 1] + space.current_to[0] * item.times_s
        east = start[some, 1:2] + s * item.discs[:, 0] + c * item.discs[:, 1] + space.current_to[1] * item.times_s
        clear[some] = (space.field.at(np.stack([north, east], axis=-1)) >= item.room_m).all(axis=1)
    return clear


def _arcs_clear(space: SearchSpace, pose: Array, turn: Array, start: Array) -> np.ndarray:
    """Whether arc-and-straight legs from poses to run starts keep the leg margin at points along them."""
    radius = space.ship.turning_radius_m
    corner = _arc_end(pose, turn, np.zeros(len(turn)), radius)
    shares = np.linspace(0.1, 1.0, 10)
    clear = np.ones(len(turn), dtype=bool)
    for share in shares:
        on_arc = _arc_end(pose, share * turn, np.zeros(len(turn)), radius)[:, :2]
        on_line = corner[:, :2] + share * (start[:, :2] - corner[:, :2])
        clear &= np.minimum(space.field.at(on_arc), space.field.at(on_line)) >= space.leg_margin_m
    return clear


def _leg_to_goal_s(space: SearchSpace, pose: Array) -> Array:
    """Estimated time of the last leg from poses (b, 3) to the goal [s]."""
    distance = space.goal_way.to_goal(pose[:, :2])
    direct = np.arctan2(space.goal[1] - pose[:, 1], space.goal[0] - pose[:, 0])
    turns = np.abs(wrap_angle(direct - pose[:, 2])) + np.abs(wrap_angle(space.goal[2] - direct))
    return np.asarray((distance + space.ship.turning_radius_m * turns) / space.ship.transit_speed_mps)


def _what_blocks(space: SearchSpace, beam: _Beam) -> str:
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


def refusing(space: SearchSpace, before: str, placement: Placement) -> SearchSpace:
    """The same space after a leg to, or a run from, a placement failed: not there again, and more run-up."""
    pair = (before, placement.primitive)
    grown = {**space.run_up, pair: space.run_up.get(pair, 0.0) + 0.5}
    return replace(space, run_up=grown, refused=np.vstack([space.refused, placement.pose]))
