"""Steady states: commands that hold a velocity, and their residual."""

from __future__ import annotations

import numpy as np
import scipy

from expdesign.errors import Unreachable
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel, allocate, direct_terms, required_force

STEADY_CHANGE = 1e-6  # largest relative change of speed per sample of a steady state
# shares of a desired velocity from which the search for the largest one that can be held begins
SHARE_STARTS = (0.9, 0.75, 0.5, 0.25, 0.1, 0.03, 0.01)
THRUST_STARTS = (0.05, 0.4, 0.9)  # shares of full thrust from which the search for commands of a direct model begins


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
    """(...) change of speed per sample, relative; `STEADY_CHANGE` at most in a steady state."""
    change = np.abs(drift(vessel, velocity, inputs)).max(axis=-1) * vessel.sample_time_s
    return np.asarray(change / np.maximum(1e-9, np.abs(velocity).max(axis=-1)))


def hold(vessel: Vessel, velocity: Array) -> Array:
    """Commands (m,) that hold a velocity (3,) through calm water.

    Raises:
        Unreachable: the actuators cannot.
    """
    inputs = trim(vessel, velocity)
    if lost(vessel, velocity, inputs) > STEADY_CHANGE:
        raise Unreachable(
            f"the actuators cannot hold its entry state {motion_text(velocity)}; {reach_text(vessel, velocity)}"
        )
    return inputs


def held_share(vessel: Vessel, velocity: Array) -> float:
    """The largest share of a velocity (3,), in steps down from all of it, that the actuators hold; 0 for none."""

    def holds(share: float) -> bool:
        return bool(lost(vessel, share * velocity, trim(vessel, share * velocity)) <= STEADY_CHANGE)

    if holds(1.0):
        return 1.0
    high, low = 1.0, next((share for share in SHARE_STARTS if holds(share)), 0.0)
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
    tries = [np.clip(start * np.sign(velocity[0]) * ahead, low + 1e-9, high - 1e-9) for start in THRUST_STARTS]
    found = [
        scipy.optimize.least_squares(excess, start, bounds=(low, high), xtol=1e-15, ftol=1e-15, gtol=1e-15)
        for start in tries
    ]
    best: Array = min(found, key=lambda item: float(item.cost)).x
    return np.asarray(best * scale)
