"""Successors of ships that sail arcs: an arc and a straight, or a stretch of the shortest path to the goal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.local_planner.protocol import RunSpace, SearchSpace, Successors
from expdesign.values import Array

# turns of arcs, and the straight after them beyond the run-up in hull lengths
ARC_TURNS_DEG = (0, 15, -15, 30, -30, 50, -50, 75, -75, 105, -105, 140, -140, 180, -180)
ARC_STRAIGHTS = (0.0, 1.0, 2.0, 3.0, 4.5, 6.0)
PATH_HEADINGS_DEG = (0, 30, -30, 60, -60, 90, -90, 135, -135, 180)  # headings of runs on it, from its direction
# ways on: turns of their arcs and straights, all as long, how many follow each other, and places looked at on each
WAY_TURNS_DEG, WAY_ARCS, WAY_POINTS = (0, 60, -60), 3, 5


@dataclass(frozen=True, kw_only=True, eq=False)
class Departures:
    """Where partial plans' next legs begin to turn."""

    pose: Array  # (b, 3) places, with courses for headings
    wait_s: Array  # (b,) time until then, and other time that legs lose


def arc_successors(space: SearchSpace, departures: Departures, able: np.ndarray, q: int, run_up_m: Array) -> Successors:
    """An arc and a straight to the run, after plans `able`; `run_up_m` of them is part of the straight."""
    radius = space.ship.turning_radius_m
    turn, extra = (
        grid.ravel() for grid in np.meshgrid(np.deg2rad(ARC_TURNS_DEG), space.hull_m * np.array(ARC_STRAIGHTS))
    )
    count, pose = len(turn), departures.pose
    departure = np.repeat(pose[able], count, axis=0)
    turns, straight = np.tile(turn, len(able)), np.tile(extra, len(able)) + np.repeat(run_up_m, count)
    sail_s = (radius * np.abs(turns) + straight) / space.ship.transit_speed_mps
    start = arc_end(departure, turns, straight, radius)
    return Successors(
        departure=pose,
        parent=np.repeat(able, count),
        primitive=np.broadcast_to(q, len(turns)),
        start=start,
        end=run_ends(space, q, start),
        leg_s=sail_s + np.repeat(departures.wait_s[able], count),
        turn=turns,
        straight=np.broadcast_to(False, len(turns)),
    )


def path_successors(
    space: SearchSpace, departures: Departures, able: np.ndarray, q: int, points: PathPoints, *, turning_radius_m: float
) -> Successors:
    """A stretch of the shortest path to the goal, then the run with some heading.

    Args:
        departures: of all plans.
        able: plans that still have the run to do.
        q: the run.
        points: of the paths of all plans.
        turning_radius_m: of the turns into and out of the path, whose length is added; 0 where leg times include it.
    """
    off_path = np.deg2rad(PATH_HEADINGS_DEG)
    plan, heading, point = np.nonzero(
        np.broadcast_to(points.exists[able, None], (len(able), len(off_path), points.count))
    )
    parent, offset = able[plan], off_path[heading]
    first = np.abs(wrap_angle(points.first_rad[parent] - departures.pose[parent, 2]))
    length_m = points.along_m[parent, point] + turning_radius_m * (np.abs(offset) + first)
    start = np.column_stack([points.place[parent, point], points.direction_rad[parent, point] + offset])
    leg_s = length_m / space.ship.transit_speed_mps + departures.wait_s[parent]
    return on_paths(space, q, departures.pose, parent, start, leg_s)


def on_paths(
    space: SearchSpace, q: int, departure: Array, parent: np.ndarray, start: Array, leg_s: Array
) -> Successors:
    """Successors by paths that keep their clearance by construction, after plans that depart from poses (b, 3)."""
    n = len(parent)
    return Successors(
        departure=departure,
        parent=parent,
        primitive=np.broadcast_to(q, n),
        start=start,
        end=run_ends(space, q, start),
        leg_s=leg_s,
        turn=np.broadcast_to(np.nan, n),
        straight=np.broadcast_to(False, n),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class PathPoints:
    """Points along the shortest paths of several plans to the goal."""

    place: Array  # (b, s, 2) north, east
    direction_rad: Array  # (b, s) of the path there
    along_m: Array  # (b, s) distance along the path
    exists: np.ndarray  # (b, s) whether the path is that long

    @property
    def count(self) -> int:
        """Points of each path."""
        return int(self.along_m.shape[1])

    @property
    def first_rad(self) -> Array:
        """(b,) direction at the first point of each path."""
        return np.asarray(self.direction_rad[np.arange(len(self.exists)), self.exists.argmax(axis=1)])


def path_points(space: SearchSpace, pose: Array, stretches: Sequence[float]) -> PathPoints:
    """Points along the paths to the goal.

    Args:
        pose: (b, 3) where the paths begin.
        stretches: hull lengths along them; the whole path is always the last.
    """
    path, plans = space.goal_distance.paths(pose[:, :2]), np.arange(len(pose))[:, None]
    steps = np.diff(path, axis=1)
    length_m = np.hypot(steps[..., 0], steps[..., 1])
    length_m[length_m <= 1e-6] = 0.0
    until_m = np.cumsum(length_m, axis=1)
    whole_m = until_m[:, -1:]
    along_m = np.hstack([np.tile(space.hull_m * np.array(stretches), (len(pose), 1)), whole_m])
    piece = (until_m[:, None] < along_m[..., None]).sum(axis=-1).clip(max=steps.shape[1] - 1)
    step, step_m = steps[plans, piece], length_m[plans, piece]
    share = 1.0 - (until_m[plans, piece] - along_m) / np.where(step_m > 0, step_m, 1.0)
    return PathPoints(
        place=path[plans, piece] + share[..., None] * step,
        direction_rad=np.arctan2(step[..., 1], step[..., 0]),
        along_m=along_m,
        exists=(along_m <= whole_m) & (whole_m > 0),
    )


def arc_end(pose: Array, turn: Array, straight: Array, radius: float) -> Array:
    """(n, 3) poses after an arc and a straight; the b-frame end of an arc is R (sin |turn|, +-(1 - cos turn))."""
    forward = radius * np.sin(np.abs(turn)) + straight * np.cos(turn)
    starboard = np.sign(turn) * radius * (1 - np.cos(turn)) + straight * np.sin(turn)
    return moved(pose, np.stack([forward, starboard, turn], axis=1))


def ways_on(space: SearchSpace, pose: Array, *, backwards: bool = False) -> np.ndarray:
    """(n,) whether arcs and straights lead on from poses (n, 3) in the water, as far as the grid knows.

    Args:
        space: with the water, and with the ship's turning radius.
        pose: where the ship may begin to turn; places with courses.
        backwards: the way leads up to the poses.
    """
    radius_m, margin_m = space.ship.turning_radius_m, space.leg_margin_m
    clearance_m = space.field.at(pose[:, :2])
    found = np.asarray(clearance_m >= margin_m + 2.0 * radius_m)  # a turning circle
    rows = np.flatnonzero(~found & (clearance_m >= margin_m))
    places = pose[rows] + np.array([0.0, 0.0, np.pi * backwards])
    turns = np.deg2rad(WAY_TURNS_DEG)
    straights_m = np.where(turns == 0.0, radius_m * np.abs(turns).max(), 0.0)
    for _ in range(WAY_ARCS):
        turn, straight_m = np.repeat(turns, len(rows)), np.repeat(straights_m, len(rows))
        rows, places = np.tile(rows, len(turns)), np.tile(places, (len(turns), 1))
        clear = np.ones(len(rows), dtype=bool)
        for share in np.linspace(0.0, 1.0, WAY_POINTS + 1)[1:]:
            ends = arc_end(places, share * turn, share * straight_m, radius_m)
            clear &= space.field.at(ends[:, :2]) >= margin_m
        rows, places = rows[clear], ends[clear]
    found[rows] = True
    return found


def between(start: Array, end: Array, spacing_m: float) -> Array:
    """(k, 2) places on the straight line between two poses (3,)."""
    count = int(np.ceil(np.hypot(*(end - start)[:2]) / spacing_m)) + 1
    return np.linspace(start[:2], end[:2], count + 1)


def run_ends(space: RunSpace | SearchSpace, primitive: np.ndarray | int, start: Array) -> Array:
    """(n, 3) poses at the ends of runs (n,), or of one run, that begin at poses (n, 3)."""
    end = moved(start, np.array([item.displacement for item in space.footprints])[primitive])
    lasting_s = np.array([item.duration_s for item in space.footprints])[primitive]
    end[:, :2] += space.current_to * lasting_s[..., None]
    return end


def all_round(count: int) -> Array:
    """(count,) directions at even angles, ahead first [rad]."""
    return np.asarray(np.arange(count) * np.pi / (count / 2))


def moved(pose: Array, step: Array) -> Array:
    """(..., 3) poses moved ahead [m], to starboard [m] and turned [rad]."""
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    ahead, starboard = step[..., 0], step[..., 1]
    north, east = pose[..., 0] + c * ahead - s * starboard, pose[..., 1] + s * ahead + c * starboard
    return np.stack([north, east, pose[..., 2] + step[..., 2]], axis=-1)
