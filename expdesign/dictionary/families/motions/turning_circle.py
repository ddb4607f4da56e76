"""Turning circle: a steady turn at a steady surge speed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.dictionary.families.motions.shapes import ramp
from expdesign.dictionary.spec import DURATION, Family, Setting
from expdesign.values import Array


def _reference(settings: Mapping[str, float], time_s: Array) -> Array:
    entered = ramp(time_s, length_s=settings["entry_s"])
    surge = settings["speed_mps"] + (settings["turn_speed_mps"] - settings["speed_mps"]) * entered
    return np.stack([surge, -settings["sway_mps"] * entered, settings["yaw_rate_radps"] * entered], axis=1)


TURNING_CIRCLE = Family(
    name="turning_circle",
    summary="a turn to one side from a straight approach to a steady yaw rate, drifting outwards",
    settings=(
        DURATION,
        Setting(name="speed_mps", meaning="approach speed", low=-50, high=50, searched="surge"),
        Setting(name="turn_speed_mps", meaning="surge speed in the turn", low=-50, high=50, searched="surge"),
        Setting(
            name="yaw_rate_radps", meaning="yaw rate in the turn, positive to starboard", low=-5, high=5, searched="yaw"
        ),
        Setting(name="entry_s", meaning="time from straight to steady turn", low=0, high=1e4, searched="time"),
        Setting(
            name="sway_mps", meaning="outward sway, positive to port", default=0.0, low=-20, high=20, searched="sway"
        ),
    ),
    reference=_reference,
)
