"""What the yaw rate adds up to, against the turn of the compass: whatever the ship does, both are of one turn.

The rate of the heading is the difference of noisy headings: sample by sample it tells little of the scale of a yaw
rate, over a turn nearly all. Its excess over the yaw rate, added up since a stretch began, is the noise of the compass
about a random walk, of the gyro's noise. A filter of that walk leaves innovations, which are white.

Source: A. C. Harvey, Forecasting, Structural Time Series Models and the Kalman Filter (1989), section 4.1.2, for a
random walk that is seen with noise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from expdesign.monitoring.noise import Noise
from expdesign.values import Array

RATE, HEADING = 2, 3  # channels of the yaw rate and of the rate of the heading
APART = 2  # samples between those that are compared: sums of central differences share every second heading


def turned(
    columns: Array, seen: NDArray[np.bool_], noise: Noise, *, sample_s: float
) -> tuple[Array, NDArray[np.bool_]]:
    """(c, w, t) innovations of columns, and (w, t) where they are: up to the first sample that lacks either sensor.

    Args:
        columns: (c, w, s, 4), zero where not measured.
        seen: (w, s, 4) what is measured; of the rate of a heading, neither the first sample of a stretch nor its last.
        sample_s: between samples [s].
    """
    inner = np.s_[:, 1:-1]
    both = np.logical_and.accumulate(seen[..., RATE][inner] & seen[..., HEADING][inner], axis=1)
    excess = (columns[..., HEADING] - columns[..., RATE])[:, :, 1:-1]
    path = sample_s * np.cumsum(np.where(both, excess, 0.0), axis=2)[..., ::APART]
    both = both[:, ::APART]
    compass, walk = noise.std[HEADING] ** 2, APART * noise.std[RATE] ** 2  # variances, by the square of a sample's time
    level, spread, result = path[..., :1], compass, np.zeros_like(path)
    for place in range(1, path.shape[-1]):
        spread += walk
        missed, whole = path[..., place : place + 1] - level, spread + compass
        result[..., place] = missed[..., 0] * np.sqrt(compass / whole)
        level = level + missed * spread / whole
        spread *= compass / whole
    both[:, :1] = False  # the first is where the sum begins
    return np.where(both, result, 0.0), both
