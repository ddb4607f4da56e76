"""Tuning constants of information that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived."""

    headings: int = 8  # evenly spread headings over which information is averaged in wind or current
    runs_at_once: int = 2048  # runs simulated together, so that their states stay in the processor's cache


TUNING = Tuning()
