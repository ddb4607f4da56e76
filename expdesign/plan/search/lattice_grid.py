"""The poses of a state lattice over a sea area: cells and headings, and which of them legs may pass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from expdesign.plan.chart import ClearanceField
from expdesign.plan.local_planner import SearchSpace
from expdesign.plan.search.tuning import SEARCH
from expdesign.values import Array

AHEAD = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
"""Cells north and east that lie ahead, by heading."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lattice:
    """Poses of a lattice over the water of a search space. The start and the goal come after them.

    Attributes:
        space: water, runs and what the ship can do.
        spacing_m: between cells.
    """

    space: SearchSpace
    spacing_m: float

    @property
    def headings(self) -> int:
        """How many; eight where the ship turns on the spot."""
        return 8 if self.space.ship.spot_rate_radps > 0 else 4

    @property
    def field(self) -> ClearanceField:
        """Clearance of the water."""
        return self.space.field

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Rows north and columns east."""
        reach_m = (np.array(self.field.clearance_m.shape) - 1) * self.field.cell_m
        rows, columns = (np.floor(reach_m / self.spacing_m).astype(int) + 1).tolist()
        return rows, columns

    @property
    def size(self) -> int:
        """Number of poses."""
        return self.shape[0] * self.shape[1] * self.headings

    @cached_property
    def centres(self) -> Array:
        """(rows, columns, 2) north, east of the cells [m]."""
        cells = np.moveaxis(np.indices(self.shape), 0, -1)
        return np.asarray(self.field.origin + self.spacing_m * cells)

    @cached_property
    def clear(self) -> np.ndarray:
        """(rows, columns) whether centre lines of legs may pass."""
        return np.asarray(self.field.at(self.centres) >= self.space.leg_margin_m)

    def angle(self, heading: int | np.ndarray) -> Array:
        """Heading [rad]."""
        return np.asarray(heading) * 2 * np.pi / self.headings

    def ahead(self, heading: int) -> np.ndarray:
        """(2,) cells north and east to the next pose ahead."""
        return np.array(AHEAD[heading % self.headings * (8 // self.headings)])

    def number(self, cells: np.ndarray, heading: int | np.ndarray) -> np.ndarray:
        """(n,) numbers of poses in cells (n, 2)."""
        return np.asarray((cells @ (self.shape[1], 1)) * self.headings + heading % self.headings)

    def poses(self, numbers: np.ndarray) -> Array:
        """(n, 3) poses by their numbers."""
        cells, heading = np.divmod(numbers, self.headings)
        return np.column_stack([self.centres.reshape(-1, 2)[cells], self.angle(heading)])

    def free(self, cells: np.ndarray) -> np.ndarray:
        """(n,) whether cells (n, 2) exist and are clear."""
        inside = ((cells >= 0) & (cells < self.shape)).all(axis=1)
        return np.asarray(inside & self.clear[tuple(np.where(inside, cells.T, 0))])

    def path_clear(self, path: Array, room_m: Array | float) -> np.ndarray:
        """(rows, columns) whether points (k, 2) north and east of a cell have room, from every cell."""
        clear, centres = self.clear.copy(), self.centres
        for offset, room in zip(path, np.broadcast_to(room_m, len(path)), strict=True):
            some = np.nonzero(clear)
            clear[some] = self.field.at(centres[some] + offset) >= room
        return clear

    def edges(self, clear: np.ndarray, heading: int, step: np.ndarray, after: int, seconds: float) -> Array:
        """(3, k) from, to and seconds of the same step (2,) [cells] from all clear cells, to another heading."""
        cells = np.argwhere(clear)
        cells = cells[self.free(cells + step)]
        ends = self.number(cells, heading), self.number(cells + step, after)
        return np.stack([*ends, np.full(len(cells), seconds)])

    def around(self, pose: Array, least_m: float) -> np.ndarray:
        """(n, 2) cells, counted from the origin, that a leg of some length reaches from a pose (3,)."""
        reach = max(SEARCH.lattice_nearby, int(np.ceil(least_m / self.spacing_m)) + 1)
        middle = np.rint(pose[:2] / self.spacing_m).astype(int)
        cells = middle + np.indices((2 * reach + 1, 2 * reach + 1)).reshape(2, -1).T - reach
        far = np.hypot(*(cells * self.spacing_m - pose[:2]).T)
        return np.asarray(cells[far >= least_m])
