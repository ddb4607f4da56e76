"""The continuous planner: prepare, sail, verify, try with drawn ships; with more room where they leave the water."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.errors import NoPlan
from expdesign.plan.assembly import leg_water, search_space, with_joints
from expdesign.plan.bounds import reposition_bound_s
from expdesign.plan.legs import LegWater, check_ends
from expdesign.plan.monte_carlo import Trials, broken_promise, leaves_too_often, promised, trials_for, worst_leg
from expdesign.plan.problem import PlanProblem
from expdesign.plan.sailing import sail_all
from expdesign.plan.search import LatticePlan, SearchSpace, build_lattice, search_lattice
from expdesign.plan.values import Leg, Plan, Progress, Promise, Verification
from expdesign.plan.verify import realised_efficiencies, verify_plan
from expdesign.plan.work_budget import Effort
from expdesign.signals import Commands, Trajectory

SAILED = 1
"""Sets the chance of drawn trials apart from that of other draws of the same seed."""
REPLANS, WIDER = 2, 1.4
"""Plans made anew, with so much more room where trials of the last one leave the water, before giving up."""
ALL = 2.0
"""Time budgets of counted work within which a plan made anew must be expected to end."""


def plan_trial(problem: PlanProblem, *, progress: Progress = lambda what, share: None) -> Plan:
    """One continuous, verified trial from start to goal with every run the design asks for.

    Raises:
        NoPlan: no way, no room, or no dynamically feasible leg; the message names what and where.
    """
    progress("measuring the water", 0.0)
    stated = water = leg_water(problem)
    check_ends(problem.start, problem.goal, water)
    space = with_joints(problem, water, search_space(problem, water), progress)
    told, effort = progress, Effort(most_s=ALL * problem.settings.time_budget_s)
    for replan in range(REPLANS + 1):
        before_s = effort.spent_s
        line = sail_all(problem, water, space, told, stated=stated, effort=effort)
        sailed = line.joined(sample_time_s=problem.vessel.sample_time_s, names=problem.vessel.model.inputs)
        told("verifying", 0.85)
        verification = _verified(problem, stated.ship.transit_speed_mps, *sailed)
        told("sailing drawn trials", 0.9)
        promise, trials = _promised(problem, stated, *sailed, attempt=replan)
        broken = broken_promise(promise, trials, sailed[2], problem.area, confidence=problem.settings.confidence)
        if not broken:
            return _finished(problem, stated, *sailed, verification=verification, promise=promise)
        leaving = leaves_too_often(promise, problem.settings.confidence)
        effort.sailed(int(trials.samples.max(axis=1).sum()))
        again_s = effort.spent_s - before_s
        if replan == REPLANS or not leaving or effort.spent_s + again_s > effort.most_s:
            more = "; more plan.clearance_m helps" if leaving else ""
            raise NoPlan(f"the plan found does not keep its promise: {broken}{more}")
        water, space = _wider(problem, water, space, trials, sailed[2], broken)
        told = _not_back(progress)
    raise AssertionError("the last plan is returned or refused")


def _not_back(progress: Progress) -> Progress:
    """Progress of a plan made anew: most of the work is done, however much of it is to be done again."""
    return lambda what, share: progress(f"with more room: {what}", max(share, 0.9))


def lattice_reference(problem: PlanProblem, *, spacing_m: float, suboptimality: float = 0.02) -> LatticePlan:
    """The same runs on a state lattice, for comparison: its costs are seconds of repositioning at transit speed.

    Changes of speed and the current are left out there, which favours the lattice.

    Raises:
        NoPlan: the lattice is too coarse for the water, or there is no way.
    """
    space = search_space(problem, leg_water(problem))
    counts = [problem.repeats[item.name] for item in space.stamps]
    lattice = build_lattice(space, counts, problem.start, spacing_m=spacing_m)
    return search_lattice(lattice, suboptimality=suboptimality)


def _verified(
    problem: PlanProblem, transit_mps: float, commands: Commands, trajectory: Trajectory, legs: tuple[Leg, ...]
) -> Verification:
    verification = verify_plan(
        problem.vessel,
        problem.area,
        problem.environment,
        commands=commands,
        trajectory=trajectory,
        legs=legs,
        clearance_m=problem.settings.clearance_m,
        transit_mps=transit_mps,
        primitives={item.name: item for item in problem.primitives},
        repeats=problem.repeats,
        start=problem.start,
        goal=problem.goal,
    )
    if not verification.verified:
        raise NoPlan("the plan found does not pass its own verification: " + "; ".join(verification.problems))
    return verification


def _promised(
    problem: PlanProblem,
    water: LegWater,
    commands: Commands,
    trajectory: Trajectory,
    legs: tuple[Leg, ...],
    *,
    attempt: int,
) -> tuple[Promise, Trials]:
    """What the trial as sailed comes to; no ship is the same that runs keep room for, or that an attempt failed for."""
    rng = np.random.default_rng((problem.seed, SAILED, attempt))
    draws = trials_for(problem.settings.confidence)
    return promised(water, commands=commands, trajectory=trajectory, legs=legs, rng=rng, draws=draws)


def _wider(
    problem: PlanProblem,
    water: LegWater,
    space: SearchSpace,
    trials: Trials,
    legs: tuple[Leg, ...],
    broken: str,
) -> tuple[LegWater, SearchSpace]:
    """More room where trials leave the water most: for that run, or for all legs.

    Raises:
        NoPlan: with more room there is no way at all.
    """
    worst = legs[worst_leg(trials)]
    if worst.kind == "primitive":
        stamps = tuple(
            replace(item, room_m=WIDER * item.room_m) if item.name == worst.name else item for item in space.stamps
        )
        return water, replace(space, stamps=stamps)
    wide = replace(water, clearance_m=water.clearance_m + (WIDER - 1.0) * problem.vessel.length_m)
    try:
        found = search_space(problem, wide)
    except NoPlan:
        raise NoPlan(f"{broken}; and there is no way to the goal that keeps farther off") from None
    return wide, replace(found, stamps=space.stamps, tried=space.tried)


def _finished(
    problem: PlanProblem,
    water: LegWater,
    commands: Commands,
    trajectory: Trajectory,
    legs: tuple[Leg, ...],
    *,
    verification: Verification,
    promise: Promise,
) -> Plan:
    sailed = {"commands": commands, "trajectory": trajectory, "legs": legs}
    placed, realised = realised_efficiencies(problem.vessel, problem.design, problem.environment, **sailed)  # type: ignore[arg-type]
    return Plan(
        area=problem.area,
        **sailed,  # type: ignore[arg-type]
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
