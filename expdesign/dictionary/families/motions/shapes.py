"""Smooth shapes of reference motions: without jumps, because actuators have rate limits."""

from __future__ import annotations

import numpy as np

from expdesign.dictionary.spec import Setting
from expdesign.dictionary.tuning import TUNING
from expdesign.errors import InputError
from expdesign.values import Array

RAMP_FRACTION = Setting(
    name="ramp_fraction",
    meaning="share of the run that the change takes",
    default=0.7,
    low=0.01,
    high=1,
    searched="share",
)


def ramp(time_s: Array, *, start_s: float = 0.0, length_s: float) -> Array:
    """Half a cosine from 0 to 1 over `length_s`, flat outside."""
    x = np.clip((time_s - start_s) / max(length_s, 1e-12), 0.0, 1.0)
    return np.asarray((1.0 - np.cos(np.pi * x)) / 2.0)


def envelope(time_s: Array, *, length_s: float) -> Array:
    """1, brought in from zero at the start and taken back to zero at the end over `length_s`."""
    return ramp(time_s, length_s=length_s) * ramp(float(time_s[-1]) - time_s, length_s=length_s)


def flat_wave(time_s: Array, *, period_s: float) -> Array:
    """A rounded square wave of amplitude 1 that begins and ends at zero and has zero mean.

    It starts in the middle of a plateau, so that its integral (heading, sideways distance) swings evenly to both sides
    and returns.

    Raises:
        InputError: the samples hold no swing of that period.
    """
    sharpness = 3.0
    wave = np.tanh(sharpness * np.cos(2.0 * np.pi * time_s / period_s)) / np.tanh(sharpness)
    fade = envelope(time_s, length_s=period_s / 12)
    weights = np.r_[0.5, np.ones(len(time_s) - 2), 0.5]
    centred = fade * (wave - weights @ (fade * wave) / max(weights @ fade, 1e-300))
    if not (centred.max() > TUNING.least_swing and centred.min() < -TUNING.least_swing):
        raise InputError(
            f"period_s is {period_s:g}, expected a full swing within duration_s = {time_s[-1]:g} and several samples "
            f"of {time_s[1]:g} s within a swing"
        )
    return np.asarray(centred / np.abs(centred).max())


def speed_change(time_s: Array, *, first: float, last: float, share: float) -> Array:
    """(k, 3) u, v, r of a straight run whose surge speed changes over a share of it and then stays."""
    surge = first + (last - first) * ramp(time_s, length_s=share * float(time_s[-1]))
    return np.stack([surge, 0 * surge, 0 * surge], axis=1)
