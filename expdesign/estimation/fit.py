"""Fit of a simulated output to a measured one.

Source: F. Ljungberg, doctoral thesis, Linköping University, (6.4).
"""

from __future__ import annotations

import numpy as np

from expdesign.values import Array


def fit_percent(measured: Array, simulated: Array) -> Array:
    """100 (1 - ||y - yhat|| / ||y - mean y||) per column of (k, n); nan for a constant y, negative for bad models.

    Samples that are not measured (nan) do not count.
    """
    seen = np.isfinite(measured)
    error = np.where(seen, measured - simulated, 0.0)
    count = np.maximum(seen.sum(axis=0), 1)
    spread = np.where(seen, measured - np.where(seen, measured, 0.0).sum(axis=0) / count, 0.0)
    size, reference = np.sqrt((error**2).sum(axis=0)), np.sqrt((spread**2).sum(axis=0))
    constant = reference <= 1e-12 * np.sqrt(np.where(seen, measured**2, 0.0).sum(axis=0))
    return np.asarray(np.where(constant, np.nan, 100.0 * (1.0 - size / np.where(constant, 1.0, reference))))
