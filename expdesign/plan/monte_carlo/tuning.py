"""Numbers of this package that are chosen, not derived, and that several modules read."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Simulated trials, go-arounds and the chance constraint."""

    heading_rad: float = radians(3.0)  # tolerance of a run's start heading
    trials_at_once: int = 1000  # trials sailed together, so that memory does not grow with their number


MONTE_CARLO = Tuning()
