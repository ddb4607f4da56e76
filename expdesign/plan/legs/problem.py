"""The optimal control problem of a leg: its corridor, its limits, and the commands before it."""

from __future__ import annotations

import numpy as np

from expdesign.plan.legs._casadi import LegProblem
from expdesign.plan.legs.tuning import LEGS
from expdesign.plan.legs.water import LegTask, LegWater, leg_speed_mps, room_beside, through_water
from expdesign.values import Array
from expdesign.vessel.hull import covering_discs


def hull_discs(water: LegWater) -> tuple[float, float]:
    """How far ahead and astern the outer discs that cover the hull stand, and the clearance of their centres [m]."""
    centres, disc_m = covering_discs(water.vessel.length_m, water.vessel.beam_m)
    return float(centres[-1]), water.clearance_m + disc_m + water.field.cell_m / 2


def leg_problem(
    task: LegTask,
    water: LegWater,
    *,
    end: Array,
    states: Array,
    inputs: Array,
    path: Array,
    duration_s: float,
    turning_rate_radps: float,
    node_s: float = 0.0,
) -> LegProblem:
    """A task as it is optimised, from a first guess between its ends, inside the room beside a path.

    Args:
        task, water: the leg and its water.
        end: (6,) the task's, with its heading continuous along the guess.
        states, inputs: (j + 1, 6) and (j + 1, m) first guess; the ends become the task's, the last inputs are kept.
        path: (j + 1, 3) poses that the corridor is measured from.
        duration_s: first guess.
        turning_rate_radps: largest yaw rate besides those at the ends.
        node_s: least time between nodes.
    """
    length_m, fastest = water.vessel.length_m, water.ship.transit_speed_mps
    arm_m, margin_m = hull_discs(water)
    side = np.stack([-np.sin(path[:, 2]), np.cos(path[:, 2])], axis=-1)
    port, starboard = (room_beside(water, path[:, :2], sign * side, margin_m) for sign in (-1.0, 1.0))
    ends = [through_water(water.environment, state) for state in (task.start, end)]
    return LegProblem(
        vessel=water.vessel,
        environment=water.environment,
        start=task.start,
        end=end,
        start_inputs=task.start_inputs,
        end_inputs=inputs[-1],
        past=task.past,
        delivered=water.delivered(task.past),
        states=np.vstack([task.start, states[1:-1], end]),
        inputs=inputs,
        duration_s=duration_s,
        time_scale_s=length_m / fastest,
        path=path,
        room_port_m=port,
        room_starboard_m=starboard,
        circle=np.r_[path[0, :2], np.inf],
        hull_arm_m=arm_m,
        top_speed_mps=leg_speed_mps(fastest, ends),
        yaw_rate_radps=max(turning_rate_radps, *(LEGS.beyond_ends * abs(motion[2]) for motion in ends)),
        lateral_mps2=max(water.ship.lateral_mps2, *(1.05 * abs(motion[0] * motion[2]) for motion in ends)),
        node_s=node_s,
        budget=task.budget,
    )
