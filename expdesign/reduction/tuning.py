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
        longest_mean_s: over which samples are averaged, at most [s].
        mean_share: of the time in which the ship sails, or turns through, her length, over which they are, at most. Her
            own times are a third of it and more.
    """

    on_time: float = 1e-6
    held_share: float = 0.9
    phases: int = 50
    shortest_batch: int = 4
    longest_mean_s: float = 1.0
    mean_share: float = 0.1


TUNING = Tuning()
