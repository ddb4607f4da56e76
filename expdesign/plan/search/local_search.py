"""Placements polished: blocks of runs are moved and turned as one while that shortens the legs at their two ends.

The search places runs at a few distances and headings. Here they may have any, their order kept: a pattern search over
all blocks of consecutive runs, by the rule for the time of legs. Legs inside a block stay as they are through water.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np
import shapely

from expdesign.conventions import rotated, wrap_angle
from expdesign.plan.chart import sight_lines
from expdesign.plan.local_planner import Departure, LegEnds, Pair, RunSpace, SearchSpace, Successors, arc_end, run_ends
from expdesign.values import Array, sealed

MANY_RUNS, SPARSE_DISCS = 50, 8  # of more runs than this, every so manieth disc is looked at before all of them
SHIFT_HULLS = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125, 0.0625)  # steps of the local search, and with each a turn
TURN_DEG = (90.0, 60.0, 40.0, 25.0, 15.0, 8.0, 4.0, 2.0)  # steps of the local search, and with each a turn
BLOCKS_AT_ONCE = 4  # moves of a block looked at together at first, four times as many then
MOST_POSES = 10_000  # in the blocks of a sweep: all blocks of up to 37 runs, and of more runs the shorter ones
SWEEPS = 20  # over all blocks of runs at most
SAME = 1e-3  # hull lengths and radians by which a leg may differ from a transition that was tried
EQUAL = 6  # decimals to which times [s] are compared, so that rounding does not choose between mirror images
# where another run is tried by a stretch of a leg: shares of it, hulls beside it, and its course from the stretch's
SHARES, ASIDE_HULLS = tuple(np.linspace(0.05, 0.95, 10).tolist()), (0.0, -2.0, 2.0, -4.0, 4.0, -7.0, 7.0, -10.0, 10.0)
ASIDE_DEG = (0.0, -45.0, 45.0, -90.0, 90.0, 180.0)
LEAST_GAIN_S = 0.05  # for which a block is moved


def clear_successors(space: SearchSpace, found: Successors, *, closed: bool = False) -> np.ndarray:
    """(n,) whether legs, runs and their ends keep their margins on the grid, with a way to each run and on after it.

    With `closed` also where there is no such way, as far as the grid knows.
    """
    start, turn = found.start, found.turn
    clear: np.ndarray = _ends_clear(space, start, found.end) & ~space.is_refused(start)
    arcs = np.flatnonzero(clear & ~np.isnan(turn))
    clear[arcs] = _arcs_clear(space, found.departure[found.parent[arcs]], turn[arcs], start[arcs])
    lines = np.flatnonzero(clear & found.straight)
    clear[lines] = _lines_clear(space, found.departure[found.parent[lines]], start[lines])
    left = np.flatnonzero(clear)
    left = left[~_surely_clear(space, found.primitive[left], start[left])]
    clear[left] = _hulls_clear(space, found.primitive[left], start[left])
    if not closed:
        clear[clear] = space.planner.ways_on(space, found.primitive[clear], start[clear], found.end[clear])
    return clear


def runs_clear(space: SearchSpace, primitive: np.ndarray, start: Array) -> np.ndarray:
    """(n,) whether runs (n,) from poses (n, 3) have room, and none of the poses was refused."""
    return np.asarray(have_room(space, primitive, start) & ~space.is_refused(start))


def have_room(space: RunSpace | SearchSpace, primitive: np.ndarray, start: Array) -> np.ndarray:
    """(n,) whether runs (n,) from poses (n, 3) and their ends keep their margins on the grid."""
    clear = _ends_clear(space, start, run_ends(space, primitive, start))
    left = np.flatnonzero(clear)
    clear[left] = _hulls_clear(space, primitive[left], start[left])
    return clear


def _ends_clear(space: RunSpace | SearchSpace, start: Array, end: Array) -> np.ndarray:
    clear = space.field.at(start[:, :2]) >= space.leg_margin_m
    return np.asarray(clear & (space.field.at(end[:, :2]) >= space.leg_margin_m))


def _surely_clear(space: SearchSpace, primitive: np.ndarray, start: Array) -> np.ndarray:
    """Whether the clearance in the middle of runs is enough for all their discs."""
    found = np.zeros(len(start), dtype=bool)
    for q in np.unique(primitive):
        some, item = np.flatnonzero(primitive == q), space.footprints[q]
        middle = (item.discs.min(axis=0) + item.discs.max(axis=0)) / 2
        reach_m = np.hypot(*(item.discs - middle).T) + np.hypot(*space.current_to) * item.times_s
        enough_m = float((reach_m + item.room_m).max()) + np.sqrt(2.0) * space.field.cell_m
        found[some] = space.field.at(_places(start[some], middle)) >= enough_m
    return found


def _hulls_clear(space: RunSpace | SearchSpace, primitive: np.ndarray, start: Array) -> np.ndarray:
    clear = np.ones(len(start), dtype=bool)
    for q in np.unique(primitive):
        some, item = np.flatnonzero(primitive == q), space.footprints[q]
        few = slice(None, None, SPARSE_DISCS)  # of many runs most are refused by a few of their discs
        for part in (few, slice(None)) if len(some) > MANY_RUNS else (slice(None),):
            drifted = item.times_s[part, None] * space.current_to
            places = _places(start[some, None], item.discs[part]) + drifted
            clear[some] = (space.field.at(places) >= item.room_m[part]).all(axis=1)
            some = some[clear[some]]
    return clear


def _places(pose: Array, points: Array) -> Array:
    """(..., 2) places of points (..., 2) forward and to starboard of poses (..., 3)."""
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    north = pose[..., 0] + c * points[..., 0] - s * points[..., 1]
    return np.stack([north, pose[..., 1] + s * points[..., 0] + c * points[..., 1]], axis=-1)


def _arcs_clear(space: SearchSpace, pose: Array, turn: Array, start: Array) -> np.ndarray:
    """Whether arc-and-straight legs from poses to run starts keep the leg margin at points along them."""
    radius = space.ship.turning_radius_m
    corner = arc_end(pose, turn, np.zeros(len(turn)), radius)
    shares = np.linspace(0.1, 1.0, 10)
    clear = np.ones(len(turn), dtype=bool)
    for share in shares:
        on_arc = arc_end(pose, share * turn, np.zeros(len(turn)), radius)[:, :2]
        on_line = corner[:, :2] + share * (start[:, :2] - corner[:, :2])
        clear &= np.minimum(space.field.at(on_arc), space.field.at(on_line)) >= space.leg_margin_m
    return clear


def _lines_clear(space: SearchSpace, pose: Array, start: Array) -> np.ndarray:
    """Whether straight lines between poses keep the leg margin at points along them, their own ends apart."""
    clear = np.ones(len(pose), dtype=bool)
    for share in np.linspace(0.2, 1.0, 9):
        clear &= space.field.at((1 - share) * pose[:, :2] + share * start[:, :2]) >= space.leg_margin_m
    return clear


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """Runs in order, where they are, and what the legs between them take."""

    runs: np.ndarray  # (n,) of the space's primitives
    poses: Array  # (n, 3) where they begin
    # n + 1 corners (k, 2) of each leg's path, both ends left out; the last leg leads to the goal
    bends: tuple[Array, ...]
    legs_s: Array  # (n + 1,) time of the legs

    def around(self, i: int, j: int) -> tuple[bytes, ...]:
        """All that decides whether runs i to j can be moved: from the run before them to the one after."""
        near = self.poses[max(i - 1, 0) : j + 2], self.legs_s[i : j + 2], *self.bends[i : j + 2]
        return tuple(part.tobytes() for part in near)


@sealed(poses="n 3")
class Polished:
    """Better poses for the same runs in the same order."""

    poses: Array  # (n, 3) where runs begin
    seconds: float  # time of all legs by the rule
    moves: int  # blocks of runs for which better places were sought


def polished(space: SearchSpace, departure: Departure, runs: Sequence[int], poses: Array) -> Polished:
    """Runs moved and turned while that makes legs shorter.

    Args:
        space: the primitives and the water; with a rule for the time of legs.
        departure: where the chain begins; the last leg leads to the goal.
        runs: (n,) indices of primitives.
        poses: (n, 3) where they begin.
    """
    legs = _Legs(space=space, departure=departure)
    chain = legs.measured(np.asarray(runs), poses)
    most = _longest_block(len(runs))
    blocks = [(i, j) for i in range(len(runs)) for j in range(i, min(i + most, len(runs)))]
    in_vain: dict[tuple[int, int], tuple[bytes, ...]] = {}
    moves = 0
    for _ in range(SWEEPS):
        before = chain
        for i, j in blocks:
            if in_vain.get((i, j)) == (around := chain.around(i, j)):
                continue
            moved, moves = legs.moved(chain, i, j), moves + 1
            if moved is chain:
                in_vain[i, j] = around
            chain = moved
        if chain is before:
            break
        chain = legs.measured(chain.runs, chain.poses)
    return Polished(poses=chain.poses, seconds=measured_s(space, runs, chain.poses, departure), moves=moves)


def _longest_block(runs: int) -> int:
    """Runs in the longest blocks that are moved: the work of a sweep would grow with the cube of the runs."""
    lengths = np.arange(1, runs + 1)
    return max(1, int(np.searchsorted(np.cumsum(lengths * (runs + 1 - lengths)), MOST_POSES, side="right")))


def measured_s(space: SearchSpace, runs: Sequence[int], poses: Array, departure: Departure) -> float:
    """Time of all legs between runs at poses (n, 3), the last one leading to the goal, by the rule [s]."""
    return float(_Legs(space=space, departure=departure).measured(np.asarray(runs), poses).legs_s.sum())


def with_another(
    space: SearchSpace, departure: Departure, runs: Sequence[int], poses: Array, *, leg: int, run: int
) -> Array | None:
    """(n + 1, 3) where runs begin with another within a leg, where it suits the legs beside it best.

    None where the leg has no room for it.

    It is tried along and beside the longest straight stretch of the leg, and then moved and turned while that makes
    legs shorter. The others stay where they are.

    Args:
        space, departure, runs, poses: as of `polished`.
        leg: number of the leg; that of the last leads to the goal.
        run: index of the primitive.
    """
    legs, placed = _Legs(space=space, departure=departure), np.array(runs, dtype=int)
    froms, tos = legs.ends(placed, poses)
    path = space.goal_distance.graph.shortest(froms[leg, :2], tos[leg, :2])
    if path is None or len(path) < 2:
        return None
    stretch = int(np.hypot(*np.diff(path, axis=0).T).argmax())
    beside = _beside(space, path[stretch], path[stretch + 1], run)
    grown = np.insert(placed, leg, run)
    bends = path[1 : stretch + 1], path[stretch + 1 : -1]
    pose = legs.first_place(grown, leg, beside, froms[leg : leg + 1], tos[leg : leg + 1], bends)
    if pose is None:
        return None
    chain = legs.measured(grown, np.insert(poses, leg, pose, axis=0))
    for _ in range(SWEEPS):
        before, chain = chain, legs.moved(chain, leg, leg)
        if chain is before:
            break
    return chain.poses


def _beside(space: SearchSpace, begin: Array, end: Array, run: int) -> Array:
    """(n, 3) poses from which a run makes its way good along a stretch, on it or beside it, or to other courses."""
    along, item = end - begin, space.footprints[run]
    course = np.arctan2(along[1], along[0])
    shares, aside_m, turns = np.meshgrid(SHARES, space.hull_m * np.array(ASIDE_HULLS), np.radians(ASIDE_DEG))
    headings = (course + turns - item.course_rad).ravel()
    across = np.array([-np.sin(course), np.cos(course)])
    middles = begin + shares.ravel()[:, None] * along + aside_m.ravel()[:, None] * across
    way = np.column_stack(rotated(item.displacement[:2, None], headings))
    return np.column_stack([middles - way / 2, headings])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Legs:
    """Legs of chains that begin and end at the same places."""

    space: SearchSpace
    departure: Departure

    def measured(self, runs: np.ndarray, poses: Array) -> Chain:
        """A chain with the shortest paths for its legs."""
        froms, tos = self.ends(runs, poses)
        paths = [self.space.goal_distance.graph.shortest(a[:2], b[:2]) for a, b in zip(froms, tos, strict=True)]
        bends = tuple(np.zeros((0, 2)) if path is None else path[1:-1] for path in paths)
        legs_s = [
            self._tried_s(runs, k, froms[k], tos[k])
            or self._leg_s(runs, k, froms[k : k + 1], tos[k : k + 1], bends[k])[0]
            for k in range(len(froms))
        ]
        return Chain(runs=runs, poses=poses, bends=bends, legs_s=np.array(legs_s))

    def moved(self, chain: Chain, i: int, j: int) -> Chain:
        """The chain with runs i to j moved as suits the legs before and after them best, or the same chain."""
        bent = any(len(bends) for bends in chain.bends[i + 1 : j + 1])
        if bent or self._kept(chain.runs, i) or self._kept(chain.runs, j + 1):
            return chain
        blocks = self._blocks(chain, i, j)
        froms, tos = self.ends(chain.runs, chain.poses)
        leaving = run_ends(self.space, np.full(len(blocks), chain.runs[j]), blocks[:, -1])
        arrive_s = self._leg_s(chain.runs, i, froms[i : i + 1], blocks[:, 0], chain.bends[i])
        leave_s = self._leg_s(chain.runs, j + 1, leaving, tos[j + 1 : j + 2], chain.bends[j + 1])
        legs_m = [np.hypot(*(b - a)[:, :2].T) for a, b in ((froms[i], blocks[:, 0]), (leaving, tos[j + 1]))]
        gain_s = chain.legs_s[i] + chain.legs_s[j + 1] - arrive_s - leave_s
        before, after = [*froms[i : i + 1, :2], *chain.bends[i]][-1], [*chain.bends[j + 1], *tos[j + 1 : j + 2, :2]][0]
        gain_s[(legs_m[0] < self._least_m(chain.runs, i)) | (legs_m[1] < self._least_m(chain.runs, j + 1))] = -np.inf
        order = np.argsort(-np.round(gain_s, EQUAL), kind="stable")
        row = self._first_clear(chain.runs[i : j + 1], blocks, order[gain_s[order] > LEAST_GAIN_S], before, after)
        if row is None:
            return chain
        poses, legs_s = chain.poses.copy(), chain.legs_s.copy()
        poses[i : j + 1], legs_s[i], legs_s[j + 1] = blocks[row], arrive_s[row], leave_s[row]
        return replace(chain, poses=poses, legs_s=legs_s)

    def first_place(
        self, runs: np.ndarray, k: int, poses: Array, before: Array, after: Array, bends: tuple[Array, Array]
    ) -> Array | None:
        """(3,) of poses (n, 3) of run k the clear one whose legs from (1, 3) and to (1, 3), with bends, take least."""
        leaving = run_ends(self.space, np.full(len(poses), runs[k]), poses)
        legs_s = self._leg_s(runs, k, before, poses, bends[0]) + self._leg_s(runs, k + 1, leaving, after, bends[1])
        legs_m = [np.hypot(*(b - a)[:, :2].T) for a, b in ((before, poses), (leaving, after))]
        legs_s[(legs_m[0] < self._least_m(runs, k)) | (legs_m[1] < self._least_m(runs, k + 1))] = np.inf
        order = np.argsort(np.round(legs_s, EQUAL), kind="stable")
        ends = [*before[:, :2], *bends[0]][-1], [*bends[1], *after[:, :2]][0]
        row = self._first_clear(runs[k : k + 1], poses[:, None], order[np.isfinite(legs_s[order])], *ends)
        return None if row is None else poses[row]

    def _first_clear(
        self, runs: np.ndarray, blocks: Array, rows: np.ndarray, before: Array, after: Array
    ) -> int | None:
        """The first of the rows of blocks (n, m, 3) that is clear, or None; more and more are looked at together."""
        first, count = 0, BLOCKS_AT_ONCE
        while first < len(rows):
            some = rows[first : first + count]
            clear = self._clear(runs, blocks[some], before, after)
            if clear.any():
                return int(some[clear.argmax()])
            first, count = first + count, 4 * count
        return None

    def _least_m(self, runs: np.ndarray, k: int) -> float:
        """Length from which on leg k takes as long as the rule says."""
        return self.space.planner.least_m(self.space, self._pair(runs, k))

    def _tried_s(self, runs: np.ndarray, k: int, before: Array, after: Array) -> float:
        """Time of leg k as tried, or 0 if it is another than that."""
        tried = self.space.tried.get(self._pair(runs, k))
        if tried is None:
            return 0.0
        c, s = np.cos(before[2]), np.sin(before[2])
        north, east = after[:2] - before[:2] - tried.seconds * self.space.current_to
        away = np.hypot(c * north + s * east - tried.step[0], c * east - s * north - tried.step[1])
        turned = abs(float(wrap_angle(after[2] - before[2] - tried.step[2])))
        if away >= SAME * self.space.hull_m or turned >= SAME:
            return 0.0
        before_run, after_run = (int(run) for run in np.r_[self.departure.last, runs, -1][k : k + 2])
        return tried.seconds + float(self.space.going_round_s(before_run, after_run, np.array(tried.seconds)))

    def _kept(self, runs: np.ndarray, k: int) -> bool:
        """Whether leg k failed elsewhere and was given more room: it is left alone."""
        return self._pair(runs, k) in self.space.run_up

    def _pair(self, runs: np.ndarray, k: int) -> Pair:
        """Names of the runs before and after leg k."""
        chain = [self.departure.last, *runs.tolist(), -1]
        return self.space.pair(chain[k], chain[k + 1])

    def _clear(self, runs: np.ndarray, blocks: Array, before: Array, after: Array) -> np.ndarray:
        """(n,) whether runs (m,) at blocks (n, m, 3) have room and ways on, and water between them and two places."""
        primitive, poses = np.tile(runs, len(blocks)), blocks.reshape(-1, 3)
        clear = np.asarray(runs_clear(self.space, primitive, poses).reshape(len(blocks), -1).all(axis=1))
        some = blocks[clear]
        ends = run_ends(self.space, primitive[: some[..., 0].size], some.reshape(-1, 3)).reshape(some.shape)
        starts, stops = (np.broadcast_to(place, (len(some), 1, 2)) for place in (before, after))
        lines = sight_lines(
            np.concatenate([starts, ends[..., :2]], axis=1).reshape(-1, 2),
            np.concatenate([some[..., :2], stops], axis=1).reshape(-1, 2),
        )
        covered = shapely.covers(self.space.goal_distance.graph.water, lines)
        seen = covered.reshape(len(some), len(runs) + 1).all(axis=1)
        some, ends = some[seen].reshape(-1, 3), ends[seen].reshape(-1, 3)
        on = self.space.planner.ways_on(self.space, primitive[: len(some)], some, ends)
        clear[clear] = seen
        clear[clear] = on.reshape(-1, len(runs)).all(axis=1)
        return clear

    def _blocks(self, chain: Chain, i: int, j: int) -> Array:
        """(moves, j - i + 1, 3) poses of a block moved and turned about its first pose, drifting as before."""
        moves, origin = _pattern(self.space.hull_m), chain.poses[i]
        c, s = np.cos(origin[2]), np.sin(origin[2])
        firsts = origin[:2] + np.stack([c * moves[:, 0] - s * moves[:, 1], s * moves[:, 0] + c * moves[:, 1]], axis=1)
        lasting_s = (
            np.array([self.space.footprints[q].duration_s for q in chain.runs])[i:j] + chain.legs_s[i + 1 : j + 1]
        )
        drift = np.r_[0.0, np.cumsum(lasting_s)][:, None] * self.space.current_to
        apart = chain.poses[i : j + 1, :2] - origin[:2] - drift
        c, s = np.cos(moves[:, 2])[:, None], np.sin(moves[:, 2])[:, None]
        turned = np.stack([c * apart[:, 0] - s * apart[:, 1], s * apart[:, 0] + c * apart[:, 1]], axis=-1)
        headings = chain.poses[i : j + 1, 2] + moves[:, 2:]
        return np.concatenate([firsts[:, None] + turned + drift, headings[..., None]], axis=-1)

    def ends(self, runs: np.ndarray, poses: Array) -> tuple[Array, Array]:
        """(n + 1, 3) where legs begin, and where they end."""
        return np.vstack([self.departure.pose, run_ends(self.space, runs, poses)]), np.vstack([poses, self.space.goal])

    def _leg_s(self, runs: np.ndarray, k: int, froms: Array, tos: Array, bends: Array) -> Array:
        """(m,) time of leg k from poses (m, 3) to poses (m, 3) along a path's bends (b, 2)."""
        runs_of = self.space.footprints
        ends = LegEnds(
            before=int(runs[k - 1]) if k else self.departure.last,
            after=int(runs[k]) if k < len(runs) else -1,
            exit_mps=runs_of[runs[k - 1]].exit_mps if k else self.departure.exit_mps,
            entry_mps=runs_of[runs[k]].entry_mps if k < len(runs) else 0.0,
        )
        return self.space.planner.leg_s(self.space, ends, froms, tos, bends)


@lru_cache(maxsize=16)
def _pattern(hull_m: float) -> Array:
    """(n, 3) moves forward, to starboard and round, of every size, to all sides alike."""
    shifts = hull_m * np.array(SHIFT_HULLS)
    sides = np.array([side for side in product((-1.0, 0.0, 1.0), repeat=3) if any(side)])
    sizes = np.column_stack([shifts, shifts, np.deg2rad(TURN_DEG)])
    return np.concatenate([sides * size for size in sizes])
