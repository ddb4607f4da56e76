"""The promise of a plan: the chance that the hull leaves allowed water in the trial as it is sailed, and where.

It comes from whole trials (`expdesign.plan.drawn_trials`): runs open loop from the states that ships really have, legs
and ways back to run-ups steered, the hull against the chart at every step. Trials broken off because a run could not be
begun are counted apart: they end in allowed water, but they do not end at the goal.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from scipy.stats import beta

from expdesign.plan.area import SeaArea
from expdesign.plan.drawn_trials import Trials, sail_trials
from expdesign.plan.leg_values import LegWater
from expdesign.plan.run_up import MISSED, ROUNDS
from expdesign.plan.values import Leg, LegOutcome, Promise
from expdesign.signals import Commands, Trajectory
from expdesign.values import Array

TRIALS = 200
"""Of a plan that is being made."""
MOST = 0.95
"""Share of trials that `most` is about, and confidence of the upper limit."""


def promised(
    water: LegWater,
    *,
    commands: Commands,
    trajectory: Trajectory,
    legs: Sequence[Leg],
    rng: np.random.Generator,
    draws: int = TRIALS,
) -> tuple[Promise, Trials]:
    """Sail drawn trials of a plan and tell what happened to them.

    The shares' standard errors are sqrt(p (1 - p) / draws).
    """
    trials = sail_trials(water, commands=commands, trajectory=trajectory, legs=legs, draws=draws, rng=rng)
    within, sample_s = trials.within[0], commands.sample_time_s
    gone, done = int(trials.left.any(axis=0).sum()), trials.completed
    extra = (trials.samples.sum(axis=0)[done] - len(commands)) * sample_s
    found = Promise(
        trials=draws,
        left=gone / draws,
        left_most=upper_limit(gone, draws),
        aborted=float(trials.aborted.any(axis=0).mean()),
        reasons=_reasons(legs, trials),
        extra_median_s=float(np.median(extra)) if len(extra) else float("nan"),
        extra_most_s=float(np.quantile(extra, MOST)) if len(extra) else float("nan"),
        rounds=ROUNDS,
        heading_rad=within.heading_rad,
        speed_mps=within.speed_mps,
        yaw_rate_radps=within.yaw_rate_radps,
        legs=tuple(_leg_outcome(trials, index, sample_s) for index in range(len(legs))),
    )
    return found, trials


def upper_limit(count: int, trials: int, *, confidence: float = MOST) -> float:
    """The share that would show `count` cases or fewer among trials with a chance of only 1 - confidence.

    Source: C. J. Clopper and E. S. Pearson, Biometrika 26 (1934), 404-413.
    """
    return 1.0 if count >= trials else float(beta.ppf(confidence, count + 1, trials - count))


def broken_promise(found: Promise, trials: Trials, legs: Sequence[Leg], area: SeaArea, *, confidence: float) -> str:
    """What is wrong with a plan, with the leg and the place where it is worst; "" when it keeps its promise."""
    if found.left > 1.0 - confidence + 1e-12:
        worst = worst_leg(trials)
        lat, lon = area.frame.to_degrees(np.nanmedian(trials.place[worst], axis=0))
        return (
            f"{found.left:.1%} of {found.trials} drawn trials leave allowed water, more than plan.confidence = "
            f"{confidence:g} allows, most of them ({trials.left[worst].mean():.1%}) {described(legs, worst)} near "
            f"{lat:.5f}, {lon:.5f}"
        )
    if not trials.completed.any():
        return f"none of {found.trials} drawn trials comes to the goal: broken off {'; '.join(found.reasons)}"
    return ""


def worst_leg(trials: Trials) -> int:
    """Index of the leg on which most trials leave allowed water."""
    return int(trials.left.mean(axis=1).argmax())


def described(legs: Sequence[Leg], index: int) -> str:
    """In a run or on a leg, which one, counted as on the run cards."""
    number = sum(leg.kind == "primitive" for leg in legs[: index + 1])
    leg = legs[index]
    if leg.kind == "primitive":
        return f"in run {number}, {leg.name!r},"
    return "on the leg to the goal" if index == len(legs) - 1 else f"on the way to run {number + 1}, {leg.name!r},"


def _reasons(legs: Sequence[Leg], trials: Trials) -> tuple[str, ...]:
    """Where trials were broken off, and why."""
    rows = []
    for index, aborted in enumerate(trials.aborted):
        if aborted.any():
            causes = Counter(trials.missed[index][aborted].tolist())
            told = ", ".join(f"{MISSED[cause]} {count / len(aborted):.1%}" for cause, count in causes.most_common())
            rows.append(f"{described(legs, index)} {aborted.mean():.1%} (out of tolerance: {told})")
    return tuple(rows)


def _leg_outcome(trials: Trials, index: int, sample_s: float) -> LegOutcome:
    sailed = trials.samples[index] > 0
    times: Array = trials.samples[index][sailed] * sample_s if sailed.any() else np.zeros(1)
    return LegOutcome(
        position_m=trials.within[index].position_m,
        left=float(trials.left[index].mean()),
        aborted=float(trials.aborted[index].mean()),
        rounds=float(trials.rounds[index][sailed].mean()) if sailed.any() else 0.0,
        median_s=float(np.median(times)),
        most_s=float(np.quantile(times, MOST)),
    )
