"""The tuning constants of the manoeuvring indices, in one place."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        zigzag_deviation_rad: largest deviation of helm and reversals of a 10/10 or 20/20 zig-zag from the
            nominal angles [rad].
        under_way: speed by the root of the length [m^0.5/s] (a Froude number of 0.016) below which a ship is not under
            way.
        held_lengths: ship lengths sailed while the helm is held at an angle of the trial, once to each side.
        touched: share of the longest stretch of held helm below which a shorter one, or a gap in one, is steering.
        least_move: share of its final angle by which the helm moves with the first order at least.
        steady_approach: change of speed, by the speed, over the last ship length of a steady approach at most.
        current: uniform current, by the approach speed, that is told when it is removed.
    """

    zigzag_deviation_rad: float = math.radians(2.0)
    under_way: float = 0.05
    held_lengths: float = 1.0
    touched: float = 0.1
    least_move: float = 0.2
    steady_approach: float = 0.05
    current: float = 0.02


TUNING = Tuning()
