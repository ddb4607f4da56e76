"""The risk of a plan: the probability that the hull leaves allowed water, where, and whether it is acceptable.

It is estimated by whole trials (`expdesign.plan.monte_carlo.trials`). Trials aborted because a run could not be begun
count apart: they end in allowed water, but not at the goal. The chance constraint holds where the share that leaves
allowed water plus its standard error is at most 1 - confidence. Besides, most trials must reach the goal.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
import scipy

from expdesign.plan.legs import LegWater
from expdesign.plan.monte_carlo.guidance import GO_AROUNDS
from expdesign.plan.monte_carlo.procedure import ABORT_CAUSES
from expdesign.plan.monte_carlo.trials import Trials, sail_trials
from expdesign.plan.values import Leg, LegOutcome, PlanSettings, RiskEstimate, SailedTrial
from expdesign.progress import Progress, silent
from expdesign.sea_area import SeaArea
from expdesign.signals import Trajectory
from expdesign.values import Array

TRIALS, MOST_TRIALS = 500, 2000  # drawn of a plan at least and at most
EXPECTED_CASES = 2.0  # trials are so many that this number may leave allowed water
UPPER_SHARE = 0.95  # percentile of times that is reported, and confidence of the upper limit of a probability
NO_PLAN_ABORTED = 0.5  # share of aborted trials from which a plan is rejected


REASONS = tuple(
    {"time": "not there in time", "no go-around path": "no go-around path"}.get(cause, f"{cause} out of tolerance")
    for cause in ABORT_CAUSES
)
"""Causes of aborted trials, in words."""


def estimate_risk(
    water: LegWater,
    sailed: SailedTrial,
    *,
    rng: np.random.Generator,
    draws: int = TRIALS,
    aborted_most: float = PlanSettings.aborted_most,
    progress: Progress = silent,
) -> tuple[RiskEstimate, Trials]:
    """Estimate the risk of a plan by drawn trials.

    The shares' standard errors are sqrt(p (1 - p) / draws).
    """
    trials = sail_trials(water, sailed, draws=draws, rng=rng, progress=progress)
    commands, trajectory, legs = sailed.commands, sailed.trajectory, sailed.legs
    within, sample_s = trials.within[0], commands.sample_time_s
    gone, done = int(trials.left.any(axis=0).sum()), trials.completed
    extra = (trials.samples.sum(axis=0)[done] - len(commands)) * sample_s
    found = RiskEstimate(
        trials=draws,
        left=gone / draws,
        left_most=upper_limit(gone, draws),
        aborted=float(trials.aborted.any(axis=0).mean()),
        reasons=_reasons(legs, trials, trajectory, water.area),
        extra_median_s=float(np.median(extra)) if len(extra) else float("nan"),
        extra_most_s=float(np.quantile(extra, UPPER_SHARE)) if len(extra) else float("nan"),
        go_arounds=GO_AROUNDS,
        heading_rad=within.heading_rad,
        yaw_rate_radps=within.yaw_rate_radps,
        legs=tuple(_leg_outcome(trials, index, sample_s) for index in range(len(legs))),
        aborted_most=aborted_most,
    )
    return found, trials


def trials_needed(confidence: float) -> int:
    """How many trials distinguish a share of 1 - confidence from none."""
    needed = np.ceil(EXPECTED_CASES / max(1.0 - confidence, 1e-9))
    return int(np.clip(needed, TRIALS, MOST_TRIALS))


def upper_limit(count: int, trials: int, *, confidence: float = UPPER_SHARE) -> float:
    """Upper confidence limit of a probability of which `count` cases were seen among trials.

    Source: C. J. Clopper and E. S. Pearson, Biometrika 26 (1934), 404-413.
    """
    return 1.0 if count >= trials else float(scipy.special.betaincinv(count + 1, trials - count, confidence))


def failed_chance_constraint(
    found: RiskEstimate, trials: Trials, legs: Sequence[Leg], area: SeaArea, *, confidence: float
) -> str:
    """Why a plan is too risky, with the worst leg and place; "" where it is acceptable."""
    if violates_chance_constraint(found, confidence):
        worst = worst_leg(trials)
        lat, lon = area.frame.to_degrees(np.nanmedian(trials.place[worst], axis=0))
        return (
            f"{found.left:.1%} of {found.trials} drawn trials (standard error {found.error:.1%}) leave allowed water, "
            f"more than plan.confidence = {confidence:g} allows, most of them ({trials.left[worst].mean():.1%}) "
            f"{described(legs, worst)} near {lat:.5f}, {lon:.5f}"
        )
    return "" if found.aborted < NO_PLAN_ABORTED else found.aborted_note


def violates_chance_constraint(found: RiskEstimate, confidence: float) -> bool:
    """Whether the share that leaves allowed water, plus its standard error, exceeds 1 - confidence."""
    return found.left > 0.0 and found.left + found.error > 1.0 - confidence + 1e-12


def shares_allowed(shares: tuple[float, float], confidence: float) -> bool:
    """Whether shares of trials that leave allowed water, and that are aborted, are acceptable if they are exact."""
    left, aborted = shares
    return left <= 1.0 - confidence and aborted < NO_PLAN_ABORTED


def worst_leg(trials: Trials) -> int:
    """Index of the leg on which most trials leave allowed water."""
    return int(trials.left.mean(axis=1).argmax())


def described(legs: Sequence[Leg], index: int) -> str:
    """Which run or leg, numbered as on the run cards."""
    number = sum(leg.kind == "primitive" for leg in legs[: index + 1])
    leg = legs[index]
    if leg.kind == "primitive":
        return f"in run {number}, {leg.name!r},"
    return "on the leg to the goal" if index == len(legs) - 1 else f"on the way to run {number + 1}, {leg.name!r},"


def _reasons(legs: Sequence[Leg], trials: Trials, trajectory: Trajectory, area: SeaArea) -> tuple[str, ...]:
    """Where trials were aborted, and why; most first."""
    rows = []
    for index in np.argsort(-trials.aborted.mean(axis=1), kind="stable").tolist():
        aborted = trials.aborted[index]
        if aborted.any():
            causes = Counter(trials.abort_cause[index][aborted].tolist())
            why = ", ".join(f"{REASONS[cause]} {count / len(aborted):.1%}" for cause, count in causes.most_common())
            lat, lon = area.frame.to_degrees(trajectory.pose[legs[index].last, :2])
            rows.append(f"{described(legs, index)} {aborted.mean():.1%} near {lat:.5f}, {lon:.5f} ({why})")
    return tuple(rows)


def _leg_outcome(trials: Trials, index: int, sample_s: float) -> LegOutcome:
    sailed = trials.samples[index] > 0
    times: Array = trials.samples[index][sailed] * sample_s if sailed.any() else np.zeros(1)
    return LegOutcome(
        position_m=trials.within[index].position_m,
        speed_mps=trials.within[index].speed_mps,
        left=float(trials.left[index].mean()),
        aborted=float(trials.aborted[index].mean()),
        go_arounds=float(trials.go_arounds[index][sailed].mean()) if sailed.any() else 0.0,
        median_s=float(np.median(times)),
        most_s=float(np.quantile(times, UPPER_SHARE)),
    )
