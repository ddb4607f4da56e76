"""Where operating points matter: complete against batchwise mean subtraction on y = theta u + e.

With an offset of the input that changes sign half-way, the variance of the complete estimator falls as 1 / (1 +
offset^2), the batchwise one stays.

Source: F. Ljungberg, doctoral thesis, Linköping University, example 7.1, (7.21)-(7.29), figure 7.1.
"""

from __future__ import annotations

import numpy as np

from expdesign.estimation.regression import single_output
from expdesign.estimation.solve import Weighting, solve_iv
from expdesign.values import Array

SAMPLES = 200
NOISE_VARIANCE = 0.25
NOISE_MEAN = 0.25


def errors(offset: float, *, runs: int, rng: np.random.Generator) -> dict[str, Array]:
    """Errors (runs,) of the "complete" and the "batch" estimator."""
    sign = np.where(np.arange(SAMPLES) < SAMPLES // 2, 1.0, -1.0)
    batch = (sign < 0).astype(np.int64)
    found: dict[str, list[float]] = {"complete": [], "batch": []}
    for _ in range(runs):
        u = rng.standard_normal(SAMPLES) + offset * sign
        y = u + NOISE_MEAN + np.sqrt(NOISE_VARIANCE) * rng.standard_normal(SAMPLES)
        regression = single_output(u[:, None], y, parameters=("theta",), batch=batch)
        for mean, values in found.items():
            solution = solve_iv(regression, u[:, None, None], Weighting(mean=mean, covariance="hc0"))
            values.append(float(solution.values[0]) - 1.0)
    return {mean: np.array(values) for mean, values in found.items()}


def predicted_variance(offset: float, mean: str) -> float:
    """For many samples."""
    return NOISE_VARIANCE / SAMPLES / (1.0 + (offset**2 if mean == "complete" else 0.0))
