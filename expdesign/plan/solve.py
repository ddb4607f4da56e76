"""The planner: place the runs, sail them, verify the plan, estimate its risk.

A plan that drawn trials leave is made anew with more room, and refused when that does not help.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any, TypeVar

import numpy as np

from expdesign.errors import NoPlan, NoRoom
from expdesign.memory import in_order
from expdesign.plan.assembly import (
    PlanRoom,
    check_connected,
    check_start,
    confidence_of_run,
    dispersions,
    footprints,
    phases_of,
    search_space,
    ship_on_legs,
    top_mps,
    waters,
)
from expdesign.plan.bounds import reposition_bound_s
from expdesign.plan.chart import reachable
from expdesign.plan.checked import Refused, drawn_risk, verified
from expdesign.plan.control import Capability
from expdesign.plan.drafts import Draft, budget_of, drafted
from expdesign.plan.legs import LegWater
from expdesign.plan.monte_carlo import (
    Trials,
    failed_chance_constraint,
    trials_needed,
    violates_chance_constraint,
    worst_leg,
)
from expdesign.plan.remedies import REPLANS, advised
from expdesign.plan.runs import draws_for
from expdesign.plan.sailing import sail_all
from expdesign.plan.values import Leg, Plan, PlanProblem, RiskEstimate, SailedTrial, Verification, WorkBudget
from expdesign.plan.verify import realised_efficiencies
from expdesign.progress import Progress, never_falling, silent
from expdesign.sea_area import SeaArea

LEAST_CONFIDENCE = 0.5  # below which none is named as a remedy
WIDENING = 1.4  # factor on a run's room then; legs get the same share of a hull length more clearance


def worth_replanning(
    problem: PlanProblem, risk: RiskEstimate, budget: WorkBudget, *, attempt: int, before_s: float
) -> bool:
    """Whether more room may help: once anyway, again where the budget is expected to be enough."""
    leaving = violates_chance_constraint(risk, problem.settings.confidence)
    expected_s = budget.spent_s + (budget.spent_s - before_s)
    return leaving and attempt < REPLANS and (attempt == 0 or expected_s <= budget.most_s)


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
        return _wider(room, worst.name)
    clearance_m = room.water.clearance_m + (WIDENING - 1.0) * problem.vessel.length_m
    water = replace(room.water, clearance_m=clearance_m)
    try:
        found = search_space(problem, water, space.planner)
    except NoPlan:
        raise NoPlan("there is no path to the goal with more clearance") from None
    return PlanRoom(water=water, space=replace(found, footprints=space.footprints, tried=space.tried))


def _wider(room: PlanRoom, name: str) -> PlanRoom:
    """More room for the runs of a name."""
    runs = room.space.footprints
    widened = tuple(replace(run, room_m=WIDENING * run.room_m) if run.name == name else run for run in runs)
    return replace(room, space=replace(room.space, footprints=widened))


def replanning_progress(progress: Progress, attempt: int) -> Progress:
    """Progress of a replan, which drawn trials may refuse once more."""
    which = f"plan {attempt + 1} of at most {REPLANS + 1}, with more room"
    return lambda activity, share: progress(f"{which}: {activity}", math.nan)


# share of the distance that the plan's time allows at top speed, beyond start and goal, from which a plan cannot return
# in that time; half, and some for speeds that legs begin and end with
BOUND_REACH = 0.6


Planned = TypeVar("Planned")


def plan_trial(problem: PlanProblem, *, advise: bool = True, progress: Progress = silent) -> Plan:
    """One continuous, verified trial from start to goal with every run the design asks for.

    Args:
        advise: whether a refusal tries which changes help, which takes as long as several plans.

    Raises:
        NoPlan: no path, no room, or no dynamically feasible leg; the message names what, where, and which change of
            one key helps, if one of those tried does.
    """
    try:
        return _in_water(problem, never_falling(progress), _planned)
    except NoPlan as error:
        raise with_advice(problem, error, progress) if advise else error from None


def plan_drafted(problem: PlanProblem, draft: Draft, *, progress: Progress = silent) -> Plan:
    """The plan of a draft. Its refusal comes without advice, as another draft may do.

    Raises:
        NoPlan: as of `plan_trial`.
    """
    try:
        return _checked(problem, draft, never_falling(progress))
    except NoPlan as error:
        error.within = draft.area
        raise


def with_advice(problem: PlanProblem, refused: NoPlan, progress: Progress = silent) -> NoPlan:
    """A refusal with which change of one key helps, in the water that was planned in."""
    return advised(replace(problem, area=refused.within or problem.area), refused, progress)


def _in_water(
    problem: PlanProblem,
    progress: Progress,
    planned: Callable[[PlanProblem, SeaArea, Capability, Progress], Planned],
    like: Draft | None = None,
) -> Planned:
    """What is planned in the smallest part of the water that has room, that of a like trial before all others."""
    check_connected(problem)
    draws_for(confidence_of_run(problem))
    ship, refused = ship_on_legs(problem), NoRoom("the chart has no water")
    check_start(problem, ship)
    for area in chain([] if like is None else [like.area], waters(problem, ship)):
        try:
            return planned(problem, area, ship, progress)
        except NoPlan as error:
            error.within = area
            if not isinstance(error, NoRoom):
                raise
            refused = error
    raise refused


def _planned(whole: PlanProblem, area: SeaArea, ship: Capability, progress: Progress) -> Plan:
    """The trial planned in a part of the water, checked with all of it."""
    return _checked(whole, drafted(whole, area, ship, progress), progress)


def _checked(whole: PlanProblem, draft: Draft, progress: Progress) -> Plan:
    """A draft's plan, verified with all of the water; made anew with more room where drawn trials leave it.

    Where too many are aborted, it is made anew once, and the plan with fewer of these is taken.
    """
    problem, water, room = replace(whole, area=draft.area), draft.water, draft.room
    if problem.settings.draft:
        phases_of(problem, room.space.planner, progress).trials("verifying", 0.0)
        return _plan(whole, draft.sailed, verification=verified(whole, water, draft.sailed), bound_s=0.0)
    confidence = problem.settings.confidence
    budget = budget_of(problem)
    sailed, before_s, budget.spent_s, reported = draft.sailed, 0.0, draft.spent_s, progress
    made = list[Refused]()
    for attempt in range(REPLANS + 1):
        if attempt:
            before_s, reported = budget.spent_s, replanning_progress(progress, attempt)
            try:
                sailed = sail_all(problem, room, reported, stated=water, budget=budget)
            except NoPlan as error:
                raise not_again(error, made) from None
        checking = phases_of(problem, room.space.planner, reported).trials
        checking("verifying", 0.0)
        checks = in_order(_check, (whole, water, sailed), ((verified,), (_bound_s,)))
        risk, trials = drawn_risk(problem, water, sailed, attempt=attempt, progress=checking)
        verification = next(checks)
        failed = failed_chance_constraint(risk, trials, sailed.legs, problem.area, confidence=confidence)
        if not failed:
            plan = _plan(whole, sailed, verification=verification, risk=risk, bound_s=next(checks))
            other = None if attempt or not risk.note else _begun_by_more(whole, draft, trials, budget, progress)
            return plan if other is None or _aborted(other) >= _aborted(plan) else other
        budget.sailed(trials.samples_sailed)
        spent_s = budget.spent_s - before_s
        made.append(Refused(sailed=sailed, risk=risk, trials=trials, failed=failed, water=room.water, spent_s=spent_s))
        if not worth_replanning(problem, risk, budget, attempt=attempt, before_s=before_s):
            break
        try:
            room = with_more_room(problem, room, trials, sailed.legs)
        except NoPlan as error:
            raise too_risky(problem, draft.room, made, f"; {error.obstacle}") from None
    raise too_risky(problem, draft.room, made)


def _begun_by_more(
    whole: PlanProblem, draft: Draft, trials: Trials, budget: WorkBudget, progress: Progress
) -> Plan | None:
    """A draft's plan made anew with more room for the run before which most trials are aborted, or None.

    The more room a run has, the farther from its planned start it may begin.
    """
    worst = draft.sailed.legs[int(trials.aborted.mean(axis=1).argmax())].name
    if worst not in whole.repeats:  # the goal
        return None
    problem, water, reported = replace(whole, area=draft.area), draft.water, replanning_progress(progress, 1)
    budget.sailed(trials.samples_sailed)
    try:
        sailed = sail_all(problem, _wider(draft.room, worst), reported, stated=water, budget=budget)
        verification = verified(whole, water, sailed)
    except NoPlan:
        return None
    risk, again = drawn_risk(problem, water, sailed, attempt=1, progress=reported)
    if failed_chance_constraint(risk, again, sailed.legs, problem.area, confidence=problem.settings.confidence):
        return None
    return _plan(whole, sailed, verification=verification, risk=risk, bound_s=_bound_s(whole, water, sailed))


def _aborted(plan: Plan) -> float:
    """Share of drawn trials that are aborted; none where none were drawn."""
    return 0.0 if plan.risk is None else plan.risk.aborted


def draft_trial(problem: PlanProblem, *, like: Draft | None = None, progress: Progress = silent) -> Draft:
    """The trial of `plan_trial` without the checks, for comparing trials.

    Args:
        like: another trial between the same places; its water is tried first, and transitions that were tried for it
            are not tried again.

    Raises:
        NoPlan: no path, no room, or no dynamically feasible leg.
    """
    return _in_water(problem, never_falling(progress), partial(drafted, like=like), like)


def _check(problem: PlanProblem, water: LegWater, sailed: SailedTrial, check: Callable[..., Any]) -> Any:
    return check(problem, water, sailed)


def _bound_s(problem: PlanProblem, water: LegWater, sailed: SailedTrial) -> float:
    """Least repositioning time of any plan of the problem's runs."""
    ship, ends_s = water.ship, float(sailed.trajectory.time_s[-1])
    # plans that lead farther take longer than this one
    area = reachable(problem.area, problem.ends, BOUND_REACH * top_mps(problem, ship) * ends_s)
    return reposition_bound_s(
        problem.vessel,
        area,
        problem.environment,
        clearance_m=problem.settings.clearance_m,
        primitives=problem.primitives,
        repeats=problem.repeats,
        ends=(problem.start, problem.goal),
        under_way=problem.under_way,
        transit_mps=ship.transit_speed_mps,
        yaw_rate_radps=ship.spot_rate_radps + ship.yaw_rate_radps,
    )


def _plan(
    problem: PlanProblem,
    sailed: SailedTrial,
    *,
    verification: Verification,
    bound_s: float,
    risk: RiskEstimate | None = None,
) -> Plan:
    """The plan with its bound and its efficiencies; a draft without risk."""
    placed, realised = realised_efficiencies(problem.vessel, problem.design, problem.environment, sailed)
    return Plan(
        area=problem.area,
        commands=sailed.commands,
        trajectory=sailed.trajectory,
        legs=sailed.legs,
        reposition_bound_s=bound_s,
        leave_water_probability=None if risk is None else risk.left,
        leave_water_by_leg=() if risk is None else tuple(leg.left for leg in risk.legs),
        design_efficiency_placed=placed,
        design_efficiency_realised=realised,
        verification=verification,
        risk=risk,
        lattice=sailed.lattice,
        standing=sailed.standing,
        draft=risk is None,
    )
