"""Numbers that steer fits."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Numbers of this room. "Cost" is twice the negative log likelihood.

    Attributes:
        sensitivities_at_once: numbers in sensitivities and their inner products of windows that are taken together, so
            that memory does not grow with the data.
        folds: of the cross-validation.
        ahead_s: length of the stretches that held-out data are also simulated in [s].
        block_s: length of the blocks that predictions are compared in [s].
    """

    sensitivities_at_once: int = 20_000_000
    folds: int = 3
    ahead_s: float = 30.0
    block_s: float = 60.0


TUNING = Tuning()
