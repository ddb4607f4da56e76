"""What the thesis adds to yaw models: a cumulative sum on the size of a residual, and the rank of a voyage.

s = |e| - d where |e| >= d, else -l;    g = max(0, g + s);    alarm where g > h
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.monitoring.yaw import YawData, YawModel, simulate_yaw
from expdesign.values import Array

RANK_TOLERANCE = 1e-6


@dataclass(frozen=True, kw_only=True)
class Detector:
    """Constants of the sum, in the unit of the residual.

    Attributes:
        d: size of a residual that counts.
        l: by which the sum falls at every smaller one.
        h: threshold.
    """

    d: float
    l: float  # noqa: E741  as the thesis names it
    h: float

    def sums(self, residual: Array) -> Array:
        """(n, k) sums of residuals (n, k)."""
        size = np.abs(residual)
        steps = np.where(size >= self.d, size - self.d, -self.l)
        found, total = np.empty_like(steps), np.zeros(len(steps))
        for index in range(steps.shape[1]):
            total = np.maximum(0.0, total + steps[:, index])
            found[:, index] = total
        return found

    def drift(self, std: float) -> float:
        """Expected step for white normal residuals of a standard deviation."""
        k = self.d / std
        tail = float(scipy.stats.norm.sf(k))
        return 2.0 * std * (float(scipy.stats.norm.pdf(k)) - k * tail) - self.l * (1.0 - 2.0 * tail)

    @classmethod
    def calibrated(cls, residuals: Array, *, false_share: float, deviations: float = 2.0) -> Detector:
        """Tuned on residuals of the nominal ship (n, k), of whose voyages a share raises an alarm.

        Args:
            residuals: of voyages as long as those that are watched.
            false_share: of the voyages.
            deviations: of the residual from which it counts.
        """
        size = np.abs(residuals)
        d = deviations * float(np.sqrt((residuals**2).mean()))
        over = size >= d
        l = 1.2 * float((size - d)[over].sum()) / max(float((~over).sum()), 1.0)  # noqa: E741
        largest = cls(d=d, l=l, h=np.inf).sums(residuals).max(axis=1)
        return cls(d=d, l=l, h=float(np.quantile(largest, 1.0 - false_share)))


def alarm_samples(detector: Detector, residual: Array) -> Array:
    """(n,) first sample with an alarm; nan without one."""
    over = detector.sums(residual) > detector.h
    return np.where(over.any(axis=1), over.argmax(axis=1), np.nan)


def excitation_rank(model: YawModel, data: YawData, parameters: Mapping[str, float]) -> int:
    """Number of parameters that one voyage determines: rank of the sensitivities of the simulated yaw rate."""
    scale = np.array([abs(parameters[name]) for name in model.parameters])
    values = np.array([parameters[name] for name in model.parameters])
    columns = simulate_yaw(model, data, values)[1][0] * scale
    size = np.linalg.norm(columns, axis=0)
    return int(np.linalg.matrix_rank(columns / np.where(size > 0, size, 1.0), tol=RANK_TOLERANCE))
