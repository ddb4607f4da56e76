"""Tuning constants of the assessment of estimates that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived."""

    ahead_s: float = 30.0  # prediction horizon from measured states [s]
    largest_error: float = 1.0  # over the standard deviation of an output, that count


TUNING = Tuning()
