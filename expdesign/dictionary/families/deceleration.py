"""Deceleration on a straight course."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.dictionary.families.shapes import ramp
from expdesign.dictionary.spec import Family, Setting
from expdesign.values import Array


def _reference(settings: Mapping[str, float], time_s: Array) -> Array:
    high, low = settings["speed_mps"], settings["to_speed_mps"]
    surge = high + (low - high) * ramp(time_s, length_s=settings["ramp_fraction"] * float(time_s[-1]))
    return np.stack([surge, 0 * surge, 0 * surge], axis=1)


DECELERATION = Family(
    name="deceleration",
    summary="from a surge speed down to a lower one, or to rest, on a straight course",
    settings=(
        Setting(name="duration_s", meaning="length of one run", low=1e-3, high=1e5),
        Setting(name="speed_mps", meaning="surge speed at the start", low=-50, high=50),
        Setting(name="to_speed_mps", meaning="surge speed reached", default=0.0, low=-50, high=50),
        Setting(name="ramp_fraction", meaning="share of the run that the change takes", default=0.7, low=0.01, high=1),
    ),
    reference=_reference,
)
