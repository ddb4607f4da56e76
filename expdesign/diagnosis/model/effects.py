"""Effects of an extended model: one row for each kind, which all read that bound, simulate, name, write or foresee it.

The key of an effect is its kind, or its kind and what it is of, e.g. `lag:n`. Without an effect its value is zero. A
GROUP in keys is the stem of input names ("n", "a", "rudder", "tau_x", ...), one input, or "all".

Measured sway is v + u sin(heading_bias). For velocities from the pose, a positive bias is a compass that shows too
little; for measured ones, a sensor whose axes lie anticlockwise of the ship's. The lever is that of the position
antenna or of the velocity sensor likewise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from expdesign.vessel.sensors import GAINS_AND_OFFSETS

TERMS, ACTUATORS, WEATHER, DEPTH, ROLL_MODE, TIME, SENSOR = (
    "terms", "actuators", "weather", "depth", "roll", "time", "sensors"
)  # fmt: skip
"""What effects act on: terms of the model by their factors, signals that the terms read (actuators, weather, depth,
time), the states (roll), and what sensors show."""


@dataclass(frozen=True, kw_only=True)
class EffectKind:
    """A kind of effects."""

    acts_on: str
    words: str  # what the number is
    name: str  # in results, with {} for the rest of the key
    unit: str = ""
    neutral: float = 0.0  # number in results without the effect
    # least and greatest value that a ship, her sensors and the sea can have; parameters and terms, whose signs
    # `resisting` keeps, and times of the data have none
    low: float = -math.inf
    high: float = math.inf
    # size that matters where standard trials give none, by default: `matters` times the ship's length [m], the time in
    # which she sails it [s], her speed [m/s], or as it is
    matters: float = math.nan
    per: str = ""

    def size(self, length_m: float, speed_mps: float) -> float:
        """Size that matters to a ship at a speed by default; nan where none is known."""
        units = {"": 1.0, "length": length_m, "time": length_m / max(speed_mps, 1e-6), "speed": speed_mps}
        return self.matters * units[self.per]


def _share(acts_on: str, words: str, name: str, low: float, high: float, matters: float) -> EffectKind:
    """A kind whose number in results is one without the effect."""
    return EffectKind(acts_on=acts_on, words=words, name=name, neutral=1.0, low=low, high=high, matters=matters)


def _time(words: str, name: str) -> EffectKind:
    """A kind whose number is a time of an actuator."""
    return EffectKind(acts_on=ACTUATORS, words=words, name=name, unit="s", low=0.0, high=120.0, matters=0.1, per="time")


EFFECTS: Mapping[str, EffectKind] = {
    "theta": EffectKind(acts_on=TERMS, words="change of a model parameter", name="{}"),
    "term": EffectKind(acts_on=TERMS, words="coefficient of a library term that the model lacks", name="{}"),
    # gain: of all terms of inputs, gain:propeller: of those without a rudder
    "gain": _share(TERMS, "share by which thrust is too strong", "factor", -0.8, 1.5, 0.1),
    "inertia": _share(TERMS, "share by which inertia in u, v or r is too small", "inertia_factor_{}", -0.6, 1.5, 0.1),
    "asymmetry": EffectKind(
        acts_on=TERMS, words="yaw moment per unit of ahead force: the thrust's line of action passes this far to port",
        name="thrust_offset_m", unit="m", matters=0.02, per="length",
    ),
    "slew": EffectKind(
        acts_on=ACTUATORS, words="time that a GROUP takes for a change of one unit", name="slew_{}_s_per_unit",
        unit="s", low=0.0, high=120.0,
    ),
    "deadband": EffectKind(
        acts_on=ACTUATORS, words="dead band of a GROUP [unit of the input]", name="deadband_{}", low=0.0
    ),
    "delay": _time("dead time of a GROUP", "delay_{}_s"),
    "lag": _time("time constant of a GROUP", "lag_{}_s"),
    "offset": EffectKind(
        acts_on=ACTUATORS, words="added to the angles of a GROUP", name="angle_offset_{}_rad", unit="rad", low=-0.5,
        high=0.5, matters=math.radians(2.0),
    ),
    "scale": _share(
        ACTUATORS, "share by which rudder angles exceed what is ordered, offset included", "angle_factor_{}", -0.8, 1.5,
        0.1,
    ),
    "current": EffectKind(
        acts_on=WEATHER, words="steady current to north or east", name="{}_mps", unit="m/s", low=-5.0, high=5.0,
        matters=0.05, per="speed",
    ),
    # wind:speed and wind:toward are the same in polar coordinates
    "wind": EffectKind(
        acts_on=WEATHER, words="mean wind to north or east where none is measured", name="{}_mps", unit="m/s",
        low=-60.0, high=60.0, matters=3.0,
    ),
    "wind:toward": EffectKind(acts_on=WEATHER, words="direction of that wind", name="toward_rad", unit="rad"),
    "shallow": EffectKind(
        acts_on=DEPTH, words="growth of damping or inertia per unit of draught over depth", name="{}_growth", low=0.0,
        high=20.0, matters=0.5,
    ),
    "roll:period": EffectKind(acts_on=ROLL_MODE, words="period of the mode", name="roll_period_s", unit="s"),
    "roll:damping": EffectKind(acts_on=ROLL_MODE, words="damping ratio of the mode", name="roll_damping_ratio"),
    "roll:sway": EffectKind(acts_on=ROLL_MODE, words="sway acceleration per unit of roll", name="Y_phi"),
    "roll:yaw": EffectKind(acts_on=ROLL_MODE, words="yaw acceleration per unit of roll", name="N_phi", unit="rad/m"),
    "change:time": EffectKind(acts_on=TIME, words="time of a change of the ship", name="time_s", unit="s"),
    # change:gain, change:damping, change:damping_u/v/r
    "change": _share(TIME, "share by which thrust or damping changes then", "{}_factor", -0.9, 2.0, 0.2),
    "heading_bias": EffectKind(
        acts_on=SENSOR, words="angle of the compass or of the velocity sensor", name="heading_bias_rad", unit="rad",
        low=-0.8, high=0.8, matters=math.radians(2.0),
    ),
    "lever": EffectKind(
        acts_on=SENSOR, words="place of the sensor, forward or starboard", name="{}_m", unit="m", matters=0.1,
        per="length",
    ),
    "late": EffectKind(
        acts_on=SENSOR, words="delay of u, v, r, psi or position", name="{}_delay_s", unit="s", low=-60.0, high=60.0,
        matters=0.05, per="time",
    ),
    **{
        fault.effect: EffectKind(
            acts_on=SENSOR, words=fault.words, name="factor" if fault.is_gain else fault.key, unit=fault.unit,
            neutral=fault.neutral, low=-fault.possible, high=fault.possible, matters=fault.matters,
        )
        for fault in GAINS_AND_OFFSETS
    },
}  # fmt: skip
"""Key or kind of an effect -> its row; the key comes first."""


def effect_kind(key: str) -> EffectKind:
    """The row of an effect."""
    return EFFECTS.get(key) or EFFECTS[key.partition(":")[0]]


def acts_on(key: str, *what: str) -> bool:
    """Whether an effect acts on one of these."""
    return effect_kind(key).acts_on in what
