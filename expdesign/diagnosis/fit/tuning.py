"""Numbers that steer fits."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Numbers of this package. "Cost" is twice the negative log likelihood."""

    # numbers in sensitivities and their inner products of windows that are taken together, so that memory does not grow
    # with the data
    sensitivities_at_once: int = 20_000_000
    folds: int = 3  # of the cross-validation
    ahead_s: float = 30.0  # length of the stretches that held-out data are also simulated in [s]
    block_s: float = 60.0  # length of the blocks that predictions are compared in [s]


TUNING = Tuning()
