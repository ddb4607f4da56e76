"""Remedies where no leg leads on, drawn trials fail, or the verification does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, islice
from typing import Any

from expdesign.errors import NoPlan
from expdesign.plan.checked import Refused, accepted, promising, verified
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
from expdesign.plan.work_budget import WorkBudget


def for_sailing(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """Less clearance, or a design without the run that no leg led to, with which every run is sailed."""
    asked = problem.settings.clearance_m
    halves = [float(f"{share * asked:.2g}") for share in PLAN.sailed_shares] if asked > 0 else []
    changes = [of_setting(problem, "clearance_m", value) for value in halves]
    names = {refused.which} - {"", "goal"}
    tries = chain(changes[:1], exclusions(problem, names) if names else (), changes[1:])
    yield from first_that_passes(
        tries, lambda other: first_sailed(other, WorkBudget()) is not None, SAILED, tell=tell, most=PLAN.most_plans
    )


def for_risk(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """A better forecast, a lower confidence, or a design without the worst run, that drawn trials accept.

    Each is planned anew before it is named, as it changes the room of runs; that is as much work as the refused plan.
    What that plan tells comes first: a forecast in which few drawn trials of it fail as well is not planned in, nor is
    a design without the worst run where too many failed elsewhere. All is counted, and no more is begun than a trial
    that is planned takes.
    """
    first: Refused | None = refused.plan
    plan_s = 0.0 if first is None else first.spent_s
    budget = WorkBudget() if first is None else WorkBudget(most_s=PLAN.remedy_work * plan_s)

    def affords() -> bool:
        return budget.spent_s + plan_s <= budget.most_s

    def passes(other: PlanProblem) -> bool:
        made = first_sailed(other, budget)
        return made is not None and accepted(other, *made, budget=budget)

    def hopeful(change: Change) -> Change:
        """The change, without a problem where few drawn trials refuse the refused plan in its forecast, too."""
        if first is None or change.problem is None or not affords():
            return change
        tell(change.words)
        water = replace(first.water, environment=change.problem.environment)
        likely = promising(change.problem, water, first.sailed, budget=budget)
        return change if likely else replace(change, problem=None)

    def without(names: set[str]) -> Iterator[Change]:
        """The design without the worst run, which is not made for nothing."""
        words = f"design.excluded with {', '.join(names)}: too many drawn trials fail elsewhere"
        if first is not None and not all(first.promises(name, problem.settings.confidence) for name in names):
            yield Change(words=words, problem=None)
        elif affords():
            yield from exclusions(problem, names)
        else:
            yield Change(words=words.partition(":")[0], problem=problem)

    names = {refused.which} - {"", "goal"}
    more = "the planner has tried more room" if len(refused.tried) > 1 else ""
    forecasts = map(hopeful, _forecasts(problem))
    lower = () if refused.confidence is None else (of_setting(problem, "confidence", refused.confidence),)
    tries = chain(islice(forecasts, 1), lower, without(names) if names else (), forecasts)
    most = max(1, PLAN.replans + 1 - max(1, len(refused.tried)))
    yield from first_that_passes(tries, passes, ACCEPTED, more, tell=tell, most=most, affords=affords)


def _forecasts(problem: PlanProblem) -> Iterator[Change]:
    """Current and wind known twice as well, as far as they are uncertain and move the ship."""
    for key, name in (("current_to", "current_std_mps"), ("wind_to", "wind_std_mps")):
        std_mps = float(f"{getattr(problem.environment, name) / 2:.3g}")
        if std_mps > 0 and (key == "current_to" or problem.vessel.model.reads_air):
            better: dict[str, Any] = {name: std_mps}
            words = f"environment.{key}.std_mps = {std_mps:g} (a better forecast)"
            yield Change(words=words, problem=replace(problem, environment=replace(problem.environment, **better)))


def for_verification(problem: PlanProblem, refused: NoPlan, tell: Tell) -> Iterator[str]:
    """Another seed, whose plan passes."""

    def passes(other: PlanProblem) -> bool:
        made = first_sailed(other, WorkBudget())
        try:
            return made is not None and verified(other, *made).passed
        except NoPlan:
            return False

    seeds = range(problem.seed + 1, problem.seed + 1 + PLAN.most_plans)
    changes = (Change(words=f"--seed {seed}", problem=replace(problem, seed=seed)) for seed in seeds)
    yield from first_that_passes(changes, passes, VERIFIED, tell=tell, most=PLAN.most_plans)
