"""Noise of the measured channels and of the simulation error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from expdesign.values import Array

AR_ORDERS = (1, 2, 3, 4, 6, 8, 12)  # of the autoregressions that are tried
SAMPLES_PER_ORDER = 6  # of a window, for each order of its autoregression, at least
LAGS = (1, 2)  # of differences of white noise that are tried [samples]; one for those of means whose samples meet
# of the remainder's variance that is always taken as white. No model is right at every frequency, and smoothed data
# would otherwise give the fastest motions, of which they show nothing, the most weight
WHITE_SHARE = 0.05
NO_DIFFERENCE = 0.0, 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Noise:
    """Spectrum and size of the remainder: in every channel an autoregression of e_k - share e_(k - lag), e white."""

    filters: Array  # (4, p + 1) whitening filters of the autoregressions, the first tap one
    std: Array  # (4,) of the whitened remainder; infinite for channels that are not measured
    current_std_mps: float = 0.0  # standard deviation of the random current [m/s]
    current_time_s: float = 300.0  # its correlation time [s]
    # (share, lag) of every channel; differences of a noisy position or heading have a share of nearly one, and hardly
    # any noise at low frequencies
    differences: tuple[tuple[float, int], ...] = (NO_DIFFERENCE,) * 4

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
            result[channel] = _filtered(_summed(values[..., channel], *noise.differences[channel]), taps / std)[..., p:]
        else:
            result[channel] = 0.0 * values[..., p:, channel]
    return np.moveaxis(result, 0, -1)


def _summed(values: Array, share: float, lag: int) -> Array:
    """(..., s) z with z_k = values_k + share z_(k - lag), from zero at the first value; nan from the first gap on."""
    if not share:
        return values
    seen = np.isfinite(values)
    recursion = [1.0, *[0.0] * (lag - 1), -share]
    sums = np.asarray(scipy.signal.lfilter([1.0], recursion, np.where(seen, values, 0.0), axis=-1))
    if seen.all():
        return sums
    begun = np.logical_or.accumulate(seen, axis=-1)
    return np.where(seen & np.logical_and.accumulate(seen | ~begun, axis=-1), sums, np.nan)


def before_windows(measured: Array, noise: Noise) -> Array:
    """(n, w, s, 4) what white noise of unit variance before the first samples of windows (w, s, 4) makes of them."""
    seen = np.isfinite(measured)
    rows = []
    for channel, (share, lag) in enumerate(noise.differences):
        for place in range(lag if share and np.isfinite(noise.std[channel]) else 0):
            at = np.argmax(seen[..., channel], axis=1) + place
            row = np.zeros_like(measured)
            row[np.arange(len(row)), np.minimum(at, row.shape[1] - 1), channel] = -share * noise.std[channel]
            rows.append(row)
    return np.array(rows).reshape(-1, *measured.shape)


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


def fit_ar_noise(remainder: Array, *, order: int | None = None, shares: Sequence[float] = ()) -> Noise:
    """Noise of the channels of (w, s, 4), pooled over windows, with autoregressions of one order.

    Only yaw rates may be differences, of headings: along axes that turn, differences of positions add up to none.

    Args:
        remainder: nan where not measured.
        order: None to choose it by Schwarz's criterion; zero for white noise.
        shares: of the differences of white noise that yaw rates may have, chosen by the same criterion.
    """
    longest = remainder.shape[1] // SAMPLES_PER_ORDER
    orders = [p for p in AR_ORDERS if p <= max(1, longest)] if order is None else [order]
    most = max(orders)
    turning = (NO_DIFFERENCE, *((share, lag) for share in shares for lag in LAGS if most))
    kinds = ((NO_DIFFERENCE,), (NO_DIFFERENCE,), turning, turning)
    tried = [_in_sums(remainder[..., channel], most, kind) for channel, kind in enumerate(kinds)]
    best: tuple[float, Noise] | None = None
    for p in orders:
        filters, std, chosen = np.zeros((4, p + 1)), np.full(4, np.inf), [NO_DIFFERENCE] * 4
        filters[:, 0] = 1.0
        criterion = 0.0
        for channel, tables in enumerate(tried):
            found = [(*_autoregression(rows, p), len(rows), how) for how, rows in tables if len(rows) >= 10 * (p + 1)]
            if not found:
                continue
            costs = [
                n * np.log(max(variance, 1e-24)) + (p + 2 * (share > 0)) * np.log(n)
                for _, variance, n, (share, _) in found
            ]
            place = int(np.argmin(costs))
            taps, variance, _, chosen[channel] = found[place]
            filters[channel, 1:] = -taps
            std[channel] = max(np.sqrt(variance), 1e-12)
            criterion += costs[place]
        noise = Noise(filters=filters, std=std, differences=tuple(chosen))
        if best is None or criterion < best[0]:
            best = criterion, noise
    assert best is not None
    return best[1]


def _in_sums(values: Array, order: int, kinds: Sequence[tuple[float, int]]) -> list[tuple[tuple[float, int], Array]]:
    """Kinds of differences that (w, s) values may be, with the lagged rows of what they are differences of.

    Values with gaps are none, as nothing is known of the sum after a gap.
    """
    found = [(kind, _lagged_rows(_without_beginnings(_summed(values, *kind), *kind), order)) for kind in kinds]
    most = max(len(rows) for _, rows in found)
    return [(kind, rows) for kind, rows in found if len(rows) == most]


def _without_beginnings(sums: Array, share: float, lag: int) -> Array:
    """Sums (w, s) less what noise before their first samples explains of them, by ridge regression."""
    if not share:
        return sums
    seen = np.isfinite(sums)
    since = np.arange(sums.shape[1]) - np.argmax(seen, axis=1)[:, None]
    result = sums.copy()
    for place in range(lag):
        column = np.where(seen & (since % lag == place), share ** (since // lag + 1.0), 0.0)
        size = (column * np.where(seen, sums, 0.0)).sum(axis=1) / (1.0 + (column**2).sum(axis=1))
        result -= size[:, None] * column
    return result


def _autoregression(rows: Array, order: int) -> tuple[Array, float]:
    """(p,) coefficients and the variance of the rest, with the white share of the variance in `rows`."""
    target, past = rows[:, 0], rows[:, 1 : order + 1]
    floor = WHITE_SHARE * float(np.mean(target**2))
    moments = past.T @ past + floor * len(rows) * np.eye(order)
    taps = np.asarray(np.linalg.lstsq(moments, past.T @ target, rcond=None)[0]) if order else np.zeros(0)
    return taps, float(np.mean((target - past @ taps) ** 2)) + floor * (1.0 + float(taps @ taps))


def _lagged_rows(values: Array, order: int) -> Array:
    """(rows, order + 1) of every sample with its past, whole rows only."""
    size = values.shape[1]
    stacked = np.stack([values[:, order - lag : size - lag] for lag in range(order + 1)], axis=-1).reshape(
        -1, order + 1
    )
    return stacked[np.isfinite(stacked).all(axis=1)]


@lru_cache(maxsize=256)
def random_current_precision(count: int, spacing_s: float, time_s: float) -> tuple[Array, float]:
    """(2 count, 2 count) inverse covariance of hat coefficients, north then east, for unit standard deviation.

    Beside it the log determinant of the covariance.
    """
    apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count))) * spacing_s
    covariance = np.kron(np.eye(2), np.exp(-apart / time_s))
    inverse = np.linalg.inv(covariance)
    inverse.flags.writeable = False
    return inverse, float(np.linalg.slogdet(covariance)[1])


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
