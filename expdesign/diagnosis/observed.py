"""What the sensors of an extended model would show of its motion."""

from __future__ import annotations

import numpy as np

from expdesign.diagnosis.extended import Extended
from expdesign.diagnosis.windows import Windows
from expdesign.values import Array


def observed(ship: Extended, states: Array, windows: Windows, turned: Array | None = None) -> Array:
    """(w, s, 4) channels that the sensors would show.

    Args:
        ship: its sensors.
        states: (w, k, n) at integrator steps.
        windows: what is measured, and when.
        turned: (w, k) heading since the start; integrated from the yaw rate when None.
    """
    u, v, r = np.moveaxis(states[:, :: windows.steps_per_sample, :3], -1, 0)
    u, v = u - ship.get("lever:starboard") * r, v + ship.get("lever:forward") * r
    bias = ship.get("heading_bias")
    if bias:
        u, v = u * np.cos(bias) - v * np.sin(bias), v * np.cos(bias) + u * np.sin(bias)
    late = ship.get("late:psi")
    if late:
        turned = r * late
        u, v = u * np.cos(turned) - v * np.sin(turned), v * np.cos(turned) + u * np.sin(turned)
    channels = {"u": u, "v": v, "r": (1 + ship.get("gyro")) * r, "psi_rate": r}
    for name in channels if windows.derived else ("psi_rate",):
        channels[name] = averaged(channels[name])
    if turned is not None:
        channels["psi_rate"] = differenced(turned[:, :: windows.steps_per_sample], channels["psi_rate"], windows)
        channels["r"] = (1 + ship.get("gyro")) * channels["psi_rate"] if windows.derived else channels["r"]
    for name, keys in LATE.items():
        delay = sum(ship.get(f"late:{key}") for key in keys)
        if delay:
            channels[name] = _shifted(channels[name], delay / windows.sample_s)
    if ship.get("late:position") and windows.derived:
        turned = -r * ship.get("late:position")
        channels["u"], channels["v"] = (
            channels["u"] * np.cos(turned) - channels["v"] * np.sin(turned),
            channels["v"] * np.cos(turned) + channels["u"] * np.sin(turned),
        )
    return np.stack(list(channels.values()), axis=-1)


LATE = {"u": ("u", "position"), "v": ("v", "position"), "r": ("r", "psi"), "psi_rate": ("psi",)}


def differenced(turned: Array, otherwise: Array, windows: Windows) -> Array:
    """Central differences (w, s) of a heading; at the ends what is given."""
    result = otherwise.copy()
    result[:, 1:-1] = (turned[:, 2:] - turned[:, :-2]) / (2 * windows.sample_s)
    return result


def averaged(values: Array) -> Array:
    """What central differences see of a velocity (..., w, s): its mean over two samples, by Simpson's rule."""
    result = values.copy()
    result[..., 1:-1] = (values[..., :-2] + 4 * values[..., 1:-1] + values[..., 2:]) / 6
    return result


def _shifted(values: Array, samples: float) -> Array:
    """Late by a number of samples, straight in between; the first value before the window begins."""
    place = np.clip(np.arange(values.shape[1]) - samples, 0, values.shape[1] - 1)
    low = np.floor(place).astype(int)
    share = place - low
    high = np.minimum(low + 1, values.shape[1] - 1)
    return np.asarray(values[:, low] * (1 - share) + values[:, high] * share)
