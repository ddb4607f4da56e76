"""Noise of the measured channels and of the simulation error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.diagnosis.data.tuning import TUNING
from expdesign.values import Array

PER_SECOND_DIFFERENCE = np.sqrt(6.0)
"""Standard deviation of second differences of white noise of unit variance."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Noise:
    """Spectrum and size of the remainder.

    Attributes:
        filters: (4, p + 1) whitening filters, the first tap one.
        std: (4,) of the whitened remainder; infinite for channels that are not measured.
        current_std_mps: standard deviation of the random current [m/s].
        current_time_s: its correlation time [s].
    """

    filters: Array
    std: Array
    current_std_mps: float = 0.0
    current_time_s: float = 300.0

    @property
    def order(self) -> int:
        """Samples lost at the beginning of a window."""
        return int(self.filters.shape[1] - 1)


def white_noise(std: Array) -> Noise:
    """White noise: the first guess."""
    return Noise(filters=np.ones((4, 1)), std=std)


def whitened(values: Array, noise: Noise, *, out: Array | None = None) -> Array:
    """(..., w, s - p, 4) filtered and in units of the remainder's standard deviation; nan where a tap is nan.

    Channels that are not measured are zero, or nan where they are nan. Channels lie apart in memory.

    Args:
        values: (..., w, s, 4).
        noise: of order p.
        out: (4, ..., w, s - p) to hold the result.
    """
    p = noise.order
    result = np.empty((4, *values.shape[:-2], values.shape[-2] - p)) if out is None else out
    for channel, (taps, std) in enumerate(zip(noise.filters, noise.std, strict=True)):
        if np.isfinite(std):
            result[channel] = _filtered(values[..., channel], taps / std)[..., p:]
        else:
            result[channel] = 0.0 * values[..., p:, channel]
    return np.moveaxis(result, 0, -1)


def _filtered(values: Array, taps: Array) -> Array:
    """Filtered along the last axis; nan only where a tap falls on a nan."""
    missing = ~np.isfinite(values)
    if not missing.any():
        return _convolved(values, taps)
    result = _convolved(np.where(missing, 0.0, values), taps)
    return np.where(_convolved(missing.astype(float), np.ones(len(taps))) > 0.5, np.nan, result)


def _convolved(values: Array, taps: Array) -> Array:
    """Each value and those before it, times the taps; zero before the first."""
    return np.asarray(
        scipy.ndimage.correlate1d(values, taps[::-1], axis=-1, mode="constant", origin=(len(taps) - 1) // 2)
    )


def fit_ar_noise(remainder: Array, *, order: int | None = None) -> Noise:
    """Autoregressions of the channels of (w, s, 4), pooled over windows, all of one order.

    Args:
        remainder: nan where not measured.
        order: None to choose it by Schwarz's criterion; zero for white noise.
    """
    longest = remainder.shape[1] // TUNING.samples_per_order
    orders = [p for p in TUNING.ar_orders if p <= max(1, longest)] if order is None else [order]
    most = max(orders)
    best: tuple[float, Noise] | None = None
    for p in orders:
        filters, std = np.zeros((4, p + 1)), np.full(4, np.inf)
        filters[:, 0] = 1.0
        criterion = 0.0
        for channel in range(4):
            rows = _lagged_rows(remainder[..., channel], most)
            if len(rows) < 10 * (p + 1):
                continue
            target, past = rows[:, 0], rows[:, 1 : p + 1]
            floor = TUNING.white_share * float(np.mean(target**2))
            moments = past.T @ past + floor * len(rows) * np.eye(p)
            taps = np.linalg.lstsq(moments, past.T @ target, rcond=None)[0] if p else np.zeros(0)
            filters[channel, 1:] = -taps
            variance = float(np.mean((target - past @ taps) ** 2)) + floor * (1.0 + float(taps @ taps))
            std[channel] = max(np.sqrt(variance), 1e-12)
            criterion += len(rows) * np.log(max(variance, 1e-24)) + p * np.log(len(rows))
        noise = Noise(filters=filters, std=std)
        if best is None or criterion < best[0]:
            best = criterion, noise
    assert best is not None
    return best[1]


def _lagged_rows(values: Array, order: int) -> Array:
    """(rows, order + 1) of every sample with its past, whole rows only."""
    size = values.shape[1]
    stacked = np.stack([values[:, order - lag : size - lag] for lag in range(order + 1)], axis=-1).reshape(
        -1, order + 1
    )
    return stacked[np.isfinite(stacked).all(axis=1)]


def random_current_covariance(count: int, spacing_s: float, time_s: float) -> Array:
    """(2 count, 2 count) of hat coefficients, north then east, for unit standard deviation."""
    apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count))) * spacing_s
    return np.asarray(np.kron(np.eye(2), np.exp(-apart / time_s)), dtype=float)


def linear_basis(steps: int, step_s: float, spacing_s: float) -> Array:
    """(count, steps) piecewise linear functions that sum to one."""
    time = np.arange(steps) * step_s
    count = max(2, round(time[-1] / spacing_s) + 1)
    knots = np.linspace(0.0, time[-1], count)
    return np.stack([np.interp(time, knots, row) for row in np.eye(count)])


def channel_std(values: Array) -> Array:
    """(n,) standard deviation of each channel of (w, s, n) over the measured samples; 0 where there are none."""
    seen = np.isfinite(values)
    count = np.maximum(seen.sum(axis=(0, 1)), 1)
    mean = np.where(seen, values, 0.0).sum(axis=(0, 1)) / count
    return np.asarray(np.sqrt(np.where(seen, (values - mean) ** 2, 0.0).sum(axis=(0, 1)) / count))


def white_noise_std(measured: Array) -> Array:
    """(n,) standard deviation of white noise in (w, s, n), from second differences, which include some motion."""
    second = np.diff(measured, 2, axis=1)
    seen = np.isfinite(second)
    mean = np.where(seen, second, 0.0) ** 2
    return np.asarray(np.sqrt(mean.sum(axis=(0, 1)) / np.maximum(seen.sum(axis=(0, 1)), 1)) / PER_SECOND_DIFFERENCE)
