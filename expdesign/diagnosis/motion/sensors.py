"""Sensor outputs of an extended model."""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model import ExtendedModel
from expdesign.values import Array


def sensor_outputs(ship: ExtendedModel, states: Array, windows: Windows, heading_change: Array | None = None) -> Array:
    """(w, s, 4) sensor outputs.

    Args:
        ship: its sensors.
        states: (w, k, n) at integrator steps.
        windows: measured channels and times.
        heading_change: (w, k) heading since the start; integrated from the yaw rate when None.
    """
    u, v, r = np.moveaxis(states[:, :: windows.steps_per_sample, :3], -1, 0)
    finer = windows.rows_per_step
    u, v = u - ship.get("lever:starboard") * r, v + ship.get("lever:forward") * r
    headings = None if heading_change is None else heading_change[:, :: windows.steps_per_sample]
    from_position = {"u", "v"} & set(windows.derived)
    if from_position:
        if headings is None:
            u, v = simpson_mean(u, finer), simpson_mean(v, finer)
        else:
            u, v = simpson_mean_of_track(u, v, headings, finer)
    u, v = _rotated(u, v, ship.get("heading_bias"))
    if not from_position:
        u, v = (1 + ship.get("log")) * u, (1 + ship.get("log")) * v
    if from_position and ship.get("late:psi"):
        u, v = _rotated(u, v, r * ship.get("late:psi"))
    channels = {"u": u, "v": v, "r": (1 + ship.get("gyro")) * r, "psi_rate": simpson_mean(r, finer)}
    if headings is not None and finer == 1:
        channels["psi_rate"] = heading_differences(headings, channels["psi_rate"], windows)
    if "r" in windows.derived:
        channels["r"] = channels["psi_rate"]
    late = LATE | {"r": ("psi",)} if "r" in windows.derived else LATE
    for name, keys in late.items():
        delay = sum(ship.get(f"late:{key}") for key in keys)
        if delay:
            channels[name] = _shifted(channels[name], delay / windows.sample_s)
    if from_position and ship.get("late:position"):
        channels["u"], channels["v"] = _rotated(channels["u"], channels["v"], -r * ship.get("late:position"))
    return np.stack(list(channels.values()), axis=-1)


def ship_velocities(ship: ExtendedModel, predicted: Array) -> Array:
    """(w, 3) velocities of the ship for sensor outputs (w, 3), without delays."""
    u, v, r = predicted.T
    r = r / (1 + ship.get("gyro"))
    u, v = _rotated(u / (1 + ship.get("log")), v / (1 + ship.get("log")), -ship.get("heading_bias"))
    return np.stack([u + ship.get("lever:starboard") * r, v - ship.get("lever:forward") * r, r], axis=-1)


def _rotated(u: Array, v: Array, angle: Array | float) -> tuple[Array, Array]:
    """Velocities along axes that lie anticlockwise of the ship's by an angle: surge leaks into sway as u sin(angle)."""
    c, s = np.cos(angle), np.sin(angle)
    return u * c - v * s, v * c + u * s


LATE = {"u": ("u", "position"), "v": ("v", "position"), "r": ("r",), "psi_rate": ("psi",)}
"""Delays that shift a channel; a yaw rate from the heading has the heading's."""


def heading_differences(heading_change: Array, otherwise: Array, windows: Windows) -> Array:
    """Central differences (w, s) of a heading; at the ends the given values."""
    result = otherwise.copy()
    result[:, 1:-1] = (heading_change[:, 2:] - heading_change[:, :-2]) / (2 * windows.sample_s)
    return result


def simpson_mean(values: Array, finer: int = 1) -> Array:
    """Central differences that belong to a velocity (..., w, s): its mean over two samples, by Simpson's rule.

    Args:
        values: at instants of comparison.
        finer: samples of the differences between two of these instants.
    """
    result = values.copy()
    bend = values[..., :-2] - 2 * values[..., 1:-1] + values[..., 2:]
    result[..., 1:-1] += bend / (6 * finer**2)
    return result


def simpson_mean_of_track(u: Array, v: Array, heading: Array, finer: int = 1) -> tuple[Array, Array]:
    """Central differences of positions: the mean velocity over two samples, along the axes of the middle one.

    The ship turns meanwhile, so this differs from the mean of u and v.
    """
    c, s = np.cos(heading), np.sin(heading)
    north, east = simpson_mean(u * c - v * s, finer), simpson_mean(u * s + v * c, finer)
    return north * c + east * s, east * c - north * s


def _shifted(values: Array, samples: float) -> Array:
    """Delayed by a number of samples, with linear interpolation; before the window, its first value."""
    place = np.clip(np.arange(values.shape[1]) - samples, 0, values.shape[1] - 1)
    low = np.floor(place).astype(int)
    share = place - low
    high = np.minimum(low + 1, values.shape[1] - 1)
    return np.asarray(values[:, low] * (1 - share) + values[:, high] * share)
