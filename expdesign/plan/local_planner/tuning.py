"""Numbers of this package that are chosen, not derived, and that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Local planners."""

    drift_rounds: int = 3  # rounds in which the time of a leg and the drift in that time are made to agree


LOCAL = Tuning()
