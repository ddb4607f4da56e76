"""What one primitive tells about the parameters."""

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
        YZ: (p, p) what subtracting each run's own means takes off X: the mean over headings of Y Z^T, and Y Z^T itself
            when heading does not matter.
        log_det_alone: log det of its own information matrix under the design's mean subtraction, or None if singular.
        excitation_condition: whether every state inside a modulus keeps its sign and clears the stated noise.
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
