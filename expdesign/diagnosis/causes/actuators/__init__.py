"""Causes in actuators and their thrust."""

from expdesign.diagnosis.causes.actuators.actuator_deadband import ACTUATOR_DEADBAND
from expdesign.diagnosis.causes.actuators.actuator_delay import ACTUATOR_DELAY
from expdesign.diagnosis.causes.actuators.actuator_lag import ACTUATOR_LAG, ACTUATOR_SLEW
from expdesign.diagnosis.causes.actuators.actuator_scale import ACTUATOR_SCALE
from expdesign.diagnosis.causes.actuators.thrust_advance_loss import THRUST_ADVANCE_LOSS
from expdesign.diagnosis.causes.actuators.thrust_gain import THRUST_GAIN
from expdesign.diagnosis.causes.actuators.thruster_asymmetry import THRUSTER_ASYMMETRY

__all__ = [
    "ACTUATOR_DEADBAND",
    "ACTUATOR_DELAY",
    "ACTUATOR_LAG",
    "ACTUATOR_SCALE",
    "ACTUATOR_SLEW",
    "THRUSTER_ASYMMETRY",
    "THRUST_ADVANCE_LOSS",
    "THRUST_GAIN",
]
