"""Remedies where no leg leads on, drawn trials fail, or the verification does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, islice
from typing import Any

from expdesign.errors import NoPlan
from expdesign.plan.checked import accepted, verified
from expdesign.plan.problem import PlanProblem
from expdesign.plan.remedies.changes import (
    ACCEPTED,
    SAILED,
    VERIFIED,
    Change,
    Tell,
    exclusions,
    first_sailed,
    first_that_passes,
    of_setting,
)
from expdesign.plan.tuning import PLAN


def for_sailing(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """Less clearance, or a design without the run that no leg led to, with which every run is sailed."""
    asked = problem.settings.clearance_m
    halves = [float(f"{share * asked:.2g}") for share in PLAN.sailed_shares] if asked > 0 else []
    changes = [of_setting(problem, "clearance_m", value) for value in halves]
    names = {refused.which} - {"", "goal"}
    tries = chain(changes[:1], exclusions(problem, names) if names else (), changes[1:])
    yield from first_that_passes(
        tries, lambda other: first_sailed(other) is not None, SAILED, tell=tell, most=PLAN.most_plans
    )


def for_risk(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """A better forecast, a lower confidence, or a design without the worst run, that drawn trials accept.

    Each is planned anew before it is named, as it changes the room of runs. A forecast with which the refused plan is
    too risky as well is not: its runs had more room. All plans together are no more than a trial that is planned may
    take, or one more.
    """

    def passes(other: PlanProblem) -> bool:
        made = first_sailed(other)
        return made is not None and accepted(other, *made)

    names = {refused.which} - {"", "goal"}
    more = "the planner has tried more room" if len(refused.tried) > 1 else ""
    forecasts = (_hopeful(change, refused, tell) for change in _forecasts(problem))
    lower = () if refused.confidence is None else (of_setting(problem, "confidence", refused.confidence),)
    tries = chain(islice(forecasts, 1), lower, exclusions(problem, names) if names else (), forecasts)
    most = max(1, PLAN.replans + 1 - max(1, len(refused.tried)))
    yield from first_that_passes(tries, passes, ACCEPTED, more, tell=tell, most=most)


def _hopeful(change: Change, refused: NoPlan, tell: Tell) -> Change:
    """The change, without a problem where drawn trials refuse the refused plan in that forecast, too."""
    if refused.plan is None or change.problem is None:
        return change
    tell(change.words)
    water, sailed = refused.plan
    water = replace(water, environment=change.problem.environment)
    return change if accepted(change.problem, water, sailed) else replace(change, problem=None)


def _forecasts(problem: PlanProblem) -> Iterator[Change]:
    """Current and wind known twice as well, as far as they are uncertain."""
    for key, name in (("current_to", "current_std_mps"), ("wind_to", "wind_std_mps")):
        std_mps = float(f"{getattr(problem.environment, name) / 2:.3g}")
        if std_mps > 0:
            better: dict[str, Any] = {name: std_mps}
            words = f"environment.{key}.std_mps = {std_mps:g} (a better forecast)"
            yield Change(words=words, problem=replace(problem, environment=replace(problem.environment, **better)))


def for_verification(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """Another seed, whose plan passes."""

    def passes(other: PlanProblem) -> bool:
        made = first_sailed(other)
        try:
            return made is not None and verified(other, *made).passed
        except NoPlan:
            return False

    seeds = range(problem.seed + 1, problem.seed + 1 + PLAN.most_plans)
    changes = (Change(words=f"--seed {seed}", problem=replace(problem, seed=seed)) for seed in seeds)
    yield from first_that_passes(changes, passes, VERIFIED, tell=tell, most=PLAN.most_plans)
