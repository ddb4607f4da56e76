"""Tuning constants of the rehearsal of designs that several modules read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived."""

    chunk_trials: int = 20  # trials in one chunk; each chunk has its own random stream
    # the same of random runs, simulated trial by trial: processes share smaller chunks more evenly
    single_trials: int = 5


TUNING = Tuning()
