"""The numbers of this room that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Dispersion of runs, and fleets.

    Attributes:
        fewest_draws, usual_draws: drawn runs of each primitive.
        expected_outside: draws are so many that this number may leave the room.
        most_draws: where one outside takes more than the usual number.
        draws_at_once: simulated together, which bounds the memory.
        few_ships: up to so many are quicker one by one than by an operation on all of them at a time.
    """

    fewest_draws: int = 200
    usual_draws: int = 2000
    expected_outside: float = 2.0
    most_draws: int = 50_000
    draws_at_once: int = 4000
    few_ships: int = 128


RUNS = Tuning()
