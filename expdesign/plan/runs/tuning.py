"""The numbers of this room that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Dispersion of runs.

    Attributes:
        fewest_draws, most_draws: drawn runs of each primitive.
        expected_outside: draws are so many that this number may leave the room.
    """

    fewest_draws: int = 200
    most_draws: int = 2000
    expected_outside: float = 2.0


RUNS = Tuning()
