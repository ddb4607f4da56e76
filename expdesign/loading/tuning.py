"""The tuning constants of load plans, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        least_efficiency: D-efficiency that a plan with fewer loads keeps, of the best with all candidates.
        small_share: of a parameter's standard deviation, below which its value counts as zero; the deviation is then
            its size.
    """

    least_efficiency: float = 0.9
    small_share: float = 0.01


TUNING = Tuning()
