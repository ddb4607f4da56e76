"""The optimal control problem of a leg: its corridor, its limits, and the commands before it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from expdesign.plan.legs.water import BEYOND_ENDS, LegTask, LegWater, leg_speed_mps, room_beside, through_water
from expdesign.plan.values import WorkBudget
from expdesign.simulation import Environment
from expdesign.values import Array, seal
from expdesign.vessel import Vessel
from expdesign.vessel.vessel import covering_discs


@dataclass(frozen=True, kw_only=True, eq=False)
class LegProblem:
    """An optimal control problem for a leg."""

    vessel: Vessel  # model, actuator limits and rates
    environment: Environment  # its means act
    # start, end: (6,) states; heading continuous along the reference
    start: Array
    end: Array
    # start_inputs, end_inputs: (m,) commands standing before the leg, and as its last sample
    start_inputs: Array
    end_inputs: Array
    past: Array  # (h, m) commands given before the leg, the standing one last
    delivered: Array  # (m,) what the actuators deliver as the leg begins, misalignment included
    # states, inputs: (j + 1, 6) and (j + 1, m) first guess at even times
    states: Array
    inputs: Array
    duration_s: float  # first guess
    time_scale_s: float  # unit of time in which smoothness is weighed
    path: Array  # (j + 1, 3) poses that the corridor is measured from
    # room_port_m, room_starboard_m: (j + 1,) how far the origin may be from the path to either side
    room_port_m: Array
    room_starboard_m: Array
    circle: Array  # (3,) north, east, radius that the hull's discs keep to; the radius may be infinite
    hull_arm_m: float  # points this far ahead and astern of the origin must keep to corridor and circle too
    # top_speed_mps, yaw_rate_radps: bounds on speed through water, in any direction, and yaw rate at the nodes
    top_speed_mps: float
    yaw_rate_radps: float
    lateral_mps2: float  # bound on surge speed through water times yaw rate
    node_s: float = 0.0  # least time between nodes; 0 for the sample time
    # (2,) value of displacement to north and east [s/m] for legs that may end anywhere, if it is zero with any heading;
    # None for legs that end at `end`
    displacement_value: Array | None = None
    guesses: int = 4  # first guesses tried at most; fewer where such a leg is doubtful
    budget: WorkBudget = field(default_factory=WorkBudget)  # work budget; once it is exhausted, nothing is found

    def __post_init__(self) -> None:
        seal(self, start="6", end="6", start_inputs="m", end_inputs="m", states="j 6", inputs="j m")
        seal(self, past="h m", delivered="m")
        seal(self, path="j 3", room_port_m="j", room_starboard_m="j", circle="3")

    @property
    def bounded(self) -> bool:
        """Whether corridor or circle bounds it."""
        return bool(np.isfinite([self.room_port_m.min(), self.room_starboard_m.min(), self.circle[2]]).any())


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
        yaw_rate_radps=max(turning_rate_radps, *(BEYOND_ENDS * abs(motion[2]) for motion in ends)),
        lateral_mps2=max(water.ship.lateral_mps2, *(1.05 * abs(motion[0] * motion[2]) for motion in ends)),
        node_s=node_s,
        budget=task.budget,
    )
