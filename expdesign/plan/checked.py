"""The tests that a plan made has to pass: its verification, and the risk by drawn trials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.errors import NoPlan
from expdesign.plan.legs import LegWater
from expdesign.plan.monte_carlo import (
    Trials,
    estimate_risk,
    failed_chance_constraint,
    sail_trials,
    shares_allowed,
    trials_needed,
    worst_leg,
)
from expdesign.plan.values import PlanProblem, RiskEstimate, SailedTrial, Verification, WorkBudget
from expdesign.plan.verify import verify_plan
from expdesign.progress import Progress, silent
from expdesign.values import Array

# share of the limits below which failures in the rest of a refused plan must be for a plan without its worst run to be
# made
PROMISE = 0.8
TRIALS_STREAM = 1  # random stream of the drawn trials, apart from other draws of the same seed
# random stream, and number, of the trials whose time decides which of several days is expected to be the shortest
LATENESS_STREAM, LATENESS_TRIALS = 2, 60
# trials that show early that too many fail, and the share of the plans at their limits that these trials leave; they
# sail side by side, so that 20 take more than half the time of 100 and let through plans of which a fifth is aborted
FEW_TRIALS, GIVEN_UP_RARELY = 100, 0.95


@dataclass(frozen=True, kw_only=True, eq=False)
class Refused:
    """A plan that is too risky."""

    sailed: SailedTrial  # commands, motion and legs
    # risk, trials: by drawn trials
    risk: RiskEstimate
    trials: Trials
    failed: str  # why it is refused
    water: LegWater  # that legs of it keep to
    spent_s: float  # counted work that it took

    @property
    def place(self) -> Array | None:
        """(2,) where most trials left allowed water, or None where none did."""
        places = self.trials.place[worst_leg(self.trials)]
        left = ~np.isnan(places[:, 0])
        return np.median(places[left], axis=0) if left.any() else None

    @property
    def worst(self) -> str:
        """The run that, with the leg to it, leaves the water or is aborted in most trials."""
        failing = (self.trials.left | self.trials.aborted).mean(axis=1)
        return self.sailed.legs[int(failing.argmax())].name

    def promises(self, name: str, confidence: float) -> bool:
        """Whether a plan without the runs of a name should be acceptable, by what failed in the rest of this one.

        Some margin is asked for: runs placed anew fail in other places.
        """
        left, aborted = self.trials.shares([leg.name != name for leg in self.sailed.legs])
        return shares_allowed((left / PROMISE, aborted / PROMISE), confidence)


def verified(problem: PlanProblem, water: LegWater, sailed: SailedTrial) -> Verification:
    """The independent check of a plan.

    Raises:
        NoPlan: it does not pass.
    """
    verification = verify_plan(
        problem.vessel,
        problem.area,
        problem.environment,
        sailed,
        clearance_m=problem.settings.clearance_m,
        transit_mps=water.ship.transit_speed_mps,
        primitives={item.name: item for item in problem.primitives},
        repeats=problem.repeats,
        start=problem.start,
        goal=problem.goal,
        under_way=problem.under_way,
    )
    if not verification.passed:
        error = NoPlan(
            "the plan found does not pass its own verification: " + "; ".join(verification.problems),
            what="verification",
        )
        error.poses = sailed.trajectory.pose
        raise error
    return verification


def drawn_risk(
    problem: PlanProblem, water: LegWater, sailed: SailedTrial, *, attempt: int = 0, progress: Progress = silent
) -> tuple[RiskEstimate, Trials]:
    """The risk of the plan of some attempt; random streams are independent of planning and of other attempts."""
    rng = np.random.default_rng((problem.seed, TRIALS_STREAM, attempt))
    settings = problem.settings
    draws = trials_needed(settings.confidence)
    return estimate_risk(water, sailed, rng=rng, draws=draws, aborted_most=settings.aborted_most, progress=progress)


def drawn_lateness_s(problem: PlanProblem, water: LegWater, sailed: SailedTrial) -> Array:
    """(legs,) mean time that drawn trials take on each leg beyond the plan, go-arounds included [s].

    Fewer trials than of a plan's risk, from a stream of their own: enough to compare days by their expected time.
    """
    rng = np.random.default_rng((problem.seed, LATENESS_STREAM))
    trials = sail_trials(water, sailed, draws=LATENESS_TRIALS, rng=rng)
    done = trials.completed
    if not done.any():
        return np.full(len(sailed.legs), np.inf)
    return np.asarray(problem.vessel.sample_time_s * trials.samples[:, done].mean(axis=1) - sailed.legs_s)


def accepted(problem: PlanProblem, water: LegWater, sailed: SailedTrial, *, budget: WorkBudget) -> bool:
    """Whether drawn trials accept a first plan; their work is counted."""
    risk, trials = drawn_risk(problem, water, sailed)
    budget.sailed(trials.samples_sailed)
    confidence = problem.settings.confidence
    return not failed_chance_constraint(risk, trials, sailed.legs, problem.area, confidence=confidence)


def promising(problem: PlanProblem, water: LegWater, sailed: SailedTrial, *, budget: WorkBudget) -> bool:
    """Whether it is likelier than not that drawn trials would accept a plan, by few of them; their work is counted."""
    rng = np.random.default_rng((problem.seed, TRIALS_STREAM))
    trials = sail_trials(water, sailed, draws=LATENESS_TRIALS, rng=rng)
    budget.sailed(trials.samples_sailed)
    return shares_allowed(trials.shares(), problem.settings.confidence)


def may_be_verified(problem: PlanProblem, water: LegWater, sailed: SailedTrial) -> bool:
    """Whether drawn trials may yet call a plan verified: few of them do not show that too many fail.

    A plan at its limits is given up in about one case of twenty.
    """
    rng, settings = np.random.default_rng((problem.seed, TRIALS_STREAM)), problem.settings
    trials = sail_trials(water, sailed, draws=FEW_TRIALS, rng=rng)
    most = scipy.stats.binom.ppf(GIVEN_UP_RARELY, FEW_TRIALS, [1.0 - settings.confidence, settings.aborted_most])
    failed = [int(some.any(axis=0).sum()) for some in (trials.left, trials.aborted)]
    return bool((np.array(failed) <= most).all())
