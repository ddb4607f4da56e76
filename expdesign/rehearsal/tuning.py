"""The tuning constants of the rehearsal of designs, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        chunk_trials: trials in one chunk; each chunk has its own random stream.
        single_trials: the same of random runs, simulated trial by trial: processes share smaller chunks more evenly.
        singular: least singular value of scaled equations, as a share of the largest, that still gives an estimate.
        degenerate_share: simulation errors above this share of the motion make a model degenerate.
    """

    chunk_trials: int = 20
    single_trials: int = 5
    singular: float = 1e-12
    degenerate_share: float = 1.0


TUNING = Tuning()
