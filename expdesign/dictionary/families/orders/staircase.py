"""Levels that are gone through up and down, for families of steps."""

from __future__ import annotations

import numpy as np

from expdesign.dictionary.spec import Setting
from expdesign.values import Array

STEPS_SETTING = Setting(name="steps", meaning="steps up, and as many down, a whole number", default=3.0, low=1, high=50)


def staircase(levels: Array, time_s: Array, duration_s: float) -> Array:
    """(k,) the levels from first to last and back to the first, each for the same time."""
    stairs = np.concatenate([levels, levels[-2::-1]])
    place = (time_s / duration_s * len(stairs)).astype(int)
    return np.asarray(stairs[np.minimum(place, len(stairs) - 1)])
