"""The D-optimal shares of a dictionary, and the sensitivity of one more run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.durations import bordered, d_optimal, log_det, rows_of, whitened
from expdesign.information import PrimitiveInformation
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """Shares of the time, the optimal ones or others, and their information.

    Attributes:
        fractions: (q,) time fractions.
        log_det: in physical scale.
        inverse: (d, d) B^-1 in physical scale.
    """

    fractions: Array
    log_det: float
    inverse: Array

    def __post_init__(self) -> None:
        seal(self, fractions="q", inverse="d d")

    @property
    def dimension(self) -> int:
        """Size of B."""
        return len(self.inverse)


def optimum(information: Sequence[PrimitiveInformation], mean_subtraction: str) -> Optimum:
    """D-optimal time fractions of a dictionary that informs about every parameter."""
    white, _ = whitened(np.array([bordered(item, mean_subtraction) for item in information]))
    rows = rows_of(white)
    assert rows is not None  # simulated runs have positive semidefinite information
    return shared(information, d_optimal(rows, tolerance=1e-10).fractions, mean_subtraction)


def shared(
    information: Sequence[PrimitiveInformation], fractions: Array, mean_subtraction: str = "complete"
) -> Optimum:
    """The information of given time fractions (q,)."""
    matrices = np.array([bordered(item, mean_subtraction) for item in information])
    white, offset = whitened(matrices)
    total = np.tensordot(fractions, matrices, axes=1)
    scale = np.sqrt(np.diag(total))
    inverse = np.linalg.inv(total / np.outer(scale, scale)) / np.outer(scale, scale)
    return Optimum(fractions=fractions, log_det=log_det(white, fractions) + offset, inverse=inverse)


def sensitivity(best: Optimum, item: PrimitiveInformation, mean_subtraction: str) -> float:
    """d = trace(B(w)^-1 B) of one run."""
    return float(np.sum(best.inverse * bordered(item, mean_subtraction)))
