"""Random telegraph: surge, sway and yaw rate switch between two levels each, independently."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from expdesign.dictionary.families.motions.shapes import envelope
from expdesign.dictionary.spec import DURATION, Family, Setting
from expdesign.values import Array


def _switching(rng: np.random.Generator, time_s: Array, *, hold_s: float, rise_s: float) -> Array:
    """A +-1 signal that changes sign after exponential times of mean `hold_s`, smoothed over `rise_s`."""
    end_s = float(time_s[-1])
    flips = np.cumsum(rng.exponential(hold_s, size=max(8, int(8 * end_s / hold_s))))
    flips = flips[flips < end_s + 10 * rise_s]  # later ones are not seen
    sign = 2.0 * rng.integers(0, 2) - 1.0
    level = sum((np.tanh(2.0 * (time_s - flip) / rise_s) + 1.0) * (-1.0) ** n for n, flip in enumerate(flips))
    return np.asarray(sign * (1.0 - level))


def _reference(settings: Mapping[str, float], time_s: Array) -> Array:
    rng = np.random.default_rng(int(settings["draw"]))
    hold_s, rise_s = settings["hold_s"], settings["rise_s"]
    swing, sway, yaw = (_switching(rng, time_s, hold_s=hold_s, rise_s=rise_s) for _ in range(3))
    fade = envelope(time_s, length_s=rise_s)
    surge = settings["speed_mps"] + settings["speed_swing_mps"] * fade * swing
    side = fade * (settings["sway_offset_mps"] + settings["sway_mps"] * sway)
    turn = fade * (settings["yaw_offset_radps"] + settings["yaw_rate_radps"] * yaw)
    return np.stack([surge, side, turn], axis=1)


TELEGRAPH = Family(
    name="telegraph",
    summary="random switching of surge speed, sway speed and yaw rate between two levels each",
    settings=(
        DURATION,
        Setting(name="speed_mps", meaning="mean surge speed", low=-50, high=50, searched="surge"),
        Setting(
            name="speed_swing_mps",
            meaning="amplitude of surge speed",
            low=0,
            high=50,
            searched="surge",
        ),
        Setting(name="sway_mps", meaning="sway speed to both sides", low=0, high=20, searched="sway"),
        Setting(name="yaw_rate_radps", meaning="yaw rate to both sides", low=0, high=5, searched="yaw"),
        Setting(name="hold_s", meaning="mean time between switches", low=1e-2, high=1e5, searched="time"),
        Setting(name="rise_s", meaning="time that a switch takes", low=1e-2, high=1e4, searched="time"),
        Setting(name="draw", meaning="seed of the random numbers", default=1.0, low=0, high=2**31, searched="draw"),
        Setting(
            name="sway_offset_mps", meaning="steady sway added to it", default=0.0, low=-20, high=20, searched="sway"
        ),
        Setting(
            name="yaw_offset_radps", meaning="steady yaw rate added to it", default=0.0, low=-5, high=5, searched="yaw"
        ),
    ),
    reference=_reference,
)
