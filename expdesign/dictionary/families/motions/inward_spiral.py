"""Inward spiral: a turn that tightens steadily."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.dictionary.families.motions.shapes import ramp
from expdesign.dictionary.spec import DURATION, Family, Setting
from expdesign.values import Array


def _reference(settings: Mapping[str, float], time_s: Array) -> Array:
    surge = np.full_like(time_s, settings["speed_mps"])
    sway = settings["sway_mps"] * ramp(time_s, length_s=settings["entry_s"])
    return np.stack([surge, sway, settings["yaw_rate_radps"] * time_s / float(time_s[-1])], axis=1)


INWARD_SPIRAL = Family(
    name="inward_spiral",
    summary="steady surge and sway while the yaw rate grows from zero, so the turn tightens",
    settings=(
        DURATION,
        Setting(name="speed_mps", meaning="surge speed", low=-50, high=50, searched="surge"),
        Setting(
            name="yaw_rate_radps", meaning="yaw rate at the end, positive to starboard", low=-5, high=5, searched="yaw"
        ),
        Setting(
            name="sway_mps", meaning="sway speed, positive to starboard", default=0.0, low=-20, high=20, searched="sway"
        ),
        Setting(
            name="entry_s", meaning="time in which the sway builds up", default=3.0, low=0, high=1e4, searched="time"
        ),
    ),
    reference=_reference,
)
