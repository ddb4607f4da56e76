"""Yaw dynamics from operational data: models with measured surge, sway, roll and drive moment as inputs.

    found = estimate_yaw(YAW_MODELS["full"], recorded)
    found.parameters, found.fit

The model is simulated, yaw rate is its only state; parameters minimise the squared error of the yaw rate (output
error). All inputs are measured, and their noise is a bias that output error does not remove.

Source: a master's thesis on the estimation of a ship's yaw dynamics in operation, chapters 2 to 6.
"""

from expdesign.monitoring.yaw.budget import excitation_rank, term_budget
from expdesign.monitoring.yaw.detector import Detector, alarm_samples
from expdesign.monitoring.yaw.estimate import YawEstimate, estimate_yaw, halves_differ, simulate_yaw
from expdesign.monitoring.yaw.model import NOMINAL, YAW_MODELS, YawData, YawModel

__all__ = [
    "NOMINAL",
    "YAW_MODELS",
    "Detector",
    "YawData",
    "YawEstimate",
    "YawModel",
    "alarm_samples",
    "estimate_yaw",
    "excitation_rank",
    "halves_differ",
    "simulate_yaw",
    "term_budget",
]
