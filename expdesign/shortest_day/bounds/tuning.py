"""The numbers of the bound on the day that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Work limits and tolerances. All but `rounding` decide only how near to the truth the bound comes."""

    rounds: int = 40  # of adding samples to a measure


TUNING = Tuning()
