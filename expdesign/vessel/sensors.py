"""Sensors: noise, place, timing and faults."""

from __future__ import annotations

import math
from dataclasses import dataclass

from expdesign.errors import InputError, UnknownName

WIND_SENSORS = ("cartesian", "vane")
SENSORS = {
    "position": "the positions",
    "heading": "the headings",
    "velocity": "surge and sway speed",
    "yaw_rate": "the yaw rate",
    "wind": "the wind",
}
"""Sensor -> what it measures; each has a `Mounting`."""
PLACED = ("position", "velocity", "wind")
"""Sensors that measure something else at another place of the ship."""


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


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A gain or an offset of what a sensor shows of a velocity: gain * true, or true + offset.

    Its row in `GAINS_AND_OFFSETS` and its field in `Sensors` are all that a fault needs. Vessel files state it,
    simulations have it, reductions of records undo it, a diagnosis looks for it, foresight asks whether it would be
    found, and `explain` describes it.
    """

    key: str  # field of `Sensors` and key in vessel files
    effect: str  # key in the extended model of a diagnosis; the effect is the value less `neutral`
    sensor: str  # one of `SENSORS`
    signals: tuple[str, ...]  # of u, v and r: what it acts on
    neutral: float  # value without the fault: 1 for a gain, 0 for an offset
    unit: str = ""
    possible: float  # farthest from `neutral` that a sensor can be
    matters: float  # distance from `neutral` that matters, for foresight
    what: str  # it acts on, in words
    cause: str  # name in diagnoses
    title: str  # of the cause
    missing: str  # from a simulation that ignores it
    summary: str  # of the cause
    explained: str  # a sentence with {} for the size: a gain in per cent, an offset in its unit
    unseen: str  # when records cannot show it

    @property
    def is_gain(self) -> bool:
        """Whether it multiplies."""
        return self.neutral == 1.0

    def undone(self, value: float) -> str:
        """What a reduction does about it."""
        if self.is_gain:
            return f"the {self.what} {'is' if len(self.signals) == 1 else 'are'} divided by {value:.4g}"
        return f"{value:.4g} {self.unit} is taken off the {self.what}"

    @property
    def words(self) -> str:
        """What the number is."""
        unit, ones = f" [{self.unit}]" if self.unit else "", "one" if len(self.signals) == 1 else "ones"
        return f"the measured {self.what} {'over' if self.is_gain else 'less'} the true {ones}{unit}"


GAINS_AND_OFFSETS = (
    Fault(
        key="velocity_scale", effect="log", sensor="velocity", signals=("u", "v"), neutral=1.0, possible=0.5,
        matters=0.05, what="surge and sway speed",
        cause="log_scale", title="Scale error of the log", missing="the scale of the log",
        summary="a log with a wrong scale, where no positions tell it",
        explained="The log has a scale error. It shows {} % of the speed that inputs and turns show.",
        unseen="surge and sway are not measured by a log, or positions beside them tell its scale without a model",
    ),
    Fault(
        key="yaw_rate_scale", effect="gyro", sensor="yaw_rate", signals=("r",), neutral=1.0, possible=0.5, matters=0.05,
        what="yaw rate",
        cause="gyro_scale", title="Scale error of the rate gyro", missing="the scale of the rate gyro",
        summary="a rate gyro with a wrong scale, by heading and motion",
        explained="The yaw rate sensor has a scale error. It shows {} % of the yaw rate that heading and motion show.",
        unseen="no yaw rate is measured",
    ),
    Fault(
        key="yaw_rate_bias_radps", effect="gyro_bias", sensor="yaw_rate", signals=("r",), neutral=0.0, unit="rad/s",
        possible=0.2, matters=0.002, what="yaw rate",
        cause="gyro_bias", title="Bias of the rate gyro", missing="the bias of the rate gyro",
        summary="a rate gyro that shows a turn when the heading stands still",
        explained="The yaw rate sensor shows {} rad/s more than heading and motion do: its zero is wrong.",
        unseen="no yaw rate is measured",
    ),
)  # fmt: skip
"""Of a velocity sensor, along its own axes, and of a gyro."""

FAULTS = (
    "heading_bias_rad",
    "velocity_angle_rad",
    *(fault.key for fault in GAINS_AND_OFFSETS),
    *(f"{name}_{axis}_m" for name in PLACED for axis in ("forward", "starboard")),
    *(f"{name}_delay_s" for name in SENSORS),
)
"""Errors of sensors that a diagnosis estimates, as vessel files call them."""
NOISE = {
    "position_m": "positions [m]",
    "heading_rad": "headings [rad]",
    "velocity_mps": "surge and sway speed [m/s]",
    "yaw_rate_radps": "yaw rate [rad/s]",
    "wind_mps": "wind speed, or of each component [m/s]",
    "wind_angle_rad": "a vane's angle [rad]",
    "roll_rad": "roll angles [rad]",
    "roll_rate_radps": "roll rates [rad/s]",
    "acceleration_mps2": "sway and lateral accelerations [m/s2]",
}
"""Standard deviation, as vessel files call it -> what it is of."""
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
    # gains and offsets, see `GAINS_AND_OFFSETS`
    velocity_scale: float = 1.0
    yaw_rate_scale: float = 1.0
    yaw_rate_bias_radps: float = 0.0
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
        for fault in GAINS_AND_OFFSETS:
            value = getattr(self, fault.key)
            if not math.isfinite(value) or (fault.is_gain and not value > 0):
                expected = "more than 0" if fault.is_gain else "a finite number"
                raise InputError(f"sensors.{fault.key} is {value:g}, expected {expected}")
        if self.wind_sensor not in WIND_SENSORS:
            raise UnknownName("wind sensor", self.wind_sensor, known=WIND_SENSORS)

    def faults(self, signal: str) -> tuple[float, float]:
        """Gain and offset with which u, v or r is shown: gain * true + offset."""
        own = [(getattr(self, fault.key), fault) for fault in GAINS_AND_OFFSETS if signal in fault.signals]
        gain = math.prod(value for value, fault in own if fault.is_gain)
        return gain, sum(value for value, fault in own if not fault.is_gain)


EXACT = Sensors()
"""Sensors without error."""
