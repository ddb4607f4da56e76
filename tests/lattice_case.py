"""Small lattices as a person would write them: cells, four headings, moves found by looking; and plain searches.

Nothing of the package's search is used: `dijkstra_plain` proves optima state by state, `astar_thesis` follows F.
Ljungberg, doctoral thesis, Linköping University, (8.9)-(8.12), whose heuristic may overestimate.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from expdesign.plan.search.lattice import LatticeProblem

AHEAD = ((1, 0), (0, 1), (-1, 0), (0, -1))


@dataclass(frozen=True)
class Run:
    """Cells ahead and to starboard, quarter turns, and cells of room to every side."""

    ahead: int
    starboard: int
    turn: int
    room: int


@dataclass(frozen=True, eq=False)
class World:
    """Free cells, runs with their counts, cost of a straight step and of a quarter turn on the spot."""

    free: np.ndarray
    runs: tuple[Run, ...]
    counts: tuple[int, ...]
    start: tuple[int, int, int]
    goal: tuple[int, int, int]
    step: float = 1.0
    turn: float = 1.0

    def is_free(self, i: int, j: int) -> bool:
        return 0 <= i < self.free.shape[0] and 0 <= j < self.free.shape[1] and bool(self.free[i][j])

    def moves(self, i: int, j: int, k: int) -> Iterator[tuple[float, tuple[int, int, int]]]:
        yield self.turn, (i, j, (k + 1) % 4)
        yield self.turn, (i, j, (k - 1) % 4)
        ahead = i + AHEAD[k][0], j + AHEAD[k][1]
        if self.is_free(*ahead):
            yield self.step, (*ahead, k)

    def after_run(self, q: int, i: int, j: int, k: int) -> tuple[int, int, int] | None:
        run, (a, b), (c, d) = self.runs[q], AHEAD[k], AHEAD[(k + 1) % 4]
        end = i + run.ahead * a + run.starboard * c, j + run.ahead * b + run.starboard * d
        rows = range(min(i, end[0]) - run.room, max(i, end[0]) + run.room + 1)
        columns = range(min(j, end[1]) - run.room, max(j, end[1]) + run.room + 1)
        if all(self.is_free(row, column) for row in rows for column in columns):
            return (*end, (k + run.turn) % 4)
        return None

    def following(self, state) -> Iterator[tuple[float, tuple]]:
        """States after one move or one run that is still wanted."""
        i, j, k, used = state
        for cost, pose in self.moves(i, j, k):
            yield cost, (*pose, used)
        for q, count in enumerate(used):
            if count < self.counts[q] and (end := self.after_run(q, i, j, k)) is not None:
                yield 0.0, (*end, (*used[:q], count + 1, *used[q + 1 :]))


def random_world(rng: np.random.Generator, shape, runs, counts, *, blocks: int, **costs) -> World:
    free = np.ones(shape, dtype=bool)
    for _ in range(blocks):
        i, j = rng.integers(shape[0]), rng.integers(shape[1])
        h, w = rng.integers(1, max(2, shape[0] // 6)), rng.integers(1, max(2, shape[1] // 6))
        free[i : i + h, j : j + w] = False
    free[0, 0] = free[-1, -1] = True
    return World(free, tuple(runs), tuple(counts), (0, 0, 0), (shape[0] - 1, shape[1] - 1, 0), **costs)


def as_matrix(entries, size: int) -> csr_array:
    """(size, size) matrix of (row, column, cost)."""
    rows, columns, costs = np.array(entries, dtype=float).reshape(-1, 3).T
    return csr_array((costs, (rows.astype(int), columns.astype(int))), shape=(size, size))


def as_problem(world: World) -> LatticeProblem:
    """The same for the package's search."""
    rows, columns = world.free.shape

    def number(pose):
        return (pose[0] * columns + pose[1]) * 4 + pose[2]

    entries, runs = [], [[] for _ in world.runs]
    for i, j, k in np.ndindex(rows, columns, 4):
        if world.free[i, j]:
            entries += [(number((i, j, k)), number(pose), cost) for cost, pose in world.moves(i, j, k)]
            for q in range(len(world.runs)):
                if (end := world.after_run(q, i, j, k)) is not None:
                    runs[q].append((number((i, j, k)), number(end), 0.0))
    size = rows * columns * 4
    return LatticeProblem(
        moves=as_matrix(entries, size),
        runs=tuple(as_matrix(run, size) for run in runs),
        counts=world.counts,
        start=number(world.start),
        goal=number(world.goal),
    )


def dijkstra_plain(world: World) -> tuple[float, int]:
    """Least cost, and how many states it took to prove it; infinite cost when there is no plan."""
    return _search(world, lambda state: 0.0)


def astar_thesis(world: World, *, weights=(1.0, 1.0, 1.0)) -> tuple[float, int]:
    """Cost and expansions of A* with the weighted heuristic: distance, heading error, runs left."""
    gi, gj, gk = world.goal

    def heuristic(state):
        i, j, k, used = state
        turn = abs(k - gk)
        left = sum(world.counts) - sum(used)
        return weights[0] * math.hypot(i - gi, j - gj) + weights[1] * min(turn, 4 - turn) + weights[2] * left

    return _search(world, heuristic)


def _search(world: World, heuristic) -> tuple[float, int]:
    start, goal = (*world.start, (0,) * len(world.counts)), (*world.goal, world.counts)
    costs, heap, done = {start: 0.0}, [(heuristic(start), start)], set()
    while heap:
        _, state = heapq.heappop(heap)
        if state == goal:
            return costs[state], len(done) + 1
        if state in done:
            continue
        done.add(state)
        for cost, after in world.following(state):
            reached = costs[state] + cost
            if reached < costs.get(after, math.inf):
                costs[after] = reached
                heapq.heappush(heap, (reached + heuristic(after), after))
    return math.inf, len(done)


def cost_of(world: World, problem: LatticeProblem, steps) -> float:
    """What a sequence of (pose, run or -1) costs in this world; fails when a step is not possible."""
    columns = world.free.shape[1]

    def pose_of(number):
        return number // 4 // columns, number // 4 % columns, number % 4

    total, used = 0.0, [0] * len(world.runs)
    assert pose_of(steps[0][0]) == world.start
    assert pose_of(steps[-1][0]) == world.goal
    for (here, q), (there, _) in pairwise(steps):
        if q < 0:
            total += min(cost for cost, pose in world.moves(*pose_of(here)) if pose == pose_of(there))
        else:
            used[q] += 1
            assert world.after_run(q, *pose_of(here)) == pose_of(there)
    assert tuple(used) == world.counts
    return total
