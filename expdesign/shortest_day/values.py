"""What is asked of a day, and the day found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from expdesign.durations import DurationDesign
from expdesign.plan.values import Plan
from expdesign.values import Array, sealed

DRAFT_POOL, DRAFT_SEARCHES = 8, 1  # candidates of every family, and searches, of a draft, at most


@dataclass(frozen=True, kw_only=True)
class AccuracySettings:
    """The accuracy asked for."""

    as_durations: bool = False  # by the design's criterion, as accurate as the optimal durations are in `total_s`
    std: Mapping[str, float] = field(default_factory=dict)  # largest standard deviation of parameters, in their units
    relative_std: Mapping[str, float] = field(default_factory=dict)  # the same, as a share of the nominal value
    # half-widths of the 95 % intervals of predicted outcomes of standard trials, by `indices.OUTCOMES`
    outcomes_95: Mapping[str, float] = field(default_factory=dict)
    outcome_speed_mps: float | None = None  # approach speed of these trials, or None for the nominal model's
    most_s: float | None = None  # longest day [s], or None for no limit
    grow: bool = True  # whether manoeuvres are added that shorten the day, or tell more in it
    starts: int = 1  # independent searches, from other candidates of manoeuvres; the shortest day of all is taken
    # length of the day [s] in which as much is to be told as can be, or None where an accuracy is asked for
    day_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class DayTried:
    """A day that was planned in search of the shortest."""

    runs: Mapping[str, int]  # how often each primitive is run
    # day_s, informative_s: all of it, and its runs, as planned [s]
    day_s: float
    informative_s: float
    expected_s: float  # all of it with the expected time of go-arounds [s]
    information: float  # of the whole track as a share of what is needed: time would have to be 1 / information as long
    # expected standard deviations of parameters from the whole track, and half-widths of the 95 % intervals of the
    # outcomes asked for
    told: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class DayParts:
    """Where the time of a planned day goes [s]."""

    way_s: float  # the shortest way to the goal at transit speed
    # runs_s, legs_s: runs, and the legs between them, beyond what the way that they make good takes
    runs_s: float
    legs_s: float


@sealed(velocities="3 2")
class DayBound:
    """What no day of a class takes less than.

    Class: velocities through water within limits, delivered inputs within those of the actuators, any heading, the
    nominal model; motions need not obey it but in how fast they gain and lose speed on the way, so the class is wider
    than what the ship can do.
    """

    information_s: float  # least time in which a motion of the class tells what is needed; proved, 0 where nothing is
    searched_s: float  # the same if the search found the samples that tell most; an estimate, never less
    # least time from start to goal in safe water, up to the largest speed of the class, and stopping there
    way_s: float
    required_s: float  # time of the runs that the limits on durations require
    velocities: Array  # (3, 2) limits of u, v and r through water [m/s, rad/s]
    speed_mps: float  # largest speed through water, in any direction

    @property
    def day_s(self) -> float:
        """Of the whole day."""
        return max(self.information_s, self.way_s, self.required_s)


@sealed(curve="k 2")
class ShortestDay:
    """The shortest day found."""

    plan: Plan  # the day
    design: DurationDesign  # its runs; fractions and certificate are those of the accuracy's reference
    tried: tuple[DayTried, ...]  # days planned, in order
    # cost_s, cost_bound_s: cost of the cheapest runs found at the prices learnt, and what no choice of the same
    # dictionary costs less than at these prices and with this information of legs [s]
    cost_s: float
    cost_bound_s: float
    information: float  # of the plan's track, as a share of what is needed
    parts: DayParts  # where its time goes
    # (k, 2) day [s] and information, as a share of what is needed, of the cheapest choices of runs, whole or not, by
    # the prices learnt and beside them as the plan: an estimate of what other accuracies would take
    curve: Array = field(default_factory=lambda: np.zeros((0, 2)))
    bound: DayBound | None = None  # on every day of a class that holds this one; None where it was not computed
    # length of the day asked for, which tells most in it; None where an accuracy was asked for
    most_s: float | None = None

    @property
    def note(self) -> str:
        """What a draft left out of the search; "" for a whole one."""
        if not self.plan.draft:
            return ""
        return (
            f"as a draft, it is the first day tried, and manoeuvres to add were searched for {DRAFT_SEARCHES} "
            f"time at most, from {DRAFT_POOL} candidates of every family, and no transitions between runs were "
            "tried; the whole job searches more, and finds a day that is shorter or tells more"
        )
