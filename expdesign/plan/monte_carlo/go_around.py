"""Go-around paths of ships that sail arcs: from wherever they are to the beginning of a run-up.

The shortest Dubins curve where the water has room for it; else a chain of such curves over a fixed set of poses round
the run-up, a roadmap that all ships share.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from expdesign.plan.chart import polyline_length
from expdesign.plan.legs import dubins_curve
from expdesign.plan.monte_carlo.tuning import MONTE_CARLO
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class GoAroundPaths:
    """Paths to a pose.

    Attributes:
        goal: (3,) position and course.
        radius_m: of the ship's turns.
        spacing_m: between points of paths.
        holds: whether a path (k, 2) stays in the water.
    """

    goal: Array
    radius_m: float
    spacing_m: float
    holds: Callable[[Array], bool]

    def find(self, pose: Array) -> Array | None:
        """A path (k, 2) from a pose (3,), or None where none was found."""
        direct = self._direct(pose)
        return self._through(pose, self._roadmap, MONTE_CARLO.first_tries) if direct is None else direct

    def _through(self, pose: Array, roadmap: _Roadmap, tries: int) -> Array | None:
        """A path through one of the nodes that look shortest, or None."""
        first_m = np.hypot(*(roadmap.nodes[:, :2] - pose[:2]).T)
        for index in np.argsort(first_m + roadmap.left_m, kind="stable")[:tries].tolist():
            first = self._curve(pose, roadmap.nodes[index])
            if self.holds(first):
                return np.concatenate([first, roadmap.paths[index][1:]])
        return None

    def _direct(self, pose: Array) -> Array | None:
        path = self._curve(pose, self.goal)
        return path if self.holds(path) else None

    def _curve(self, start: Array, end: Array) -> Array:
        return dubins_curve(start, end, radius_m=self.radius_m, spacing_m=self.spacing_m)[:, :2]

    @cached_property
    def _roadmap(self) -> _Roadmap:
        """Nodes with a known path to the goal: those one curve away first, then those that reach one of these."""
        nodes = [node for node in self._nodes() if self.holds(np.stack([node[:2], node[:2] + 1e-3]))]
        found: list[tuple[Array, Array]] = []
        roadmap = _Roadmap.of(found)
        for _ in range(MONTE_CARLO.curves):
            paths = [
                self._through(node, roadmap, MONTE_CARLO.next_tries) if found else self._direct(node) for node in nodes
            ]
            found += [(node, path) for node, path in zip(nodes, paths, strict=True) if path is not None]
            nodes = [node for node, path in zip(nodes, paths, strict=True) if path is None]
            roadmap = _Roadmap.of(found)
        return roadmap

    def _nodes(self) -> list[Array]:
        """(3,) poses all round the goal."""
        counts = MONTE_CARLO.node_bearings, MONTE_CARLO.node_courses
        bearings, courses = (2 * np.pi * np.arange(count) / count for count in counts)
        north, east, heading = self.goal
        return [
            np.array(
                [
                    north + ring * self.radius_m * np.cos(heading + bearing),
                    east + ring * self.radius_m * np.sin(heading + bearing),
                    heading + course,
                ]
            )
            for ring, bearing, course in product(MONTE_CARLO.nodes_radii, bearings, courses)
        ]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Roadmap:
    """Nodes (k, 3), the path from each to the goal, and its length [m]."""

    nodes: Array
    paths: tuple[Array, ...]
    left_m: Array

    @classmethod
    def of(cls, found: list[tuple[Array, Array]]) -> _Roadmap:
        """From pairs of a node and its path."""
        return cls(
            nodes=np.array([node for node, _ in found]).reshape(-1, 3),
            paths=tuple(path for _, path in found),
            left_m=np.array([polyline_length(path) for _, path in found]),
        )
