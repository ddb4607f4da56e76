"""The tuning constants of pages, figures, cards and files, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived."""

    noticed: float = 0.02  # relative differences below this are not reported


TUNING = Tuning()
