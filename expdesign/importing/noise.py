"""Noise and rounding of the readings of each sensor, as lines of a vessel file."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from expdesign.importing.channels import Channel
from expdesign.importing.mapping import NORTHWARD, SOG
from expdesign.kinematics import held
from expdesign.values import Array

EARTH_M_PER_DEG = 111195.0
THIRD = math.sqrt(20.0)
"""Standard deviation of third differences of white noise of one."""
STEPS = 2000
WHOLE = 0.98
LOOKED_AT = 20_000
"""Samples from which it is told whether a log repeats readings."""
KEYS = (("heading_rad", "heading_rad", "heading"), ("r_radps", "yaw_rate_radps", "yaw_rate"),
        ("u_mps", "velocity_mps", "velocity"), (NORTHWARD, "velocity_mps", "velocity"),
        (SOG, "velocity_mps", "velocity"), ("lat_deg", "position_m", "position"), ("north_m", "position_m", "position"),
        ("wind_speed_mps", "wind_mps", "wind"), ("roll_rad", "roll_rad", ""))  # fmt: skip
"""Column, key of its noise in [sensors], and sensor whose interval is stated beside it."""


def sensor_keys(found: Mapping[str, Channel], held_s: Mapping[str, float]) -> dict[str, tuple[float, str]]:
    """Key of [sensors] -> value, and what it is, for every sensor that the columns show."""
    keys: dict[str, tuple[float, str]] = {}
    for column, key, sensor in KEYS:
        if column not in found or key in keys:
            continue
        scale = EARTH_M_PER_DEG if column == "lat_deg" else 1.0
        values = found[column].values
        if column == "heading_rad":
            values = np.unwrap(values)
        interval_s = held_s.get(column, 0.0)
        how = held(values[:LOOKED_AT, None])
        if how is not None and not how.interpolated:  # the log repeats what was read before
            values = values[np.flatnonzero(np.diff(values, prepend=np.nan) != 0)]
            interval_s = how.interval * found[column].interval_s
        rounding = scale * step_of(values)
        noise = scale * white_noise(values)
        value = max(noise, rounding / math.sqrt(12.0))
        if value > 0:
            words = f"noise {noise:.2g}, rounded to {rounding:.2g}" if rounding else f"noise {noise:.2g}"
            keys[key] = float(f"{value:.2g}"), words
        if sensor and interval_s:
            keys[f"{sensor}_interval_s"] = float(f"{interval_s:.4g}"), "between readings"
    return keys


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
