"""Tuning constants of pages, figures, cards and files that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived."""

    noticed: float = 0.02  # relative differences below this are not reported


TUNING = Tuning()
