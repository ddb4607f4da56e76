"""How much of the way to the goal a run can save at most, over all places and headings at which its hull has room.

The least times to the goal from the ends of a run differ by no more than its chord takes where the chord lies in the
water. Elsewhere it goes round a headland: then a corner of the shore that sticks out lies in the convex hull of its
track, as a taut string in place of the track bends there. Such places are looked through in cells of position and
heading, which are divided until each has no room for the hull, or has its chord in the water, or is small: there the
ways from its middle count, and how far the ends may be from it. The water is grown for that by the size of the cells,
so that a straight line leads from any end in a cell to the end in the middle of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from expdesign.dictionary import Primitive
from expdesign.plan.bounds.displacement import Displacement, Headway
from expdesign.plan.chart import VisibilityGraph, build_visibility_graph, sight_lines, simplified
from expdesign.values import Array
from expdesign.vessel import Vessel

CELL, HEADINGS = 16 / 15, 32
"""First cells: in hull lengths, and to a full turn."""
LEVELS, FINER = 3, 3
"""Times that cells are halved, and those that hold the most besides."""
MOST_CELLS, MOST_PAIRS, MOST_LOOKS = 300_000, 20_000_000, 400_000
"""Cells of any level for a run, pairs of these and corners, and cells whose ways are looked up for all runs together:
no more is worth the time."""
WORTH = 0.005
"""Share of the way that may be gained on a bound for which runs are looked at."""
ENOUGH = 0.3
"""What is found counts, and so much more need not be looked for: way in sizes of the cells after `LEVELS`."""
BEST = 4000
"""Cells among which the most is looked for that a run really saves."""
PLACES = 13
"""Samples of a run at which its hull needs room."""
SIDES = np.stack([np.cos(np.arange(24) * np.pi / 12), np.sin(np.arange(24) * np.pi / 12)], axis=1)
"""Normals of the sides of a polygon that holds a track."""
ROUND = 1.01
"""No point of such a polygon is farther away than its farthest side by more."""
CHUNK = 50_000
"""Points from which ways are looked up at a time."""
QUAD_SEGS = 32
"""Chords to a quarter circle round grown water."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GoalTimes:
    """Least times to the goal.

    Attributes:
        graph: of the water.
        headway: of legs.
        nodes, seconds: (n, 2) corners, the goal last, and the least time from each.
    """

    graph: VisibilityGraph
    headway: Headway
    nodes: Array
    seconds: Array

    def at(self, points: Array) -> Array:
        """(k,) least time from points (k, 2), infinite where no path leads to the goal or a point is ashore."""
        parts = [self._at(points[first : first + CHUNK]) for first in range(0, len(points), CHUNK)]
        return np.concatenate([np.zeros(0), *parts])

    def _at(self, points: Array) -> Array:
        total = self.headway.seconds(self.nodes - points[:, None]) + self.seconds
        order, found, left = np.argsort(total, axis=1), np.full(len(points), np.inf), np.arange(len(points))
        for rank in range(len(self.nodes)):
            node = order[left, rank]
            leads = np.isfinite(total[left, node])
            left, node = left[leads], node[leads]
            if not len(left):
                break
            seen = shapely.covers(self.graph.water, sight_lines(points[left], self.nodes[node]))
            found[left[seen]] = total[left[seen], node[seen]]
            left = left[~seen]
        return found


def goal_times(graph: VisibilityGraph, goal: Array, headway: Headway) -> GoalTimes:
    """Least times to a goal (2,) inside the water."""
    nodes, n = np.concatenate([graph.corners, goal[None]]), len(graph.corners)
    rows, columns = graph.lengths.nonzero()
    seen = graph.sees(goal, nodes[:n])
    tail, head = np.r_[rows, columns, seen], np.r_[columns, rows, np.full(len(seen), n)]
    cost = headway.seconds(nodes[head] - nodes[tail]) + 1e-12
    backwards = coo_matrix((cost, (head, tail)), shape=(n + 1, n + 1)).tocsr()
    return GoalTimes(graph=graph, headway=headway, nodes=nodes, seconds=dijkstra(backwards, indices=n))


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """Where a run leads over ground from a reference: what turns with the heading, and the drift that does not.

    Attributes:
        water: (3 PLACES, 2) forward and to starboard: amidships, both ends among them, then points before and abaft of
            it that are half the beam from the hull's sides, too.
        drift: (3 PLACES, 2) north and east.
        hull_m: (24,) distances from the reference of the sides of a polygon that holds the track through water.
    """

    water: Array
    drift: Array
    hull_m: Array

    @property
    def reach_m(self) -> float:
        """How far from the reference anything is that turns with the heading."""
        return max(float(np.hypot(*self.water.T).max()), ROUND * float(self.hull_m.max()))

    @property
    def ends_m(self) -> float:
        """The same of the track's ends."""
        return float(np.hypot(*self.water[[0, PLACES - 1]].T).max())

    @property
    def drift_m(self) -> float:
        """How far anything is carried from where it would be in calm water."""
        return float(np.hypot(*self.drift.T).max())

    def at(self, cells: Array, k: int) -> Array:
        """(n, 2) where point k is at poses (n, 3)."""
        c, s = np.cos(cells[:, 2]), np.sin(cells[:, 2])
        (x, y), (north, east) = self.water[k], self.drift[k]
        return np.stack([cells[:, 0] + c * x - s * y + north, cells[:, 1] + s * x + c * y + east], axis=1)

    def ends(self, cells: Array) -> tuple[Array, Array]:
        """(n, 2) where runs begin, and where they end."""
        return self.at(cells, 0), self.at(cells, PLACES - 1)


def track_of(run: Primitive, vessel: Vessel, current_to: Array) -> Track:
    """The track of a run that goes the same way through water wherever it is."""
    pose, time_s = run.trajectory.pose, run.trajectory.time_s
    kept = np.rint(np.linspace(0, len(pose) - 1, PLACES)).astype(int)
    middle = (pose[:, :2].min(axis=0) + pose[:, :2].max(axis=0)) / 2
    drift = (time_s[kept] - (time_s[0] + time_s[-1]) / 2)[:, None] * current_to
    along = np.stack([np.cos(pose[kept, 2]), np.sin(pose[kept, 2])], axis=1)
    ahead, places = max(0.0, vessel.length_m - vessel.beam_m) / 2 * along, pose[kept, :2] - middle
    return Track(
        water=np.concatenate([places, places + ahead, places - ahead]),
        drift=np.tile(drift, (3, 1)),
        hull_m=(SIDES @ (pose[:, :2] - middle).T).max(axis=1),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Saving:
    """What a run saves is looked for here.

    Attributes:
        track: of the run.
        times: in the grown water.
        water: in which points that are half the beam from the hull's sides have to be.
        cell_m: edge of the first cells.
    """

    track: Track
    times: GoalTimes
    water: shapely.Geometry
    cell_m: float

    def most_s(self, chord_s: float, looks: int) -> tuple[float, int]:
        """The most that the run saves, infinite where that takes too many looks, and the looks left."""
        track, cells = self.track, self._first()
        spare_s = ENOUGH * self._slowness * self._spread_m(track.ends_m, LEVELS)
        told_s = chord_s + spare_s
        for level in range(LEVELS + FINER + 1):
            spread_m, slack_s = self._spread_m(track.ends_m, level), 0.0
            if len(cells) > MOST_CELLS or len(cells) * len(self.times.nodes) > MOST_PAIRS:
                return np.inf, looks
            cells = self._possible(cells, level)
            saved, looked = self._saved(cells, level)
            looks, slack_s = looks - looked, 2 * self._slowness * spread_m
            if looks < 0:
                return np.inf, 0
            if level >= LEVELS:
                best = cells[np.argsort(-saved, kind="stable")[:BEST]]
                real = np.sort(-saved)[:BEST][has_room(track, best, self.water)]
                told_s = max(told_s, float(-real.min(initial=np.inf)) + spare_s)
            left = saved + slack_s > told_s
            if level == LEVELS + FINER:
                return float((saved[left] + slack_s).max(initial=told_s)), looks
            cells = _halved(cells[left], self.cell_m * 0.5**level, np.pi / HEADINGS * 0.5**level)
        raise AssertionError("the last level returns")

    @property
    def _slowness(self) -> float:
        return 1.0 / (self.times.headway.speed_mps - self.times.headway.current_mps)

    def _spread_m(self, reach_m: float, level: int) -> float:
        return spread_m(self.cell_m, reach_m, level)

    def _first(self) -> Array:
        """(n, 3) middles of cells that cover all references and headings."""
        more_m = ROUND * float(self.track.hull_m.max()) + self.track.drift_m
        return first_cells(self.water, more_m, self.cell_m)

    def _possible(self, cells: Array, level: int) -> Array:
        """Cells in which the hull may have room and the chord may be cut off by a corner."""
        track, farther_m = self.track, self._spread_m(self.track.reach_m, level)
        cells = _round_corners(track, cells, self.times.nodes[:-1], farther_m)
        cells = cells[has_room(track, cells, grown(self.water, farther_m))]
        inner = grown(self.times.graph.water, -self._spread_m(track.ends_m, level))
        shapely.prepare(inner)
        return cells[~shapely.covers(inner, sight_lines(*track.ends(cells)))] if len(cells) else cells

    def _saved(self, cells: Array, level: int) -> tuple[Array, int]:
        """(n,) what is saved in the middle of cells, infinite where that cannot be told yet, and the looks it took."""
        ends, known = self.track.ends(cells), np.full(len(cells), True)
        if level < LEVELS:  # the water is grown by less than a cell: a straight line need not lead to its middle
            inner = grown(self.times.graph.water, -self._spread_m(self.track.ends_m, level))
            shapely.prepare(inner)
            known = np.all([shapely.contains_xy(inner, end[:, 1], end[:, 0]) for end in ends], axis=0)
        before_s, after_s = (self.times.at(end[known]) for end in ends)
        some = np.isfinite(before_s) & np.isfinite(after_s)  # others lie in water that no way leads to
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

    None where an end is not in that water, no way joins them, the chart is too large, or hardly anything is gained.

    Args:
        runs: that go the same way through water wherever they are.
        displacements: what each of them can contribute anyway.
        repeats: how often; where much is to be gained is looked first.
        water: where amidships may be, and whatever else is half the beam from the hull's sides.
        ends: start and goal, (2,) or (3,).
        headway: of legs.
        vessel: who.
        known_s: bound on the way less all savings that is known anyway.
    """
    tracks = {run.name: track_of(run, vessel, headway.current_to) for run in runs}
    start, goal = (end[:2] for end in ends)
    times = grown_times(tuple(tracks.values()), water, goal, headway, vessel)
    if times is None or not shapely.covers(times.graph.water, shapely.Point(start[::-1])):
        return None
    whole_s = float(times.at(start[None])[0])
    at_best_s = whole_s - sum(repeats[name] * displacements[name].chord_s for name in tracks)
    if not np.isfinite(whole_s) or at_best_s < known_s + WORTH * whole_s:
        return None
    most, looks = {}, MOST_LOOKS
    for name in sorted(
        tracks, key=lambda name: repeats[name] * (displacements[name].chord_s - displacements[name].path_s)
    ):
        saving = Saving(track=tracks[name], times=times, water=water, cell_m=CELL * vessel.length_m)
        found_s, looks = saving.most_s(displacements[name].chord_s, looks)
        most[name] = min(displacements[name].path_s, found_s)
    return whole_s, most


def grown_times(
    tracks: Sequence[Track], water: shapely.Geometry, goal: Array, headway: Headway, vessel: Vessel
) -> GoalTimes | None:
    """Least times to a goal (2,) in the water grown as far as ends may be from the middle of cells after `LEVELS`.

    None where the goal is not in it, or the chart is too large.
    """
    cell_m, (west, south, east, north) = CELL * vessel.length_m, shapely.bounds(water)
    if HEADINGS * (east - west) * (north - south) / cell_m**2 > MOST_CELLS:
        return None
    smallest_m = spread_m(cell_m, max((track.ends_m for track in tracks), default=0.0), LEVELS)
    graph = build_visibility_graph(simplified(grown(water, smallest_m), grow=True, tolerance_m=vessel.length_m / 40))
    return goal_times(graph, goal, headway) if shapely.covers(graph.water, shapely.Point(goal[::-1])) else None


def spread_m(cell_m: float, reach_m: float, level: int) -> float:
    """How far points in a cell that turn with the heading may be from where they are in its middle [m]."""
    return float((cell_m / np.sqrt(2) + np.pi / HEADINGS * reach_m) * 0.5**level)


def grown(water: shapely.Geometry, distance_m: float) -> shapely.Geometry:
    """No less than the water within a distance, or no more than that farther from its shore than a negative one."""
    wide_m = distance_m / np.cos(np.pi / (4 * QUAD_SEGS)) + np.copysign(1e-6, distance_m)
    return shapely.buffer(water, wide_m, quad_segs=QUAD_SEGS)


def first_cells(water: shapely.Geometry, more_m: float, cell_m: float) -> Array:
    """(n, 3) middles of cells of all places as near to a water's box and of all headings."""
    west, south, east, north = shapely.bounds(water)
    axes = [
        low - more_m + cell_m * (np.arange(np.ceil((high - low + 2 * more_m) / cell_m)) + 0.5)
        for low, high in ((south, north), (west, east))
    ]
    grids = np.meshgrid(*axes, (np.arange(HEADINGS) + 0.5) * 2 * np.pi / HEADINGS, indexing="ij")
    return np.stack([grid.ravel() for grid in grids], axis=1)


def _halved(cells: Array, cell_m: float, half_rad: float) -> Array:
    """(8 n, 3) middles of the eighths of cells with an edge and half a range of headings."""
    signs = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray((cells[:, None] + signs * [cell_m / 2, cell_m / 2, half_rad]).reshape(-1, 3))


def _round_corners(track: Track, cells: Array, corners: Array, farther_m: float) -> Array:
    """Those cells in which some corner may be in the convex hull of the track."""
    slack_m, reach_m = farther_m + track.drift_m, ROUND * float(track.hull_m.max())
    c, s, near = np.cos(cells[:, 2]), np.sin(cells[:, 2]), np.zeros(len(cells), dtype=bool)
    for corner in corners:
        some = np.flatnonzero(~near & (np.abs(cells[:, :2] - corner).max(axis=1) <= reach_m + slack_m))
        away = corner - cells[some, :2]
        ahead, starboard = c[some] * away[:, 0] + s[some] * away[:, 1], c[some] * away[:, 1] - s[some] * away[:, 0]
        near[some] = (SIDES @ np.stack([ahead, starboard]) <= track.hull_m[:, None] + slack_m).all(axis=0)
    return cells[near]


def has_room(track: Track, cells: Array, water: shapely.Geometry) -> np.ndarray:
    """(n,) whether in the middle of cells all points of the track lie in a water."""
    shapely.prepare(water)
    left = np.arange(len(cells))
    for k in (0, PLACES - 1, *range(1, PLACES - 1), *range(PLACES, len(track.water))):
        places = track.at(cells[left], k)
        left = left[shapely.contains_xy(water, places[:, 1], places[:, 0])]
    return np.isin(np.arange(len(cells)), left)
