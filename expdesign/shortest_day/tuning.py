"""The numbers of the shortest day that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Rounds and tolerances."""

    rounds: int = 5  # most days that are planned in search of the shortest
    choice_gap: float = 1e-3  # relative gap at which the choice of runs ends


TUNING = Tuning()
