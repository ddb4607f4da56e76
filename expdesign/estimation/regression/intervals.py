"""Rows of a regression where velocities are read less often than they are sampled.

Between two readings a velocity is interpolated, and its differences from sample to sample are those of the
interpolation. Their sum from one reading to the next is a difference of readings. Every row therefore becomes the mean
of the rows between two readings, for each output by itself; equations that hold for rows hold for their means.
"""

from __future__ import annotations

import numpy as np

from expdesign.values import Array


def mean_between_readings(rows: Array, interpolated: Array) -> Array:
    """Rows (k - 1, n, ...) of pairs of successive samples, each replaced by the mean over its interval.

    Args:
        rows: of pairs of samples.
        interpolated: (k, n) positive where an output lies between readings; the ends count as read.
    """
    result = np.array(rows)
    for output, between in enumerate(interpolated.T):
        starts = np.flatnonzero(~(between[:-1] > 0) | (np.arange(len(rows)) == 0))
        counts = np.diff(np.append(starts, len(rows)))
        sums = np.add.reduceat(rows[:, output], starts, axis=0)
        means = sums / counts.reshape(-1, *[1] * (sums.ndim - 1))
        result[:, output] = np.repeat(means, counts, axis=0)
    return result
