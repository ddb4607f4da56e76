"""The catalogue of causes by where they act: one signature, one visible tuple."""

from expdesign.diagnosis.causes.actuators import (
    ACTUATOR_DEADBAND,
    ACTUATOR_DELAY,
    ACTUATOR_LAG,
    ACTUATOR_SCALE,
    ACTUATOR_SLEW,
    LATE_ORDERS,
    THRUST_ADVANCE_LOSS,
    THRUST_GAIN,
    THRUSTER_ASYMMETRY,
)
from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values, rounded
from expdesign.diagnosis.causes.environment import CURRENT, SHALLOW_WATER, WIND, wind_can_be_told
from expdesign.diagnosis.causes.hull import (
    CHANGE_POINT,
    LOAD_CHANGE,
    MISSING_TERM,
    PARAMETERS,
    ROLL_COUPLING,
    UNLISTED_TERM,
)
from expdesign.diagnosis.causes.sensors import SENSOR_CAUSES

CAUSES: tuple[Cause, ...] = (
    PARAMETERS,
    CURRENT,
    WIND,
    MISSING_TERM,
    THRUST_GAIN,
    THRUST_ADVANCE_LOSS,
    THRUSTER_ASYMMETRY,
    ACTUATOR_LAG,
    ACTUATOR_DELAY,
    LATE_ORDERS,
    ACTUATOR_SLEW,
    ACTUATOR_DEADBAND,
    ACTUATOR_SCALE,
    LOAD_CHANGE,
    *SENSOR_CAUSES,
    SHALLOW_WATER,
    ROLL_COUPLING,
    CHANGE_POINT,
)
