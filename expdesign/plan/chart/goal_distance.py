"""Distance to the goal round the islands, and the shortest path there, for every point of the water.

Paths are those of the visibility graph, so the distance prefers no direction; the grid only tabulates it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import scipy
import shapely

from expdesign.plan.chart.clearance_grid import ClearanceField
from expdesign.plan.chart.visibility_graph import VisibilityGraph
from expdesign.values import Array

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
