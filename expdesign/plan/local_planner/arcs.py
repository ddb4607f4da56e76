"""Successors of ships that sail arcs: an arc and a straight, or a stretch of the shortest path to the goal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.local_planner.protocol import SearchSpace, Successors
from expdesign.plan.local_planner.tuning import LOCAL
from expdesign.values import Array

TURNS = np.deg2rad([0, 15, -15, 30, -30, 50, -50, 75, -75, 105, -105, 140, -140, 180, -180])
OFFSETS = np.deg2rad([0, 30, -30, 60, -60, 90, -90, 135, -135, 180])
"""Headings of runs from the direction of the path."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Departures:
    """Where partial plans' next legs begin to turn.

    Attributes:
        pose: (b, 3) places, with courses for headings.
        wait_s: (b,) time until then, and other time that legs lose.
    """

    pose: Array
    wait_s: Array


def arc_successors(space: SearchSpace, departures: Departures, able: np.ndarray, q: int, run_up_m: Array) -> Successors:
    """An arc and a straight to the run, after plans `able`; `run_up_m` of them is part of the straight."""
    radius = space.ship.turning_radius_m
    turn, extra = (grid.ravel() for grid in np.meshgrid(TURNS, space.hull_m * np.array(LOCAL.arc_straights)))
    count, pose = len(turn), departures.pose
    departure = np.repeat(pose[able], count, axis=0)
    turns, straight = np.tile(turn, len(able)), np.tile(extra, len(able)) + np.repeat(run_up_m, count)
    sail_s = (radius * np.abs(turns) + straight) / space.ship.transit_speed_mps
    return Successors(
        parent=np.repeat(able, count),
        primitive=np.full(len(turns), q),
        departure=departure,
        start=arc_end(departure, turns, straight, radius),
        leg_s=sail_s + np.repeat(departures.wait_s[able], count),
        turn=turns,
        straight=np.zeros(len(turns), dtype=bool),
    )


def path_successors(
    space: SearchSpace, departures: Departures, able: np.ndarray, q: int, *, turning_radius_m: float
) -> Successors:
    """A stretch of the shortest path to the goal, then the run with some heading.

    Args:
        space: the water.
        departures: of all plans.
        able: plans that still have the run to do.
        q: the run.
        turning_radius_m: of the turns into and out of the path, whose length is added; 0 where leg times include it.
    """
    parents, starts, seconds = [np.zeros(0, dtype=int)], [np.zeros((0, 3))], [np.zeros(0)]
    for index in able:
        pose = departures.pose[index]
        points, along = path_points(space, pose, np.array(LOCAL.path_stretches))
        if not len(points):
            continue
        heading = np.arctan2(points[:, 3], points[:, 2])
        first = np.abs(wrap_angle(heading[:1] - pose[2]))
        for offset in OFFSETS:
            length = along + turning_radius_m * (abs(offset) + first)
            starts.append(np.column_stack([points[:, :2], heading + offset]))
            seconds.append(length / space.ship.transit_speed_mps + departures.wait_s[index])
            parents.append(np.full(len(points), index))
    return on_paths(q, departures.pose, np.concatenate(parents), np.concatenate(starts), np.concatenate(seconds))


def on_paths(q: int, pose: Array, parent: np.ndarray, start: Array, leg_s: Array) -> Successors:
    """Successors by paths that keep their clearance by construction, after plans at poses (b, 3)."""
    n = len(parent)
    return Successors(
        parent=parent,
        primitive=np.full(n, q),
        departure=pose[parent],
        start=start,
        leg_s=leg_s,
        turn=np.full(n, np.nan),
        straight=np.zeros(n, dtype=bool),
    )


def path_points(space: SearchSpace, pose: Array, stretches: Array) -> tuple[Array, Array]:
    """Rows (north, east, direction north, direction east) along the path to the goal, and their distances along it.

    Args:
        space: the water.
        pose: (3,) where the path begins.
        stretches: hull lengths along it; the whole path is always among them.
    """
    path = space.goal_distance.path(pose[:2])
    steps = np.hypot(*np.diff(path, axis=0).T)
    path, steps = path[np.r_[True, steps > 1e-6]], steps[steps > 1e-6]
    if not len(steps):
        return np.zeros((0, 4)), np.zeros(0)
    along = np.r_[0.0, np.cumsum(steps)]
    chosen = np.r_[stretches * space.hull_m, along[-1]]
    chosen = chosen[chosen <= along[-1]]
    piece = np.clip(np.searchsorted(along, chosen, side="left") - 1, 0, len(steps) - 1)
    places = np.stack([np.interp(chosen, along, column) for column in path.T], axis=1)
    return np.column_stack([places, np.diff(path, axis=0)[piece] / steps[piece, None]]), chosen


def arc_end(pose: Array, turn: Array, straight: Array, radius: float) -> Array:
    """(n, 3) poses after an arc and a straight; the b-frame end of an arc is R (sin |turn|, +-(1 - cos turn))."""
    forward = radius * np.sin(np.abs(turn)) + straight * np.cos(turn)
    starboard = np.sign(turn) * radius * (1 - np.cos(turn)) + straight * np.sin(turn)
    return moved(pose, np.stack([forward, starboard, turn], axis=1))


def between(start: Array, end: Array, spacing_m: float) -> Array:
    """(k, 2) places on the straight line between two poses (3,)."""
    count = int(np.ceil(np.hypot(*(end - start)[:2]) / spacing_m)) + 1
    return np.linspace(start[:2], end[:2], count + 1)


def moved(pose: Array, step: Array) -> Array:
    """(n, 3) poses moved ahead [m], to starboard [m] and turned [rad]."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    north = pose[:, 0] + c * step[:, 0] - s * step[:, 1]
    east = pose[:, 1] + s * step[:, 0] + c * step[:, 1]
    return np.stack([north, east, pose[:, 2] + step[:, 2]], axis=1)
