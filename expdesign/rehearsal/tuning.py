"""The tuning constants of the rehearsal of designs, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        chunk_trials: trials in one chunk; each chunk has its own random stream.
    """

    chunk_trials: int = 20


TUNING = Tuning()
