"""The most of the path to the goal that a run can save: branch and bound over places and headings with hull room.

The least times to the goal from both ends of a run differ by no more than its chord takes where the chord lies in the
water. Elsewhere the path bends at an obstacle corner, which then lies in the convex hull of the run's track. Such
placements are enumerated in cells of position and heading. A cell is divided until it has no room for the hull, has its
chord in the water, or is small: then the path from its middle counts, and how far the ends may be from it. The water is
grown by the size of the cells, so that a straight line leads from any end in a cell to the end in its middle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
import shapely

from expdesign.dictionary import Primitive
from expdesign.plan.bounds.displacement import (
    SIDES,
    SIDES_MARGIN,
    TRACK_SAMPLES,
    Displacement,
    Headway,
    Track,
    track_of,
)
from expdesign.plan.chart import VisibilityGraph, build_visibility_graph, sight_lines, simplified, taut_bends
from expdesign.sea_area import moved
from expdesign.values import Array
from expdesign.vessel import Vessel

QUAD_SEGMENTS = 32  # chords to a quarter circle round grown water
CELL_HULLS = 16 / 15  # edge of the first cells of branch and bound, in hull lengths
CELL_HEADINGS = 32  # of them to a full turn
LEVELS, EXTRA_LEVELS = 3, 3  # refinement levels, and extra levels for the most promising cells
# limits of branch and bound: cells of a level, their pairs with corners, and cells whose times are looked up for all
# runs together
CELLS, PAIRS, LOOKUPS = 300_000, 20_000_000, 400_000
WORTHWHILE = 0.005  # share of the path that must be gainable over the known bound
ENOUGH = 0.3  # gain that need not be improved on, in sizes of the cells after `levels`
CANDIDATES = 4000  # cells among which the largest real gain is looked for
LOOKUP_CHUNK = 1_000  # points looked up at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class GoalTimes:
    """Least times to the goal."""

    graph: VisibilityGraph  # of the water
    headway: Headway  # of legs
    # nodes, seconds: (n, 2) corners, the goal last, and the least time from each
    nodes: Array
    seconds: Array
    next_node: np.ndarray  # (n,) on the path from each; the goal's is itself

    def at(self, points: Array) -> Array:
        """(k,) least time from points (k, 2), infinite where no path leads to the goal or a point is ashore."""
        parts = [self._at(points[first : first + LOOKUP_CHUNK]) for first in range(0, len(points), LOOKUP_CHUNK)]
        return np.concatenate([np.zeros(0), *parts])

    def _at(self, points: Array) -> Array:
        total = self.headway.seconds(self.nodes - points[:, None]) + self.seconds
        return taut_bends(self.graph, points, self.nodes, self.next_node, total)[0]


def goal_times(graph: VisibilityGraph, goal: Array, headway: Headway) -> GoalTimes:
    """Least times to a goal (2,) inside the water."""
    nodes, n = np.concatenate([graph.corners, goal[None]]), len(graph.corners)
    rows, columns = graph.lengths.nonzero()
    seen = graph.sees(goal, nodes[:n])
    tail, head = np.r_[rows, columns, seen], np.r_[columns, rows, np.full(len(seen), n)]
    cost = headway.seconds(nodes[head] - nodes[tail]) + 1e-12
    backwards = scipy.sparse.coo_matrix((cost, (head, tail)), shape=(n + 1, n + 1)).tocsr()
    seconds, after = scipy.sparse.csgraph.dijkstra(backwards, indices=n, return_predecessors=True)
    next_node = np.where(after < 0, np.arange(n + 1), after)
    return GoalTimes(graph=graph, headway=headway, nodes=nodes, seconds=seconds, next_node=next_node)


@dataclass(frozen=True, kw_only=True, eq=False)
class Saving:
    """Branch and bound for what a run saves."""

    track: Track  # of the run
    times: GoalTimes  # in the grown water
    water: shapely.Geometry  # in which points half the beam from the hull's sides have to be
    cell_m: float  # edge of the first cells

    def most_s(self, chord_s: float, lookups: int) -> tuple[float, int]:
        """The most that the run saves, infinite where that takes too many lookups, and the lookups left."""
        track, cells = self.track, self._first()
        spare_s = ENOUGH * self._slowness * self._spread_m(track.ends_m, LEVELS)
        threshold_s = chord_s + spare_s
        for level in range(LEVELS + EXTRA_LEVELS + 1):
            spread_m, slack_s = self._spread_m(track.ends_m, level), 0.0
            if len(cells) > CELLS or len(cells) * len(self.times.nodes) > PAIRS:
                return np.inf, lookups
            cells = self._possible(cells, level)
            saved, taken = self._saved(cells, level)
            lookups, slack_s = lookups - taken, 2 * self._slowness * spread_m
            if lookups < 0:
                return np.inf, 0
            if level >= LEVELS:
                best = cells[np.argsort(-saved, kind="stable")[:CANDIDATES]]
                real = np.sort(-saved)[:CANDIDATES][has_room(track, best, self.water)]
                threshold_s = max(threshold_s, float(-real.min(initial=np.inf)) + spare_s)
            left = saved + slack_s > threshold_s
            if level == LEVELS + EXTRA_LEVELS:
                return float((saved[left] + slack_s).max(initial=threshold_s)), lookups
            cells = next_cells(cells[left], self.cell_m, level)
        raise AssertionError("the last level returns")

    @property
    def _slowness(self) -> float:
        return 1.0 / (self.times.headway.speed_mps - self.times.headway.current_mps)

    def _spread_m(self, reach_m: float, level: int) -> float:
        return spread_m(self.cell_m, reach_m, level)

    def _first(self) -> Array:
        """(n, 3) middles of cells that cover all references and headings."""
        more_m = SIDES_MARGIN * float(self.track.hull_m.max()) + self.track.drift_m
        return first_cells(self.water, more_m, self.cell_m)

    def _possible(self, cells: Array, level: int) -> Array:
        """Cells in which the hull may have room and the chord may be cut off by a corner."""
        track, farther_m = self.track, self._spread_m(self.track.reach_m, level)
        cells = _near_corners(track, cells, self.times.nodes[:-1], farther_m)
        cells = cells[has_room(track, cells, grown(self.water, farther_m))]
        inner = grown(self.times.graph.water, -self._spread_m(track.ends_m, level))
        shapely.prepare(inner)
        return cells[~shapely.covers(inner, sight_lines(*track.ends(cells)))] if len(cells) else cells

    def _saved(self, cells: Array, level: int) -> tuple[Array, int]:
        """(n,) what is saved in the middle of cells, infinite where that is unknown yet, and the lookups it took."""
        ends, known = self.track.ends(cells), np.full(len(cells), True)
        if level < LEVELS:  # the water is grown by less than a cell: a straight line need not lead to its middle
            inner = grown(self.times.graph.water, -self._spread_m(self.track.ends_m, level))
            shapely.prepare(inner)
            known = np.all([shapely.contains_xy(inner, end[:, 1], end[:, 0]) for end in ends], axis=0)
        before_s, after_s = (self.times.at(end[known]) for end in ends)
        some = np.isfinite(before_s) & np.isfinite(after_s)  # others are not connected to the goal
        saved = np.full(len(cells), np.inf)
        saved[known] = np.where(some, before_s - np.where(some, after_s, 0.0), -np.inf)
        return saved, int(known.sum())


def time_saved_s(
    runs: Sequence[Primitive],
    displacements: Mapping[str, Displacement],
    repeats: Mapping[str, int],
    water: shapely.Geometry,
    ends: tuple[Array, Array],
    headway: Headway,
    vessel: Vessel,
    *,
    known_s: float = -np.inf,
) -> tuple[float, dict[str, float]] | None:
    """Least time from start to goal in the water grown a little, and the most of it that each run can save [s].

    None where an end is not in that water, they are not connected, the chart is too large, or little is to be gained.

    Args:
        runs: whose tracks through water are the same at every place.
        displacements: limits of what each can contribute.
        repeats: how often; runs with much to gain come first.
        water: where amidships may be, and whatever else is half the beam from the hull's sides.
        ends: start and goal, (2,) or (3,).
        known_s: bound on the path less all savings that is known already.
    """
    tracks = {run.name: track_of(run, vessel, headway.current_to) for run in runs}
    start, goal = (end[:2] for end in ends)
    times = grown_times(tuple(tracks.values()), water, goal, headway, vessel)
    if times is None or not shapely.covers(times.graph.water, shapely.Point(start[::-1])):
        return None
    whole_s = float(times.at(start[None])[0])
    at_best_s = whole_s - sum(repeats[name] * displacements[name].chord_s for name in tracks)
    if not np.isfinite(whole_s) or at_best_s < known_s + WORTHWHILE * whole_s:
        return None
    most, lookups = {}, LOOKUPS
    for name in sorted(
        tracks, key=lambda name: repeats[name] * (displacements[name].chord_s - displacements[name].path_s)
    ):
        saving = Saving(track=tracks[name], times=times, water=water, cell_m=CELL_HULLS * vessel.length_m)
        found_s, lookups = saving.most_s(displacements[name].chord_s, lookups)
        most[name] = min(displacements[name].path_s, found_s)
    return whole_s, most


def grown_times(
    tracks: Sequence[Track], water: shapely.Geometry, goal: Array, headway: Headway, vessel: Vessel
) -> GoalTimes | None:
    """Least times to a goal (2,) in the water grown by the distance of ends from the middle of the last cells.

    None where the goal is not in it, or the chart is too large.
    """
    cell_m, (west, south, east, north) = CELL_HULLS * vessel.length_m, shapely.bounds(water)
    if CELL_HEADINGS * (east - west) * (north - south) / cell_m**2 > CELLS:
        return None
    smallest_m = spread_m(cell_m, max((track.ends_m for track in tracks), default=0.0), LEVELS)
    graph = build_visibility_graph(simplified(grown(water, smallest_m), grow=True, tolerance_m=vessel.length_m / 40))
    return goal_times(graph, goal, headway) if shapely.covers(graph.water, shapely.Point(goal[::-1])) else None


def spread_m(cell_m: float, reach_m: float, level: int) -> float:
    """How far points that turn with the heading may be from their places in the middle of their cell [m]."""
    return float((cell_m / np.sqrt(2) + np.pi / CELL_HEADINGS * reach_m) * 0.5**level)


def grown(water: shapely.Geometry, distance_m: float) -> shapely.Geometry:
    """A superset of the water grown by a distance, or a subset of the water shrunk by a negative one."""
    wide_m = distance_m / np.cos(np.pi / (4 * QUAD_SEGMENTS)) + np.copysign(1e-6, distance_m)
    return moved(water, wide_m, quad_segs=QUAD_SEGMENTS)


def first_cells(water: shapely.Geometry, more_m: float, cell_m: float) -> Array:
    """(n, 3) middles of cells of all headings and all places within a distance of a water's box."""
    west, south, east, north = shapely.bounds(water)
    axes = [
        low - more_m + cell_m * (np.arange(np.ceil((high - low + 2 * more_m) / cell_m)) + 0.5)
        for low, high in ((south, north), (west, east))
    ]
    grids = np.meshgrid(*axes, (np.arange(CELL_HEADINGS) + 0.5) * 2 * np.pi / CELL_HEADINGS, indexing="ij")
    return np.stack([grid.ravel() for grid in grids], axis=1)


def next_cells(cells: Array, cell_m: float, level: int) -> Array:
    """(8 n, 3) middles of the eighths of cells (n, 3) of a level, the first of which have an edge."""
    signs = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    halves = np.array([cell_m / 2, cell_m / 2, np.pi / CELL_HEADINGS]) * 0.5**level
    return np.asarray((cells[:, None] + signs * halves).reshape(-1, 3))


def _near_corners(track: Track, cells: Array, corners: Array, farther_m: float) -> Array:
    """Those cells in which some corner may be in the convex hull of the track."""
    slack_m = farther_m + track.drift_m
    reach_m = SIDES_MARGIN * float(track.hull_m.max()) + slack_m
    (north, east), c, s = cells[:, :2].T.copy(), np.cos(cells[:, 2]), np.sin(cells[:, 2])
    near, left = np.zeros(len(cells), dtype=bool), np.arange(len(cells))
    for corner in corners:
        to_north, to_east = corner[0] - north[left], corner[1] - east[left]
        reached = np.flatnonzero((np.abs(to_north) <= reach_m) & (np.abs(to_east) <= reach_m))
        some, to_north, to_east = left[reached], to_north[reached], to_east[reached]
        ahead, starboard = c[some] * to_north + s[some] * to_east, c[some] * to_east - s[some] * to_north
        near[some] = (SIDES @ np.stack([ahead, starboard]) <= track.hull_m[:, None] + slack_m).all(axis=0)
        left = left[~near[left]]
    return cells[near]


def has_room(track: Track, cells: Array, water: shapely.Geometry) -> np.ndarray:
    """(n,) whether in the middle of cells all points of the track lie in a water."""
    shapely.prepare(water)
    left = np.arange(len(cells))
    for k in (
        0,
        TRACK_SAMPLES - 1,
        *range(1, TRACK_SAMPLES - 1),
        *range(TRACK_SAMPLES, len(track.water)),
    ):
        places = track.at(cells[left], k)
        left = left[shapely.contains_xy(water, places[:, 1], places[:, 0])]
    return np.isin(np.arange(len(cells)), left)
