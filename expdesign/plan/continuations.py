"""How a partial plan can go on: an arc and a straight, or a stretch of the way to the goal; and whether it is clear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.field import OCTILE_EXCESS
from expdesign.plan.search_space import PartialPlans, SearchSpace
from expdesign.values import Array

TURNS = np.deg2rad([0, 15, -15, 30, -30, 50, -50, 75, -75, 105, -105, 140, -140, 180, -180])
STRAIGHTS = np.array([0.0, 2.0, 6.0])
"""Straight after a turn, beyond the run-up, in hull lengths."""
WAYS = np.array([5.0, 12.0, 25.0, 50.0, 100.0])
"""Stretches of the shortest way to the goal, in hull lengths; the whole way is always tried too."""
WAY_OFFSETS = np.deg2rad([0, 30, -30, 60, -60, 90, -90, 135, -135, 180])


@dataclass(frozen=True, kw_only=True, eq=False)
class Options:
    """Ways to go on, one per row.

    Attributes:
        parent: (n,) index of the partial plan.
        primitive: (n,) index of the run to do next.
        start: (n, 3) where it begins.
        leg_s: (n,) time to get there.
        turn: (n,) angle of the arc that leads there, before a straight; nan for stretches of the way to the goal.
    """

    parent: np.ndarray
    primitive: np.ndarray
    start: Array
    leg_s: Array
    turn: Array

    def __getitem__(self, rows: np.ndarray) -> Options:
        return Options(**{name: column[rows] for name, column in vars(self).items()})


def joined(parts: Sequence[Options]) -> Options:
    """All rows of several sets of options."""
    return Options(**{name: np.concatenate([vars(part)[name] for part in parts]) for name in vars(parts[0])})


def continuations(space: SearchSpace, beam: PartialPlans, q: int) -> list[Options]:
    """Every way to begin primitive q after each partial plan."""
    able = np.flatnonzero(beam.left[:, q] > 0)
    runup = np.array([_run_up(space, int(last), q) for last in beam.last[able]])
    change_s = np.abs(beam.exit_mps[able] - space.stamps[q].entry_mps) / space.ship.acceleration_mps2
    return [_arcs(space, beam, able, q, runup, change_s), _transits(space, beam, able, q, change_s)]


def _run_up(space: SearchSpace, last: int, q: int) -> float:
    """Straight before a run [m]: one hull length to settle, more after failures."""
    before = space.stamps[last].name if last >= 0 else ""
    return space.hull_m * (1.0 + space.run_up.get((before, space.stamps[q].name), 0.0))


def _arcs(space: SearchSpace, beam: PartialPlans, able: np.ndarray, q: int, runup: Array, change_s: Array) -> Options:
    turn, extra = (grid.ravel() for grid in np.meshgrid(TURNS, STRAIGHTS * space.hull_m))
    pose = np.repeat(beam.pose[able], len(turn), axis=0)
    turns, straight = np.tile(turn, len(able)), np.tile(extra, len(able)) + np.repeat(runup, len(turn))
    length = space.ship.turning_radius_m * np.abs(turns) + straight
    leg_s = length / space.ship.transit_speed_mps + np.repeat(change_s, len(turn))
    start = _arc_end(pose, turns, straight, space.ship.turning_radius_m)
    parent = np.repeat(able, len(turn))
    return Options(parent=parent, primitive=np.full(len(parent), q), start=start, leg_s=leg_s, turn=turns)


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


def _transits(space: SearchSpace, beam: PartialPlans, able: np.ndarray, q: int, change_s: Array) -> Options:
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
    return Options(
        parent=np.concatenate([np.zeros(0, dtype=int), *parents]),
        primitive=np.full(sum(map(len, parents)), q),
        start=np.concatenate([np.zeros((0, 3)), *starts]),
        leg_s=np.concatenate([np.zeros(0), *times]),
        turn=np.full(sum(map(len, parents)), np.nan),
    )


def _way_points(space: SearchSpace, pose: Array) -> tuple[Array, Array]:
    """Rows (north, east, direction north, direction east) along the way to the goal, and their distances along it."""
    way = space.goal_way.way(pose[:2])
    if len(way) < 3:
        return np.zeros((0, 4)), np.zeros(0)
    steps = np.hypot(*np.diff(way, axis=0).T)
    along = np.r_[0.0, np.cumsum(steps)] / np.sqrt(OCTILE_EXCESS)
    wished = np.r_[WAYS * space.hull_m, along[-1]]
    at = np.searchsorted(along, wished[wished <= along[-1]]).clip(1, len(way) - 1)
    back = np.maximum(at - 5, 0)
    ahead = np.minimum(at + 5, len(way) - 1)
    return np.column_stack([way[at], way[ahead] - way[back]]), along[at]


def run_ends(space: SearchSpace, primitive: np.ndarray, start: Array) -> Array:
    """(n, 3) poses at the ends of runs (n,) of the space's primitives that begin at poses (n, 3)."""
    steps = np.array([item.displacement for item in space.stamps])[primitive]
    end = _moved(start, steps)
    end[:, :2] += space.current_to * np.array([item.duration_s for item in space.stamps])[primitive][:, None]
    return end


def clear_options(space: SearchSpace, plans: PartialPlans, options: Options) -> np.ndarray:
    """(n,) whether arcs, runs and their ends keep their margins on the grid."""
    start, turn, primitive = options.start, options.turn, options.primitive
    clear = space.field.at(start[:, :2]) >= space.leg_margin_m
    for bad in space.refused:
        near = np.hypot(*(start[:, :2] - bad[:2]).T) < space.hull_m / 2
        clear &= ~(near & (np.abs(wrap_angle(start[:, 2] - bad[2])) < 0.2))
    clear &= space.field.at(run_ends(space, primitive, start)[:, :2]) >= space.leg_margin_m
    arcs = np.flatnonzero(clear & ~np.isnan(turn))
    clear[arcs] = _arcs_clear(space, plans.pose[options.parent[arcs]], turn[arcs], start[arcs])
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
