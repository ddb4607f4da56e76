"""Tuning constants of the manoeuvring indices that several modules read."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived."""

    # largest deviation of helm and reversals of a 10/10 or 20/20 zig-zag from the nominal angles [rad]
    zigzag_deviation_rad: float = math.radians(2.0)


TUNING = Tuning()
