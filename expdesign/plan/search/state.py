"""What the search for order and placement knows: the runs as stamps, the water as grids, plans as far as they got."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.plan.chart import ClearanceField, GoalWays
from expdesign.plan.control import Capability
from expdesign.plan.legs import HelmTimes, LegTimes, helm_times
from expdesign.plan.values import Placement
from expdesign.sea_area import LocalFrame
from expdesign.values import Array, seal
from expdesign.vessel.hull import covering_discs, disc_points, thinned_poses


@dataclass(frozen=True, kw_only=True, eq=False)
class Stamp:
    """A primitive as the search sees it.

    Attributes:
        name: of the primitive.
        discs: (n, 2) forward/starboard centres of the discs that cover its swept hull [m].
        times_s: (n,) when the hull is there [s].
        room_m: (n,) clearance that each disc centre needs [m].
        displacement: (3,) forward m, starboard m, turn rad through water.
        duration_s: of one run [s].
        entry_mps, exit_mps: surge speed at its ends.
    """

    name: str
    discs: Array
    times_s: Array
    room_m: Array
    displacement: Array
    duration_s: float
    entry_mps: float
    exit_mps: float

    @property
    def course_rad(self) -> float:
        """Course that it makes good, from its heading at the beginning."""
        return float(np.arctan2(self.displacement[1], self.displacement[0]))

    @property
    def way_ahead_rad(self) -> float:
        """The same, from its heading at the end."""
        return self.course_rad - float(self.displacement[2])


@dataclass(frozen=True, kw_only=True, eq=False)
class TriedJoint:
    """A short leg between two runs as it was sailed in open water.

    Attributes:
        step: (3,) forward m, starboard m and turn rad through water.
        seconds: its time.
        more_s: how much longer that is than the rule for legs says, where the rule can be trusted.
    """

    step: Array
    seconds: float
    more_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchSpace:
    """What the search looks up.

    Attributes:
        stamps: the primitives to place.
        frame: for messages.
        field, goal_way: clearance and the way to the goal.
        goal: (3,) pose.
        ship: speeds and turns on legs.
        hull_m: hull length [m].
        leg_margin_m: clearance that leg centre lines need on the grid [m].
        current_to: (2,) mean current [m/s].
        times: how long legs take, for agile vessels; None for others.
        tried: joints that were tried, by (name before, name after), "" for start and goal; None where no leg was found.
        run_up: extra straight before a run, by (name before, name) in hull lengths; grows where a leg failed.
        recoveries: (q, 4) what each run is followed by before the ship goes straight: way ahead m, to starboard m,
            course from the heading at the run's end rad, time s; None where ships need nothing of the kind.
        refused: (b, 3) start poses that turned out unreachable or unsafe; none is tried near them again.
    """

    stamps: tuple[Stamp, ...]
    frame: LocalFrame
    field: ClearanceField
    goal_way: GoalWays
    goal: Array
    ship: Capability
    hull_m: float
    leg_margin_m: float
    current_to: Array
    recoveries: Array | None = None
    times: LegTimes | None = None
    tried: Mapping[tuple[str, str], TriedJoint | None] = dataclasses.field(default_factory=dict)
    run_up: Mapping[tuple[str, str], float] = dataclasses.field(default_factory=dict)
    refused: Array = dataclasses.field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        seal(self, goal="3", current_to="2", refused="b 3")
        if self.recoveries is not None:
            seal(self, recoveries="q 4")

    @property
    def helm_times(self) -> HelmTimes | None:
        """How long legs of ships with a helm take; None for others."""
        return None if self.ship.approach is None else helm_times(self.ship)

    def off(self, last: int) -> Array:
        """(4,) what a ship with a helm does after a run, -1 for the start, before she turns; as in `recoveries`."""
        if last >= 0 and self.recoveries is not None:
            return np.asarray(self.recoveries[last])
        return np.array([self.hull_m, 0.0, 0.0, self.hull_m / self.ship.transit_speed_mps])

    def more_s(self, before: int, after: int) -> float:
        """How much longer legs from one run to another take than the rule says; -1 for start and goal."""
        names = [self.stamps[index].name if index >= 0 else "" for index in (before, after)]
        joint = self.tried.get((names[0], names[1]))
        return 0.0 if joint is None else joint.more_s


@dataclass(frozen=True, kw_only=True, eq=False)
class PartialPlans:
    """Partial plans with equally many runs.

    Attributes:
        pose: (b, 3) where they end; exit_mps (b,) how fast; last (b,) index of the last primitive, -1 at the start.
        left: (b, q) runs still to do.
        cost_s: (b,) repositioning time so far.
        history: per plan, its (primitive index, start pose) so far.
    """

    pose: Array
    exit_mps: Array
    last: np.ndarray
    left: np.ndarray
    cost_s: Array
    history: tuple[tuple[tuple[int, Array], ...], ...]


def stamp(primitive: Primitive, room_m: Array, *, length_m: float, beam_m: float) -> Stamp:
    """Reduce a primitive to what the search needs; `room_m` (k + 1,) is the clearance for discs at each sample."""
    centres, _ = covering_discs(length_m, beam_m)
    pose = primitive.trajectory.pose
    kept = thinned_poses(pose, reach_m=length_m / 2, spacing_m=length_m / 4)
    return Stamp(
        name=primitive.name,
        discs=disc_points(pose[kept], centres).reshape(-1, 2),
        times_s=np.repeat(kept * primitive.trajectory.sample_time_s, len(centres)),
        room_m=np.repeat(room_m[kept], len(centres)),
        displacement=primitive.displacement,
        duration_s=primitive.duration_s,
        entry_mps=float(primitive.entry_velocity[0]),
        exit_mps=float(primitive.exit_velocity[0]),
    )


def refusing(space: SearchSpace, before: str, placement: Placement) -> SearchSpace:
    """The same space after a leg to, or a run from, a placement failed: not there again, and more run-up."""
    pair = (before, placement.primitive)
    grown = {**space.run_up, pair: space.run_up.get(pair, 0.0) + 0.5}
    return replace(space, run_up=grown, refused=np.vstack([space.refused, placement.pose]))
