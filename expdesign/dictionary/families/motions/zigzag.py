"""Zig-zag: yaw rate to one side and the other at a steady surge speed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.dictionary.families.motions.shapes import envelope, flat_wave
from expdesign.dictionary.spec import WHOLE_PERIODS, Family, Setting
from expdesign.values import Array


def _reference(settings: Mapping[str, float], time_s: Array) -> Array:
    wave = flat_wave(time_s, period_s=settings["period_s"])
    surge = np.full_like(time_s, settings["speed_mps"])
    offset = envelope(time_s, length_s=settings["period_s"] / 4)
    sway = settings["sway_offset_mps"] * offset - settings["sway_mps"] * wave
    return np.stack([surge, sway, settings["yaw_offset_radps"] * offset + settings["yaw_rate_radps"] * wave], axis=1)


ZIGZAG = Family(
    name="zigzag",
    summary="alternating turns at a steady surge speed, drifting outwards; without offsets the heading returns",
    settings=(
        WHOLE_PERIODS,
        Setting(name="speed_mps", meaning="surge speed", low=-50, high=50, searched="surge"),
        Setting(
            name="yaw_rate_radps",
            meaning="largest yaw rate; the first turn is to starboard",
            low=-5,
            high=5,
            searched="yaw",
        ),
        Setting(name="period_s", meaning="time of one full swing", low=1e-2, high=1e5, searched="time"),
        Setting(name="sway_mps", meaning="largest outward sway speed", default=0.0, low=-20, high=20, searched="sway"),
        Setting(
            name="sway_offset_mps", meaning="steady sway added to it", default=0.0, low=-20, high=20, searched="sway"
        ),
        Setting(
            name="yaw_offset_radps", meaning="steady yaw rate added to it", default=0.0, low=-5, high=5, searched="yaw"
        ),
    ),
    reference=_reference,
)
