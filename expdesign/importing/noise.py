"""Noise, rounding and interval of the readings of each sensor, as keys of `[sensors]` in vessel files."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from expdesign.importing.channels import Channel
from expdesign.importing.sampling import SAME, Sampled
from expdesign.values import Array

EARTH_M_PER_DEG = 111195.0
THIRD = math.sqrt(20.0)
"""Standard deviation of third differences of white noise of one."""
STEPS = 2000
WHOLE = 0.98
DITHERED = 0.3  # noise over rounding above which means of readings are finer than the rounding
KEYS = (("heading_rad", ("heading_rad",), "heading"), ("yaw_rate_radps", ("r_radps",), "yaw_rate"),
        ("velocity_mps", ("u_mps", "v_mps"), "velocity"), ("position_m", ("lat_deg",), "position"),
        ("position_m", ("north_m", "east_m"), "position"), ("wind_mps", ("wind_speed_mps",), "wind"),
        ("roll_rad", ("roll_rad",), ""))  # fmt: skip
"""Key of a sensor's noise in [sensors], the columns that show it, and the sensor whose interval is stated beside."""


def sensor_keys(found: Sampled) -> dict[str, tuple[float, str]]:
    """Key of [sensors] -> value for the rows that are written, and what it is, for every sensor that shows."""
    keys: dict[str, tuple[float, str]] = {}
    for key, columns, sensor in KEYS:
        own = [found.channels[name] for name in columns if name in found.channels]
        if not own or key in keys:
            continue
        value, words = _noise(own, found.sample_time_s)
        if value > 0:
            keys[key] = float(f"{value:.2g}"), words
        if sensor and columns[0] in found.held_s:
            keys[f"{sensor}_interval_s"] = float(f"{found.held_s[columns[0]]:.4g}"), "between readings"
    return keys


def _noise(channels: Sequence[Channel], step_s: float) -> tuple[float, str]:
    """Standard deviation of the readings of one sensor in the rows that are written, and words on it."""
    squares, noises, roundings, averaged = [], [], [], False
    for channel in channels:
        scale = EARTH_M_PER_DEG if channel.name == "lat_deg" else 1.0
        values = np.unwrap(channel.values) if channel.name == "heading_rad" else channel.values
        rounding, noise = scale * step_of(values), scale * white_noise(values)
        share = channel.interval_s / step_s
        averaged = share < 1.0 / SAME
        mean = math.sqrt(share) if averaged else 1.0
        coarse = rounding / math.sqrt(12.0) * (mean if noise > DITHERED * rounding else 1.0)
        squares.append(max(noise * mean, coarse) ** 2)
        noises.append(noise)
        roundings.append(rounding)
    words = f"noise {max(noises):.2g}" + (f", rounded to {max(roundings):.2g}" if any(roundings) else "")
    return math.sqrt(float(np.mean(squares))), words + (" in each reading, of which rows are means" if averaged else "")


def step_of(values: Array) -> float:
    """The step that readings are rounded to; 0 where none shows."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-9 * max(float(np.abs(values).max()), 1e-12)]
    if not len(steps):
        return 0.0
    least = float(np.quantile(steps, 0.01)) if len(steps) > STEPS else float(steps.min())
    near = steps[steps < 1.5 * least]
    step = float(near.mean()) if len(near) else least
    small = steps[steps < 50 * step]
    whole = np.abs(small / step - np.round(small / step)) < 0.2
    return step if len(small) > 20 and whole.mean() > WHOLE else 0.0


def white_noise(values: Array) -> float:
    """Standard deviation of what changes from reading to reading, from third differences, robust against orders."""
    if len(values) < 50:
        return 0.0
    third = np.diff(values, 3)
    return float(1.4826 * np.median(np.abs(third - np.median(third))) / THIRD)
