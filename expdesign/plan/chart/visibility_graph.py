"""Exact shortest paths through polygons, by the visibility graph of the corners at which such paths can bend.

Independent of any grid: turning the chart turns the paths with it.

Source: T. Lozano-Perez and M. A. Wesley, An algorithm for planning collision-free paths among polyhedral obstacles,
Communications of the ACM 22 (1979), 560-570.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import scipy
import shapely

from expdesign.sea_area import as_multipolygon, moved
from expdesign.values import Array

KEPT_GRAPHS = 12  # visibility graphs, clearance grids and tables of distances that a process keeps
# of a simplified water at most, by the least tolerance, in those asked for, at which so many are accepted: more make
# the graph slow, but water that shrinks further loses its passages. A thousand islands have four thousand corners,
# however straight their shores. Water that grows has the first number at most.
CORNERS: tuple[tuple[float, int], ...] = ((1.0, 700), (16.0, 2500), (128.0, 5000))
PAIRS = 1_000_000  # of corners that are tested for sight at a time
DENSE = 16_000  # corners of a water above which a coarser one is made of a finer one that was tried, not of the water

STRAIGHT = 0.98  # share of the tolerance by which moved shores are straightened; the rest is for moving them
SLIT_M = 1e-3  # growth of the water before lines of sight are tested, as a path may touch the shore
GLANCES = (0.5, 0.75, 0.25, 0.9, 0.1, 0.625, 0.375)  # shares of a line of sight at which it is tested first
TAUT = 1e-3  # share of the water's size by which a path may miss a corner that it bends at


Corners = tuple[tuple[float, int], ...]
"""Most corners by the least tolerance, in those asked for, at which so many are accepted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Roadmap:
    """Water, and the lengths between places of it that are in sight of each other."""

    water: shapely.MultiPolygon  # polygons (east, north), grown by `SLIT_M`
    # (n, 2) north/east of places where paths may bend: shores' corners that stick out into the water, ..
    corners: Array
    # (n, n) sparse distances between such places in sight of each other; not all need be there
    lengths: scipy.sparse.csr_matrix

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Prepare the water in another process, too: copies of geometries are not."""
        self.__dict__.update(state)
        shapely.prepare(self.water)

    def shortest(self, start: Array, end: Array) -> Array | None:
        """(k, 2) the shortest path between two points (2,), or None where the water does not connect them.

        Points outside the water are connected to its nearest point by a straight line.
        """
        inside = np.array([self.nearest(start), self.nearest(end)])
        straight = shapely.covers(self.water, shapely.LineString(inside[:, ::-1]))
        between = inside if straight else self._bent(*inside)
        if between is None:
            return None
        path = np.array([start, *between, end])
        return path[np.r_[True, np.hypot(*np.diff(path, axis=0).T) > 1e-9]]

    def _bent(self, start: Array, end: Array) -> Array | None:
        """(k, 2) the shortest path between two points of the water, or None."""
        nodes, distance, before = self._least_costs(start, end, lambda step: np.hypot(*step.T))
        n = len(self.corners)
        chain = [n + 1]
        while np.isfinite(distance[n + 1]) and chain[-1] != n:
            chain.append(int(before[chain[-1]]))
        return nodes[chain[::-1]] if chain[-1] == n else None

    def _least_costs(self, start: Array, end: Array, cost: Callable[[Array], Array]) -> tuple[Array, Array, np.ndarray]:
        """Corners and two points of the water, least costs from the first to all, and the node before each."""
        nodes = np.concatenate([self.corners, [start, end]])
        n = len(self.corners)
        rows, columns = self.lengths.nonzero()
        tails, heads = [rows, columns], [columns, rows]
        for k, point in enumerate((start, end)):
            seen = self.sees(point, nodes)
            seen = seen[seen < n + k]  # the ends see each other once
            tails += [np.full(len(seen), n + k), seen]
            heads += [seen, np.full(len(seen), n + k)]
        tail, head = np.concatenate(tails), np.concatenate(heads)
        data = cost(nodes[head] - nodes[tail]) + 1e-12
        graph = scipy.sparse.coo_matrix((data, (tail, head)), shape=(n + 2, n + 2)).tocsr()
        least, before = scipy.sparse.csgraph.dijkstra(graph, indices=n, return_predecessors=True)
        return nodes, least, before

    def nearest(self, point: Array) -> Array:
        """The point (2,) itself if it lies in the water, else the nearest one that does."""
        here = shapely.Point(point[1], point[0])
        if shapely.covers(self.water, here):
            return point
        there = shapely.get_coordinates(shapely.shortest_line(self.water, here))[0]
        return np.array([there[1], there[0]])

    def sees(self, point: Array, nodes: Array) -> np.ndarray:
        """Indices of the nodes in sight of a point."""
        apart = np.hypot(*(nodes - point).T) > 0
        return np.flatnonzero(_joined(self.water, np.broadcast_to(point, nodes.shape), nodes) | ~apart)

    def joins(self, a: Array, b: Array) -> np.ndarray:
        """(n,) whether points (n, 2) are in sight of each other."""
        return _joined(self.water, a, b)


@dataclass(frozen=True, kw_only=True, eq=False)
class VisibilityGraph(Roadmap):
    """The roadmap of all pairs that shortest paths lead over, so its paths are the shortest of the water."""

    beside: Array  # (n, 2, 2) the corners before and after each along the shore

    def least_cost(self, start: Array, end: Array, cost: Callable[[Array], Array]) -> float:
        """Least cost of a path between two points (2,), infinite where there is none.

        Exact for costs of straight steps (k, 2) that grow with the step's length and obey the triangle inequality, even
        if they depend on direction: the best path then bends at corners only. For points outside the water it is the
        cost between its nearest points.
        """
        _, least, _ = self._least_costs(self.nearest(start), self.nearest(end), cost)
        return float(least[len(self.corners) + 1])

    def bends(self, points: Array, corners: np.ndarray, ahead: Array) -> np.ndarray:
        """(k, n) whether a shortest path from a point (k, 2) may bend at a corner (n,), on to a place (n, 2).

        Such a path is taut: it turns towards the obstacle, which lies on one side of both its lines. Lines may miss
        this by `TAUT` of the water's size, as paths may touch the shore.
        """
        place = self.corners[corners]
        directions = np.concatenate([ahead[:, None], self.beside[corners]], axis=1) - place[:, None]  # (n, 3, 2)
        directions /= np.maximum(np.hypot(directions[..., :1], directions[..., 1:]), 1e-12)
        side = np.sign(_cross(directions[:, :1], directions[:, 1:]).sum(axis=1))
        west, south, east, north = self.water.bounds
        spare_m = TAUT * float(np.hypot(north - south, east - west))
        found = np.ones((len(points), len(corners)), dtype=bool)
        for k in range(3):
            normal = side[:, None] * np.stack([-directions[:, k, 1], directions[:, k, 0]], axis=1)
            found &= points @ normal.T >= (place * normal).sum(axis=1) - spare_m
        return found


@lru_cache(maxsize=KEPT_GRAPHS)
def visibility_graph_of(water: shapely.MultiPolygon, tolerance_m: float, corners: Corners) -> VisibilityGraph:
    """The visibility graph of a water, shrunk until its shore is simple; kept, as remedies ask for it again."""
    return build_visibility_graph(simplified(water, grow=False, tolerance_m=tolerance_m, corners=corners))


def build_visibility_graph(water: shapely.Geometry) -> VisibilityGraph:
    """The visibility graph of a water polygon with at most some thousands of corners."""
    corners, before, after = shore_corners(as_multipolygon(water))
    grown = opened(water)
    parts = np.array_split(np.arange(len(corners)), len(corners) ** 2 // PAIRS + 1)
    pairs = [_pairs_in_sight(grown, corners, before, after, tails) for tails in parts]
    tail, head = np.concatenate(pairs, axis=1)
    away = np.hypot(*(corners[tail] - corners[head]).T)
    lengths = scipy.sparse.coo_matrix((away, (tail, head)), shape=(len(corners), len(corners))).tocsr()
    return VisibilityGraph(water=grown, corners=corners, beside=np.stack([before, after], axis=1), lengths=lengths)


def opened(water: shapely.Geometry) -> shapely.MultiPolygon:
    """Water grown by `SLIT_M`, prepared for lines of sight, which may touch the shore."""
    grown = as_multipolygon(shapely.buffer(as_multipolygon(water), SLIT_M, join_style="mitre"))
    shapely.prepare(grown)
    return grown


def _pairs_in_sight(
    water: shapely.MultiPolygon, corners: Array, before: Array, after: Array, tails: np.ndarray
) -> np.ndarray:
    """(2, k) some corners of all (n, 2), and later ones in sight of them to which a shortest path may lead."""
    rows, head = np.nonzero(tails[:, None] < np.arange(len(corners)))
    tail = tails[rows]
    tangent = _tangent(corners[tail], corners[head], before[head], after[head])
    tangent &= _tangent(corners[head], corners[tail], before[tail], after[tail])
    tail, head = tail[tangent], head[tangent]
    seen = _joined(water, corners[tail], corners[head])
    return np.stack([tail[seen], head[seen]])


def simplified(
    water: shapely.MultiPolygon, *, grow: bool, tolerance_m: float, corners: Corners = CORNERS
) -> shapely.MultiPolygon:
    """Water with at most so many corners that contains the given water (`grow`), or lies inside it.

    The shore is moved by a tolerance, and straightened by less than that. The tolerance is doubled until few enough
    corners are left: passages narrower than four tolerances may then be lost, or, grown, islands.

    Args:
        water: polygons.
        grow: whether the result contains the water; else it lies inside.
        tolerance_m: at first.
        corners: as `CORNERS`.
    """
    least_m = tolerance_m
    source, moved_m, made = water, 0.0, [(water, 0.0)]
    while True:
        step_m = tolerance_m - moved_m
        simple = _straightened(moved(source, step_m if grow else -step_m), STRAIGHT * step_m)
        most = max(count for times, count in corners if times * least_m <= tolerance_m)
        if len(shore_corners(simple)[0]) <= (corners[0][1] if grow else most):
            return simple
        made.append((simple, tolerance_m))
        if shapely.get_num_coordinates(source) > DENSE:
            source, moved_m = made[-2]  # moved by a quarter of what comes next
        tolerance_m *= 2.0


def _straightened(water: shapely.Geometry, tolerance_m: float) -> shapely.MultiPolygon:
    """Water whose shores pass by the given ones within a tolerance, with fewer corners.

    Source: D. H. Douglas and T. K. Peucker, Cartographica 10 (1973), 112-122. Shores are lines that keep their first
    corner, as GEOS drops that of a ring up to twice the tolerance away. Where shores come to cross, what lies inside an
    odd number of them is water; nothing farther from them than the tolerance changes.
    """
    parts = shapely.get_parts(as_multipolygon(water))
    if not len(parts):
        return shapely.MultiPolygon()
    rings, part = shapely.get_rings(parts, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    lines = shapely.simplify(shapely.linestrings(points, indices=ring), tolerance_m, preserve_topology=False)
    polygons = [
        shapely.Polygon(shell, [hole for hole in holes if len(hole.coords) > 3])
        for shell, *holes in np.split(lines, np.flatnonzero(np.diff(part)) + 1)
        if len(shell.coords) > 3
    ]
    return as_multipolygon(shapely.make_valid(shapely.MultiPolygon(polygons)))


def polyline_length(points: Array) -> float:
    """Length of a line through points (k, 2) [m]."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def sight_lines(a: Array, b: Array) -> np.ndarray:
    """(n,) straight lines between north/east points (n, 2), for shapely."""
    return np.asarray(shapely.linestrings(np.stack([a[:, ::-1], b[:, ::-1]], axis=1)))


def _joined(water: shapely.MultiPolygon, a: Array, b: Array) -> np.ndarray:
    """(n,) whether a water covers the lines between points (n, 2): first some places on them, then the whole lines."""
    seen = np.arange(len(a))
    for share in GLANCES:
        north, east = ((1.0 - share) * a[seen] + share * b[seen]).T
        seen = seen[shapely.intersects_xy(water, east, north)]
    found = np.zeros(len(a), dtype=bool)
    found[seen] = shapely.covers(water, sight_lines(a[seen], b[seen])) if len(seen) else False
    return found


def shore_corners(water: shapely.MultiPolygon) -> tuple[Array, Array, Array]:
    """Corners where the shore bends away from the water (n, 2) north/east, with their neighbours on the ring."""
    found: list[Array] = [np.zeros((3, 0, 2))]
    for polygon in shapely.get_parts(shapely.orient_polygons(water)):
        for ring in (polygon.exterior, *polygon.interiors):
            points = shapely.get_coordinates(ring)[:-1, ::-1]
            before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
            # rings run with the water on their left in (east, north), which is on the right in (north, east)
            reflex = _cross(points - before, after - points) > 0
            found.append(np.stack([points[reflex], before[reflex], after[reflex]]))
    corners, before, after = np.concatenate(found, axis=1)
    return corners, before, after


def _tangent(origin: Array, corner: Array, before: Array, after: Array) -> np.ndarray:
    """Whether the line from an origin to a corner leaves both of the corner's shores on one side."""
    ahead = corner - origin
    sides = _cross(ahead, before - corner) * _cross(ahead, after - corner)
    return np.asarray(sides >= -1e-9 * np.maximum(np.abs(ahead).max(axis=-1), 1.0) ** 2)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
