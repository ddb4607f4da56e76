"""Tuning constants of the reduction that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived."""

    shortest_batch: int = 4  # samples that a batch must keep


TUNING = Tuning()
