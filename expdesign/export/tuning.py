"""The tuning constants of pages, figures, cards and files, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        noticed: relative differences below this are not reported.
    """

    noticed: float = 0.02


TUNING = Tuning()
