"""The search space, and the protocol of local planners: how one kind of ship gets from one state to another.

Only the local planner knows the kind of ship. Everything above it uses the protocol `LocalPlanner`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.dictionary import Primitive
from expdesign.plan.chart import ClearanceField, GoalDistance
from expdesign.plan.control import AgileShip, Capability
from expdesign.plan.legs import FoundLeg, LegTask, LegWater
from expdesign.plan.runs import Footprint
from expdesign.plan.values import Placement, WorkBudget
from expdesign.progress import Progress, silent
from expdesign.sea_area import LocalFrame
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel

DRIFT_ROUNDS = 3  # rounds in which the time of a leg and the drift in that time are made to agree

GO_AROUND_RUN_UPS = 3.0  # expected time of go-arounds before a run that follows another at once, in run-ups, and
SETTLED_RUN_UPS = 2.0  # length of leg, in run-ups, on which it falls to 1/e; of drawn trials with legs of 5 to 270 s


Pair = tuple[str, str]
"""Names of the runs before and after a leg; "" for start and goal."""
Alike = Mapping[tuple[int, float], np.ndarray]
"""Positions of partial plans by the run that was last and its exit speed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TriedTransition:
    """A short leg between two runs as it was optimised in open water."""

    step: Array  # (3,) forward m, starboard m and turn rad through water
    seconds: float  # its time
    more_s: float  # how much longer that is than the rule for legs says, where the rule can be trusted


@dataclass(frozen=True, kw_only=True)
class GoAroundTime:
    """Expected time of go-arounds before a run that follows another: after a short leg the ship is less settled."""

    soon_s: float  # where there is no leg
    settled_s: float  # length of leg on which it falls to 1/e

    @staticmethod
    def of(ship: Capability, vessel: Vessel) -> GoAroundTime | None:
        """Go-around time of ships that turn on the spot; the legs of others have run-ups."""
        if not isinstance(ship, AgileShip):
            return None
        run_up_s = ship.run_up_s(vessel, ship.transit_speed_mps)
        return GoAroundTime(soon_s=GO_AROUND_RUN_UPS * run_up_s, settled_s=SETTLED_RUN_UPS * run_up_s)

    def seconds(self, leg_s: Array) -> Array:
        """(...,) for legs (...,)."""
        return np.asarray(self.soon_s * np.exp(-np.asarray(leg_s) / self.settled_s))


@sealed(current_to="2")
class RunSpace:
    """Where runs may be placed, whatever leads to them."""

    footprints: tuple[Footprint, ...]  # the primitives to place
    frame: LocalFrame  # for messages
    field: ClearanceField  # clearance
    leg_margin_m: float  # clearance that leg centre lines need on the grid [m]
    current_to: Array  # (2,) mean current [m/s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Departure:
    """Where a search begins."""

    pose: Array  # (3,)
    exit_mps: float = 0.0  # surge speed there
    last: int = -1  # index of the run that ends there, or -1


@sealed(goal="3", current_to="2", refused="b 3")
class SearchSpace:
    """Data of the search for places and orders."""

    footprints: tuple[Footprint, ...]  # the primitives to place
    frame: LocalFrame  # for messages
    # field, goal_distance: clearance, and the shortest path to the goal from everywhere
    field: ClearanceField
    goal_distance: GoalDistance
    goal: Array  # (3,) pose
    planner: LocalPlanner  # how this kind of ship gets from run to run
    hull_m: float  # hull length [m]
    leg_margin_m: float  # clearance that leg centre lines need on the grid [m]
    current_to: Array  # (2,) mean current [m/s]
    # transitions that were tried; None where no leg was found
    tried: Mapping[Pair, TriedTransition | None] = dataclasses.field(default_factory=dict)
    # extra straight before a run in hull lengths; grows where a leg failed
    run_up: Mapping[Pair, float] = dataclasses.field(default_factory=dict)
    go_around: GoAroundTime | None = None  # expected time of go-arounds, where plans are compared by it too
    # (b, 3) start poses that turned out unreachable or unsafe; none is tried near them again
    refused: Array = dataclasses.field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def ship(self) -> Capability:
        """Speeds and turns on legs."""
        return self.planner.ship

    def pair(self, before: int, after: int) -> Pair:
        """Names of two runs; -1 for start and goal."""
        first, last = (self.footprints[index].name if index >= 0 else "" for index in (before, after))
        return first, last

    def more_s(self, before: int, after: int) -> float:
        """How much longer legs from one run to another take than the rule says; -1 for start and goal."""
        tried = self.tried.get(self.pair(before, after))
        return 0.0 if tried is None else tried.more_s

    def going_round_s(self, before: int, after: int, leg_s: Array) -> Array:
        """(...,) expected time of go-arounds after legs (...,) from one run to another; -1 for start and goal."""
        if self.go_around is None or before < 0 or after < 0:
            return np.zeros(np.shape(leg_s))
        return self.go_around.seconds(leg_s)

    def more_run_up_m(self, before: int, after: int) -> float:
        """Extra straight before a run [m]."""
        return self.hull_m * self.run_up.get(self.pair(before, after), 0.0)

    def is_refused(self, pose: Array) -> np.ndarray:
        """(n,) whether poses (n, 3) are near one that was refused."""
        found = np.zeros(len(pose), dtype=bool)
        for bad in self.refused:
            near = np.hypot(*(pose[:, :2] - bad[:2]).T) < self.hull_m / 2
            found |= near & (np.abs(wrap_angle(pose[:, 2] - bad[2])) < 0.2)
        return found

    def refusing(self, before: str, placement: Placement) -> SearchSpace:
        """The space without a placement to which a leg failed, or from which a run did, and with more run-up."""
        pair = (before, placement.primitive)
        grown = {**self.run_up, pair: self.run_up.get(pair, 0.0) + 0.5}
        return replace(self, run_up=grown, refused=np.vstack([self.refused, placement.pose]))


@dataclass(frozen=True, kw_only=True, eq=False)
class PartialPlans:
    """Partial plans with equally many runs."""

    pose: Array  # (b, 3) where they end; exit_mps (b,) how fast; last (b,) index of the last primitive, -1 at the start
    exit_mps: Array
    last: np.ndarray
    left: np.ndarray  # (b, q) runs still to do
    cost_s: Array  # (b,) repositioning time so far
    history: tuple[tuple[tuple[int, Array], ...], ...]  # per plan, its (primitive index, start pose) so far

    @property
    def wanted(self) -> list[int]:
        """Runs that some plan still has to do."""
        return [q for q in range(self.left.shape[1]) if self.left[:, q].any()]

    def able(self, q: int) -> np.ndarray:
        """Indices of plans that still have a run to do."""
        return np.flatnonzero(self.left[:, q] > 0)

    def alike(self, rows: np.ndarray) -> Alike:
        """Positions in `rows` of plans after the same run at the same exit speed."""
        keys = list(zip(self.last.tolist(), self.exit_mps.tolist(), strict=True))
        kinds = {key: kind for kind, key in enumerate(dict.fromkeys(keys))}
        kind_of = np.array([kinds[key] for key in keys], dtype=int)[rows]
        found = {key: np.flatnonzero(kind_of == kind) for key, kind in kinds.items()}
        first = {key: where[0] for key, where in found.items() if len(where)}
        return {key: found[key] for key in sorted(first, key=first.__getitem__)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Successors:
    """Continuations of partial plans by one leg and one run, one per row."""

    departure: Array  # (b, 3) pose from which the leg of each partial plan is checked for clearance
    parent: np.ndarray  # (n,) index of the partial plan
    primitive: np.ndarray  # (n,) index of the run to do next
    # start, end: (n, 3) where the run begins, and where it ends
    start: Array
    end: Array
    leg_s: Array  # (n,) time to get to its start
    turn: Array  # (n,) angle of the arc that leads there, before a straight; nan for others
    straight: np.ndarray  # (n,) whether a straight line leads there

    def __len__(self) -> int:
        return len(self.parent)

    def __getitem__(self, rows: np.ndarray) -> Successors:
        return replace(self, **{name: vars(self)[name][rows] for name in _COLUMNS})

    @classmethod
    def joined(cls, parts: Sequence[Successors]) -> Successors:
        """All rows of several sets that continue the same partial plans."""
        return replace(parts[0], **{name: np.concatenate([vars(part)[name] for part in parts]) for name in _COLUMNS})

    @classmethod
    def chosen(cls, parts: Sequence[Successors], rows: np.ndarray) -> Successors:
        """Rows (n,) of several sets, as if these were joined."""
        firsts = np.cumsum([0, *map(len, parts)])
        part_of = np.searchsorted(firsts, rows, side="right") - 1
        found = cls.joined([part[rows[part_of == k] - firsts[k]] for k, part in enumerate(parts)])
        return found[np.argsort(np.argsort(part_of, kind="stable"))]


_COLUMNS = ("parent", "primitive", "start", "end", "leg_s", "turn", "straight")


@dataclass(frozen=True, kw_only=True)
class LegEnds:
    """The runs that a leg leads from and to."""

    # before, after: indices of the runs; -1 for start and goal
    before: int
    after: int
    # exit_mps, entry_mps: surge speeds there
    exit_mps: float
    entry_mps: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TransitionTrials:
    """How transitions are tried before the search proper."""

    water: LegWater  # of the plan
    primitives: Mapping[str, Primitive]  # the runs by name
    start: Array  # (3,) pose of the plan
    under_way: tuple[Array, Array]  # (3,) velocity through water with which it begins, and (m,) commands standing then
    made_good: bool  # whether displacement towards the goal saves time on later legs
    # work budget; transitions that are not tried within it keep the rule for leg times
    budget: WorkBudget = dataclasses.field(default_factory=WorkBudget)
    progress: Progress = silent  # of choosing some transitions, which counts as one of them, and trying them


class LocalPlanner(Protocol):
    """How one kind of ship gets from one state to another."""

    @property
    def ship(self) -> Capability:
        """Speeds and turns on legs."""

    @property
    def transition_trials(self) -> int:
        """Plans whose transitions are tried before the search proper; 0 where the rule for leg times is enough."""

    def check_ends(self, start: Array, goal: Array, water: LegWater) -> None:
        """Raise NoPlan where the ship cannot leave its start pose (3,) or reach its goal."""

    def leg(self, task: LegTask, water: LegWater) -> FoundLeg | None:
        """From one state to another in safe water, or None where none is found.

        The last commands of azimuths without angle limits may differ from the task's by whole turns.
        """

    def with_transitions(self, space: SearchSpace, pairs: Sequence[Pair], trials: TransitionTrials) -> SearchSpace:
        """The space with the transitions of these pairs tried."""

    def successors(self, space: SearchSpace, plans: PartialPlans) -> list[Successors]:
        """Placements of every run that is left after each partial plan, each set with one run."""

    def ways_on(self, space: SearchSpace, primitive: np.ndarray, start: Array, end: Array) -> np.ndarray:
        """(n,) whether the water has a way to runs (n,) from poses (n, 3) to poses (n, 3), and a way on after them."""

    def leg_s(self, space: SearchSpace, ends: LegEnds, froms: Array, tos: Array, bends: Array) -> Array:
        """(n,) time of legs between poses (n or 1, 3) along a path with bends (b, 2) [s]."""

    def leg_path(self, space: SearchSpace, before: int, start: Array, end: Array) -> Array:
        """(k, 2) places along a leg in open water between poses (3,), after a run, or after the start (-1)."""

    def to_goal_s(self, space: SearchSpace, plans: PartialPlans) -> Array:
        """(b,) estimated time of the last leg [s]."""

    def least_m(self, space: SearchSpace, pair: Pair) -> float:
        """Length from which on `leg_s` holds [m]."""

    def losses_s(self, space: SearchSpace, *, made_good: bool) -> tuple[Array, Array]:
        """Least time that legs lose: (q, q) between runs, the run before in rows, and (q,) to the goal [s].

        Args:
            space: with the runs.
            made_good: whether displacement towards the goal counts, at transit speed.
        """
