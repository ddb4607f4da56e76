"""Least times to the goal in a current, by the visibility graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.plan.bounds.displacement import Headway
from expdesign.plan.bounds.tuning import BOUNDS
from expdesign.plan.chart import VisibilityGraph, taut_bends
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class GoalTimes:
    """Least times to the goal.

    Attributes:
        graph: of the water.
        headway: of legs.
        nodes, seconds: (n, 2) corners, the goal last, and the least time from each.
        next_node: (n,) on the path from each; the goal's is itself.
    """

    graph: VisibilityGraph
    headway: Headway
    nodes: Array
    seconds: Array
    next_node: np.ndarray

    def at(self, points: Array) -> Array:
        """(k,) least time from points (k, 2), infinite where no path leads to the goal or a point is ashore."""
        parts = [
            self._at(points[first : first + BOUNDS.lookup_chunk])
            for first in range(0, len(points), BOUNDS.lookup_chunk)
        ]
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
