"""The table of ship quantities: one row for every number about a ship that may be unknown, wrong or changing.

    order -> actuators -> terms (forces, inertia), weather, depth, roll -> motion -> sensors -> record

A row is all that readers and writers of vessel files, simulations, reductions, diagnoses, foresight and `explain` know
of a quantity. Rows of sensors are the fields of `Sensors`, rows of actuators those of `Response`; both are named as in
vessel files. The others stand in `OTHERS`. A gain or an offset of a sensor is one row and nothing else.

A diagnosis estimates EFFECTS: a quantity less its neutral value. The key of an effect is its kind, or its kind and what
it is of, e.g. `lag:n`. A GROUP in keys is the stem of input names ("n", "a", "rudder", "tau_x", ...), one input, or
"all". What several sensors share is one kind: the place of the antenna or of the velocity sensor is `lever`.

Measured sway is v + u sin(heading_bias). For velocities from the pose, a positive bias is a compass that shows too
little; for measured ones, a sensor whose axes lie anticlockwise of the ship's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import Any

from expdesign.errors import InputError, UnknownName

TERMS, ACTUATORS, WEATHER, DEPTH, ROLL_MODE, TIME, SENSOR = (
    "terms", "actuators", "weather", "depth", "roll", "time", "sensors"
)  # fmt: skip
"""Stages: terms of the model by their factors, signals that the terms read (actuators, weather, depth, time), the
states (roll), and what sensors show."""
NUMBER, ANGLE, NOT_NEGATIVE, POSITIVE, STD = (
    "a finite number", "a finite angle", "0 or more", "more than 0", "a standard deviation of 0 or more"
)  # fmt: skip
"""What a vessel file may state."""
POSE, LOG, GYRO = "pose", "log", "gyro"
"""Sensors that velocities come from: positions and compass, a velocity sensor, a rate gyro."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """Words for the cause that a quantity is in a diagnosis."""

    name: str  # in diagnoses
    title: str
    missing: str  # from a simulation that ignores it
    summary: str
    explained: str  # a sentence with {} for the size: a gain in per cent, an offset in its unit
    unseen: str  # when records cannot show it


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A row of the table."""

    stage: str  # where it acts
    words: str = ""  # what the number is
    unit: str = ""
    neutral: float = 0.0  # value that changes nothing: 1 for a gain or a share, 0 for others
    # In vessel files.
    key: str = ""  # key in [sensors], or field of `Response`; "" where the file states it in another way
    takes: str = NUMBER
    stated_as: str = ""  # of actuators: the key in [[actuators]] with the {name}, the {unit} and its {rate} of a signal
    sensor: str = ""  # of `SENSORS`, "" for noise
    signals: tuple[str, ...] = ()  # of u, v and r: what a gain or an offset of a sensor acts on
    what: str = ""  # these in words
    fault: Fault | None = None
    # In diagnoses.
    effects: tuple[str, ...] = ()  # keys, or the kind, of what is estimated
    sign: float = 1.0  # of the effect in the stated number
    shown_by: str = ""  # `POSE`, `LOG` or `GYRO`: velocities that come from that show it; "" for all
    result: str = ""  # name in results, with {} for the rest of the key; "" for a row that has the kind of another
    # least and greatest effect that a ship, her sensors and the sea can have; parameters and terms, whose signs
    # physics keeps, and times of the data have none
    low: float = -math.inf
    high: float = math.inf
    # size that matters where standard trials give none, by default: `matters` times the ship's length [m], the time in
    # which she sails it [s], her speed [m/s], or as it is
    matters: float = math.nan
    per: str = ""

    @property
    def is_gain(self) -> bool:
        """Whether it multiplies."""
        return self.neutral == 1.0

    @property
    def is_fault(self) -> bool:
        """Whether it is an error of a sensor that can be estimated: neither its noise nor its interval."""
        return self.stage == SENSOR and bool(self.sensor) and not self.key.endswith("_interval_s")

    def size(self, length_m: float, speed_mps: float) -> float:
        """Size that matters to a ship at a speed by default; nan where none is known."""
        units = {"": 1.0, "length": length_m, "time": length_m / max(speed_mps, 1e-6), "speed": speed_mps}
        return self.matters * units[self.per]

    def undone(self, value: float) -> str:
        """What a reduction does about a gain or an offset of a sensor."""
        if self.is_gain:
            return f"the {self.what} {'is' if len(self.signals) == 1 else 'are'} divided by {value:.4g}"
        return f"{value:.4g} {self.unit} is taken off the {self.what}"

    def is_shown(self, derived: tuple[str, ...]) -> bool:
        """Whether velocities show it, of which these of u, v, r come from the pose."""
        from_log = not {"u", "v"} & {*derived}
        return {"": True, POSE: "u" in derived, LOG: from_log, GYRO: "r" not in derived}[self.shown_by]

    def admits(self, value: float) -> bool:
        """Whether a vessel may have it."""
        if self.takes == POSITIVE:
            return value > 0 and (value < math.inf or self.default == math.inf)
        return math.isfinite(value) and (value >= 0 or self.takes not in (NOT_NEGATIVE, STD))

    @property
    def default(self) -> float:
        """What a file that is silent states: a slew rate, whose effect is its inverse, has no limit."""
        return math.inf if self.effects == ("slew",) else self.neutral


def _row(**given: Any) -> Any:
    """A field whose row is this; its name becomes the key."""
    row = Quantity(**given)
    return field(default=row.default, metadata={"row": row})


@cache
def rows_of(kind: type[Sensors | Response]) -> tuple[Quantity, ...]:
    """Rows of the fields of `Sensors` or `Response`."""
    return tuple(replace(one.metadata["row"], key=one.name) for one in fields(kind) if "row" in one.metadata)


def _check(value: Sensors | Response, name: str) -> None:
    for row in rows_of(type(value)):  # type: ignore[arg-type]
        number = getattr(value, row.key)
        if not row.admits(number):
            raise InputError(f"{name}.{row.key} is {number:g}, expected {row.takes}")


# Actuators.


def _time(words: str, kind: str) -> Any:
    return _row(
        stage=ACTUATORS, words=words, unit="s", takes=NOT_NEGATIVE, stated_as=f"{{name}}_{kind}_s",
        effects=(kind,), result=f"{kind}_{{}}_s", low=0.0, high=120.0, matters=0.1, per="time",
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Response:
    """How one actuator signal follows its command c(t), in this order.

    The actuator moves towards a command at its slew rate; a position smaller in size than `deadband` counts as zero,
    others are not shortened; it acts `delay_s` later; what is delivered approaches it as a first-order lag,
    dx/dt = (c - x) / `lag_s`; a misalignment is added, x + `offset`.
    """

    # slew rate, the largest change per second [unit of the signal per second], infinite for none
    rate: float = _row(
        stage=ACTUATORS, words="the slew rate at which {the} follows orders [{per}]; no limit when not given",
        unit="s", takes=POSITIVE, stated_as="{name}_rate{rate}",
        effects=("slew",), result="slew_{}_s_per_unit", low=0.0, high=120.0,
    )  # fmt: skip
    deadband: float = _row(  # [unit of the signal], not negative
        stage=ACTUATORS, words="the dead band: a smaller {bare} ordered has no effect{in_unit}", takes=NOT_NEGATIVE,
        stated_as="{name}_deadband{unit}",
        effects=("deadband",), result="deadband_{}", low=0.0,
    )  # fmt: skip
    # dead time [s]
    delay_s: float = _time("the dead time of {the} [s]", "delay")
    # time constant [s], 0 for none
    lag_s: float = _time("the time constant with which {the} follows [s]", "lag")
    # delivered beyond the command [rad]: positive turns thrust, or rudder, from bow towards starboard
    offset: float = _row(
        stage=ACTUATORS, words="the misalignment [rad]: the true angle less the commanded one", unit="rad", takes=ANGLE,
        stated_as="{name}_offset{unit}",
        effects=("offset",), result="angle_offset_{}_rad", low=-0.5, high=0.5, matters=math.radians(2.0),
    )  # fmt: skip

    def __post_init__(self) -> None:
        _check(self, "response")

    @property
    def follows(self) -> bool:
        """Whether commands that change no faster than `rate` are delivered unchanged and at once."""
        return not (self.lag_s or self.delay_s or self.deadband or self.offset)


# Sensors.

WIND_SENSORS = ("cartesian", "vane")
SENSORS = {
    "position": "the positions",
    "heading": "the headings",
    "velocity": "surge and sway speed",
    "yaw_rate": "the yaw rate",
    "wind": "the wind",
}
"""Sensor -> what it measures."""
READINGS = {
    "position": "positions", "heading": "headings", "velocity": "velocities", "yaw_rate": "yaw rates", "wind": "winds",
}  # fmt: skip
"""Sensor -> its readings in words."""


def _std(of: str) -> Any:
    return _row(stage=SENSOR, words=f"the standard deviation of {of}", takes=STD)


def _gain(signals: tuple[str, ...], what: str, sensor: str, shown_by: str, **given: Any) -> Any:
    """A gain of what a sensor shows: gain * true."""
    ones = "one" if len(signals) == 1 else "ones"
    return _row(
        stage=SENSOR, sensor=sensor, signals=signals, what=what, words=f"the measured {what} over the true {ones}",
        takes=POSITIVE, neutral=1.0, shown_by=shown_by, result="factor", **given,
    )  # fmt: skip


def _place(sensor: str, side: str, shown_by: str = "") -> Any:
    reach = "forward of amidships" if side == "forward" else "to starboard of the centre line"
    return _row(
        stage=SENSOR, sensor=sensor, words=f"the place of the sensor of {SENSORS[sensor]} {reach} [m]", unit="m",
        effects=(f"lever:{side}",) if shown_by else (), shown_by=shown_by,
    )  # fmt: skip


def _delay(sensor: str, effects: tuple[str, ...] = (), shown_by: str = "") -> Any:
    return _row(
        stage=SENSOR, sensor=sensor, words=f"the delay of {SENSORS[sensor]} [s]", unit="s", takes=NOT_NEGATIVE,
        effects=effects, shown_by=shown_by,
    )  # fmt: skip


def _interval(sensor: str) -> Any:
    words = f"the time between new readings of {SENSORS[sensor]} [s], or 0 for every sample"
    return _row(stage=SENSOR, sensor=sensor, words=words, unit="s", takes=NOT_NEGATIVE)


@dataclass(frozen=True, kw_only=True)
class Sensors:
    """Errors of the measurements: noise, and by sensor its faults, its place, its delay and its interval.

    A sensor shows gain * true + offset of its velocities, along its own axes, at its own place. Between new readings
    the last one is repeated, noise and all; with an interval not above the sample time every sample is new.
    """

    position_m: float = _std("positions [m]")
    heading_rad: float = _std("headings [rad]")
    velocity_mps: float = _std("surge and sway speed [m/s]")
    yaw_rate_radps: float = _std("yaw rate [rad/s]")
    wind_mps: float = _std("wind speed, or of each component [m/s]")
    wind_angle_rad: float = _std("a vane's angle [rad]")
    roll_rad: float = _std("roll angles [rad]")
    roll_rate_radps: float = _std("roll rates [rad/s]")
    acceleration_mps2: float = _std("sway and lateral accelerations [m/s2]")
    heading_bias_rad: float = _row(
        stage=SENSOR, sensor="heading", words="the measured heading less the true one [rad]", takes=ANGLE, unit="rad",
        effects=("heading_bias",), sign=-1.0, shown_by=POSE,
    )  # fmt: skip
    velocity_angle_rad: float = _row(
        stage=SENSOR, sensor="velocity", takes=ANGLE, unit="rad",
        words="the angle from the bow to the velocity sensor's forward axis [rad], clockwise",
        effects=("heading_bias",), sign=-1.0, shown_by=LOG,
    )  # fmt: skip
    velocity_scale: float = _gain(
        ("u", "v"), "surge and sway speed", "velocity", LOG, effects=("log",), low=-0.5, high=0.5, matters=0.05,
        fault=Fault(
            name="log_scale", title="Scale error of the log", missing="the scale of the log",
            summary="a log with a wrong scale, where no positions tell it",
            explained="The log has a scale error. It shows {} % of the speed that inputs and turns show.",
            unseen="surge and sway are not measured by a log, or positions beside them tell its scale without a model",
        ),
    )  # fmt: skip
    # surge_scale, sway_scale: of one axis, beside that of both; positions tell it, no diagnosis looks for it
    surge_scale: float = _gain(
        ("u",), "surge speed", "velocity", LOG, effects=("log_surge",), low=-0.5, high=0.5, matters=0.05
    )
    sway_scale: float = _gain(
        ("v",), "sway speed", "velocity", LOG, effects=("log_sway",), low=-0.5, high=0.5, matters=0.05
    )
    yaw_rate_scale: float = _gain(
        ("r",), "yaw rate", "yaw_rate", GYRO, effects=("gyro",), low=-0.5, high=0.5, matters=0.05,
        fault=Fault(
            name="gyro_scale", title="Scale error of the rate gyro", missing="the scale of the rate gyro",
            summary="a rate gyro with a wrong scale, by heading and motion",
            explained="The yaw rate sensor has a scale error. It shows {} % of the yaw rate that heading and motion "
            "show.",
            unseen="no yaw rate is measured",
        ),
    )  # fmt: skip
    yaw_rate_bias_radps: float = _row(
        stage=SENSOR, sensor="yaw_rate", signals=("r",), what="yaw rate", unit="rad/s", shown_by=GYRO,
        words="the measured yaw rate less the true one [rad/s]",
        effects=("gyro_bias",), result="yaw_rate_bias_radps", low=-0.2, high=0.2, matters=0.002,
        fault=Fault(
            name="gyro_bias", title="Bias of the rate gyro", missing="the bias of the rate gyro",
            summary="a rate gyro that shows a turn when the heading stands still",
            explained="The yaw rate sensor shows {} rad/s more than heading and motion do: its zero is wrong.",
            unseen="no yaw rate is measured",
        ),
    )  # fmt: skip
    # "cartesian" measures the components of the relative wind, "vane" its speed and angle
    wind_sensor: str = "cartesian"
    position_forward_m: float = _place("position", "forward", POSE)
    position_starboard_m: float = _place("position", "starboard", POSE)
    position_delay_s: float = _delay("position", ("late:position",), POSE)
    position_interval_s: float = _interval("position")
    heading_delay_s: float = _delay("heading", ("late:psi",))
    heading_interval_s: float = _interval("heading")
    velocity_forward_m: float = _place("velocity", "forward", LOG)
    velocity_starboard_m: float = _place("velocity", "starboard", LOG)
    velocity_delay_s: float = _delay("velocity", ("late:u", "late:v"), LOG)
    velocity_interval_s: float = _interval("velocity")
    yaw_rate_delay_s: float = _delay("yaw_rate", ("late:r",), GYRO)
    yaw_rate_interval_s: float = _interval("yaw_rate")
    wind_axis_rad: float = _row(
        stage=SENSOR, sensor="wind", takes=ANGLE, unit="rad",
        words="the angle from the bow to the wind sensor's forward axis, or its zero [rad], clockwise",
    )  # fmt: skip
    wind_forward_m: float = _place("wind", "forward")
    wind_starboard_m: float = _place("wind", "starboard")
    wind_delay_s: float = _delay("wind")
    wind_interval_s: float = _interval("wind")

    def __post_init__(self) -> None:
        _check(self, "sensors")
        if self.wind_sensor not in WIND_SENSORS:
            raise UnknownName("wind sensor", self.wind_sensor, known=WIND_SENSORS)

    def shown(self, signal: str) -> tuple[float, float]:
        """Gain and offset with which u, v or r is shown: gain * true + offset."""
        own = [(getattr(self, row.key), row) for row in GAINS_AND_OFFSETS if signal in row.signals]
        gain = math.prod(value for value, row in own if row.is_gain)
        return gain, sum(value for value, row in own if not row.is_gain)

    def place(self, sensor: str) -> tuple[float, float]:
        """Place of a sensor in the b-frame, forward and to starboard [m]; the origin where that means nothing."""
        return getattr(self, f"{sensor}_forward_m", 0.0), getattr(self, f"{sensor}_starboard_m", 0.0)

    def timing(self, sensor: str) -> tuple[float, float]:
        """Age of a sensor's readings and time between new ones [s]; zeros for a sensor read at every sample's time."""
        return getattr(self, f"{sensor}_delay_s"), getattr(self, f"{sensor}_interval_s")


EXACT = Sensors()  # sensors without error
GAINS_AND_OFFSETS = tuple(row for row in rows_of(Sensors) if row.signals)
"""Of a velocity sensor, along its own axes, and of a gyro."""
NOISE = tuple(row.key for row in rows_of(Sensors) if row.takes == STD)  # standard deviations of sensors


# What no field of a vessel file states by itself.


def _share(stage: str, effect: str, words: str, result: str, low: float, high: float, matters: float) -> Quantity:
    """A number in results that is one without the effect."""
    return Quantity(
        stage=stage, effects=(effect,), words=words, result=result, neutral=1.0, low=low, high=high, matters=matters
    )


OTHERS = (
    Quantity(stage=TERMS, effects=("theta",), words="change of a model parameter", result="{}"),
    Quantity(stage=TERMS, effects=("term",), words="coefficient of a library term that the model lacks", result="{}"),
    # gain: of all terms of inputs, gain:propeller: of those without a rudder
    _share(TERMS, "gain", "share by which thrust is too strong", "factor", -0.8, 1.5, 0.1),
    _share(
        TERMS, "inertia", "share by which inertia in u, v or r is too small", "inertia_factor_{}", -0.6, 1.5, 0.1
    ),
    Quantity(
        stage=TERMS, effects=("asymmetry",),
        words="yaw moment per unit of ahead force: the thrust's line of action passes this far to port",
        result="thrust_offset_m", unit="m", matters=0.02, per="length",
    ),
    Quantity(
        stage=ACTUATORS, effects=("lead",), words="time by which inputs act before their recorded orders",
        result="orders_late_{}_s", unit="s", low=0.0, high=60.0, matters=0.05, per="time",
    ),
    _share(
        ACTUATORS, "scale", "share by which rudder angles or one engine's speed exceed orders, offset included",
        "input_factor_{}", -1.05, 1.5, 0.1,  # an engine or a rudder that does nothing, and the error of that
    ),
    Quantity(
        stage=WEATHER, effects=("current",), words="steady current to north or east", result="{}_mps", unit="m/s",
        low=-5.0, high=5.0, matters=0.05, per="speed",
    ),
    # wind:speed and wind:toward are the same in polar coordinates
    Quantity(
        stage=WEATHER, effects=("wind",), words="mean wind to north or east where none is measured", result="{}_mps",
        unit="m/s", low=-60.0, high=60.0, matters=3.0,
    ),
    Quantity(stage=WEATHER, effects=("wind:toward",), words="direction of it", result="toward_rad", unit="rad"),
    Quantity(
        stage=DEPTH, effects=("shallow",), words="growth of damping or inertia per unit of draught over depth",
        result="{}_growth", low=0.0, high=20.0, matters=0.5,
    ),
    Quantity(
        stage=ROLL_MODE, effects=("roll:period",), words="period of the mode", result="roll_period_s", unit="s"
    ),
    Quantity(
        stage=ROLL_MODE, effects=("roll:damping",), words="damping ratio of the mode", result="roll_damping_ratio"
    ),
    Quantity(stage=ROLL_MODE, effects=("roll:sway",), words="sway acceleration per unit of roll", result="Y_phi"),
    Quantity(
        stage=ROLL_MODE, effects=("roll:yaw",), words="yaw acceleration per unit of roll", result="N_phi", unit="rad/m"
    ),
    Quantity(stage=TIME, effects=("change:time",), words="time of a change of the ship", result="time_s", unit="s"),
    # change:gain, change:damping, change:damping_u/v/r
    _share(TIME, "change", "share by which thrust or damping changes then", "{}_factor", -0.9, 2.0, 0.2),
    Quantity(
        stage=SENSOR, effects=("heading_bias",), words="angle of the compass or of the velocity sensor",
        result="heading_bias_rad", unit="rad", low=-0.8, high=0.8, matters=math.radians(2.0),
    ),
    Quantity(
        stage=SENSOR, effects=("lever",), words="place of the sensor, forward or starboard", result="{}_m", unit="m",
        matters=0.1, per="length",
    ),
    Quantity(
        stage=SENSOR, effects=("late",), words="delay of u, v, r, psi or position", result="{}_delay_s", unit="s",
        low=-60.0, high=60.0, matters=0.05, per="time",
    ),
)  # fmt: skip
"""Terms, weather, depth, roll and changes in time, and kinds of effects that several sensors share."""
EFFECTS: Mapping[str, Quantity] = {
    row.effects[0]: row for row in (*OTHERS, *rows_of(Response), *rows_of(Sensors)) if row.result
}
"""Key or kind of an effect -> its row; the key comes first."""


@cache
def effect_row(key: str) -> Quantity:
    """The row of an effect."""
    return EFFECTS.get(key) or EFFECTS[key.partition(":")[0]]


def acts_on(key: str, *stages: str) -> bool:
    """Whether an effect acts on one of these stages."""
    return effect_row(key).stage in stages
