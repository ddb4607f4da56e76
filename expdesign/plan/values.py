"""The problem that the planner solves, what it answers, and the work of a search.

Work is counted instead of timed, so that a search gives up at the same point on every machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.durations import DurationDesign
from expdesign.sea_area import SeaArea
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Environment, to_body
from expdesign.values import Array, sealed
from expdesign.vessel import NUMPY, Vessel

ITERATION_S = 2e-4  # one iteration of the optimiser for each sample of a leg, on a machine of 2020 [s]
SEARCH_S = 1.0  # one search for a path round obstacles, which mostly ends without one
SUCCESSOR_S, MOVE_S = 1e-6, 1e-3  # one placement looked at, and one block of runs that is moved to better places
SAMPLE_S = 2.5e-3  # one sample of some hundred drawn ships there [s]


class WorkBudget:
    """Counted work of a search, in seconds of a reference machine.

    Attributes:
        spent_s: so far.
        most_s: the budget. Work under way is never stopped; only what comes after it is refused.
    """

    def __init__(self, most_s: float = math.inf) -> None:
        """Begin with nothing spent."""
        self.spent_s, self.most_s = 0.0, most_s

    @property
    def exhausted(self) -> bool:
        """Whether nothing is left."""
        return self.spent_s > self.most_s

    def optimised(self, iterations: int, samples: int) -> None:
        """Count iterations of the optimiser on a leg of some samples."""
        self.spent_s += ITERATION_S * iterations * samples

    def searched(self) -> None:
        """Count a search for a path round obstacles."""
        self.spent_s += SEARCH_S

    def placed(self, successors: int, moves: int = 0) -> None:
        """Count placements of runs looked at, and blocks of runs that were moved."""
        self.spent_s += SUCCESSOR_S * successors + MOVE_S * moves

    def sailed(self, samples: int) -> None:
        """Count samples of drawn trials."""
        self.spent_s += SAMPLE_S * samples


PlannerName = Literal["beam", "lattice"]
DRAFT = "a DRAFT: the nominal ship keeps to allowed water, no trials were drawn, and nobody may sail it"
PathsName = Literal["ompl", "visibility"]


@dataclass(frozen=True, kw_only=True)
class PlanSettings:
    """Settings of the plan."""

    clearance_m: float = 20.0  # least distance from the hull to anything forbidden [m]
    # share of drawn trials that must stay in allowed water from start to goal, between 0 and 1
    confidence: float = 0.95
    aborted_most: float = 0.1  # share of drawn trials that may be aborted in a plan that counts as verified
    # factor on how far heading, speed, yaw rate and, where there is room, place may be off where a run begins, and on
    # the distance from the goal at which a trial has reached it
    start_tolerance: float = 1.0
    # for tries of other places where a leg or a run fails: one for every two seconds, fewer where legs cost more [s].
    # Work is counted, so that a slow machine finds the same plan as a fast one; by the clock a search that is stuck
    # ends after five times the budget. A plan whose drawn trials leave the water is made anew once, and a second time
    # if the work counted so far suggests that this ends within twice the budget.
    time_budget_s: float = 60.0
    # speed of repositioning legs, or None for nine tenths of what the actuators allow
    transit_speed_mps: float | None = None
    turning_radius_m: float | None = None  # of repositioning legs, or None for what the vessel model allows
    # name of the search that orders and places the runs, see `expdesign.plan.search.placed_runs`
    planner: PlannerName = "beam"
    # distance between the cells of the lattice planner, or None for one that suits the ship
    lattice_spacing_m: float | None = None
    # whether one placing of the runs and the check of the nominal track are enough; no key of a file
    draft: bool = False
    # what finds the paths of legs that bend, of ships that turn on the spot: OMPL, or the visibility graph
    paths: PathsName = "ompl"


@sealed(velocity="3", inputs="m")
class UnderWay:
    """The motion with which a plan begins."""

    velocity: Array  # (3,) surge and sway over ground m/s, yaw rate rad/s
    inputs: Array  # (m,) commands standing, which the actuators deliver


@dataclass(frozen=True, kw_only=True)
class Leg:
    """One stretch of the plan; sample indices point into the plan's commands and trajectory."""

    kind: str  # "primitive" or "reposition"
    name: str  # of the primitive, or what the repositioning leads to
    first: int  # index of its first command; the trajectory sample of the same index is its start state
    last: int  # index of the trajectory sample at its end, which is the next leg's first
    # where the path of a repositioning leg comes from, as `expdesign.plan.legs.LegPath`; "" where unknown
    path: str = ""


@dataclass(frozen=True, kw_only=True)
class LatticeProof:
    """How good the placements of the lattice planner are among all plans on the same lattice.

    Costs are seconds of repositioning by the rule of the lattice. The bound says nothing of plans whose runs begin at
    other places or headings.
    """

    spacing_m: float  # between cells
    headings: int  # of a cell
    cost_s: float  # of the plan found for the whole trial
    lower_bound_s: float  # no plan on the lattice costs less
    # places of it that legs or runs could not be sailed at, so that the rest was placed anew from there
    refused: int = 0

    @property
    def gap(self) -> float:
        """How far the plan may be from the best on the lattice, relative to its cost."""
        return 1.0 - self.lower_bound_s / self.cost_s if self.cost_s > 0 else 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class SailedTrial:
    """A trial as planned: commands, the motion they give, and the legs in it."""

    commands: Commands  # (k, m) actuator commands from start to goal
    trajectory: Trajectory  # k + 1 samples
    legs: tuple[Leg, ...]  # in time order, without gaps
    lattice: LatticeProof | None = None  # proof of the lattice planner, or None for other planners
    # (m,) commands before the first, which the actuators deliver as the trial begins; None for zeros
    standing: Array | None = None
    # of the runs, where the search put them; they begin there up to what a leg may miss its end by
    placements: tuple[Placement, ...] = ()

    @property
    def states(self) -> Array:
        """(k + 1, 6) pose and velocity over ground."""
        return np.hstack([self.trajectory.pose, self.trajectory.velocity])

    @property
    def day_s(self) -> float:
        """Everything between start and goal [s]."""
        return self.commands.duration_s

    @property
    def legs_s(self) -> Array:
        """(legs,) time of each [s]."""
        return np.array([leg.last - leg.first for leg in self.legs]) * self.commands.sample_time_s

    def seconds(self, kind: str) -> float:
        """Total time of the legs of one kind [s]."""
        return sum(leg.last - leg.first for leg in self.legs if leg.kind == kind) * self.commands.sample_time_s


@dataclass(frozen=True, kw_only=True)
class Verification:
    """What the independent check of a plan found."""

    clearance_min_m: float  # least distance from the hull to forbidden water over the whole track [m]
    clearance_time_s: float  # when [s]
    reproduction_error_m: float  # largest distance between the track and the re-simulated commands [m]
    limit_excess: float  # largest violation of an actuator limit or rate, relative to its range
    problems: tuple[str, ...]  # one sentence for each failed check; empty when the plan passes
    # after which the re-simulation begins anew on the track, as small errors grow without bound; None where it does not
    stretch_s: float | None = None
    # largest roll angle of the re-simulated commands, in still water; None without [roll]
    heel_max_rad: float | None = None

    @property
    def passed(self) -> bool:
        """True when every check passed."""
        return not self.problems


@dataclass(frozen=True, kw_only=True)
class LegOutcome:
    """What drawn trials did on one leg."""

    # left, aborted: shares of all trials in which the hull left allowed water here, or which were aborted here, before
    # the run that follows
    left: float
    aborted: float
    go_arounds: float  # mean number of go-arounds for the run that follows, over the ships that sailed the leg
    # median_s, most_s: median and 95th percentile of the time it took [s]
    median_s: float
    most_s: float
    longest_s: float  # time on it after which a trial is aborted; zero of runs [s]
    # position_m, speed_mps: distance from the planned start, and difference from the planned velocity over ground,
    # within which a run begins
    position_m: float
    speed_mps: float


@dataclass(frozen=True, kw_only=True)
class RiskEstimate:
    """Monte Carlo estimate of a plan's risk: whole trials of drawn ships in drawn weather.

    They are sailed by the procedure of `plan.monte_carlo.procedure`.
    """

    trials: int  # how many
    left: float  # share in which the hull left allowed water, on a run or on a leg
    left_most: float  # the share is below this with 95 % confidence (Clopper and Pearson 1934)
    aborted: float  # share aborted in allowed water because a run could not be begun within tolerance
    reasons: tuple[str, ...]  # one sentence for each leg on which trials were aborted, most first
    # extra_median_s, extra_most_s: median and 95th percentile of the time beyond the plan's, over the trials that
    # reached the goal [s]; nan when none did
    extra_median_s: float
    extra_most_s: float
    go_arounds: int  # largest number of go-arounds for one run
    # heading_rad, yaw_rate_radps: tolerances within which runs begin, besides those of each leg
    heading_rad: float
    yaw_rate_radps: float
    legs: tuple[LegOutcome, ...]  # what happened on each
    aborted_most: float = PlanSettings.aborted_most  # the share that may be

    @property
    def error(self) -> float:
        """Standard error of `left` [share of trials]; at least that of half a trial."""
        share = min(max(self.left, 0.5 / self.trials), 1.0 - 0.5 / self.trials)
        return float(np.sqrt(share * (1.0 - share) / self.trials))

    @property
    def note(self) -> str:
        """Warning about a plan of which more drawn trials are aborted than may be; "" for others."""
        return "" if self.aborted <= self.aborted_most else self.aborted_note

    @property
    def aborted_note(self) -> str:
        """How many drawn trials are aborted, and where most of them; for a plan of which some are."""
        return (
            f"{self.aborted:.1%} of {self.trials} drawn trials, about {10 * self.aborted:.0f} in 10, were aborted "
            f"because a run could not be begun or the goal not reached, most of them {self.reasons[0]}"
        )


@dataclass(frozen=True, kw_only=True)
class DayLength:
    """Everything between start and goal [s]."""

    planned_s: float  # by the plan
    # median_s, most_s: median and 95th percentile of the drawn trials that reached the goal; nan without any
    median_s: float
    most_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """One continuous trial from start to goal."""

    area: SeaArea  # the sea area, its frame included
    commands: Commands  # (k, m) actuator commands from start to goal
    trajectory: Trajectory  # k + 1 samples
    legs: tuple[Leg, ...]  # in time order, without gaps
    # no plan with these runs, and legs no faster through water than transit speed, repositions in less time [s]; proved
    # except for the quantities that `expdesign.plan.bounds.repositioning` estimates; 0 of a draft
    reposition_bound_s: float
    # chance that the hull leaves allowed water in the trial as it is sailed, by `risk`, or None if not computed
    leave_water_probability: float | None
    # efficiency of the whole trajectory's information, by the design's criterion, against the optimal design's in the
    # time asked for; None where the track alone does not determine it
    design_efficiency_realised: float | None
    verification: Verification  # what the independent check found
    leave_water_by_leg: tuple[float | None, ...] = ()  # the same for each leg, or () if not computed
    # as realised, of the runs alone, with the headings in wind and the entries they got
    design_efficiency_placed: float | None = None
    risk: RiskEstimate | None = None  # what drawn trials of the plan came to; None if not computed
    lattice: LatticeProof | None = None  # proof of the lattice planner, or None for other planners
    # (m,) commands before the first, which the actuators deliver as the plan begins; None for a plan that begins at
    # rest with all of them zero
    standing: Array | None = None
    draft: bool = False  # whether no trials were drawn as only a draft was asked for, which nobody may sail

    @property
    def verified(self) -> bool:
        """Whether the independent check passed and no more drawn trials were aborted than may be; a draft never is."""
        return self.verification.passed and not self.draft and not (self.risk and self.risk.note)

    @property
    def verdict(self) -> str:
        """The outcome of check and drawn trials in a few words."""
        if not self.verification.passed:
            return f"not verified: {'; '.join(self.verification.problems)}"
        if self.draft:
            return DRAFT
        if self.risk is None or self.verified:
            return "verified"
        return (
            f"kept in allowed water; {100 * self.risk.aborted:.4g} % of {self.risk.trials} drawn trials were aborted, "
            f"above the limit of {100 * self.risk.aborted_most:.4g} % (plan.aborted_most)"
        )

    @property
    def sailed(self) -> SailedTrial:
        """Commands, motion and legs."""
        return SailedTrial(
            commands=self.commands,
            trajectory=self.trajectory,
            legs=self.legs,
            lattice=self.lattice,
            standing=self.standing,
        )

    @property
    def sample_leg(self) -> np.ndarray:
        """(k + 1,) index of the leg each sample belongs to; a leg owns its first sample, the last one owns its last."""
        index = np.full(len(self.trajectory), len(self.legs) - 1)
        for number, leg in enumerate(self.legs):
            index[leg.first : leg.last] = number
        return index

    @property
    def day(self) -> DayLength:
        """How long it takes from start to goal."""
        planned_s, risk = self.commands.duration_s, self.risk
        median_s, most_s = (np.nan, np.nan) if risk is None else (risk.extra_median_s, risk.extra_most_s)
        return DayLength(planned_s=planned_s, median_s=planned_s + median_s, most_s=planned_s + most_s)

    @property
    def legs_s(self) -> Array:
        """(legs,) time of each [s]."""
        return np.array([leg.last - leg.first for leg in self.legs]) * self.commands.sample_time_s

    def seconds(self, kind: str) -> float:
        """Total time of the legs of one kind [s]."""
        return self.sailed.seconds(kind)


@sealed(pose="3")
class Placement:
    """Where one run starts."""

    primitive: str  # name
    pose: Array  # (3,) start pose in the n-frame


@dataclass(frozen=True, kw_only=True)
class Placements:
    """What a search for places finds."""

    runs: tuple[Placement, ...]  # where each begins, in the order in which they are to be done
    work_s: float = 0.0  # work counted for the search, if it counts any [s]
    lattice: LatticeProof | None = None  # proof of the lattice planner


@sealed(start="3", goal="3")
class PlanProblem:
    """A trial to be planned."""

    # vessel, area, environment, settings: who, where, in what weather, with which settings
    vessel: Vessel
    area: SeaArea
    environment: Environment
    settings: PlanSettings
    primitives: tuple[Primitive, ...]  # of the dictionary, in the design's order
    design: DurationDesign  # gives the number of runs of each
    # start, goal: (3,) poses; the ship ends at rest through the water
    start: Array
    goal: Array
    seed: int = 0  # of everything drawn
    # whether plans are compared by their expected time, go-arounds included, where the ship has a rule
    expected: bool = False
    # how the ship moves at the start; None where it is at rest through the water there
    under_way: UnderWay | None = None

    @property
    def repeats(self) -> dict[str, int]:
        """How often each primitive is run."""
        return dict(zip(self.design.problem.names, self.design.repeats, strict=True))

    @property
    def used(self) -> tuple[Primitive, ...]:
        """Primitives that are run."""
        return tuple(item for item in self.primitives if self.repeats[item.name])

    @property
    def ends(self) -> Array:
        """(2, 2) positions of start and goal."""
        return np.stack([self.start[:2], self.goal[:2]])

    @property
    def current_mps(self) -> float:
        """Speed of the forecast's mean current."""
        return float(np.hypot(*self.environment.current_to))

    @property
    def begin(self) -> Array:
        """(6,) state at the start."""
        return self.at_rest(self.start) if self.under_way is None else np.r_[self.start, self.under_way.velocity]

    @property
    def standing(self) -> Array:
        """(m,) commands standing there."""
        return np.zeros(len(self.vessel.limits)) if self.under_way is None else self.under_way.inputs

    def moving(self, pose: Array, velocity: Array) -> Array:
        """(6,) state at a pose with a velocity (3,) through the forecast's mean current."""
        u_c, v_c = to_body(self.environment.current_to, pose[2], NUMPY)
        return np.asarray(np.r_[pose, velocity + np.array([u_c, v_c, 0.0])])

    def at_rest(self, pose: Array) -> Array:
        """(6,) state at a pose, at rest through the water."""
        return self.moving(pose, np.zeros(3))
