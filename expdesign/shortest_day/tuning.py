"""The numbers of the shortest day that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Rounds and tolerances.

    Attributes:
        rounds: most days that are planned in search of the shortest.
        choice_gap: relative gap at which the choice of runs ends.
    """

    rounds: int = 5
    choice_gap: float = 1e-3


TUNING = Tuning()
