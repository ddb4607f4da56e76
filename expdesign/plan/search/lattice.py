"""State-lattice planning with counters, exact: every run the asked number of times, at the least cost between them.

A state is a pose of the lattice and how often each run was used. Counters only grow, so states with the same counters
form a layer: a shortest-path problem over poses, entered by runs from the layers before. Layers are solved one after
the other in order of how many runs they hold, each by Dijkstra's method on costs reduced by a heuristic. That is A*
started at all entries at once, cut off where no better plan can follow.

The heuristic is the exact cost to the goal when the number of runs left counts but not of which kind: obstacles are in
it, it never overestimates, and it is consistent. A narrow search, which keeps only the most promising layers, comes
first; the full search then need only look where something better could be. Its work is limited: where it ends early,
what it has not looked at still gives a lower bound.

Source: F. Ljungberg, doctoral thesis, Linköping University, (8.3)-(8.12), which uses A* with a heuristic that is not
admissible; layers, heuristic and bound derived here. Reduced costs: D. B. Johnson, J. ACM 24 (1977), 1-13.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np
import scipy

from expdesign.errors import InputError, NoPlan
from expdesign.progress import Progress, silent
from expdesign.values import Array

Counters = tuple[int, ...]
NARROW = 1  # layers kept per number of runs in the search that comes before the full one
NO_PATH = "the lattice holds no path from start to goal that has room for every run"
TINY = 1e-9  # share of a cost that is rounding


@dataclass(frozen=True, kw_only=True, eq=False)
class LatticeProblem:
    """Poses, what leads from one to the other, and how often each run is wanted."""

    # (n, n) sparse matrix, entry (a, b) the cost, 0 or more, of the basic move from pose a to pose b
    moves: scipy.sparse.csr_array
    # one (n, n) sparse matrix for each run, entry (a, b) the cost, 0 or more, besides the run itself, of a run that
    # begins at pose a and of the way from its end to pose b
    runs: tuple[scipy.sparse.csr_array, ...]
    counts: Counters  # how often each run is wanted
    # start, goal: poses
    start: int
    goal: int

    def __post_init__(self) -> None:
        if len(self.runs) != len(self.counts) or any(run.shape != self.moves.shape for run in self.runs):
            shapes = " ".join(str(run.shape) for run in self.runs)
            raise InputError(f"runs {shapes} do not fit moves {self.moves.shape} and {len(self.counts)} counts")
        least = min((float(edges.data.min()) for edges in (self.moves, *self.runs) if edges.nnz), default=0.0)
        if not least >= 0:
            raise InputError(f"the cheapest move costs {least:g}, expected 0 or more")

    @property
    def states(self) -> int:
        """Poses times counters."""
        return int(self.moves.shape[0] * np.prod(np.array(self.counts) + 1))


@dataclass(frozen=True, kw_only=True)
class LatticePlan:
    """A plan with its proof."""

    cost: float  # of the plan
    lower_bound: float  # no plan costs less; equal to `cost` when the plan is proved optimal
    expansions: int  # states whose cost became final, in all searches
    steps: tuple[tuple[int, int], ...]  # (pose, run that begins there or -1 for a move), from start to goal

    @property
    def gap(self) -> float:
        """How far the plan may be from the best, relative to its cost."""
        return 1.0 - self.lower_bound / self.cost if self.cost > 0 else 0.0


def search_lattice(
    problem: LatticeProblem,
    *,
    suboptimality: float = 0.0,
    most_states: float = np.inf,
    progress: Progress = silent,
) -> LatticePlan:
    """The cheapest plan, or one proved to cost at most (1 + suboptimality) times the cheapest.

    Where the work ends first, the plan of the narrow search and the bound proved by then.

    Args:
        problem: what is wanted.
        suboptimality: 0 for the optimum; more lets the search leave out what could save only so little.
        most_states: states after which the full search ends; it finishes the layer it is at.
        progress: told the share of layers done.

    Raises:
        NoPlan: the goal cannot be reached with the runs asked for, or no plan was found within the states allowed.
    """
    edges = tuple(_Edges.of(run) for run in problem.runs)
    to_go = _costs_to_go(problem, edges)
    relaxed = float(to_go[-1][problem.start])
    if not np.isfinite(relaxed):
        raise NoPlan(NO_PATH)
    graphs = [_reduced(problem.moves, heuristic) for heuristic in to_go]
    best = _Layers(problem, edges, to_go, graphs, np.inf).search(NARROW, np.inf, progress)
    quantum, expansions, unseen = _quantum(problem), best.expansions, np.inf
    limit = _worth_looking(best.cost, suboptimality, quantum)
    if limit >= relaxed:
        found = _Layers(problem, edges, to_go, graphs, limit).search(None, most_states, progress)
        expansions, unseen = expansions + found.expansions, found.unseen
        best = found if found.cost < best.cost else best
    if not np.isfinite(best.cost):
        raise NoPlan(NO_PATH if unseen == np.inf else f"no plan among the first {expansions} states of the lattice")
    bound = min(best.cost, max(min(_next_multiple(limit, quantum), unseen), relaxed))
    return LatticePlan(cost=best.cost, lower_bound=bound, expansions=expansions, steps=best.steps)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Edges:
    """Entries of a sparse matrix, by row."""

    tails: np.ndarray
    heads: np.ndarray
    costs: Array

    @classmethod
    def of(cls, matrix: scipy.sparse.csr_array) -> _Edges:
        tails = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
        return cls(tails=tails, heads=matrix.indices, costs=matrix.data)


def _worth_looking(cost: float, suboptimality: float, quantum: float) -> float:
    """Plans above this cost need not be found once one of `cost` is known."""
    return float((cost - TINY * cost) / (1.0 + suboptimality)) if suboptimality else cost - 0.5 * quantum - TINY * cost


def _next_multiple(limit: float, quantum: float) -> float:
    """The least cost that a plan can have when none costs `limit` or less."""
    return float(np.ceil(limit / quantum) * quantum) if quantum else limit / (1.0 - TINY)


def _quantum(problem: LatticeProblem) -> float:
    """A cost of which every cost is a whole multiple, or 0: two plans then differ by nothing or at least by that."""
    costs = np.unique(np.concatenate([problem.moves.data, *(run.data for run in problem.runs)]))
    costs = costs[costs > 0]
    if not len(costs):
        return 0.0
    smallest = float(costs[0])
    whole = costs / smallest
    return smallest if np.abs(whole - np.rint(whole)).max() < TINY else 0.0


def _costs_to_go(problem: LatticeProblem, edges: tuple[_Edges, ...]) -> list[Array]:
    """[m] -> (n,) least cost from every pose to the goal with m runs of whatever kind in between."""
    back = scipy.sparse.csr_array(problem.moves.T)
    goal = np.full(back.shape[0], np.inf)
    goal[problem.goal] = 0.0
    layers = [_settled(back, goal)[0]]
    wanted = [q for q, count in enumerate(problem.counts) if count]
    for _ in range(sum(problem.counts)):
        after = np.full(back.shape[0], np.inf)
        for q in wanted:
            np.minimum.at(after, edges[q].tails, edges[q].costs + layers[-1][edges[q].heads])
        layers.append(_settled(back, after)[0])
    return layers


def _reduced(moves: scipy.sparse.csr_array, heuristic: Array) -> scipy.sparse.csr_array:
    """Costs plus the heuristic's growth along them; moves from or to where no goal can be reached are left out."""
    edges = _Edges.of(moves)
    useful = np.isfinite(heuristic[edges.tails]) & np.isfinite(heuristic[edges.heads])
    rows, columns = edges.tails[useful], edges.heads[useful]
    costs = edges.costs[useful] + heuristic[columns] - heuristic[rows]
    return scipy.sparse.csr_array((np.maximum(costs, 0.0), (rows, columns)), shape=moves.shape)


def _settled(graph: scipy.sparse.csr_array, entry: Array, limit: float = np.inf) -> tuple[Array, np.ndarray]:
    """Least costs (n,) when poses can be entered at a cost, and each pose's predecessor, n for the entry itself.

    Entries of zero are edges here: SciPy's graph routines keep what a sparse matrix stores.
    """
    n = graph.shape[0]
    open_poses = np.flatnonzero(np.isfinite(entry) & (entry <= limit))
    if not len(open_poses):
        return np.full(n, np.inf), np.full(n, -1)
    lowest = float(entry[open_poses].min())
    extended = scipy.sparse.csr_array(
        (
            np.concatenate([graph.data, entry[open_poses] - lowest]),
            np.concatenate([graph.indices, open_poses.astype(graph.indices.dtype)]),
            np.append(graph.indptr, graph.nnz + len(open_poses)),
        ),
        shape=(n + 1, n + 1),
    )
    costs, before = scipy.sparse.csgraph.dijkstra(extended, indices=n, return_predecessors=True, limit=limit - lowest)
    return cast(Array, costs[:n] + lowest), before[:n]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Layer:
    """Poses reached with some counters: their numbers, costs plus heuristic, and the poses before them."""

    poses: np.ndarray
    values: Array
    before: np.ndarray


@dataclass(frozen=True, kw_only=True)
class _Found:
    """The best plan of one search; no plan through states that it did not look at costs less than `unseen`."""

    cost: float
    expansions: int
    steps: tuple[tuple[int, int], ...]
    unseen: float = np.inf


@dataclass(frozen=True, eq=False)
class _Layers:
    """One search: layers by counters, values are cost so far plus cost to go."""

    problem: LatticeProblem
    edges: tuple[_Edges, ...]
    to_go: list[Array]
    graphs: list[scipy.sparse.csr_array]
    limit: float

    def search(self, width: int | None, most_states: float, progress: Progress) -> _Found:
        """Layer by layer; at most `width` of them for each number of runs, the most promising."""
        total, expansions = sum(self.problem.counts), 0
        done: dict[Counters, _Layer] = {}
        wave: dict[Counters, Array] = {tuple(0 for _ in self.problem.counts): self._entry_at_start()}
        for runs in range(total + 1):
            progress("searching the lattice", runs / (total + 1))
            kept = sorted(wave, key=lambda counters: float(wave[counters].min()))[:width]
            following: dict[Counters, Array] = {}
            for number, counters in enumerate(kept):
                if expansions > most_states:
                    unseen = [*(wave[left] for left in kept[number:]), *following.values()]
                    return _Found(
                        cost=np.inf, expansions=expansions, steps=(), unseen=min(float(part.min()) for part in unseen)
                    )
                layer = self._layer(wave[counters], total - runs)
                done[counters] = layer
                expansions += len(layer.poses)
                for after, entry in self._entries(counters, layer, total - runs):
                    following[after] = np.minimum(following[after], entry) if after in following else entry
            wave = following if runs < total else wave
        last = done.get(self.problem.counts)
        if last is None or self.problem.goal not in last.poses:
            return _Found(cost=np.inf, expansions=expansions, steps=())
        cost = float(last.values[np.searchsorted(last.poses, self.problem.goal)])
        return _Found(cost=cost, expansions=expansions, steps=self._steps(done))

    def _entry_at_start(self) -> Array:
        entry = np.full(self.problem.moves.shape[0], np.inf)
        entry[self.problem.start] = self.to_go[-1][self.problem.start]
        return entry

    def _layer(self, entry: Array, left: int) -> _Layer:
        values, before = _settled(self.graphs[left], entry, self.limit)
        poses = np.flatnonzero(np.isfinite(values))
        return _Layer(poses=poses, values=values[poses], before=before[poses])

    def _entries(self, counters: Counters, layer: _Layer, left: int) -> Iterator[tuple[Counters, Array]]:
        """What each run that is still wanted leads to."""
        costs = np.full(self.problem.moves.shape[0], np.inf)
        costs[layer.poses] = layer.values - self.to_go[left][layer.poses]
        for q, (used, wanted) in enumerate(zip(counters, self.problem.counts, strict=True)):
            if used == wanted:
                continue
            edges, entry = self.edges[q], np.full(len(costs), np.inf)
            np.minimum.at(entry, edges.heads, costs[edges.tails] + edges.costs + self.to_go[left - 1][edges.heads])
            if entry.min() <= self.limit:
                yield (*counters[:q], used + 1, *counters[q + 1 :]), entry

    def _steps(self, done: dict[Counters, _Layer]) -> tuple[tuple[int, int], ...]:
        """Back from the goal, by the poses before, and by runs where a layer was entered."""
        n, pose, counters = self.problem.moves.shape[0], self.problem.goal, self.problem.counts
        steps = [(pose, -1)]
        while True:
            layer = done[counters]
            row = int(np.searchsorted(layer.poses, pose))
            before = int(layer.before[row])
            if before == n and not any(counters):
                return tuple(reversed(steps))
            if before == n:
                pose, q, counters = self._run_before(done, counters, pose)
                steps.append((pose, q))
            else:
                pose = before
                steps.append((pose, -1))

    def _run_before(self, done: dict[Counters, _Layer], counters: Counters, pose: int) -> tuple[int, int, Counters]:
        """The run by which a layer was entered at a pose: where it began, which it was, and the counters before."""
        left = sum(self.problem.counts) - sum(counters)
        found: tuple[float, int, int, Counters] = (np.inf, -1, -1, ())
        for q, used in enumerate(counters):
            earlier = (*counters[:q], used - 1, *counters[q + 1 :])
            layer = done.get(earlier)
            if layer is None:
                continue
            edges = self.edges[q]
            arriving = np.flatnonzero((edges.heads == pose) & np.isin(edges.tails, layer.poses))
            if not len(arriving):
                continue
            tails = edges.tails[arriving]
            values = layer.values[np.searchsorted(layer.poses, tails)]
            reached = values - self.to_go[left + 1][tails] + edges.costs[arriving] + self.to_go[left][pose]
            nearest = int(reached.argmin())
            found = min(found, (float(reached[nearest]), int(tails[nearest]), q, earlier))
        return found[1], found[2], found[3]
