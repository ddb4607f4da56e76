"""Sensors: noise, place, timing and faults."""

from __future__ import annotations

import math
from dataclasses import dataclass

from expdesign.errors import InputError, UnknownName

WIND_SENSORS = ("cartesian", "vane")
SENSORS = ("position", "heading", "velocity", "yaw_rate", "wind")
"""Measured quantities; each has a `Mounting`."""


@dataclass(frozen=True, kw_only=True)
class Mounting:
    """Place, delay and sampling interval of a sensor."""

    # forward_m, starboard_m: place in the b-frame [m]; means something to position, velocity and wind
    forward_m: float = 0.0
    starboard_m: float = 0.0
    delay_s: float = 0.0  # age of its readings [s]
    # time between new readings [s]; in between the last one is repeated, noise and all. Not above the sample time,
    # every sample is new.
    interval_s: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not math.isfinite(value) or (name.endswith("_s") and value < 0):
                raise InputError(f"mounting.{name} is {value:g}, expected a finite number, not negative for times")


FAULTS = (
    "heading_bias_rad",
    "velocity_angle_rad",
    "velocity_scale",
    "yaw_rate_scale",
    *(f"{name}_{axis}_m" for name in ("position", "velocity", "wind") for axis in ("forward", "starboard")),
    *(f"{name}_delay_s" for name in SENSORS),
)
"""Errors of sensors that a diagnosis estimates, as vessel files call them."""
NOISE = (
    "position_m", "heading_rad", "velocity_mps", "yaw_rate_radps", "wind_mps", "wind_angle_rad", "roll_rad",
    "roll_rate_radps", "acceleration_mps2",
)  # fmt: skip
"""Standard deviations, as vessel files call them."""
CENTRAL = Mounting()
"""At the origin of the b-frame, at once, every sample."""


@dataclass(frozen=True, kw_only=True)
class Sensors:
    """Errors of the measurements."""

    # position_m, heading_rad, velocity_mps, yaw_rate_radps: standard deviations of white noise, not negative
    position_m: float = 0.0
    heading_rad: float = 0.0
    velocity_mps: float = 0.0
    yaw_rate_radps: float = 0.0
    wind_mps: float = 0.0  # of each component of a cartesian wind sensor, or of a vane's speed
    wind_angle_rad: float = 0.0  # of a vane's angle
    # roll_rad, roll_rate_radps, acceleration_mps2: of roll, its rate, and of sway and lateral acceleration
    roll_rad: float = 0.0
    roll_rate_radps: float = 0.0
    acceleration_mps2: float = 0.0
    heading_bias_rad: float = 0.0  # measured heading less true heading
    # from the bow to the velocity sensor's own forward axis, clockwise; it measures along that
    velocity_angle_rad: float = 0.0
    velocity_scale: float = 1.0  # measured surge and sway over true ones
    yaw_rate_scale: float = 1.0  # measured yaw rate over true yaw rate
    # "cartesian" measures the components of the relative wind, "vane" its speed and angle
    wind_sensor: str = "cartesian"
    # position, heading, velocity, yaw_rate, wind: where, how late and how often each is measured
    position: Mounting = CENTRAL
    heading: Mounting = CENTRAL
    velocity: Mounting = CENTRAL
    yaw_rate: Mounting = CENTRAL
    wind: Mounting = CENTRAL

    def __post_init__(self) -> None:
        for name in NOISE:
            value = getattr(self, name)
            if not 0 <= value < math.inf:
                raise InputError(f"sensors.{name} is {value:g}, expected a standard deviation of 0 or more")
        for name in ("heading_bias_rad", "velocity_angle_rad"):
            if not math.isfinite(getattr(self, name)):
                raise InputError(f"sensors.{name} is {getattr(self, name):g}, expected a finite angle")
        for name in ("velocity_scale", "yaw_rate_scale"):
            if not 0 < getattr(self, name) < math.inf:
                raise InputError(f"sensors.{name} is {getattr(self, name):g}, expected more than 0")
        if self.wind_sensor not in WIND_SENSORS:
            raise UnknownName("wind sensor", self.wind_sensor, known=WIND_SENSORS)


EXACT = Sensors()
"""Sensors without error."""
