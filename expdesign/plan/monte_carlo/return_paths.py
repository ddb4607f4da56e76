"""Return paths of many ships to one place, the shortest in safe water, and how ships follow them.

They are the visibility-graph paths of planned legs, in the water that centre lines may use. A ship outside that water
goes straight back into it first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from expdesign.conventions import wrap_angle
from expdesign.plan.chart import VisibilityGraph, first_bends, path_over, shortest_path_tree
from expdesign.plan.control import CONTROL, Helmsman
from expdesign.plan.monte_carlo.tuning import MONTE_CARLO
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class ReturnPaths:
    """All shortest paths to a place.

    Attributes:
        graph: of the water.
        place: (2,).
        nodes, distance, next_node: by `shortest_path_tree`.
    """

    graph: VisibilityGraph
    place: Array
    nodes: Array
    distance: Array
    next_node: np.ndarray

    def find(self, points: Array) -> list[Array | None]:
        """A path (k, 2) from each point (n, 2), the point itself first, or None where there is none."""
        inside = np.array([self.graph.nearest(point) for point in points]).reshape(-1, 2)
        reached = np.flatnonzero(np.isfinite(self.distance))
        length, first = first_bends(self.graph, inside, self.nodes[reached], self.distance[reached])
        found: list[Array | None] = []
        for point, start, away, node in zip(points, inside, length, reached[first], strict=True):
            found.append(self._chain(point, start, int(node)) if np.isfinite(away) else None)
        return found

    def _chain(self, point: Array, start: Array, node: int) -> Array:
        path = np.array([point, start, *path_over(node, self.nodes, self.next_node), self.place])
        return path[np.r_[True, np.hypot(*np.diff(path, axis=0).T) > 1e-6]]

    def holds(self, path: Array) -> bool:
        """Whether a path (k, 2) stays in the water."""
        return bool(shapely.covers(self.graph.water, shapely.LineString(path[:, ::-1])))


def build_return_paths(graph: VisibilityGraph, place: Array) -> ReturnPaths:
    """The tree of shortest paths to a place (2,)."""
    nodes, distance, next_node = shortest_path_tree(graph, place)
    return ReturnPaths(graph=graph, place=place, nodes=nodes, distance=distance, next_node=next_node)


class PathFollowers:
    """n ships, each on a path of its own to one state.

    Attributes:
        goal: (6,) where all paths lead.
        length_m: (n,) of the paths at their start.
    """

    def __init__(self, helm: Helmsman, goal: Array, ships: int, *, reach_m: float) -> None:
        """No ship has a path yet; a ship within `reach_m` of the goal has arrived."""
        self._helm, self.goal = helm, goal
        self._path: Array = np.tile(goal[:2], (ships, 2, 1))
        self._left: Array = np.zeros((ships, 2))
        self._bend: Array = np.full((ships, 2), helm.ship.transit_speed_mps)
        self._next = np.ones(ships, dtype=int)
        self._reach_m = reach_m
        self.length_m: Array = np.zeros(ships)

    def start(self, ship: int, path: Array) -> None:
        """Give a ship a path (k, 2) that begins where it is."""
        room = len(path) - self._path.shape[1]
        if room > 0:
            self._path = np.concatenate([self._path, np.repeat(self._path[:, -1:], room, axis=1)], axis=1)
            self._left = np.pad(self._left, ((0, 0), (0, room)))
            self._bend = np.pad(self._bend, ((0, 0), (0, room)), mode="edge")
        count, fastest = len(path), self._helm.ship.transit_speed_mps
        steps = np.diff(path, axis=0)
        self._path[ship], self._left[ship], self._next[ship] = self.goal[:2], 0.0, min(1, count - 1)
        self._path[ship, :count] = path
        length = np.hypot(*steps.T)
        self._left[ship, :count] = np.r_[np.cumsum(length[::-1])[::-1], 0.0]
        self._bend[ship] = MONTE_CARLO.bend_speed * fastest if self._helm.ship.keeps_station else fastest
        if count > 2:
            turn = np.abs(wrap_angle(np.diff(np.arctan2(steps[:, 1], steps[:, 0]))))
            self._bend[ship, 1 : count - 1] = fastest * np.maximum(
                MONTE_CARLO.bend_speed, np.cos(np.minimum(turn, np.pi / 2))
            )
        self.length_m[ship] = length.sum()

    def arrived(self, states: Array) -> np.ndarray:
        """(n,) ships that have arrived and, if they keep station, are on the desired heading."""
        helm = self._helm
        there = np.hypot(*(states[:, :2] - self.goal[:2]).T) < self._reach_m
        turned = np.abs(wrap_angle(states[:, 2] - self.goal[2])) < MONTE_CARLO.turned_rad
        turned &= np.abs(states[:, 5]) < MONTE_CARLO.turned_rad / (2.0 * helm.answer_s)
        if helm.ship.keeps_station:
            return np.asarray(there & turned)
        ahead = np.stack([np.cos(self.goal[2]), np.sin(self.goal[2])])
        on_last = self._left[np.arange(len(states)), self._next] <= 0.0
        return np.asarray(there | (on_last & ((states[:, :2] - self.goal[:2]) @ ahead > 0.0)))

    def desired(self, states: Array) -> Array:
        """(n, 6) desired state of each ship: towards its path, at a speed from which it can slow down in time."""
        helm, everyone = self._helm, np.arange(len(states))
        length, fastest = helm.vessel.length_m, helm.ship.transit_speed_mps
        last = (self._left <= 0.0).argmax(axis=1)
        ahead = np.hypot(*(self._path[everyone, self._next] - states[:, :2]).T)
        there, before = self._path[everyone, self._next], self._path[everyone, self._next - 1]
        passed = ((there - states[:, :2]) * (there - before)).sum(axis=1) <= 0.0
        self._next = np.where(
            ((ahead < MONTE_CARLO.bend_hulls * length) | passed) & (self._next < last), self._next + 1, self._next
        )
        there, before = self._path[everyone, self._next], self._path[everyone, self._next - 1]
        offset = there - states[:, :2]
        ahead = np.hypot(*offset.T)
        left = ahead + self._left[everyone, self._next]
        brake = MONTE_CARLO.braking * helm.ship.acceleration_mps2
        braked_m = np.maximum(ahead - MONTE_CARLO.bend_hulls * length, 0.0)
        speed = np.sqrt(self._bend[everyone, self._next] ** 2 + 2 * brake * braked_m)
        near = left < MONTE_CARLO.turn_hulls * length
        lengthways = np.cos(np.arctan2(offset[:, 1], offset[:, 0]) - self.goal[2])
        slow = np.minimum(
            fastest * np.maximum(lengthways, MONTE_CARLO.sideways_speed), left / (CONTROL.track_lead * helm.answer_s)
        )
        speed = np.minimum(np.minimum(speed, fastest), np.where(near & helm.ship.keeps_station, slow, np.inf))
        leg = there - before
        leg = leg / np.maximum(np.hypot(*leg.T), 1e-9)[:, None]
        across = offset - (offset * leg).sum(axis=1)[:, None] * leg
        look = length if helm.ship.keeps_station else MONTE_CARLO.look_ahead_hulls * length
        pursued = leg * look + across  # a point ahead on the path
        if helm.ship.keeps_station:
            pursued = np.where((near | (ahead < look))[:, None], offset, pursued)
        course = pursued / np.maximum(np.hypot(*pursued.T), 1e-9)[:, None]
        through = course * speed[:, None] - helm.environment.current_to
        pointing = np.arctan2(through[:, 1], through[:, 0])
        heading = np.where(near & helm.ship.keeps_station, self.goal[2], pointing)
        off = np.cos(np.minimum(np.abs(wrap_angle(heading - states[:, 2])), np.pi / 2))
        ground = (
            course
            * (speed * np.where(near | (not helm.ship.keeps_station), 1.0, np.maximum(off, MONTE_CARLO.bend_speed)))[
                :, None
            ]
        )
        c, s = np.cos(heading), np.sin(heading)
        return np.column_stack(
            [
                states[:, :2],
                heading,
                ground[:, 0] * c + ground[:, 1] * s,
                ground[:, 1] * c - ground[:, 0] * s,
                np.zeros(len(states)),
            ]
        )
