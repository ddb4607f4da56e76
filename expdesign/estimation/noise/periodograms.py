"""Periodograms of residuals, and their expectations for each part of the noise.

Stretches may have gaps; expectations are exact for the samples that are there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.estimation.noise.parts import Slow
from expdesign.estimation.noise.timeline import Stretch
from expdesign.estimation.tuning import TUNING
from expdesign.values import Array


def periodograms(eps: Array, parts: Sequence[Stretch], expected: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Frequencies (f,), the periodogram there, and each part's expected one (2 + m, f), of all stretches in a row.

    Frequency zero is there only where the mean is, not where it was subtracted.
    """
    found = []
    for part, shapes in zip(parts, expected, strict=True):
        own = eps[part.rows]
        ordinates = np.abs(np.fft.rfft(part.spread(own), part.padded)) ** 2 / len(part.places)
        frequency = 2 * np.pi * np.arange(len(ordinates)) / part.padded
        first = int(abs(own.sum()) <= 1e-9 * np.sqrt(len(own)) * np.linalg.norm(own))
        found.append((frequency[first:], ordinates[first:], shapes[:, first:]))
    frequency, ordinates, shapes = (np.concatenate(items, axis=-1) for items in zip(*found, strict=True))
    return frequency, ordinates, shapes


def expected_periodogram(part: Stretch, slow: Sequence[Slow]) -> Array:
    """(2 + m, f) expected periodogram of every part of the noise with unit variance, at the samples of a stretch."""
    count = part.padded
    lags = np.arange(count)
    straight = _pairs(part.spread(np.ones(len(part.places))), count)
    turning = straight if part.turn is None else _pairs(part.turn.real, count) + _pairs(part.turn.imag, count)
    covariances = np.zeros((2 + len(slow), count))
    covariances[:2, 0] = 1.0, 2.0
    covariances[1, 1:2] = -1.0
    covariances[:2] *= straight
    for row, own in zip(covariances[2:], slow, strict=True):
        row[:] = np.exp(-lags / own.memory) * (turning if own.turning else straight)
    covariances /= len(part.places)
    covariances[:, 1:] += covariances[:, :0:-1].copy()
    return np.asarray(np.fft.rfft(covariances, axis=1).real)


def _pairs(weights: Array, count: int) -> Array:
    """(count,) sum of products of weights (t,) so many samples apart, t not above the count."""
    return np.asarray(np.fft.irfft(np.abs(np.fft.rfft(weights, 2 * count)) ** 2, 2 * count)[:count])


def binned(frequency: Array, ordinates: Array, shapes: Array) -> tuple[Array, Array, Array]:
    """Mean ordinates (b,) and shapes (2 + m, b) of bins, and how many frequencies each holds, half for zero."""
    means, weight = in_bins(frequency, np.vstack([ordinates, shapes]))
    return means[0], means[1:], weight


def in_bins(frequency: Array, rows: Array) -> tuple[Array, Array]:
    """Means (q, b) of rows (q, f) in bins of frequency (f,), and how many frequencies each bin holds, half for zero."""
    least = frequency[frequency > 0].min(initial=np.pi)
    position = np.log(np.maximum(frequency, least) / least) / np.log(1.001 * np.pi / least)
    place = np.where(frequency > 0, 1 + (TUNING.spectrum_bins * position).astype(int), 0)
    _, place, count = np.unique(place, return_inverse=True, return_counts=True)
    weight = np.asarray(np.bincount(place, np.where(frequency > 0, 1.0, 0.5)), dtype=float)
    return np.array([np.bincount(place, row) / count for row in rows]), weight


def misfit_of(frequency: Array, ordinates: Array, level: Array) -> float:
    """Bartlett's statistic: how far the cumulated ratio of periodogram to expectation is from a straight line."""
    ratio = ordinates / np.maximum(level, 1e-12 * level.max())
    order = np.argsort(frequency, kind="stable")
    rising = np.cumsum(ratio[order[frequency[order] > 0]])
    if not rising[-1] > 0:
        return 0.0
    even = np.arange(1, len(rising) + 1) / len(rising)
    return float(np.abs(rising / rising[-1] - even).max() * np.sqrt(len(rising)))
