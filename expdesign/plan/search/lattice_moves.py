"""A sea area as a state lattice: cells, four headings, straights and quarter turns, runs snapped to the lattice.

Costs are seconds of repositioning at transit speed; changes of speed cost nothing here. A run ends where it ends; from
there the shortest Dubins curve to a lattice pose nearby is part of its cost, so that the chain of poses is continuous.

Source: F. Ljungberg, doctoral thesis, Linköping University, section 8.2 and 9.4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array

from expdesign.plan.chart import ClearanceField
from expdesign.plan.legs import dubins_curve
from expdesign.plan.local_planner import SearchSpace
from expdesign.plan.runs import Footprint
from expdesign.plan.search.lattice import LatticeProblem
from expdesign.values import Array

HEADINGS = np.arange(4) * np.pi / 2
NEARBY = 2
"""Cells around the end of a run, a start or a goal, in which a lattice pose is looked for."""
POINTS = 8
"""Places looked at along a move."""


class _Grid:
    """Cells of a lattice over a clearance field, and which of their poses a leg may use."""

    def __init__(self, field: ClearanceField, spacing_m: float, margin_m: float) -> None:
        rows, columns = field.clearance_m.shape
        reach = np.array([rows - 1, columns - 1]) * field.cell_m
        self.field, self.spacing_m, self.margin_m = field, spacing_m, margin_m
        self.shape: tuple[int, int] = tuple((np.floor(reach / spacing_m).astype(int) + 1).tolist())
        self.origin = field.origin
        self.clear = field.at(self.centres()) >= margin_m

    def centres(self) -> Array:
        """(rows, columns, 2) north, east of the cells [m]."""
        rows, columns = np.indices(self.shape)
        return np.asarray(self.origin + self.spacing_m * np.stack([rows, columns], axis=-1))

    def number(self, rows: np.ndarray, columns: np.ndarray, heading: int) -> np.ndarray:
        """Pose numbers."""
        return np.asarray((rows * self.shape[1] + columns) * 4 + heading)

    def inside(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        return np.asarray((rows >= 0) & (rows < self.shape[0]) & (columns >= 0) & (columns < self.shape[1]))

    def free(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Whether cells exist and are clear."""
        inside = self.inside(rows, columns)
        return np.asarray(inside & self.clear[np.where(inside, rows, 0), np.where(inside, columns, 0)])

    def path_clear(self, path: Array, heading: int, room_m: Array | float) -> np.ndarray:
        """(rows, columns) whether points (k, 2), relative to a pose of that heading, have room from every cell."""
        c, s = np.cos(HEADINGS[heading]), np.sin(HEADINGS[heading])
        clear, centres = self.clear.copy(), self.centres()
        rooms = np.broadcast_to(room_m, len(path))
        for (forward, starboard), room in zip(path, rooms, strict=True):
            offset = np.array([c * forward - s * starboard, s * forward + c * starboard])
            some = np.nonzero(clear)
            clear[some] = self.field.at(centres[some] + offset) >= room
        return clear


def build_lattice(space: SearchSpace, counts: Sequence[int], start: Array, *, spacing_m: float) -> LatticeProblem:
    """The lattice problem of a search space. Its last two poses are the start and the goal themselves.

    Args:
        space: water, runs and what the ship can do; the current is left out.
        counts: how often each of the space's runs is wanted.
        start: (3,) pose.
        spacing_m: between cells; at least the turning radius, so that a quarter turn fits.
    """
    grid = _Grid(space.field, max(spacing_m, space.ship.turning_radius_m), space.leg_margin_m)
    poses = grid.clear.size * 4
    runs = [_run_ends(grid, space, run) for run in space.footprints]
    entries = np.concatenate(
        [
            _moves(grid, space),
            _doors(grid, space, start, poses),
            _doors(grid, space, space.goal, poses + 1, arriving=True),
        ],
        axis=1,
    )
    return LatticeProblem(
        moves=csr_array((entries[2], entries[:2].astype(np.int32)), shape=(poses + 2, poses + 2)),
        ends=np.array([np.append(ends, (-1, -1)) for ends, _ in runs]).reshape(-1, poses + 2),
        run_costs=np.array([np.append(costs, (0.0, 0.0)) for _, costs in runs]).reshape(-1, poses + 2),
        counts=tuple(int(count) for count in counts),
        start=poses,
        goal=poses + 1,
    )


def _moves(grid: _Grid, space: SearchSpace) -> Array:
    """(3, k) from, to and seconds: straights and quarter turns to both sides from every clear cell."""
    s, radius = grid.spacing_m, space.ship.turning_radius_m
    shares = np.linspace(0.0, 1.0, POINTS)
    straight = np.column_stack([s * shares, 0 * shares])
    turn = np.concatenate(
        [
            np.column_stack([(s - radius) * shares, 0 * shares]),
            np.column_stack(
                [s - radius + radius * np.sin(np.pi / 2 * shares), radius * (1 - np.cos(np.pi / 2 * shares))]
            ),
            np.column_stack([0 * shares + s, radius + (s - radius) * shares]),
        ]
    )
    turn_m = 2 * (s - radius) + radius * np.pi / 2
    kinds = [(straight, (1, 0), 0, s), (turn, (1, 1), 1, turn_m), (turn * (1, -1), (1, -1), -1, turn_m)]
    entries: list[np.ndarray] = []
    for heading in range(4):
        for path, step, quarter, length in kinds:
            rows, columns = np.nonzero(grid.path_clear(path, heading, grid.margin_m))
            to_rows, to_columns = _stepped(rows, columns, step, heading)
            fits = grid.free(to_rows, to_columns)
            here = grid.number(rows, columns, heading)[fits]
            there = grid.number(to_rows, to_columns, (heading + quarter) % 4)[fits]
            entries.append(np.stack([here, there, np.full(len(here), length / space.ship.transit_speed_mps)]))
    return np.concatenate(entries, axis=1)


def _stepped(
    rows: np.ndarray, columns: np.ndarray, step: tuple[int, int], heading: int
) -> tuple[np.ndarray, np.ndarray]:
    """Cells (ahead, starboard) of others."""
    c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[heading]
    return rows + step[0] * c - step[1] * s, columns + step[0] * s + step[1] * c


def _run_ends(grid: _Grid, space: SearchSpace, run: Footprint) -> tuple[np.ndarray, Array]:
    """Pose after a run and the Dubins curve that follows it, and that curve's seconds, from every pose."""
    ends, costs = np.full((grid.clear.size, 4), -1), np.zeros((grid.clear.size, 4))
    step, quarter, curve = _snap(grid, space, run.displacement)
    seconds = _length(curve) / space.ship.transit_speed_mps
    for heading in range(4):
        clear = grid.path_clear(run.discs, heading, run.room_m)
        clear &= grid.path_clear(curve[:, :2], heading, grid.margin_m)
        rows, columns = np.nonzero(clear)
        to_rows, to_columns = _stepped(rows, columns, step, heading)
        fits = grid.free(to_rows, to_columns)
        cells = (rows * grid.shape[1] + columns)[fits]
        ends[cells, heading] = grid.number(to_rows, to_columns, (heading + quarter) % 4)[fits]
        costs[cells, heading] = seconds
    return ends.ravel(), costs.ravel()


def _snap(grid: _Grid, space: SearchSpace, displacement: Array) -> tuple[tuple[int, int], int, Array]:
    """The lattice pose nearest to the end of a run by Dubins curve: its step, quarter turns, and the curve."""
    middle = np.rint(displacement[:2] / grid.spacing_m).astype(int)
    near = range(-NEARBY, NEARBY + 1)
    options = [((int(middle[0]) + i, int(middle[1]) + j), quarter) for i in near for j in near for quarter in range(4)]
    curves = [
        dubins_curve(
            displacement,
            np.array([*(grid.spacing_m * np.array(step)), HEADINGS[quarter]]),
            radius_m=space.ship.turning_radius_m,
            spacing_m=grid.spacing_m / 4,
        )
        for step, quarter in options
    ]
    best = int(np.argmin([_length(curve) for curve in curves]))
    return (*options[best], curves[best])


def _doors(grid: _Grid, space: SearchSpace, pose: Array, number: int, *, arriving: bool = False) -> Array:
    """(3, k) from, to and seconds of the Dubins curves from a pose to clear lattice poses near it, or to it from them.

    Near its ends a way needs no more clearance than the ends have, so that a berth can be left and reached.
    """
    cell = np.rint((pose[:2] - grid.origin) / grid.spacing_m).astype(int)
    rows, columns = (
        axis.ravel() for axis in np.mgrid[-NEARBY : NEARBY + 1, -NEARBY : NEARBY + 1] + cell[:, None, None]
    )
    fits = grid.free(rows, columns)
    entries = []
    for row, column in zip(rows[fits], columns[fits], strict=True):
        for heading in range(4):
            there = np.array([*(grid.origin + grid.spacing_m * np.array([row, column])), HEADINGS[heading]])
            ends = (there, pose) if arriving else (pose, there)
            curve = dubins_curve(*ends, radius_m=space.ship.turning_radius_m, spacing_m=grid.spacing_m / 4)
            berth = min(grid.margin_m, float(grid.field.at(pose[:2])))
            if (grid.field.at(curve[:, :2]) >= berth).all():
                entries.append((number, int(grid.number(row, column, heading)), _length(curve)))
    found = np.array(entries).reshape(-1, 3).T
    found = found / np.array([[1.0], [1.0], [space.ship.transit_speed_mps]])
    return np.asarray(found[[1, 0, 2]] if arriving else found)


def _length(curve: Array) -> float:
    return float(np.hypot(*np.diff(curve[:, :2], axis=0).T).sum())
