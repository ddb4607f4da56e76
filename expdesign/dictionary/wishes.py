"""What a family wished for beside what the vessel does: names promise the first, only the second counts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.dictionary.build import family
from expdesign.dictionary.primitive import Primitive
from expdesign.errors import InputError
from expdesign.values import Array

STRAYED = 0.1
"""Largest departure, as a share of the largest wished speed or yaw rate, from which a primitive counts as strayed."""


def wished_motion(primitive: Primitive) -> Array | None:
    """(k + 1, 3) u, v, r that its family wished for, or None where families give commands instead."""
    try:
        reference = family(primitive.family).reference
    except InputError:
        return None
    return None if reference is None else reference(primitive.settings, primitive.trajectory.time_s)


def departure(primitive: Primitive) -> float:
    """Largest difference between motion and wish: of u and v per largest wished speed, of r per largest yaw rate.

    Zero for families that wish for no velocities.
    """
    wished = wished_motion(primitive)
    if wished is None:
        return 0.0
    apart = np.abs(primitive.trajectory.velocity - wished).max(axis=0)
    speed = max(float(np.hypot(*wished[:, :2].T).max()), 1e-9)
    turn = float(np.abs(wished[:, 2]).max()) or speed
    return float(max(apart[0] / speed, apart[1] / speed, apart[2] / turn))


def strayed(primitives: Sequence[Primitive]) -> tuple[Primitive, ...]:
    """Those that actuators or model keep from what they wished."""
    return tuple(item for item in primitives if departure(item) > STRAYED)
