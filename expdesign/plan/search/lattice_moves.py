"""A sea area as a state lattice: cells, headings, straights, arcs, turns on the spot, and runs with the way after them.

Costs are seconds of repositioning, by the local planner's rule where a leg begins or ends, at transit speed between. A
run ends where it ends; the leg from there to a lattice pose nearby is part of its cost, so that the chain of poses is
continuous. Ships that turn on the spot have eight headings and may turn at every pose, others four and arcs only.

Source: F. Ljungberg, doctoral thesis, Linköping University, section 8.2 and 9.4.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from expdesign.plan.chart import ClearanceField
from expdesign.plan.local_planner import Departure, LegEnds, SearchSpace, moved
from expdesign.plan.runs import Footprint
from expdesign.plan.search.lattice import LatticeProblem
from expdesign.values import Array

LATTICE_NEARBY = 2  # cells to each side, at least, within which legs lead from and to the lattice
LATTICE_POINTS = 8  # places looked at along a move
LATTICE_LEAST_SPEED = 0.1  # over ground against a current, in transit speeds


AHEAD = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
"""Cells north and east that lie ahead, by heading."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lattice:
    """Poses of a lattice over the water of a search space. The start and the goal come after them."""

    space: SearchSpace  # water, runs and what the ship can do
    spacing_m: float  # between cells

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
        reach = max(LATTICE_NEARBY, int(np.ceil(least_m / self.spacing_m)) + 1)
        middle = np.rint(pose[:2] / self.spacing_m).astype(int)
        cells = middle + np.indices((2 * reach + 1, 2 * reach + 1)).reshape(2, -1).T - reach
        far = np.hypot(*(cells * self.spacing_m - pose[:2]).T)
        return np.asarray(cells[far >= least_m])


NO_BENDS = np.zeros((0, 2))


def build_lattice(lattice: Lattice, counts: Sequence[int], departure: Departure) -> LatticeProblem:
    """The lattice problem of a search space. Its last two poses are the start and the goal themselves.

    Args:
        counts: how often each of the space's runs is wanted.
    """
    start, goal = lattice.size, lattice.size + 1
    moves = [*_straights(lattice), *_arcs(lattice), *_spot_turns(lattice)]
    moves += [_leaving(lattice, departure, start), _arriving(lattice, goal)]
    return LatticeProblem(
        moves=_matrix(lattice, moves),
        runs=tuple(_matrix(lattice, list(_run(lattice, q))) for q in range(len(lattice.space.footprints))),
        counts=tuple(int(count) for count in counts),
        start=start,
        goal=goal,
    )


def _matrix(lattice: Lattice, entries: Sequence[Array]) -> scipy.sparse.csr_array:
    """Sparse matrix of edges; of several between two poses the cheapest."""
    tails, heads, seconds = np.concatenate([np.zeros((3, 0)), *entries], axis=1)
    order = np.lexsort((seconds, heads, tails))
    tails, heads, seconds = tails[order], heads[order], seconds[order]
    first = np.r_[True, (np.diff(tails) != 0) | (np.diff(heads) != 0)][: len(tails)]
    size = lattice.size + 2
    ends = tails[first].astype(np.int32), heads[first].astype(np.int32)
    return scipy.sparse.csr_array((seconds[first], ends), shape=(size, size))


def _straights(lattice: Lattice) -> Iterator[Array]:
    """Ahead to the next cell, with the current's help."""
    for heading in range(lattice.headings):
        step = lattice.ahead(heading)
        path = np.linspace(0.0, 1.0, LATTICE_POINTS)[:, None] * step * lattice.spacing_m
        clear = lattice.path_clear(path, lattice.space.leg_margin_m)
        seconds = float(np.hypot(*path[-1])) / _over_ground_mps(lattice.space, float(lattice.angle(heading)))
        yield lattice.edges(clear, heading, step, heading, seconds)


def _over_ground_mps(space: SearchSpace, course_rad: float) -> float:
    """Speed along a course at transit speed through water, the current across it held off; little where it is swept."""
    top = space.ship.transit_speed_mps
    along, across = _turned(space.current_to[None], -course_rad)[0]
    return float(max(np.sqrt(max(top**2 - across**2, 0.0)) + along, LATTICE_LEAST_SPEED * top))


def _arcs(lattice: Lattice) -> Iterator[Array]:
    """Quarter turns under way to both sides, where cells are far enough apart for the ship's turning radius."""
    ship, shares = lattice.space.ship, np.linspace(0.0, 1.0, LATTICE_POINTS)
    quarter = lattice.headings // 4
    for heading in range(lattice.headings):
        stride_m = lattice.spacing_m * float(np.hypot(*lattice.ahead(heading)))
        straight_m = stride_m - ship.turning_radius_m
        if straight_m < 0:
            continue
        bend = shares * np.pi / 2
        arc = ship.turning_radius_m * np.column_stack([np.sin(bend), 1.0 - np.cos(bend)]) + (straight_m, 0.0)
        before = np.column_stack([straight_m * shares, 0 * shares])
        path = np.concatenate([before, arc, stride_m - before[::-1, ::-1]])
        seconds = (2 * straight_m + ship.turning_radius_m * np.pi / 2) / ship.transit_speed_mps
        for side in (1, -1):
            clear = lattice.path_clear(
                _turned(path * (1, side), float(lattice.angle(heading))), lattice.space.leg_margin_m
            )
            step = lattice.ahead(heading) + lattice.ahead(heading + side * quarter)
            yield lattice.edges(clear, heading, step, heading + side * quarter, seconds)


def _spot_turns(lattice: Lattice) -> Iterator[Array]:
    """Turns to every other heading where the ship is, in the time of a leg that only turns, from rest to rest."""
    space = lattice.space
    if space.ship.spot_rate_radps <= 0:
        return
    clear = lattice.field.at(lattice.centres) >= space.leg_margin_m + space.hull_m / 2
    at_rest = LegEnds(before=-1, after=-1, exit_mps=0.0, entry_mps=0.0)
    turns = np.column_stack([np.zeros((lattice.headings, 2)), lattice.angle(np.arange(lattice.headings))])
    seconds = space.planner.leg_s(space, at_rest, np.zeros((1, 3)), turns, NO_BENDS)
    for heading in range(lattice.headings):
        for turn in range(1, lattice.headings):
            yield lattice.edges(clear, heading, np.zeros(2, dtype=int), heading + turn, float(seconds[turn]))


def _run(lattice: Lattice, q: int) -> Iterator[Array]:
    """A run from every pose with room for it, and the best leg after it to each heading of a cell nearby."""
    space, run = lattice.space, lattice.space.footprints[q]
    for heading in range(lattice.headings):
        discs = _turned(run.discs, float(lattice.angle(heading))) + run.times_s[:, None] * space.current_to
        clear = lattice.path_clear(discs, run.room_m)
        if not clear.any():
            continue
        clear &= ~_refused(lattice, heading)
        end = _run_end(lattice, run, heading)
        away = Departure(pose=end, exit_mps=run.exit_mps, last=q)
        for step, after, seconds in _best_legs(lattice, away):
            there = np.r_[step * lattice.spacing_m, lattice.angle(after)]
            path = space.planner.leg_path(space, q, end, there)
            yield lattice.edges(clear & lattice.path_clear(path, space.leg_margin_m), heading, step, after, seconds)


def _run_end(lattice: Lattice, run: Footprint, heading: int) -> Array:
    """(3,) end of a run that begins at the origin."""
    begin = np.array([[0.0, 0.0, float(lattice.angle(heading))]])
    drift = np.r_[run.duration_s * lattice.space.current_to, 0.0]
    return np.asarray(moved(begin, run.displacement[None])[0] + drift)


def _refused(lattice: Lattice, heading: int) -> np.ndarray:
    """(rows, columns) whether runs may not begin there, as one has failed."""
    cells = lattice.centres.reshape(-1, 2)
    poses = np.column_stack([cells, np.full(len(cells), lattice.angle(heading))])
    return lattice.space.is_refused(poses).reshape(lattice.shape)


def _best_legs(lattice: Lattice, departure: Departure) -> Iterator[tuple[np.ndarray, int, float]]:
    """The quickest leg in open water to each heading: its cell, counted from the origin, that heading, and seconds."""
    cells = lattice.around(departure.pose, _least_m(lattice.space, departure.last))
    for after in range(lattice.headings):
        tos = np.column_stack([cells * lattice.spacing_m, np.full(len(cells), lattice.angle(after))])
        seconds = _leaving_s(lattice.space, departure, tos)
        best = int(np.argmin(seconds))
        yield cells[best], after, float(seconds[best])


def _leaving_s(space: SearchSpace, departure: Departure, tos: Array) -> Array:
    """(n,) time of legs from a departure to lattice poses (n, 3), passed at transit speed [s]."""
    ends = LegEnds(before=departure.last, after=-1, exit_mps=departure.exit_mps, entry_mps=space.ship.transit_speed_mps)
    return space.planner.leg_s(space, ends, departure.pose[None], tos, NO_BENDS)


def _least_m(space: SearchSpace, last: int) -> float:
    """Least length of a leg after a run, longer where one has failed [m]."""
    name = space.footprints[last].name if last >= 0 else ""
    failed = max((hulls for pair, hulls in space.run_up.items() if pair[0] == name), default=0.0)
    return space.planner.least_m(space, (name, "")) + space.hull_m * failed


def _leaving(lattice: Lattice, departure: Departure, number: int) -> Array:
    """(3, k) edges from the start to clear lattice poses near it."""
    space, (cells, heading) = lattice.space, _near(lattice, departure.pose, _least_m(lattice.space, departure.last))
    tos = lattice.poses(lattice.number(cells, heading))
    clear = [
        _leg_clear(space, space.planner.leg_path(space, departure.last, departure.pose, to), departure.pose)
        for to in tos
    ]
    seconds = _leaving_s(space, departure, tos) if len(tos) else np.zeros(0)
    return np.stack([np.full(len(tos), number), lattice.number(cells, heading), seconds])[:, clear]


def _arriving(lattice: Lattice, number: int) -> Array:
    """(3, k) edges from clear lattice poses near the goal to it, where the ship stops."""
    space, (cells, heading) = lattice.space, _near(lattice, lattice.space.goal, _least_m(lattice.space, -1))
    froms, ends = lattice.poses(lattice.number(cells, heading)), np.tile(space.goal, (len(cells), 1))
    clear = [_leg_clear(space, space.planner.leg_path(space, -1, pose, space.goal), space.goal) for pose in froms]
    to_rest = LegEnds(before=-1, after=-1, exit_mps=space.ship.transit_speed_mps, entry_mps=0.0)
    seconds = space.planner.leg_s(space, to_rest, froms, ends, NO_BENDS) if len(froms) else np.zeros(0)
    return np.stack([lattice.number(cells, heading), np.full(len(froms), number), seconds])[:, clear]


def _near(lattice: Lattice, pose: Array, least_m: float) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) clear cells near a pose and (n,) all headings in them."""
    from_origin = np.r_[pose[:2] - lattice.field.origin, pose[2]]
    cells = lattice.around(from_origin, least_m)
    cells = cells[lattice.free(cells)]
    return np.repeat(cells, lattice.headings, axis=0), np.tile(np.arange(lattice.headings), len(cells))


def _leg_clear(space: SearchSpace, path: Array, end: Array) -> bool:
    """Whether a path keeps the margin of legs, or the clearance of its end (3,) where that is less, at a berth."""
    berth_m = min(space.leg_margin_m, float(space.field.at(end[:2])))
    return bool((space.field.at(path) >= berth_m).all())


def _turned(points: Array, angle_rad: float) -> Array:
    """(n, 2) points turned clockwise from north."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.asarray(points @ np.array([[c, s], [-s, c]]))
