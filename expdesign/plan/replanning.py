"""Replanning: when a plan that drawn trials leave is made anew, with how much room, and the refusal otherwise."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from expdesign.errors import NoPlan
from expdesign.plan.assembly import (
    PlanRoom,
    dispersions,
    footprints,
    search_space,
)
from expdesign.plan.checked import Refused
from expdesign.plan.monte_carlo import (
    Trials,
    failed_chance_constraint,
    trials_needed,
    violates_chance_constraint,
    worst_leg,
)
from expdesign.plan.problem import PlanProblem
from expdesign.plan.tuning import PLAN
from expdesign.plan.values import Leg, RiskEstimate
from expdesign.plan.work_budget import WorkBudget
from expdesign.progress import Progress

LEAST_CONFIDENCE = 0.5  # below which none is named as a remedy
WIDENING = 1.4  # factor on a run's room then; legs get the same share of a hull length more clearance


def worth_replanning(
    problem: PlanProblem, risk: RiskEstimate, budget: WorkBudget, *, attempt: int, before_s: float
) -> bool:
    """Whether more room may help: once anyway, again where the budget is expected to be enough."""
    leaving = violates_chance_constraint(risk, problem.settings.confidence)
    expected_s = budget.spent_s + (budget.spent_s - before_s)
    return leaving and attempt < PLAN.replans and (attempt == 0 or expected_s <= budget.most_s)


def too_risky(problem: PlanProblem, first: PlanRoom, made: list[Refused], more: str = "") -> NoPlan:
    """The refusal of plans of which too many drawn trials fail, with the confidence that accepts the first of them."""
    best = min(made, key=lambda plan: plan.risk.left)
    again = f"; planned {len(made)} times, each with more room than before" if len(made) > 1 else ""
    error = NoPlan(f"the plan found is too risky: {best.failed}{again}{more}", place=best.place)
    error.tried = tuple(f"plan {number}: {plan.failed}" for number, plan in enumerate(made, start=1))
    error.poses = best.sailed.trajectory.pose
    lower = _met(problem, made[0].risk)
    if lower is not None and _accepts(problem, first, made[0], lower):
        error.remedies = (f"with plan.confidence = {lower:g} the first plan is made once more, and accepted",)
        return error
    error.what, error.which, error.confidence = "risk", best.worst, lower
    error.plan = made[0]
    return error


def _met(problem: PlanProblem, risk: RiskEstimate) -> float | None:
    """The lower confidence that a plan would meet; None where aborted trials are the reason, or far too many leave."""
    lower = float(np.floor(1000.0 * (1.0 - risk.left - risk.error)) / 1000.0)
    return lower if LEAST_CONFIDENCE <= lower < problem.settings.confidence else None


def _accepts(problem: PlanProblem, first: PlanRoom, plan: Refused, confidence: float) -> bool:
    """Whether the planner makes the first plan once more with a lower confidence, and accepts it."""
    if trials_needed(confidence) != trials_needed(problem.settings.confidence):
        return False
    if failed_chance_constraint(plan.risk, plan.trials, plan.sailed.legs, problem.area, confidence=confidence):
        return False
    changed = replace(problem, settings=replace(problem.settings, confidence=confidence))
    runs = footprints(changed, first.space.field, dispersions(changed))
    return all(np.array_equal(a.room_m, b.room_m) for a, b in zip(runs, first.space.footprints, strict=True))


def not_again(error: NoPlan, made: list[Refused]) -> NoPlan:
    """Where a plan with more room fails: what was wrong with the one before comes first."""
    if made:
        error.obstacle = f"the plan found is too risky: {made[0].failed}; made anew with more room: {error.obstacle}"
        error.tried = tuple(f"plan {number}: {plan.failed}" for number, plan in enumerate(made, start=1))
        error.poses = made[0].sailed.trajectory.pose if error.poses is None else error.poses
        if error.place is None and (place := made[0].place) is not None:
            error.place = float(place[0]), float(place[1])
    return error


def with_more_room(problem: PlanProblem, room: PlanRoom, trials: Trials, legs: tuple[Leg, ...]) -> PlanRoom:
    """More room where most trials leave the water: for that run, or for all legs.

    Raises:
        NoPlan: with more room there is no path at all.
    """
    worst, space = legs[worst_leg(trials)], room.space
    if worst.kind == "primitive":
        widened = tuple(
            replace(run, room_m=WIDENING * run.room_m) if run.name == worst.name else run for run in space.footprints
        )
        return replace(room, space=replace(space, footprints=widened))
    clearance_m = room.water.clearance_m + (WIDENING - 1.0) * problem.vessel.length_m
    water = replace(room.water, clearance_m=clearance_m)
    try:
        found = search_space(problem, water, space.planner)
    except NoPlan:
        raise NoPlan("there is no path to the goal with more clearance") from None
    return PlanRoom(water=water, space=replace(found, footprints=space.footprints, tried=space.tried))


def replanning_progress(progress: Progress, attempt: int) -> Progress:
    """Progress of a replan, which drawn trials may refuse once more."""
    which = f"plan {attempt + 1} of at most {PLAN.replans + 1}, with more room"
    return lambda activity, share: progress(f"{which}: {activity}", math.nan)
