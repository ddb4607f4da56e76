"""The information of one primitive about the parameters."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.dictionary.primitive import Primitive
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class PrimitiveInformation:
    """Per-sample moments of regressors and instruments over one run (thesis (7.50)-(7.55)).

    Attributes:
        primitive: the manoeuvre.
        X: (p, p) mean of Phi Z^T.
        Y: (p, n) mean of Phi.
        Z: (p, n) mean of the instruments.
        YZ: (p, p) to subtract from X in batch mean subtraction: the mean of Y Z^T over headings.
        log_det_alone: log det of its own information matrix under the design's mean subtraction, or None if singular.
        excitation_condition: whether every argument of a modulus keeps its sign, with a margin for the stated noise.
    """

    primitive: Primitive
    X: Array
    Y: Array
    Z: Array
    YZ: Array
    log_det_alone: float | None
    excitation_condition: bool

    def __post_init__(self) -> None:
        seal(self, X="p p", Y="p n", Z="p n", YZ="p p")
