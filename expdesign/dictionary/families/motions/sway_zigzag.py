"""Sway zig-zag: sideways motion to one side and the other on a steady heading."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.dictionary.families.motions.shapes import flat_wave
from expdesign.dictionary.spec import WHOLE_PERIODS, Family, Setting
from expdesign.values import Array


def _reference(settings: Mapping[str, float], time_s: Array) -> Array:
    wave = flat_wave(time_s, period_s=settings["period_s"])
    surge = np.full_like(time_s, settings["speed_mps"])
    return np.stack([surge, settings["sway_mps"] * wave, 0 * wave], axis=1)


SWAY_ZIGZAG = Family(
    name="sway_zigzag",
    summary="alternating sideways motion on a steady heading, with or without headway",
    settings=(
        WHOLE_PERIODS,
        Setting(
            name="sway_mps",
            meaning="largest sway speed; the first push is to starboard",
            low=-20,
            high=20,
            searched="sway",
        ),
        Setting(name="period_s", meaning="time of one full swing", low=1e-2, high=1e5, searched="time"),
        Setting(name="speed_mps", meaning="surge speed", default=0.0, low=-50, high=50, searched="surge"),
    ),
    reference=_reference,
)
