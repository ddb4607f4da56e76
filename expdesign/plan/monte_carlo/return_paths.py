"""Return paths of many ships to one place, the shortest in safe water, and how ships follow them.

They are the visibility-graph paths of planned legs, in the water that centre lines may use. A ship outside that water
goes straight back into it first. Ships that sail arcs go around by the shortest Dubins curve to the beginning of the
run-up where the water has room for it; else by a chain of such curves over a fixed set of poses round it, a roadmap
that all ships share.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import product

import numpy as np
import shapely

from expdesign.conventions import wrap_angle
from expdesign.plan.chart import VisibilityGraph, first_bends, path_over, polyline_length, shortest_path_tree
from expdesign.plan.control import TRACK_LEAD, Helmsman, lengths
from expdesign.plan.legs import dubins_curve
from expdesign.values import Array

TURN_HULLS = 2.0  # distance from the end of a return path within which ships that keep station turn to its heading
TURNED_RAD = 0.15  # heading error there up to which they have turned
BEND_SPEED = 0.25  # least speed at bends and while the bow points elsewhere, in transit speeds
BRAKING = 0.5  # share of the mean acceleration that is used for slowing down on return paths
SIDEWAYS_SPEED = 0.5  # sideways and astern, in transit speeds
LOOK_AHEAD_HULLS = 1.5  # of helm-steered ships on return paths (line of sight guidance)
ARC_HULLS = 1.5  # distance from the next bend of an arc within which a ship turns as the arc does
BEND_HULLS = 0.4  # distance from a bend at which a ship has reached it
GO_AROUND_ROOM = 1.0  # turning radii that paths of arcs keep from the water's edge where they can
# distances from the goal of the poses through which go-arounds lead, in turning radii
NODES_RADII = (2.0, 4.0, 7.0, 11.0)
NODE_BEARINGS, NODE_COURSES = 12, 8  # bearings of these poses at each distance, and courses at each of them
FIRST_TRIES, NEXT_TRIES = 60, 6  # such poses tried for a ship, and for a go-around from another pose
CURVES = 3  # Dubins curves that a go-around from such a pose consists of at most


@dataclass(frozen=True, kw_only=True, eq=False)
class ReturnPaths:
    """All shortest paths to a place."""

    graph: VisibilityGraph  # of the water
    place: Array  # (2,)
    # nodes, distance, next_node: by `shortest_path_tree`
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

    def hold(self, points: Array, paths: np.ndarray) -> np.ndarray:
        """(k,) whether paths stay in the water, from all their points (j, 2) and the path of each point (j,)."""
        return np.asarray(shapely.covers(self.graph.water, shapely.linestrings(points[:, ::-1], indices=paths)))


def covers_path(water: shapely.Geometry, path: Array) -> bool:
    """Whether a path (k, 2) stays in the water."""
    return bool(shapely.covers(water, shapely.LineString(path[:, ::-1])))


def build_return_paths(graph: VisibilityGraph, place: Array) -> ReturnPaths:
    """The tree of shortest paths to a place (2,)."""
    nodes, distance, next_node = shortest_path_tree(graph, place)
    return ReturnPaths(graph=graph, place=place, nodes=nodes, distance=distance, next_node=next_node)


class PathFollowers:
    """n ships, each on a path of its own to a state.

    Attributes:
        goals: (n, 6) where the paths lead.
        length_m: (n,) of the paths at their start.
    """

    def __init__(self, helm: Helmsman, goal: Array, ships: int, *, reach_m: float) -> None:
        """No ship has a path yet; all are to lead to a goal (6,), and a ship within `reach_m` of it has arrived."""
        self._helm, self.goals = helm, np.tile(goal, (ships, 1))
        self._path: Array = np.tile(goal[:2], (ships, 2, 1))
        self._left: Array = np.zeros((ships, 2))
        self._bend: Array = np.full((ships, 2), helm.ship.transit_speed_mps)
        self._curvature: Array = np.zeros((ships, 2))
        self._next, self._last = np.ones(ships, dtype=int), np.zeros(ships, dtype=int)
        self._reach_m = reach_m
        self.length_m: Array = np.zeros(ships)

    def start(self, ship: int, path: Array) -> None:
        """Give a ship a path (k, 2) that begins where it is."""
        room = len(path) - self._path.shape[1]
        if room > 0:
            self._path = np.concatenate([self._path, np.repeat(self._path[:, -1:], room, axis=1)], axis=1)
            self._left = np.pad(self._left, ((0, 0), (0, room)))
            self._bend = np.pad(self._bend, ((0, 0), (0, room)), mode="edge")
            self._curvature = np.pad(self._curvature, ((0, 0), (0, room)))
        count, fastest = len(path), self._helm.ship.transit_speed_mps
        steps = np.diff(path, axis=0)
        self._path[ship], self._left[ship], self._next[ship] = self.goals[ship, :2], 0.0, min(1, count - 1)
        self._path[ship, :count] = path
        length = np.hypot(*steps.T)
        self._left[ship, :count] = np.r_[np.cumsum(length[::-1])[::-1], 0.0]
        self._last[ship] = (self._left[ship] <= 0.0).argmax()
        self._bend[ship] = BEND_SPEED * fastest if self._helm.ship.keeps_station else fastest
        self._curvature[ship] = 0.0
        if count > 2:
            turn = wrap_angle(np.diff(np.arctan2(steps[:, 1], steps[:, 0])))
            slow = np.cos(np.minimum(np.abs(turn), np.pi / 2))
            self._bend[ship, 1 : count - 1] = fastest * np.maximum(BEND_SPEED, slow)
            self._curvature[ship, 1 : count - 1] = 2.0 * turn / (length[1:] + length[:-1])
        self.length_m[ship] = length.sum()

    def arrived(self, ships: np.ndarray, states: Array) -> np.ndarray:
        """(k,) which of some ships (k,) have arrived and, if they keep station, are on the desired heading."""
        helm, goals = self._helm, self.goals[ships]
        off = states[:, :2] - goals[:, :2]
        there = lengths(off) < self._reach_m
        if helm.ship.keeps_station:
            turned = np.abs(wrap_angle(states[:, 2] - goals[:, 2])) < TURNED_RAD
            return np.asarray(there & turned & (np.abs(states[:, 5]) < TURNED_RAD / (2.0 * helm.answer_s)))
        ahead = off[:, 0] * np.cos(goals[:, 2]) + off[:, 1] * np.sin(goals[:, 2])
        on_last = self._left[ships, self._next[ships]] <= 0.0
        return np.asarray(there | (on_last & (ahead > 0.0)))

    def desired(self, ships: np.ndarray, states: Array) -> Array:
        """(k, 6) desired states of some ships (k,): towards their paths, at a speed from which they slow in time."""
        helm, keeps = self._helm, self._helm.ship.keeps_station
        length, fastest = helm.vessel.length_m, helm.ship.transit_speed_mps
        self._pass_bends(ships, states[:, :2])
        at, course_there = self._next[ships], self.goals[ships, 2]
        there, before = self._path[ships, at], self._path[ships, at - 1]
        offset = there - states[:, :2]
        ahead = lengths(offset)
        left = ahead + self._left[ships, at]
        near = (left < TURN_HULLS * length) & keeps
        speed = self._speed(ahead, self._bend[ships, at])
        if near.any():
            lengthways = np.cos(np.arctan2(offset[near, 1], offset[near, 0]) - course_there[near])
            slow = np.minimum(
                fastest * np.maximum(lengthways, SIDEWAYS_SPEED),
                left[near] / (TRACK_LEAD * helm.answer_s),
            )
            speed[near] = np.minimum(speed[near], slow)
        leg = there - before
        leg = leg / np.maximum(lengths(leg), 1e-9)[:, None]
        across = offset - (offset[:, 0] * leg[:, 0] + offset[:, 1] * leg[:, 1])[:, None] * leg
        look = length if keeps else LOOK_AHEAD_HULLS * length
        pursued = leg * look + across  # a point ahead on the path
        if keeps:
            pursued = np.where((near | (ahead < look))[:, None], offset, pursued)
        course = pursued / np.maximum(lengths(pursued), 1e-9)[:, None]
        through = course * speed[:, None] - helm.environment.current_to
        heading = np.where(near, course_there, np.arctan2(through[:, 1], through[:, 0]))
        if keeps:
            off = np.cos(np.minimum(np.abs(wrap_angle(heading - states[:, 2])), np.pi / 2))
            speed = speed * np.where(near, 1.0, np.maximum(off, BEND_SPEED))
        north, east = (course * speed[:, None]).T
        c, s = np.cos(heading), np.sin(heading)
        # arcs are steered from their bends on, by ships that are near: farther off they would circle beside the bend
        turning = (ahead < ARC_HULLS * length) & (not keeps)
        rate = turning * self._curvature[ships, at] * speed
        rows = [states[:, 0], states[:, 1], heading, north * c + east * s, east * c - north * s, rate]
        return np.array(rows).T

    def _pass_bends(self, ships: np.ndarray, places: Array) -> None:
        """Ships (k,) at places (k, 2) that have reached or passed a bend turn to the next one."""
        at = self._next[ships]
        there, before = self._path[ships, at], self._path[ships, at - 1]
        off, leg = there - places, there - before
        reached = lengths(off) < BEND_HULLS * self._helm.vessel.length_m
        passed = off[:, 0] * leg[:, 0] + off[:, 1] * leg[:, 1] <= 0.0
        self._next[ships] = at + ((reached | passed) & (at < self._last[ships]))

    def _speed(self, ahead_m: Array, bend_mps: Array) -> Array:
        """(k,) speeds from which ships can slow down to those of the bends ahead."""
        brake = BRAKING * self._helm.ship.acceleration_mps2
        braked_m = np.maximum(ahead_m - BEND_HULLS * self._helm.vessel.length_m, 0.0)
        return np.minimum(np.sqrt(bend_mps * bend_mps + 2 * brake * braked_m), self._helm.ship.transit_speed_mps)


@dataclass(frozen=True, kw_only=True, eq=False)
class GoAroundPaths:
    """Paths to a pose."""

    goal: Array  # (3,) position and course
    radius_m: float  # of the ship's turns
    spacing_m: float  # between points of paths
    holds: Callable[[Array], bool]  # whether a path (k, 2) stays in the water

    def find(self, pose: Array) -> Array | None:
        """A path (k, 2) from a pose (3,), or None where none was found."""
        direct = self._direct(pose)
        return self._through(pose, self._roadmap, FIRST_TRIES) if direct is None else direct

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
        for _ in range(CURVES):
            paths = [self._through(node, roadmap, NEXT_TRIES) if found else self._direct(node) for node in nodes]
            found += [(node, path) for node, path in zip(nodes, paths, strict=True) if path is not None]
            nodes = [node for node, path in zip(nodes, paths, strict=True) if path is None]
            roadmap = _Roadmap.of(found)
        return roadmap

    def _nodes(self) -> list[Array]:
        """(3,) poses all round the goal."""
        counts = NODE_BEARINGS, NODE_COURSES
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
            for ring, bearing, course in product(NODES_RADII, bearings, courses)
        ]


def build_go_arounds(
    water: shapely.Geometry, goal: Array, *, radius_m: float, spacing_m: float
) -> tuple[GoAroundPaths, ...]:
    """Paths to a pose (3,) that leave room for ships that turn wider than planned, where it has that, and all paths."""
    roomy = shapely.buffer(water, -GO_AROUND_ROOM * radius_m)
    shapely.prepare(roomy)
    waters = [roomy, water] if shapely.contains_xy(roomy, goal[1], goal[0]) else [water]
    return tuple(
        GoAroundPaths(goal=goal, radius_m=radius_m, spacing_m=spacing_m, holds=partial(covers_path, room))
        for room in waters
    )


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
