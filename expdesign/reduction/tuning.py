"""The tuning constants of the reduction, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        on_time: difference of two times, in samples, below which they count as equal.
        held_share: share of changes of a signal that a stated interval must explain.
        phases: changes from which the time of the readings within an interval is searched for.
        shortest_batch: samples that a batch must keep.
    """

    on_time: float = 1e-6
    held_share: float = 0.9
    phases: int = 50
    shortest_batch: int = 4


TUNING = Tuning()
