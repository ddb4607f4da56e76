"""Multisine: surge, sway and yaw rate each swing with several frequencies at once.

Phases follow Schroeder's rule, so that the sum of equal sines stays low; each of the three velocities has its own
frequencies, so that they are uncorrelated over a whole period.

Source: M. R. Schroeder, Synthesis of low-peak-factor signals, IEEE Trans. Inf. Theory 16 (1970), 85-89.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.dictionary.families.motions.shapes import envelope
from expdesign.dictionary.spec import WHOLE_PERIODS, Family, Setting
from expdesign.dictionary.tuning import TUNING
from expdesign.values import Array


def _sum_of_sines(time_s: Array, *, period_s: float, first: int) -> Array:
    """Largest modulus 1, harmonics first, first + 3, ... of a period."""
    place = np.arange(TUNING.tones)
    phase = -np.pi * place * (place + 1) / TUNING.tones
    angles = 2 * np.pi * (first + 3 * place)[:, None] * time_s / period_s + phase[:, None]
    wave = np.sin(angles).sum(axis=0) * envelope(time_s, length_s=period_s / 12)
    return np.asarray(wave / max(float(np.abs(wave).max()), 1e-12))


def _reference(settings: Mapping[str, float], time_s: Array) -> Array:
    swing, side, turn = (_sum_of_sines(time_s, period_s=settings["period_s"], first=first) for first in (1, 2, 3))
    surge = settings["speed_mps"] + settings["speed_swing_mps"] * swing
    return np.stack([surge, settings["sway_mps"] * side, settings["yaw_rate_radps"] * turn], axis=1)


MULTISINE = Family(
    name="multisine",
    summary="multisines in surge speed, sway speed and yaw rate, with four different frequencies each",
    settings=(
        WHOLE_PERIODS,
        Setting(name="period_s", meaning="common period of all sines", low=1e-2, high=1e5, searched="time"),
        Setting(name="speed_mps", meaning="mean surge speed", low=-50, high=50, searched="surge"),
        Setting(
            name="speed_swing_mps",
            meaning="amplitude of surge speed",
            default=0.0,
            low=0,
            high=50,
            searched="surge",
        ),
        Setting(name="sway_mps", meaning="largest sway speed", default=0.0, low=-20, high=20, searched="sway"),
        Setting(name="yaw_rate_radps", meaning="largest yaw rate", default=0.0, low=-5, high=5, searched="yaw"),
    ),
    reference=_reference,
)
