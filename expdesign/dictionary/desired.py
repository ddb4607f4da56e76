"""Deviation of the simulated motion from the desired one; designs use the simulated motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.dictionary.build import family
from expdesign.dictionary.primitive import Primitive
from expdesign.dictionary.tuning import TUNING
from expdesign.errors import InputError
from expdesign.values import Array


def desired_motion(primitive: Primitive) -> Array | None:
    """(k + 1, 3) desired u, v, r, or None where the family gives commands instead."""
    try:
        reference = family(primitive.family).reference
    except InputError:
        return None
    return None if reference is None else reference(primitive.settings, primitive.trajectory.time_s)


def deviation(primitive: Primitive) -> float:
    """Largest deviation from the desired motion: of u and v per largest desired speed, of r per largest yaw rate.

    Zero for families without desired velocities.
    """
    desired = desired_motion(primitive)
    if desired is None:
        return 0.0
    apart = np.abs(primitive.trajectory.velocity - desired).max(axis=0)
    speed = max(float(np.hypot(*desired[:, :2].T).max()), 1e-9)
    turn = float(np.abs(desired[:, 2]).max()) or speed
    return float(max(apart[0] / speed, apart[1] / speed, apart[2] / turn))


def deviating(primitives: Sequence[Primitive]) -> tuple[Primitive, ...]:
    """Primitives that deviate from the desired motion by more than `Tuning.reported_deviation`."""
    return tuple(item for item in primitives if deviation(item) > TUNING.reported_deviation)
