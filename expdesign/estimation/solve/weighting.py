"""Options of instrumental variables: their equations, and the noise that their covariance accounts for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.errors import InputError, UnknownName

COVARIANCES = ("components", "hac", "kernel", "hc1", "hc0")
BLOCKS = ("one", "batch")


@dataclass(frozen=True, kw_only=True)
class Weighting:
    """Options of the equations and of their covariance.

    Attributes:
        mean: subtracted from the instruments, one of `zero_mean.MEANS`.
        blocks: "one" block of instruments for all batches, or one per "batch" (4.45).
        batch_weights: one factor per batch, how much its equations count; () for all alike.
        output_weights: one factor per output, how much its equation counts; () for all alike.
        covariance: one of `COVARIANCES`, see `sandwich`.
        kernel: of the "hac" and "kernel" covariance.
        lags: their last lag, None for automatic.
    """

    mean: str = "none"
    blocks: str = "one"
    batch_weights: tuple[float, ...] = ()
    output_weights: tuple[float, ...] = ()
    covariance: str = "components"
    kernel: str = "parzen"
    lags: int | None = None

    def __post_init__(self) -> None:
        for what, value, known in (
            ("instrument blocks", self.blocks, BLOCKS),
            ("covariance", self.covariance, COVARIANCES),
        ):
            if value not in known:
                raise UnknownName(what, value, known=known)
        for name in ("batch_weights", "output_weights"):
            if not all(0 < weight < np.inf for weight in getattr(self, name)):
                raise InputError(f"{name} {getattr(self, name)} need to be positive numbers")
