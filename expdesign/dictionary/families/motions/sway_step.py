"""Sway step: sideways motion that starts, stays and ends, on a steady heading."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.dictionary.families.motions.shapes import ramp
from expdesign.dictionary.spec import DURATION, Family, Setting
from expdesign.values import Array


def _reference(settings: Mapping[str, float], time_s: Array) -> Array:
    rise_s, held_s = settings["rise_s"], settings["held_fraction"] * float(time_s[-1])
    sway = settings["sway_mps"] * (ramp(time_s, length_s=rise_s) - ramp(time_s, start_s=held_s, length_s=rise_s))
    return np.stack([np.full_like(time_s, settings["speed_mps"]), sway, 0 * sway], axis=1)


SWAY_STEP = Family(
    name="sway_step",
    summary="a step of sway speed on a steady heading, and back",
    settings=(
        DURATION,
        Setting(name="sway_mps", meaning="sway speed, positive to starboard", low=-20, high=20, searched="sway"),
        Setting(name="rise_s", meaning="time that a step takes", low=1e-2, high=1e4, searched="time"),
        Setting(name="speed_mps", meaning="surge speed", default=0.0, low=-50, high=50, searched="surge"),
        Setting(
            name="held_fraction",
            meaning="share of the run after which the sway returns to zero",
            default=0.6,
            low=0.05,
            high=1,
            searched="share",
        ),
    ),
    reference=_reference,
)
