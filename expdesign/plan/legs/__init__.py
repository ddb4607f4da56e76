"""Repositioning legs: the water they share, optimised commands, and how long they take."""

from expdesign.plan.legs._ompl import dubins_curve
from expdesign.plan.legs.agile import joint
from expdesign.plan.legs.agile_times import NEAR, TURNS, WISHES, LegTimes, joint_lost_s, joints, leg_times
from expdesign.plan.legs.escape_check import check_ends
from expdesign.plan.legs.find import find_leg, leg_trajectory
from expdesign.plan.legs.helm_times import HelmTimes, helm_times, moved
from expdesign.plan.legs.recovery import displaced, recover
from expdesign.plan.legs.water import BEYOND_ENDS, LegTask, LegWater, last_state, leg_speed_mps, nearest_turns

__all__ = [
    "BEYOND_ENDS",
    "NEAR",
    "TURNS",
    "WISHES",
    "HelmTimes",
    "LegTask",
    "LegTimes",
    "LegWater",
    "check_ends",
    "displaced",
    "dubins_curve",
    "find_leg",
    "helm_times",
    "joint",
    "joint_lost_s",
    "joints",
    "last_state",
    "leg_speed_mps",
    "leg_times",
    "leg_trajectory",
    "moved",
    "nearest_turns",
    "recover",
]
