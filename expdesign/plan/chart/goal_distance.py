"""Distance to the goal round the islands, and the way there, for every point of the water.

The ways are the visibility graph's, so the distance has no favourite directions; the grid is only a table of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import distance_transform_edt, map_coordinates
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from expdesign.plan.chart.clearance_grid import ClearanceField
from expdesign.plan.chart.visibility_graph import Ways, sight_lines
from expdesign.values import Array

TABLE_CELLS = 60_000
CHUNK = 4000
"""Cells looked at at a time."""
FEW = 20
"""Corners that are sorted by the way over them first; the others only where none of these is in sight."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GoalWays:
    """Ways to the goal.

    Attributes:
        ways: of the water.
        field: the grid of the table.
        distance_m: (rows, columns) length of the way to the goal; where there is none, that of the nearest
            cell with one, and the distance to it.
        turn: (rows, columns) node where the way from a cell bends first.
        nodes: (n, 2) corners, the goal last.
        following: (n,) next node of each node's way; the goal's own is itself.
    """

    ways: Ways
    field: ClearanceField
    distance_m: Array
    turn: np.ndarray
    nodes: Array
    following: np.ndarray

    def to_goal(self, points: Array) -> Array:
        """(...,) length of the way to the goal from (..., 2) points [m]."""
        cells = np.moveaxis((points - self.field.origin) / self.field.cell_m, -1, 0)
        inside = [np.clip(cell, 0, size - 1) for cell, size in zip(cells, self.distance_m.shape, strict=True)]
        return np.asarray(map_coordinates(self.distance_m, inside, order=1, mode="nearest"))

    def way(self, point: Array) -> Array:
        """(k, 2) from a point to the goal."""
        row, column = self.field.index(point)
        node = int(self.turn[row, column])
        chain = [point, self.nodes[node]]
        while (after := int(self.following[node])) != node:
            node = after
            chain.append(self.nodes[node])
        return np.array(chain)


def build_goal_ways(ways: Ways, field: ClearanceField, goal: Array) -> GoalWays | None:
    """The table for a goal (2,), or None when the goal sees no water.

    Args:
        ways: of the water that centre lines may use.
        field: its grid; thinned to `TABLE_CELLS`.
        goal: place.
    """
    nodes, distance, following = ways_to(ways, goal)
    grid = field.thinned(TABLE_CELLS)
    shape = grid.clearance_m.shape
    cells = grid.centre(np.arange(grid.clearance_m.size))
    wet = np.flatnonzero(shapely.contains_xy(ways.water, cells[:, 1], cells[:, 0]))
    reached = np.flatnonzero(np.isfinite(distance))
    if not len(wet):
        return None
    length, turn = _tabled(ways, cells[wet], nodes[reached], distance[reached])
    table, first = np.full(grid.clearance_m.size, np.inf), np.full(grid.clearance_m.size, len(nodes) - 1)
    table[wet], first[wet] = length, reached[turn]
    if not np.isfinite(table).any():
        return None
    filled, first = _filled(table.reshape(shape), first.reshape(shape), grid.cell_m)
    return GoalWays(ways=ways, field=grid, distance_m=filled, turn=first, nodes=nodes, following=following)


def ways_to(ways: Ways, goal: Array) -> tuple[Array, Array, np.ndarray]:
    """Nodes (n, 2), the goal last, their distances to it and the next node of each."""
    inside = ways.nearest(goal)
    nodes = np.concatenate([ways.corners, inside[None]])
    n = len(ways.corners)
    seen = ways.sees(inside, nodes)
    seen = seen[seen < n]
    rows, columns = ways.lengths.nonzero()
    data = np.r_[ways.lengths.data, np.hypot(*(nodes[seen] - inside).T)] + 1e-12
    graph = coo_matrix((data, (np.r_[rows, np.full(len(seen), n)], np.r_[columns, seen])), shape=(n + 1, n + 1))
    distance, before = dijkstra(graph.tocsr(), directed=False, indices=n, return_predecessors=True)
    following = np.where(before < 0, np.arange(n + 1), before)
    return nodes, distance + float(np.hypot(*(inside - goal))), following


def _tabled(ways: Ways, points: Array, nodes: Array, distance: Array) -> tuple[Array, np.ndarray]:
    """(k,) length of the shortest way from each point and the node it bends at first."""
    length, turn = np.full(len(points), np.inf), np.zeros(len(points), dtype=int)
    for first in range(0, len(points), CHUNK):
        part = slice(first, first + CHUNK)
        length[part], turn[part] = first_bends(ways, points[part], nodes, distance)
    return length, turn


def first_bends(ways: Ways, points: Array, nodes: Array, distance: Array) -> tuple[Array, np.ndarray]:
    """The same for some points: nodes are tried from the best on until one is in sight."""
    total = np.hypot(*np.moveaxis(points[:, None] - nodes, -1, 0)) + distance
    length, turn = np.full(len(points), np.inf), np.zeros(len(points), dtype=int)
    order = _best_first(total, min(FEW, len(nodes)))
    left = np.arange(len(points))
    for k in range(len(nodes)):
        if k == FEW:
            order = np.zeros((len(points), len(nodes)), dtype=int)
            order[left] = np.argsort(total[left], axis=1)
        node = order[left, k]
        seen = shapely.covers(ways.water, sight_lines(points[left], nodes[node]))
        length[left[seen]], turn[left[seen]] = total[left[seen], node[seen]], node[seen]
        left = left[~seen]
        if not len(left):
            break
    return length, turn


def _best_first(total: Array, count: int) -> np.ndarray:
    """(k, count) columns of the least totals, in order."""
    few = np.argpartition(total, count - 1, axis=1)[:, :count]
    return np.asarray(np.take_along_axis(few, np.argsort(np.take_along_axis(total, few, 1), axis=1), 1))


def _filled(table: Array, turn: np.ndarray, cell_m: float) -> tuple[Array, np.ndarray]:
    """Cells without a way get their nearest neighbour's, and the distance to it."""
    missing = ~np.isfinite(table)
    away, (rows, columns) = distance_transform_edt(missing, return_indices=True)
    return table[rows, columns] + cell_m * away, turn[rows, columns]
