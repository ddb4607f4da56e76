"""Legs along Dubins curves: for vessels that cannot turn on the spot, and where agile legs fail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.plan.control import Capability
from expdesign.plan.legs._ompl import CURVE, DUBINS, dubins_curve, search_dubins
from expdesign.plan.legs.optimise import solve_leg
from expdesign.plan.legs.problem import LegProblem, leg_problem
from expdesign.plan.legs.water import FoundLeg, LegPath, LegTask, LegWater, acceptable, nearest_turns
from expdesign.values import Array
from expdesign.vessel import Vessel, commands_for, required_push

# margins of the boxes searched for Dubins paths round a leg's ends, in turning radii plus hull lengths
SEARCH_BOXES = (4.0, 40.0)


def curved_leg(task: LegTask, water: LegWater) -> FoundLeg | None:
    """Along a Dubins path in safe water, or None when none is found."""
    path = find_path(task, water)
    if path is None:
        return None
    wide = _leg_problem(task, water, path.points)
    for narrowing in (1.0, 0.5, 0.1):
        problem = replace(
            wide,
            room_port_m=narrowing * wide.room_port_m,
            room_starboard_m=narrowing * wide.room_starboard_m,
        )
        values = solve_leg(problem, water)
        if values is not None and acceptable(problem.start, problem.end, water, values, task.past):
            return FoundLeg(commands=values, source=path.source)
    return None


def find_path(task: LegTask, water: LegWater) -> LegPath | None:
    """Poses (k, 3) of a Dubins path whose swept hull stays in safe water, or None."""
    radius, spacing = water.ship.turning_radius_m, water.vessel.length_m / 6
    direct = dubins_curve(task.start[:3], task.end[:3], radius_m=radius, spacing_m=spacing)
    if water.holds(direct):
        return LegPath(points=direct, source=CURVE)
    if not all(water.holds(end) for end in (direct[:1], direct[-1:])):  # then no path does
        return None
    for attempt, reach in enumerate(SEARCH_BOXES):
        task.budget.searched()
        box = reach * (radius + water.vessel.length_m)
        path = search_dubins(
            task.start[:3],
            task.end[:3],
            radius_m=radius,
            spacing_m=2 * spacing,
            low=np.minimum(task.start, task.end)[:2] - box,
            high=np.maximum(task.start, task.end)[:2] + box,
            holds=water.holds,
            seed=task.seed + 7919 * attempt,
        )
        if path is not None and water.holds(path):
            return LegPath(points=path, source=DUBINS)
    return None


def _leg_problem(task: LegTask, water: LegWater, path: Array) -> LegProblem:
    vessel, ship = water.vessel, water.ship
    reference, duration_s = _timed(path, task.start[3], task.end[3], ship, vessel.length_m)
    guess = _guessed_inputs(vessel, reference, task.start_inputs, duration_s)
    guess[-1] = nearest_turns(vessel, task.end_inputs, guess[-1])
    return leg_problem(
        task,
        water,
        end=np.r_[task.end[:2], reference[-1, 2], task.end[3:]],
        states=reference,
        inputs=guess,
        path=reference[:, :3],
        duration_s=duration_s,
        turning_rate_radps=ship.yaw_rate_radps,
    )


def _timed(path: Array, first_mps: float, last_mps: float, ship: Capability, length_m: float) -> tuple[Array, float]:
    """States (j + 1, 6) at even times along a path sailed with trapezoidal speed, and the time it takes."""
    steps = np.hypot(*np.diff(path[:, :2], axis=0).T)
    along = np.r_[0.0, np.cumsum(steps)]
    a, slow = ship.acceleration_mps2, 0.15 * ship.transit_speed_mps
    speed = np.sqrt(np.minimum(max(first_mps, 0.0) ** 2 + 2 * a * along, max(last_mps, 0.0) ** 2 + 2 * a * along[::-1]))
    speed = np.clip(speed, slow, ship.transit_speed_mps)
    time_s = np.r_[0.0, np.cumsum(steps * 2 / (speed[1:] + speed[:-1]))]
    nodes = int(np.clip(np.ceil(along[-1] / (0.7 * length_m)), 24, 160))
    even = np.linspace(0.0, time_s[-1], nodes + 1)
    pose = np.stack([np.interp(even, time_s, column) for column in path.T], axis=1)
    yaw_rate = np.gradient(pose[:, 2], even)
    surge = np.interp(even, time_s, speed)
    return np.column_stack([pose, surge, np.zeros(nodes + 1), yaw_rate]), float(time_s[-1])


def _guessed_inputs(vessel: Vessel, reference: Array, before: Array, duration_s: float) -> Array:
    """Commands (j + 1, m) that would hold each node's speed and turn."""
    push = required_push(vessel.model, reference[1:, 3:], np.zeros(3))
    step_s = duration_s / (len(reference) - 1)
    return np.vstack([before, commands_for(vessel.model, push, sample_time_s=step_s, before=before)])
