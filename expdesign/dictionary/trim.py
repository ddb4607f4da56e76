"""Steady states: commands that hold a velocity, and their residual."""

from __future__ import annotations

import numpy as np
import scipy

from expdesign.dictionary.tuning import TUNING
from expdesign.errors import Unreachable
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel, allocate, direct_terms, required_force


def trim(vessel: Vessel, velocity: Array) -> Array:
    """Commands (..., m) that hold a velocity (..., 3) through calm water, as far as the actuators can."""
    if direct_terms(vessel.model):
        flat = velocity.reshape(-1, 3)
        return np.array([_direct_trim(vessel, row) for row in flat]).reshape(*velocity.shape[:-1], -1)
    force = required_force(vessel.model, velocity, np.zeros(3))
    return np.asarray(allocate(vessel.actuators, force[..., None, :], sample_time_s=vessel.sample_time_s)[..., 0, :])


def drift(vessel: Vessel, velocity: Array, inputs: Array) -> Array:
    """Acceleration (..., 3) at a velocity (..., 3) through calm water under given commands (..., m)."""
    motion, held = np.moveaxis(velocity, -1, 0), np.moveaxis(inputs, -1, 0)
    parts = vessel.model.accelerations(motion, motion[:2], held, NUMPY)
    if vessel.model.roll is not None:
        parts = vessel.model.roll.standing(parts, motion[0] * motion[2])
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def lost(vessel: Vessel, velocity: Array, inputs: Array) -> Array:
    """(...) change of speed per sample, relative; `Tuning.steady_change` at most in a steady state."""
    change = np.abs(drift(vessel, velocity, inputs)).max(axis=-1) * vessel.sample_time_s
    return np.asarray(change / np.maximum(1e-9, np.abs(velocity).max(axis=-1)))


def hold(vessel: Vessel, velocity: Array) -> Array:
    """Commands (m,) that hold a velocity (3,) through calm water.

    Raises:
        Unreachable: the actuators cannot.
    """
    inputs = trim(vessel, velocity)
    if lost(vessel, velocity, inputs) > TUNING.steady_change:
        raise Unreachable(
            f"the actuators cannot hold its entry state {motion_text(velocity)}; {reach_text(vessel, velocity)}"
        )
    return inputs


def held_share(vessel: Vessel, velocity: Array) -> float:
    """The largest share of a velocity (3,), in steps down from all of it, that the actuators hold; 0 for none."""

    def holds(share: float) -> bool:
        return bool(lost(vessel, share * velocity, trim(vessel, share * velocity)) <= TUNING.steady_change)

    if holds(1.0):
        return 1.0
    high, low = 1.0, next((share for share in TUNING.share_starts if holds(share)), 0.0)
    while low and high - low > 1e-4 * low:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def motion_text(velocity: Array) -> str:
    """A velocity (3,) for messages."""
    turn = f", r = {velocity[2]:.4g} rad/s" if velocity[2] else ""
    return f"u = {velocity[0]:.4g} m/s, v = {velocity[1] + 0.0:.4g} m/s{turn}"


def reach_text(vessel: Vessel, velocity: Array) -> str:
    """What of a velocity (3,) the actuators hold, for messages."""
    share = held_share(vessel, velocity)
    return (
        f"in that direction they reach {motion_text(share * velocity)}"
        if share
        else "they reach no motion in that direction"
    )


def _direct_trim(vessel: Vessel, velocity: Array) -> Array:
    """Least accelerations within limits, by commands as small as do it, for a model that reads its actuators."""
    scale = np.array(
        [max(abs(x.low), abs(x.high)) if np.isfinite([x.low, x.high]).all() else 1.0 for x in vessel.limits]
    )
    low, high = (np.array([getattr(x, side) for x in vessel.limits]) / scale for side in ("low", "high"))
    free = np.maximum(np.abs(drift(vessel, velocity, 0 * scale)).max(), 1e-12)

    def excess(share: Array) -> Array:
        return np.asarray(np.r_[drift(vessel, velocity, share * scale) / free, 1e-9 * share])

    ahead = np.array([name.startswith(("n", "tau_x")) for name in vessel.model.inputs])
    tries = [np.clip(start * np.sign(velocity[0]) * ahead, low + 1e-9, high - 1e-9) for start in TUNING.thrust_starts]
    found = [
        scipy.optimize.least_squares(excess, start, bounds=(low, high), xtol=1e-15, ftol=1e-15, gtol=1e-15)
        for start in tries
    ]
    best: Array = min(found, key=lambda item: float(item.cost)).x
    return np.asarray(best * scale)
