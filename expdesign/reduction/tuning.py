"""The tuning constants of the reduction, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        shortest_batch: samples that a batch must keep.
    """

    shortest_batch: int = 4


TUNING = Tuning()
