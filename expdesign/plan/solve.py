"""The planner: place the runs, sail them, verify the plan, try it with drawn ships; with more room where those fail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.errors import NoPlan
from expdesign.plan.assembly import leg_water, search_space, with_transitions
from expdesign.plan.bounds import reposition_bound_s
from expdesign.plan.legs import LegWater
from expdesign.plan.local_planner import local_planner
from expdesign.plan.monte_carlo import Trials, broken_promise, leaves_too_often, promised, trials_for, worst_leg
from expdesign.plan.problem import PlanProblem
from expdesign.plan.sailing import PlanRoom, sail_all
from expdesign.plan.search import LatticePlan, build_lattice, search_lattice
from expdesign.plan.values import Leg, Plan, Progress, Promise, SailedTrial, Verification
from expdesign.plan.verify import realised_efficiencies, verify_plan
from expdesign.plan.work_budget import WorkBudget

TRIALS_STREAM = 1
"""Random stream of the drawn trials, apart from other draws of the same seed."""
REPLANS = 2
"""Plans made anew before giving up, each with more room where trials of the one before leave the water."""
WIDER = 1.4
"""Factor on a run's room then; legs get the same share of a hull length more clearance."""
REPLAN_BUDGETS = 2.0
"""Time budgets of counted work within which a plan made anew must be expected to end."""


def plan_trial(problem: PlanProblem, *, progress: Progress = lambda what, share: None) -> Plan:
    """One continuous, verified trial from start to goal with every run the design asks for.

    Raises:
        NoPlan: no path, no room, or no dynamically feasible leg; the message names what and where.
    """
    progress("measuring the water", 0.0)
    stated = leg_water(problem)
    room, budget = _room(problem, stated, progress), WorkBudget(most_s=REPLAN_BUDGETS * problem.settings.time_budget_s)
    for attempt in range(REPLANS + 1):
        before_s = budget.spent_s
        sailed = sail_all(problem, room, progress, stated=stated, budget=budget)
        progress("verifying", 0.85)
        verification = _verified(problem, stated, sailed)
        progress("sailing drawn trials", 0.9)
        promise, trials = _drawn_trials(problem, stated, sailed, attempt=attempt)
        broken = broken_promise(promise, trials, sailed.legs, problem.area, confidence=problem.settings.confidence)
        if not broken:
            return _finished(problem, stated, sailed, verification=verification, promise=promise)
        budget.sailed(int(trials.samples.max(axis=1).sum()))
        _check_worth_replanning(problem, promise, broken, budget, attempt=attempt, before_s=before_s)
        room = _wider(problem, room, trials, sailed.legs, broken)
        progress = _replanning(progress)
    raise AssertionError("the last plan is returned or refused")


def lattice_reference(problem: PlanProblem, *, spacing_m: float, suboptimality: float = 0.02) -> LatticePlan:
    """The same runs on a state lattice, for comparison: its costs are seconds of repositioning at transit speed.

    Changes of speed and the current are left out there, which favours the lattice.

    Raises:
        NoPlan: the lattice is too coarse for the water, or there is no path.
    """
    water = leg_water(problem)
    space = search_space(problem, water, local_planner(water, problem.used))
    counts = [problem.repeats[item.name] for item in space.footprints]
    lattice = build_lattice(space, counts, problem.start, spacing_m=spacing_m)
    return search_lattice(lattice, suboptimality=suboptimality)


def _room(problem: PlanProblem, water: LegWater, progress: Progress) -> PlanRoom:
    """The water and the search space of the first plan."""
    planner = local_planner(water, problem.used)
    planner.check_ends(problem.start, problem.goal, water)
    space = search_space(problem, water, planner)
    return PlanRoom(water=water, space=with_transitions(problem, water, space, progress))


def _verified(problem: PlanProblem, water: LegWater, sailed: SailedTrial) -> Verification:
    """The independent check of a plan; NoPlan where it fails."""
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
    )
    if not verification.verified:
        raise NoPlan("the plan found does not pass its own verification: " + "; ".join(verification.problems))
    return verification


def _drawn_trials(
    problem: PlanProblem, water: LegWater, sailed: SailedTrial, *, attempt: int
) -> tuple[Promise, Trials]:
    """Outcomes of drawn trials. Uses random streams independent of planning and of earlier attempts."""
    rng = np.random.default_rng((problem.seed, TRIALS_STREAM, attempt))
    return promised(water, sailed, rng=rng, draws=trials_for(problem.settings.confidence))


def _check_worth_replanning(
    problem: PlanProblem, promise: Promise, broken: str, budget: WorkBudget, *, attempt: int, before_s: float
) -> None:
    """Raise NoPlan where more room would not help, or where there is no budget left to try."""
    leaving = leaves_too_often(promise, problem.settings.confidence)
    expected_s = budget.spent_s + (budget.spent_s - before_s)
    if attempt == REPLANS or not leaving or expected_s > budget.most_s:
        more = "; more plan.clearance_m helps" if leaving else ""
        raise NoPlan(f"the plan found does not keep its promise: {broken}{more}")


def _wider(problem: PlanProblem, room: PlanRoom, trials: Trials, legs: tuple[Leg, ...], broken: str) -> PlanRoom:
    """More room where trials leave the water most: for that run, or for all legs.

    Raises:
        NoPlan: with more room there is no path at all.
    """
    worst, space = legs[worst_leg(trials)], room.space
    if worst.kind == "primitive":
        widened = tuple(
            replace(run, room_m=WIDER * run.room_m) if run.name == worst.name else run for run in space.footprints
        )
        return replace(room, space=replace(space, footprints=widened))
    water = replace(room.water, clearance_m=room.water.clearance_m + (WIDER - 1.0) * problem.vessel.length_m)
    try:
        found = search_space(problem, water, space.planner)
    except NoPlan:
        raise NoPlan(f"{broken}; and there is no path to the goal with more clearance") from None
    return PlanRoom(water=water, space=replace(found, footprints=space.footprints, tried=space.tried))


def _replanning(progress: Progress) -> Progress:
    """Progress of a plan made anew: most of the work is done, however much of it is to be done again."""
    return lambda what, share: progress(f"with more room: {what}", max(share, 0.9))


def _finished(
    problem: PlanProblem, water: LegWater, sailed: SailedTrial, *, verification: Verification, promise: Promise
) -> Plan:
    placed, realised = realised_efficiencies(problem.vessel, problem.design, problem.environment, sailed)
    return Plan(
        area=problem.area,
        commands=sailed.commands,
        trajectory=sailed.trajectory,
        legs=sailed.legs,
        reposition_bound_s=_reposition_bound_s(problem, water),
        leave_water_probability=promise.left,
        leave_water_by_leg=tuple(leg.left for leg in promise.legs),
        design_efficiency_placed=placed,
        design_efficiency_realised=realised,
        verification=verification,
        promise=promise,
    )


def _reposition_bound_s(problem: PlanProblem, water: LegWater) -> float:
    return reposition_bound_s(
        problem.vessel,
        problem.area,
        problem.environment,
        clearance_m=problem.settings.clearance_m,
        primitives=problem.primitives,
        repeats=problem.repeats,
        ends=(problem.start, problem.goal),
        transit_mps=water.ship.transit_speed_mps,
        yaw_rate_radps=water.ship.spot_rate_radps + water.ship.yaw_rate_radps,
    )
