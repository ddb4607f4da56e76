"""A lower bound on the day: by what must be told, and by the way to the goal."""

from __future__ import annotations

import numpy as np

from expdesign.errors import InputError
from expdesign.plan.assembly import ship_on_legs
from expdesign.plan.bounds import Headway, time_to_sail_s
from expdesign.plan.legs import through_water
from expdesign.plan.problem import PlanProblem
from expdesign.plan.values import Plan, SailedTrial
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.bounds.fewest_samples import fewest_samples
from expdesign.shortest_day.bounds.motions import Motions
from expdesign.shortest_day.bounds.tuning import TUNING
from expdesign.shortest_day.bounds.under_way import speed_changes
from expdesign.shortest_day.prices import fewest_runs
from expdesign.shortest_day.values import DayBound
from expdesign.simulation import to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY


def day_bound(problem: PlanProblem, accuracy: Accuracy, plan: Plan | SailedTrial) -> DayBound:
    """A bound for all days whose velocities through water stay within those of the dictionary and of a plan.

    Args:
        problem: gives vessel, weather, water, dictionary and ends.
        accuracy: to be reached; limits on standard deviations bound the way only, as noise that samples share leaves no
            information of single samples to bound.
        plan: a day found; the class of motions holds it.
    """
    seen = _velocities(problem, plan)
    velocities, speed_mps = velocity_limits(seen), float(np.hypot(*seen[:, :2].T).max())
    environment, design = problem.environment, problem.design.problem
    try:
        motions = Motions.within(
            problem.vessel.model,
            design.parameters,
            velocities,
            air_to=environment.wind_to - environment.current_to,
        )
        samples = fewest_samples(accuracy.of_information, motions, mean_subtraction=design.mean_subtraction)
    except InputError:  # inputs without limits, or enough known already: nothing to tell
        samples = None
    second = problem.vessel.sample_time_s
    return DayBound(
        information_s=samples.least * second if samples else 0.0,
        searched_s=samples.estimate * second if samples else 0.0,
        way_s=_from_rest_to_rest_s(problem, velocities, speed_mps),
        required_s=float(fewest_runs(problem) @ design.run_s),
        velocities=velocities,
        speed_mps=speed_mps,
    )


def _velocities(problem: PlanProblem, plan: Plan | SailedTrial) -> Array:
    """(k, 3) velocities through water of all runs and of a plan."""
    heading_rad, ground = plan.trajectory.pose[:, 2], plan.trajectory.velocity
    current = to_body(problem.environment.current_to, heading_rad, NUMPY)
    water = ground - np.stack([*current, np.zeros(len(ground))], axis=1)
    return np.concatenate([water, *(item.trajectory.velocity for item in problem.primitives)])


def velocity_limits(seen: Array) -> Array:
    """(3, 2) least and largest of velocities (k, 3); sway and yaw to both sides alike, as a ship is."""
    u, most = seen[:, 0], np.abs(seen).max(axis=0)
    return np.array([[u.min(), u.max()], [-most[1], most[1]], [-most[2], most[2]]])


def fastest_mps(problem: PlanProblem) -> float:
    """Largest speed through water of legs, of the runs of the dictionary, and at the start."""
    begin = through_water(problem.environment, problem.begin)[None]
    runs = np.concatenate([begin, *(item.trajectory.velocity for item in problem.primitives)])
    return max(ship_on_legs(problem).transit_speed_mps, float(np.hypot(*runs[:, :2].T).max()))


def _from_rest_to_rest_s(problem: PlanProblem, velocities: Array, speed_mps: float) -> float:
    """`way_bound_s`, and the time to gain speed and to stop, by the nominal model; without a mean current only.

    Boxes are halved for a closer bound only where that time matters.
    """
    way_s, environment = way_bound_s(problem, speed_mps), problem.environment
    if problem.current_mps > 0:
        return way_s
    model, begin_mps = problem.vessel.model, float(np.hypot(*through_water(environment, problem.begin)[:2]))
    try:
        motions = Motions.within(model, model.names, velocities, air_to=environment.wind_to)
    except InputError:  # inputs without limits
        return way_s
    found_s = way_s
    for rounds in (0, TUNING.speed_rounds):
        changes = speed_changes(motions, speed_mps, rounds=rounds)
        if changes is not None:
            found_s = max(found_s, changes.least_s(way_s * speed_mps, begin_mps))
        if found_s < (1 + TUNING.slow_start) * way_s:
            break
    return found_s


def way_bound_s(problem: PlanProblem, speed_mps: float) -> float:
    """Least time of the way to the goal in safe water at a speed through it; 0 where the current is faster."""
    if speed_mps <= problem.current_mps:
        return 0.0
    headway = Headway(speed_mps=speed_mps, current_to=problem.environment.current_to)
    vessel, ends = problem.vessel, (problem.start, problem.goal)
    margin_m = problem.settings.clearance_m + vessel.beam_m / 2
    return max(0.0, time_to_sail_s(problem.area, margin_m, {}, {}, ends, headway, vessel.length_m / 30))
