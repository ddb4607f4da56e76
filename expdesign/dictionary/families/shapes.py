"""Smooth pieces that references are made of: actuators have rates, so nothing jumps."""

from __future__ import annotations

import numpy as np

from expdesign.values import Array


def ramp(time_s: Array, *, start_s: float = 0.0, length_s: float) -> Array:
    """Half a cosine from 0 to 1 over `length_s`, flat outside."""
    x = np.clip((time_s - start_s) / max(length_s, 1e-12), 0.0, 1.0)
    return np.asarray((1.0 - np.cos(np.pi * x)) / 2.0)


def flat_wave(time_s: Array, *, period_s: float) -> Array:
    """A rounded square wave between -1 and 1 that starts at 1 in the middle of a plateau.

    Its integral over the first quarter is the peak, so a heading rate of this shape swings the heading evenly to
    both sides and returns after every whole period.
    """
    sharpness = 3.0
    return np.asarray(np.tanh(sharpness * np.cos(2.0 * np.pi * time_s / period_s)) / np.tanh(sharpness))


def faded(signal: Array, time_s: Array, *, length_s: float) -> Array:
    """The signal brought in from zero at the start and taken back to zero at the end."""
    end_s = float(time_s[-1])
    return signal * ramp(time_s, length_s=length_s) * ramp(end_s - time_s, length_s=length_s)
