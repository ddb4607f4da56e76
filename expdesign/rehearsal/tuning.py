"""The tuning constants of the rehearsal of designs, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        chunk_trials: trials in one chunk; each chunk has its own random stream.
        single_trials: the same of random runs, simulated trial by trial: processes share smaller chunks more evenly.
    """

    chunk_trials: int = 20
    single_trials: int = 5


TUNING = Tuning()
