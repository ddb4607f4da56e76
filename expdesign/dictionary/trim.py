"""Steady states: commands that hold a velocity, and their residual."""

from __future__ import annotations

import numpy as np

from expdesign.errors import Unreachable
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel, commands_for, required_push

STEADY_CHANGE = 1e-6  # largest relative change of speed per sample of a steady state
# shares of a desired velocity from which the search for the largest one that can be held begins
SHARE_STARTS = (0.9, 0.75, 0.5, 0.25, 0.1, 0.03, 0.01)


def trim(vessel: Vessel, velocity: Array) -> Array:
    """Commands (..., m) that hold a velocity (..., 3) through calm water, as far as the actuators can."""
    push = required_push(vessel.model, velocity, np.zeros(3))
    return np.asarray(commands_for(vessel.model, push[..., None, :], sample_time_s=vessel.sample_time_s)[..., 0, :])


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
