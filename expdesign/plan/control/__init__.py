"""What the ship can do on legs, and how she is steered along them."""

from expdesign.plan.control.acceleration_limits import LegEnd, SpeedChanges, least_loss, leg_end, to_work_s
from expdesign.plan.control.capability import RUN_UP, SETTLE, Capability, capability, joint_m, speed_loss_s, turn_loss_s
from expdesign.plan.control.helm_capability import full_ahead, stopped
from expdesign.plan.control.tracking import CATCH_UP, LEAD, Helmsman, Reference, over_ground

__all__ = [
    "CATCH_UP",
    "LEAD",
    "RUN_UP",
    "SETTLE",
    "Capability",
    "Helmsman",
    "LegEnd",
    "Reference",
    "SpeedChanges",
    "capability",
    "full_ahead",
    "joint_m",
    "least_loss",
    "leg_end",
    "over_ground",
    "speed_loss_s",
    "stopped",
    "to_work_s",
    "turn_loss_s",
]
