"""The tuning constants of the assessment of estimates, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        ahead_s: prediction horizon from measured states [s].
        largest_error: over the standard deviation of an output, that count.
    """

    ahead_s: float = 30.0
    largest_error: float = 1.0


TUNING = Tuning()
