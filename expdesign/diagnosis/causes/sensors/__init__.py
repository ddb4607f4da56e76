"""Causes in sensors."""

from expdesign.diagnosis.causes.sensors.heading_bias import HEADING_BIAS
from expdesign.diagnosis.causes.sensors.lever_arm import LEVER_ARM
from expdesign.diagnosis.causes.sensors.scales import GYRO_SCALE, LOG_SCALE
from expdesign.diagnosis.causes.sensors.sensor_delay import SENSOR_DELAY

__all__ = ["GYRO_SCALE", "HEADING_BIAS", "LEVER_ARM", "LOG_SCALE", "SENSOR_DELAY"]
