"""How much measured channels vary."""

from __future__ import annotations

import numpy as np

from expdesign.values import Array


def spread(values: Array) -> Array:
    """(n,) standard deviation of each channel of (w, s, n) over what is measured; 0 where nothing is."""
    seen = np.isfinite(values)
    count = np.maximum(seen.sum(axis=(0, 1)), 1)
    mean = np.where(seen, values, 0.0).sum(axis=(0, 1)) / count
    return np.asarray(np.sqrt(np.where(seen, (values - mean) ** 2, 0.0).sum(axis=(0, 1)) / count))
