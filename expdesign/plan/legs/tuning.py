"""Numbers of this package that are chosen, not derived, and that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Legs: optimisation, paths and recovery."""

    # largest speed and yaw rate of legs whose ends are faster than legs need be, in those of their ends
    beyond_ends: float = 1.02


LEGS = Tuning()
