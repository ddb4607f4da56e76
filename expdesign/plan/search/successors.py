"""Whether successors of partial plans keep their clearances on the grid."""

from __future__ import annotations

import numpy as np

from expdesign.plan.local_planner import RunSpace, SearchSpace, Successors, arc_end, run_ends
from expdesign.plan.search.tuning import SEARCH
from expdesign.values import Array


def clear_successors(space: SearchSpace, found: Successors) -> np.ndarray:
    """(n,) whether legs, runs and their ends keep their margins on the grid."""
    start, turn = found.start, found.turn
    clear: np.ndarray = _ends_clear(space, start, found.end) & ~space.is_refused(start)
    arcs = np.flatnonzero(clear & ~np.isnan(turn))
    clear[arcs] = _arcs_clear(space, found.departure[found.parent[arcs]], turn[arcs], start[arcs])
    lines = np.flatnonzero(clear & found.straight)
    clear[lines] = _lines_clear(space, found.departure[found.parent[lines]], start[lines])
    left = np.flatnonzero(clear)
    left = left[~_surely_clear(space, found.primitive[left], start[left])]
    clear[left] = _hulls_clear(space, found.primitive[left], start[left])
    return clear


def runs_clear(space: SearchSpace, primitive: np.ndarray, start: Array) -> np.ndarray:
    """(n,) whether runs (n,) from poses (n, 3) have room, and none of the poses was refused."""
    return np.asarray(have_room(space, primitive, start) & ~space.is_refused(start))


def have_room(space: RunSpace | SearchSpace, primitive: np.ndarray, start: Array) -> np.ndarray:
    """(n,) whether runs (n,) from poses (n, 3) and their ends keep their margins on the grid."""
    ends_clear = _ends_clear(space, start, run_ends(space, primitive, start))
    return np.asarray(ends_clear & _hulls_clear(space, primitive, start))


def _ends_clear(space: RunSpace | SearchSpace, start: Array, end: Array) -> np.ndarray:
    clear = space.field.at(start[:, :2]) >= space.leg_margin_m
    return np.asarray(clear & (space.field.at(end[:, :2]) >= space.leg_margin_m))


def _surely_clear(space: SearchSpace, primitive: np.ndarray, start: Array) -> np.ndarray:
    """Whether the clearance in the middle of runs is enough for all their discs."""
    found = np.zeros(len(start), dtype=bool)
    for q in np.unique(primitive):
        some, item = np.flatnonzero(primitive == q), space.footprints[q]
        middle = (item.discs.min(axis=0) + item.discs.max(axis=0)) / 2
        reach_m = np.hypot(*(item.discs - middle).T) + np.hypot(*space.current_to) * item.times_s
        enough_m = float((reach_m + item.room_m).max()) + np.sqrt(2.0) * space.field.cell_m
        found[some] = space.field.at(_places(start[some], middle)) >= enough_m
    return found


def _hulls_clear(space: RunSpace | SearchSpace, primitive: np.ndarray, start: Array) -> np.ndarray:
    clear = np.ones(len(start), dtype=bool)
    for q in np.unique(primitive):
        some, item = np.flatnonzero(primitive == q), space.footprints[q]
        few = slice(None, None, SEARCH.sparse_discs)  # of many runs most are refused by a few of their discs
        for part in (few, slice(None)) if len(some) > SEARCH.many_runs else (slice(None),):
            drifted = item.times_s[part, None] * space.current_to
            places = _places(start[some, None], item.discs[part]) + drifted
            clear[some] = (space.field.at(places) >= item.room_m[part]).all(axis=1)
            some = some[clear[some]]
    return clear


def _places(pose: Array, points: Array) -> Array:
    """(..., 2) places of points (..., 2) forward and to starboard of poses (..., 3)."""
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    north = pose[..., 0] + c * points[..., 0] - s * points[..., 1]
    return np.stack([north, pose[..., 1] + s * points[..., 0] + c * points[..., 1]], axis=-1)


def _arcs_clear(space: SearchSpace, pose: Array, turn: Array, start: Array) -> np.ndarray:
    """Whether arc-and-straight legs from poses to run starts keep the leg margin at points along them."""
    radius = space.ship.turning_radius_m
    corner = arc_end(pose, turn, np.zeros(len(turn)), radius)
    shares = np.linspace(0.1, 1.0, 10)
    clear = np.ones(len(turn), dtype=bool)
    for share in shares:
        on_arc = arc_end(pose, share * turn, np.zeros(len(turn)), radius)[:, :2]
        on_line = corner[:, :2] + share * (start[:, :2] - corner[:, :2])
        clear &= np.minimum(space.field.at(on_arc), space.field.at(on_line)) >= space.leg_margin_m
    return clear


def _lines_clear(space: SearchSpace, pose: Array, start: Array) -> np.ndarray:
    """Whether straight lines between poses keep the leg margin at points along them, their own ends apart."""
    clear = np.ones(len(pose), dtype=bool)
    for share in np.linspace(0.2, 1.0, 9):
        clear &= space.field.at((1 - share) * pose[:, :2] + share * start[:, :2]) >= space.leg_margin_m
    return clear
