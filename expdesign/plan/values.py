"""What the planner is asked for and what it answers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.plan.area import SeaArea
from expdesign.signals import Commands, Trajectory
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True)
class PlanSettings:
    """Wishes for the plan.

    Attributes:
        clearance_m: least distance from the hull to anything forbidden [m].
        confidence: share of sampled truths whose runs must stay in safe water, between 0 and 1.
        time_budget_s: buys tries of other places when a leg or a run fails, one for every two seconds, so that a slow
            machine finds the same plan as a fast one; by the clock the search ends after ten times as long [s].
        transit_speed_mps: speed of repositioning legs, or None for nine tenths of what the actuators allow.
        turning_radius_m: of repositioning legs, or None for what the vessel model allows.
    """

    clearance_m: float = 20.0
    confidence: float = 0.95
    time_budget_s: float = 60.0
    transit_speed_mps: float | None = None
    turning_radius_m: float | None = None


@dataclass(frozen=True, kw_only=True)
class Leg:
    """One stretch of the plan; sample indices point into the plan's commands and trajectory.

    Attributes:
        kind: "primitive" or "reposition".
        name: of the primitive, or what the repositioning leads to.
        first: index of its first command; the trajectory sample of the same index is its start state.
        last: index of the trajectory sample at its end, which is the next leg's first.
    """

    kind: str
    name: str
    first: int
    last: int


@dataclass(frozen=True, kw_only=True)
class Verification:
    """What the independent check of a plan found.

    Attributes:
        clearance_min_m: least distance from the hull to forbidden water over the whole track [m].
        clearance_time_s: when [s].
        reproduction_error_m: largest distance between the track and the re-simulated commands [m].
        limit_excess: largest violation of an actuator limit or rate, relative to its range.
        problems: one sentence for each failed check; empty when the plan is verified.
    """

    clearance_min_m: float
    clearance_time_s: float
    reproduction_error_m: float
    limit_excess: float
    problems: tuple[str, ...]

    @property
    def verified(self) -> bool:
        """True when every check passed."""
        return not self.problems


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """One continuous trial from start to goal.

    Attributes:
        area: the sea area, its frame included.
        commands: (k, m) actuator commands from start to goal.
        trajectory: k + 1 samples.
        legs: in time order, without gaps.
        reposition_bound_s: no plan with these runs repositions in less time [s].
        leave_water_probability: chance that a primitive run open loop leaves safe water, or None if not computed.
        leave_water_by_leg: the same for each leg; None for legs between runs, or () if not computed.
        design_efficiency_realised: efficiency of the whole trajectory's information, by the design's criterion, against
            the optimal design's in the time asked for; None where the track alone cannot tell.
        verification: what the independent check found.
        design_efficiency_placed: as realised, of the runs alone, with the headings in wind and the entries they got.
    """

    area: SeaArea
    commands: Commands
    trajectory: Trajectory
    legs: tuple[Leg, ...]
    reposition_bound_s: float
    leave_water_probability: float | None
    design_efficiency_realised: float | None
    verification: Verification
    leave_water_by_leg: tuple[float | None, ...] = ()
    design_efficiency_placed: float | None = None

    @property
    def sample_leg(self) -> np.ndarray:
        """(k + 1,) index of the leg each sample belongs to; a leg owns its first sample, the last one owns its last."""
        index = np.full(len(self.trajectory), len(self.legs) - 1)
        for number, leg in enumerate(self.legs):
            index[leg.first : leg.last] = number
        return index

    def seconds(self, kind: str) -> float:
        """Total time of the legs of one kind [s]."""
        return sum(leg.last - leg.first for leg in self.legs if leg.kind == kind) * self.commands.sample_time_s


@dataclass(frozen=True, kw_only=True, eq=False)
class Placement:
    """Where one run starts.

    Attributes:
        primitive: name.
        pose: (3,) start pose in the n-frame.
    """

    primitive: str
    pose: Array

    def __post_init__(self) -> None:
        seal(self, pose="3")
