"""The catalogue of causes: one file each, one signature, one visible tuple."""

from expdesign.diagnosis.candidate import Cause
from expdesign.diagnosis.causes.actuator_deadband import ACTUATOR_DEADBAND
from expdesign.diagnosis.causes.actuator_delay import ACTUATOR_DELAY
from expdesign.diagnosis.causes.actuator_lag import ACTUATOR_LAG
from expdesign.diagnosis.causes.change_point import CHANGE_POINT
from expdesign.diagnosis.causes.current import CURRENT
from expdesign.diagnosis.causes.gyro_scale import GYRO_SCALE
from expdesign.diagnosis.causes.heading_bias import HEADING_BIAS
from expdesign.diagnosis.causes.lever_arm import LEVER_ARM
from expdesign.diagnosis.causes.load_change import LOAD_CHANGE
from expdesign.diagnosis.causes.missing_term import MISSING_TERM
from expdesign.diagnosis.causes.parameters import PARAMETERS
from expdesign.diagnosis.causes.roll_coupling import ROLL_COUPLING
from expdesign.diagnosis.causes.sensor_delay import SENSOR_DELAY
from expdesign.diagnosis.causes.shallow_water import SHALLOW_WATER
from expdesign.diagnosis.causes.thrust_advance_loss import THRUST_ADVANCE_LOSS
from expdesign.diagnosis.causes.thrust_gain import THRUST_GAIN
from expdesign.diagnosis.causes.thruster_asymmetry import THRUSTER_ASYMMETRY
from expdesign.diagnosis.causes.wind import WIND

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
    ACTUATOR_DEADBAND,
    LOAD_CHANGE,
    HEADING_BIAS,
    LEVER_ARM,
    SENSOR_DELAY,
    GYRO_SCALE,
    SHALLOW_WATER,
    ROLL_COUPLING,
    CHANGE_POINT,
)

__all__ = ["CAUSES"]
