"""Tuning constants of monitoring that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Sizes, lengths and limits."""

    known_within: float = 6.0  # a change is watched for where its size is so many standard errors of the reference
    # share of the size that matters for which a sum grows fastest: of changes smaller than half of it, it does not grow
    tuned_to: float = 0.6
    relative_size: float = 0.1  # change of a parameter, a gain or an inertia that matters, as a share


TUNING = Tuning()
