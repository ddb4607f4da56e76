"""Grids over the water: distance to what is forbidden, and distance to the goal round the islands with the path there.

Paths to the goal are those of the visibility graph, so the distance prefers no direction; the grid only tabulates it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import scipy
import shapely

from expdesign.plan.chart.visibility_graph import VisibilityGraph
from expdesign.sea_area import SeaArea, as_multipolygon
from expdesign.values import Array, sealed

GRID_CELLS = 3_000_000  # of the clearance grid at most; a larger area gets a coarser grid
FINE_HULLS = 0.25  # spacing of that grid in hull lengths above which a smaller part of the chart is planned in
KEPT = 0.9  # share of the extent of the water, from which on nothing is left out for being unreachable
LEAST_REACH_HULLS = 60.0  # hull lengths that this part reaches from start and goal at least
ROUTING_CELLS = 400_000  # of the grid on which the narrowest passage is located
KEPT_GRIDS = 3  # visibility graphs, clearance grids and tables of distances that a process keeps


@sealed(origin="2", clearance_m="r c")
class ClearanceField:
    """Distance to forbidden water on a grid."""

    origin: Array  # (2,) north, east of the first cell's centre [m]
    cell_m: float  # grid spacing [m]
    clearance_m: Array  # (rows north, columns east) distance from the cell's centre to anything forbidden [m]

    @property
    def error_m(self) -> float:
        """A looked-up clearance differs from the true one by less than this [m]."""
        return 2.0 * self.cell_m  # half a cell's diagonal at the point and at the shore, and half a cell of rounding

    def index(self, points: Array) -> tuple[np.ndarray, np.ndarray]:
        """Nearest cell's row and column of (..., 2) north/east points; outside the grid they are clipped."""
        cells = np.rint((points - self.origin) / self.cell_m)
        rows, columns = self.clearance_m.shape
        row, column = np.fmax(cells[..., 0], 0.0), np.fmax(cells[..., 1], 0.0)  # quicker than clip for few points
        return np.fmin(row, rows - 1).astype(np.intp), np.fmin(column, columns - 1).astype(np.intp)

    def at(self, points: Array) -> Array:
        """(...,) clearance of (..., 2) points; the grid's rim is forbidden, so points outside have none."""
        rows, columns = self.index(points)
        return np.asarray(self.clearance_m[rows, columns])

    def thinned(self, cells: int) -> ClearanceField:
        """Every n-th cell in both directions, so that at most `cells` are left."""
        step = max(1, int(np.ceil(np.sqrt(self.clearance_m.size / cells))))
        return ClearanceField(
            origin=self.origin, cell_m=self.cell_m * step, clearance_m=self.clearance_m[::step, ::step]
        )

    def centre(self, flat: np.ndarray) -> Array:
        """(..., 2) north/east of flat cell numbers."""
        rows, columns = np.divmod(flat, self.clearance_m.shape[1])
        return self.origin + self.cell_m * np.stack([rows, columns], axis=-1)


def grid_cell_m(area: SeaArea, resolution_m: float) -> float:
    """Spacing of the grid over an area [m]."""
    west, south, east, north = area.water.bounds
    return max(resolution_m, float(np.sqrt((east - west) * (north - south) / GRID_CELLS)))


def clearance_field(area: SeaArea, *, resolution_m: float) -> ClearanceField:
    """Clearance of every cell of a grid over the allowed water, by an exact distance transform.

    Args:
        resolution_m: desired spacing; coarser where the area would need more than `GRID_CELLS`.
    """
    return _clearance_field(area.water, grid_cell_m(area, resolution_m))


@lru_cache(maxsize=KEPT_GRIDS)
def _clearance_field(water: shapely.MultiPolygon, cell: float) -> ClearanceField:
    """The field of a water on cells of a size [m]; kept, as remedies ask for it again."""
    west, south, east, north = water.bounds
    norths = np.arange(south - cell, north + 2 * cell, cell)
    easts = np.arange(west - cell, east + 2 * cell, cell)
    shapely.prepare(water)
    free = shapely.contains_xy(water, *np.meshgrid(easts, norths))
    # a pier thinner than a cell hides between the centres: every cell that a shore passes through is forbidden
    shore = shapely.get_coordinates(shapely.segmentize(shapely.boundary(water), cell / 2))
    free[
        np.rint((shore[:, 1] - norths[0]) / cell).astype(int), np.rint((shore[:, 0] - easts[0]) / cell).astype(int)
    ] = False
    free[[0, -1], :] = free[:, [0, -1]] = False
    distance = np.asarray(scipy.ndimage.distance_transform_edt(free)) * cell - cell / 2
    return ClearanceField(origin=np.array([norths[0], easts[0]]), cell_m=cell, clearance_m=distance.clip(0.0))


def narrowest_passage(field: ClearanceField, start: Array, goal: Array) -> tuple[float, Array]:
    """The largest clearance with which start (2,) and goal (2,) are connected, and where the passage is that narrow.

    Returns:
        Clearance [m] (zero when they are not connected at all), and the (2,) north/east place.
    """
    a, b = field.index(start), field.index(goal)
    low, high = 0.0, float(min(field.clearance_m[a], field.clearance_m[b]))
    eight = np.ones((3, 3))
    while high - low > field.cell_m / 4:
        middle = (low + high) / 2
        regions, _ = scipy.ndimage.label(field.clearance_m >= middle, structure=eight)
        low, high = (middle, high) if regions[a] == regions[b] else (low, middle)
    regions, _ = scipy.ndimage.label(field.clearance_m >= high, structure=eight)
    path = _path(field, start, goal, low - field.cell_m)
    passage, beside = _first_passage(regions[field.index(path)])
    apart = sum(scipy.ndimage.distance_transform_edt(regions != region) for region in beside if region)
    among = path[passage]
    return low, among[int(np.argmin(apart[field.index(among)]))] if any(beside) else among[len(among) // 2]


def _first_passage(regions: np.ndarray) -> tuple[slice, tuple[int, int]]:
    """The part of a path (k,) between the first two wide regions that it passes through, and these; 0 for none."""
    wide = np.flatnonzero(regions)
    changes = np.flatnonzero(np.diff(regions[wide]))
    if len(wide) and not regions[0]:  # it begins in narrow water
        first, last = 0, int(wide[0])
    elif len(changes):
        first, last = int(wide[changes[0]]), int(wide[changes[0] + 1])
    else:
        first, last = int(wide[-1]) if len(wide) else 0, len(regions) - 1
    return slice(first, last + 1), (int(regions[first]), int(regions[last]))


def _path(fine: ClearanceField, start: Array, goal: Array, clearance_m: float) -> Array:
    """(k, 2) centres of a shortest eight-neighbour path through cells with a clearance; one row where there is none."""
    field = fine.thinned(ROUTING_CELLS)
    free = field.clearance_m >= clearance_m
    free[field.index(goal)] = True
    numbers = np.arange(free.size).reshape(free.shape)
    tails, heads, lengths = [], [], []
    for step_row, step_column in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a, b = _neighbours(numbers, step_row, step_column)
        both = free.ravel()[a] & free.ravel()[b]
        tails.append(a[both])
        heads.append(b[both])
        lengths.append(np.full(int(both.sum()), np.hypot(step_row, step_column)))
    ends = np.concatenate(tails), np.concatenate(heads)
    graph = scipy.sparse.coo_matrix((np.concatenate(lengths), ends), shape=(numbers.size, numbers.size)).tocsr()
    before = scipy.sparse.csgraph.dijkstra(
        graph, directed=False, indices=int(numbers[field.index(goal)]), return_predecessors=True
    )[1]
    cells = [int(numbers[field.index(start)])]
    while (after := int(before[cells[-1]])) >= 0:
        cells.append(after)
    return field.centre(np.array(cells))


def _neighbours(numbers: np.ndarray, step_row: int, step_column: int) -> tuple[np.ndarray, np.ndarray]:
    rows, columns = numbers.shape
    low, high = max(0, -step_column), columns - max(0, step_column)
    a = numbers[: rows - step_row, low:high]
    b = numbers[step_row:, low + step_column : high + step_column]
    return a.ravel(), b.ravel()


def reachable(area: SeaArea, ends: Array, reach_m: float) -> SeaArea:
    """The water round the ends (k, 2), as far as a distance north, south, east and west, that is connected to them.

    The area itself where that extends about as far, and where an end is not in the water.
    """
    east_north = np.asarray(ends)[:, ::-1]
    least, most = east_north.min(axis=0) - reach_m, east_north.max(axis=0) + reach_m
    west, south, east, north = area.water.bounds
    all_in = (least <= (west, south)).all() and (most >= (east, north)).all()
    water = area.water if all_in else as_multipolygon(shapely.intersection(area.water, shapely.box(*least, *most)))
    parts, points = shapely.get_parts(water), shapely.points(east_north)
    held = np.array([shapely.intersects(part, points) for part in parts])
    found = shapely.MultiPolygon(list(parts[held.any(axis=1)]))
    kept = shapely.box(*found.bounds).area > KEPT * shapely.box(*area.water.bounds).area
    return area if kept or not held.any(axis=0).all() else replace(area, water=found)


def connects(area: SeaArea, ends: Array) -> bool:
    """Whether one part of the water holds all ends (k, 2)."""
    points = shapely.points(np.asarray(ends)[:, ::-1])
    return any(bool(shapely.intersects(part, points).all()) for part in area.water.geoms)


def resolved(area: SeaArea, ends: Array, reach_m: float, *, hull_m: float) -> tuple[SeaArea, float]:
    """The reachable water, no larger than the clearance grid resolves well for a hull, and its reach [m].

    Args:
        area, ends, reach_m: as for `reachable`.
        hull_m: length of the hull.
    """
    reach_m = max(reach_m, LEAST_REACH_HULLS * hull_m)
    found = reachable(area, ends, reach_m)
    while grid_cell_m(found, hull_m / 8) > FINE_HULLS * hull_m:
        smaller_m = reach_m * np.sqrt(0.5)
        less = reachable(found, ends, smaller_m)
        if smaller_m < LEAST_REACH_HULLS * hull_m or (connects(found, ends) and not connects(less, ends)):
            break
        found, reach_m = less, smaller_m
    return found, reach_m


KEPT_TABLES = 6  # visibility graphs, clearance grids and tables of distances that a process keeps
TABLE_CELLS = 60_000  # of the table of distances to the goal
TABLE_CHUNK = 1000  # cells of that table processed at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class GoalDistance:
    """Distances and paths to the goal."""

    graph: VisibilityGraph  # of the water
    field: ClearanceField  # the grid of the table
    # (rows, columns) length of the path to the goal; where there is none, that of the nearest cell with one, and the
    # distance to it
    distance_m: Array
    first_bend: np.ndarray  # (rows, columns) node where the path from a cell bends first
    nodes: Array  # (n, 2) corners, the goal last
    next_node: np.ndarray  # (n,) on each node's path; the goal's is itself

    def to_goal(self, points: Array) -> Array:
        """(...,) length of the path to the goal from (..., 2) points [m]."""
        cells = [(points[..., k] - self.field.origin[k]) / self.field.cell_m for k in (0, 1)]
        return np.asarray(scipy.ndimage.map_coordinates(self.distance_m, cells, order=1, mode="nearest"))

    def path(self, point: Array) -> Array:
        """(k, 2) shortest path from a point to the goal."""
        row, column = self.field.index(point)
        return np.array([point, *path_over(int(self.first_bend[row, column]), self.nodes, self.next_node)])

    def paths(self, points: Array) -> Array:
        """(b, k, 2) shortest paths from points (b, 2) to the goal, which the shorter ones repeat."""
        chains = self._chains[self.first_bend[self.field.index(points)]]
        return np.concatenate([points[:, None], self.nodes[chains]], axis=1)

    @cached_property
    def _chains(self) -> np.ndarray:
        """(n, k) each node and those after it on the path to the goal, which is repeated."""
        chains = [np.arange(len(self.next_node))]
        while (after := self.next_node[chains[-1]]).tolist() != chains[-1].tolist():
            chains.append(after)
        return np.stack(chains, axis=1)


def build_goal_distance(graph: VisibilityGraph, field: ClearanceField, goal: Array) -> GoalDistance | None:
    """The table for a goal (2,), or None where no path leads to it.

    Args:
        graph: of the water that centre lines may use.
        field: its grid; thinned to `TABLE_CELLS`.
        goal: position.
    """
    return _goal_distance(graph, field, (float(goal[0]), float(goal[1])))


@lru_cache(maxsize=KEPT_TABLES)
def _goal_distance(graph: VisibilityGraph, field: ClearanceField, goal: tuple[float, float]) -> GoalDistance | None:
    """The table; kept, as remedies ask for it again."""
    nodes, distance, next_node = shortest_path_tree(graph, np.array(goal))
    grid = field.thinned(TABLE_CELLS)
    cells = grid.centre(np.arange(grid.clearance_m.size))
    wet = np.flatnonzero(shapely.contains_xy(graph.water, cells[:, 1], cells[:, 0]))
    table, first = np.full(grid.clearance_m.size, np.inf), np.full(grid.clearance_m.size, len(nodes) - 1)
    for some in np.array_split(wet, len(wet) // TABLE_CHUNK + 1):
        total = scipy.spatial.distance.cdist(cells[some], nodes) + distance
        table[some], first[some] = taut_bends(graph, cells[some], nodes, next_node, total)
    if not np.isfinite(table).any():
        return None
    shape = grid.clearance_m.shape
    filled, first = _filled(table.reshape(shape), first.reshape(shape), grid.cell_m)
    return GoalDistance(graph=graph, field=grid, distance_m=filled, first_bend=first, nodes=nodes, next_node=next_node)


def shortest_path_tree(graph: VisibilityGraph, goal: Array) -> tuple[Array, Array, np.ndarray]:
    """Nodes (n, 2), the goal last, their distances to it and the next node on the path of each."""
    inside = graph.nearest(goal)
    nodes = np.concatenate([graph.corners, inside[None]])
    n = len(graph.corners)
    seen = graph.sees(inside, nodes)
    seen = seen[seen < n]
    rows, columns = graph.lengths.nonzero()
    data = np.r_[graph.lengths.data, np.hypot(*(nodes[seen] - inside).T)] + 1e-12
    edges = scipy.sparse.coo_matrix(
        (data, (np.r_[rows, np.full(len(seen), n)], np.r_[columns, seen])), shape=(n + 1, n + 1)
    )
    distance, before = scipy.sparse.csgraph.dijkstra(edges.tocsr(), directed=False, indices=n, return_predecessors=True)
    next_node = np.where(before < 0, np.arange(n + 1), before)
    return nodes, distance + float(np.hypot(*(inside - goal))), next_node


def path_over(node: int, nodes: Array, next_node: np.ndarray) -> list[Array]:
    """Nodes (2,) of a shortest path tree from one node on to the goal."""
    chain = [nodes[node]]
    while (after := int(next_node[node])) != node:
        node = after
        chain.append(nodes[node])
    return chain


def first_bends(graph: VisibilityGraph, points: Array, nodes: Array, distance: Array) -> tuple[Array, np.ndarray]:
    """(k,) length of the shortest path from each point, infinite where there is none, and the node of its first bend.

    Args:
        points: (k, 2).
        nodes, distance: (n, 2) places and the lengths of the paths from there.
    """
    total = scipy.spatial.distance.cdist(points, nodes) + distance
    bend = _nearest_seen(graph, points, nodes, total)
    return _chosen(total, bend), bend.clip(0)


def taut_bends(
    graph: VisibilityGraph, points: Array, nodes: Array, next_node: np.ndarray, total: Array
) -> tuple[Array, np.ndarray]:
    """(k,) least cost of paths from each point, infinite where there is none, and the node of its first bend.

    Nodes at which a shortest path may bend are tested for sight first, the others only where none of them is seen.

    Args:
        points: (k, 2).
        nodes, next_node: (n, 2) corners of the graph, the goal last, and the node (n,) after each.
        total: (k, n) cost of the paths from the points that bend at the nodes first.
    """
    taut = np.isfinite(total)
    corners = np.flatnonzero(taut[:, :-1].any(axis=0))
    taut[:, corners] &= graph.bends(points, corners, nodes[next_node[corners]])
    likely = np.flatnonzero(taut.any(axis=0))
    found = _nearest_seen(graph, points, nodes[likely], np.where(taut[:, likely], total[:, likely], np.inf))
    bend = np.where(found < 0, -1, likely[found])
    left = np.flatnonzero(bend < 0)
    left = left[shapely.intersects_xy(graph.water, points[left, 1], points[left, 0])]
    bend[left] = _nearest_seen(graph, points[left], nodes, total[left])
    return _chosen(total, bend), bend.clip(0)


def _chosen(total: Array, node: np.ndarray) -> Array:
    """(k,) totals of nodes, infinite for none."""
    return np.where(node < 0, np.inf, total[np.arange(len(node)), node])


def _nearest_seen(graph: VisibilityGraph, points: Array, nodes: Array, total: Array) -> np.ndarray:
    """(k,) the node of least finite total (k, n) in sight of each point, -1 for none."""
    found, rows, left = np.full(len(points), -1), np.arange(len(points)), total.copy()
    while len(rows):
        node = left.argmin(axis=1)
        some = np.isfinite(left[np.arange(len(rows)), node])
        rows, left, node = rows[some], left[some], node[some]
        seen = graph.joins(points[rows], nodes[node])
        found[rows[seen]] = node[seen]
        left[np.arange(len(rows)), node] = np.inf
        rows, left = rows[~seen], left[~seen]
    return found


def _filled(table: Array, bend: np.ndarray, cell_m: float) -> tuple[Array, np.ndarray]:
    """Cells without a path get that of the nearest cell with one, and the distance to it."""
    missing = ~np.isfinite(table)
    away, (rows, columns) = scipy.ndimage.distance_transform_edt(missing, return_indices=True)
    return table[rows, columns] + cell_m * away, bend[rows, columns]
