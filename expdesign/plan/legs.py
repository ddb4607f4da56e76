"""Repositioning legs: a Dubins path for the centre line, then commands that the vessel model follows."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from expdesign.plan._casadi import LegProblem, solve_leg
from expdesign.plan._ompl import Clear, dubins_curve, search_dubins
from expdesign.plan.area import SeaArea
from expdesign.plan.capability import Capability
from expdesign.plan.field import ClearanceField
from expdesign.plan.footprint import covering_discs, swept_area
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Environment, simulate
from expdesign.values import Array, seal
from expdesign.vessel import Vessel, allocate, required_force

ROOM_M = 3.0
"""Hull lengths to either side beyond which a corridor is not widened."""
NEAR_ENDS = 2.0
"""Hull lengths round a leg's ends within which its path needs no more clearance than the ends have."""
ARRIVAL = 1e-3
"""Largest miss of a leg's end state, in hull lengths, and in transit speeds."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LegTask:
    """A leg to be found.

    Attributes:
        start, end: (6,) states, pose in the n-frame and velocity over ground.
        start_inputs, end_inputs: (m,) commands standing at its ends.
        seed: of the path search.
    """

    start: Array
    end: Array
    start_inputs: Array
    end_inputs: Array
    seed: int

    def __post_init__(self) -> None:
        seal(self, start="6", end="6", start_inputs="m", end_inputs="m")


@dataclass(frozen=True, kw_only=True)
class LegWater:
    """Vessel, weather and water that all legs of a plan share.

    Attributes:
        vessel, environment, ship: who sails, in what, how fast.
        area: allowed water.
        clearance_m: least distance of the hull from anything forbidden.
        field: the same water on a grid.
    """

    vessel: Vessel
    environment: Environment
    ship: Capability
    area: SeaArea
    clearance_m: float
    field: ClearanceField

    @cached_property
    def safe(self) -> shapely.MultiPolygon:
        """Water that the hull may touch."""
        safe = self.area.safe_water(self.clearance_m)
        shapely.prepare(safe)
        return safe

    @property
    def path_margin_m(self) -> float:
        """Clearance of the centre line that keeps the hull clear on an arc of the turning radius."""
        radius, half_length, half_beam = (
            self.ship.turning_radius_m,
            self.vessel.length_m / 2,
            self.vessel.beam_m / 2,
        )
        return self.clearance_m + float(np.hypot(radius + half_beam, half_length)) - radius


def find_leg(task: LegTask, water: LegWater) -> Array | None:
    """Commands (k, m) that take the vessel from one state to the other in safe water, or None when none is found.

    The end commands of azimuths without angle limits may be whole turns away from the wished ones.
    """
    path = find_path(task, water)
    if path is None:
        return None
    for narrowing in (1.0, 0.5, 0.1):
        problem = _leg_problem(task, water, path, narrowing)
        values = solve_leg(problem)
        if values is not None and _acceptable(problem, water, values):
            return values
    return None


def find_path(task: LegTask, water: LegWater) -> Array | None:
    """(k, 3) poses of a Dubins path whose swept hull stays in safe water, or None."""
    radius, spacing = water.ship.turning_radius_m, water.vessel.length_m / 6
    direct = dubins_curve(task.start[:3], task.end[:3], radius_m=radius, spacing_m=spacing)
    if _inside(direct, water):
        return direct
    for attempt, (reach, slack) in enumerate(((4.0, 0.5), (4.0, 1.5), (40.0, 1.0))):
        box = reach * (radius + water.vessel.length_m)
        path = search_dubins(
            task.start[:3],
            task.end[:3],
            radius_m=radius,
            spacing_m=2 * spacing,
            low=np.minimum(task.start, task.end)[:2] - box,
            high=np.maximum(task.start, task.end)[:2] + box,
            clear=_checker(task, water, slack * water.field.cell_m),
            seed=task.seed + 7919 * attempt,
        )
        if path is not None and _inside(path, water):
            return path
    return None


def _checker(task: LegTask, water: LegWater, slack_m: float) -> Clear:
    """Point check on the clearance grid; near the leg's ends no more is asked than the ends themselves have."""
    field, margin = water.field, water.path_margin_m + slack_m
    grid, (north, east), cell = field.clearance_m, field.origin.tolist(), field.cell_m
    rows, columns = grid.shape
    near = NEAR_ENDS * water.vessel.length_m
    ends = [(*end[:2].tolist(), float(field.at(end[:2])) - cell) for end in (task.start, task.end)]

    def clear(x: float, y: float) -> bool:
        row, column = round((x - north) / cell), round((y - east) / cell)
        if not (0 <= row < rows and 0 <= column < columns):
            return False
        found = float(grid[row, column])
        if found >= margin:
            return True
        return any(found >= least and math.hypot(x - a, y - b) < near for a, b, least in ends)

    return clear


def _inside(pose: Array, water: LegWater) -> bool:
    return bool(shapely.contains_properly(water.safe, swept_area(pose, water.vessel.hull_b)))


def _acceptable(problem: LegProblem, water: LegWater, values: Array) -> bool:
    """Whether the commands, simulated, stay in safe water and arrive."""
    track = leg_trajectory(water, problem.start, values)
    end = np.r_[track.pose[-1], track.velocity[-1]]
    scale = np.r_[[water.vessel.length_m] * 2, 1.0, [water.ship.transit_speed_mps] * 2, water.ship.yaw_rate_radps]
    return bool((np.abs(end - problem.end) <= ARRIVAL * scale).all()) and _inside(track.pose, water)


def leg_trajectory(water: LegWater, start: Array, values: Array) -> Trajectory:
    """The motion that commands (k, m) give from a state (6,)."""
    vessel = water.vessel
    commands = Commands(sample_time_s=vessel.sample_time_s, names=vessel.model.inputs, values=values)
    return simulate(vessel, commands, pose=start[:3], velocity=start[3:], environment=water.environment)


def _leg_problem(task: LegTask, water: LegWater, path: Array, narrowing: float) -> LegProblem:
    vessel, ship = water.vessel, water.ship
    reference, duration_s = _timed(path, task.start[3], task.end[3], ship, vessel.length_m)
    guess = _guessed_inputs(vessel, reference, task.start_inputs, duration_s)
    end_inputs = _nearest_turns(vessel, task.end_inputs, guess[-1])
    end = np.r_[task.end[:2], reference[-1, 2], task.end[3:]]
    reference[0], reference[-1], guess[-1] = task.start, end, end_inputs
    side = np.stack([-np.sin(reference[:, 2]), np.cos(reference[:, 2])], axis=-1)
    current = float(np.hypot(*water.environment.current_to))
    centres, disc_m = covering_discs(vessel.length_m, vessel.beam_m)
    margin = water.clearance_m + disc_m + water.field.cell_m / 2
    port, starboard = (_room(water, reference[:, :2], sign * side, margin, narrowing) for sign in (-1.0, 1.0))
    return LegProblem(
        vessel=vessel,
        environment=water.environment,
        start=task.start,
        end=end,
        start_inputs=task.start_inputs,
        end_inputs=end_inputs,
        reference=reference,
        guess=guess,
        duration_s=duration_s,
        side=side,
        room_port_m=port,
        room_starboard_m=starboard,
        hull_arm_m=float(centres[-1]),
        top_speed_mps=leg_speed_mps(ship, (task.start[3:], task.end[3:])) + current,
        yaw_rate_radps=max(ship.yaw_rate_radps, 1.02 * abs(task.start[5]), 1.02 * abs(task.end[5])),
    )


def leg_speed_mps(ship: Capability, ends: Iterable[Array]) -> float:
    """Largest speed on a leg: transit speed, or 2 % above what its ends (3,) have."""
    return max(ship.transit_speed_mps, *(1.02 * float(np.hypot(*velocity[:2])) for velocity in ends))


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
    force = np.array([required_force(vessel.model, row[3:], np.zeros(3)) for row in reference[1:]])
    step_s = duration_s / (len(reference) - 1)
    return np.vstack([before, allocate(vessel.actuators, force, sample_time_s=step_s, before=before)])


def _nearest_turns(vessel: Vessel, inputs: Array, near: Array) -> Array:
    """The same commands with unlimited azimuth angles shifted by whole turns towards `near`."""
    shifted = inputs.copy()
    for index, (name, limit) in enumerate(zip(vessel.model.inputs, vessel.limits, strict=True)):
        if name.startswith("a") and not np.isfinite([limit.low, limit.high]).any():
            shifted[index] += 2 * np.pi * np.round((near[index] - inputs[index]) / (2 * np.pi))
    return shifted


def _room(water: LegWater, centre: Array, side: Array, margin_m: float, narrowing: float) -> Array:
    """(j,) how far each centre may move to one side while its discs keep clear, at most `ROOM_M` hull lengths."""
    steps = np.arange(0.0, ROOM_M * water.vessel.length_m, water.field.cell_m)
    points = centre[:, None] + steps[:, None] * side[:, None, :]
    free = water.field.at(points) >= margin_m
    free[:, 0] = True
    return np.asarray(narrowing * steps[np.cumprod(free, axis=1).sum(axis=1).astype(int) - 1])
