"""The information of one primitive about the parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from expdesign.dictionary.primitive import Primitive
from expdesign.values import Array, frozen_set, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class PrimitiveInformation:
    """Per-sample moments of regressors and instruments over one run (thesis (7.50)-(7.55)).

    Attributes:
        primitive: the manoeuvre.
        X: (p, p) mean of Phi Z^T.
        Y: (p, n) mean of Phi; with samples of each equation's own, over the samples of each stratum, of which n counts
            all of all equations, times their share of the run.
        Z: (p, n) mean of the instruments.
        YZ: (p, p) to subtract from X in batch mean subtraction: the mean of Y Z^T over headings.
        log_det_alone: log det of its own information matrix under the design's mean subtraction, or None if singular.
        excitation_condition: whether every argument of a modulus keeps its sign, with a margin for the stated noise.
        excites: the same by equation, for the moduli in its terms.
        clear_share: share of the samples that meet it, by equation; where it is required, 0 for runs that do not.
        used: (n,) share of the run's samples in each column of Y; 1 where all are used.
    """

    primitive: Primitive
    X: Array
    Y: Array
    Z: Array
    YZ: Array
    log_det_alone: float | None
    excitation_condition: bool
    excites: Mapping[str, bool] = field(default_factory=dict)
    clear_share: Mapping[str, float] = field(default_factory=dict)
    used: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if not self.used.size:
            frozen_set(self, "used", np.ones(self.Y.shape[1]))
        seal(self, X="p p", Y="p n", Z="p n", YZ="p p", used="n")


def over_shares(Y: Array, used: Array) -> Array:
    """(..., p, n) columns of Y over their shares (..., n); zero where nothing is used."""
    shares = used[..., None, :]
    return np.divide(Y, shares, out=np.zeros_like(Y), where=shares > 0)
