"""What is left over when a simulation is right: coloured noise per channel, and currents that vary slowly.

Each channel's remainder is taken as autoregressive; filtering it white is generalised least squares. A current that
wanders in the n-frame pushes the ship differently on every heading, which no stationary colour describes; it enters as
a random effect, a Gauss-Markov process on hat functions, with the standard deviation and correlation time that make the
data most likely.

Sources: D. Cochrane and G. H. Orcutt, Journal of the American Statistical Association 44 (1949), 32-61; H. D. Patterson
and R. Thompson, Biometrika 58 (1971), 545-554.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from expdesign.values import Array

ORDERS = (1, 2, 3, 4, 6, 8, 12)
SHORTEST_PER_ORDER = 6
FLOOR = 0.05
"""White share of the remainder's variance that is taken for granted: no model is right at every frequency, and smoothed
data would otherwise make the quickest motions, of which they tell nothing, count most."""
NO_FEEDBACK = np.array([1.0, 0.0])
"""With one coefficient instead of two SciPy takes a path through Python loops."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Noise:
    """Colour and size of the remainder.

    Attributes:
        filters: (4, p + 1) whitening filters, the first tap one.
        std: (4,) of the whitened remainder; infinite for channels that are not measured.
        wander_mps: standard deviation of the wandering current [m/s].
        wander_time_s: its correlation time [s].
    """

    filters: Array
    std: Array
    wander_mps: float = 0.0
    wander_time_s: float = 300.0

    @property
    def order(self) -> int:
        """Samples lost at the beginning of a window."""
        return int(self.filters.shape[1] - 1)


def white_noise(std: Array) -> Noise:
    """Nothing known of colour yet."""
    return Noise(filters=np.ones((4, 1)), std=std)


def whitened(values: Array, noise: Noise) -> Array:
    """(..., w, s - p, 4) filtered and in units of the remainder's standard deviation; nan where a tap is nan."""
    p = noise.order
    result = np.empty((*values.shape[:-2], values.shape[-2] - p, values.shape[-1]))
    for channel, (taps, std) in enumerate(zip(noise.filters, noise.std, strict=True)):
        if np.isfinite(std):
            result[..., channel] = _filtered(values[..., channel], taps / std)[..., p:]
        else:
            result[..., channel] = 0.0 * values[..., p:, channel]
    return result


def _filtered(values: Array, taps: Array) -> Array:
    """Filtered along the last axis; nan where a tap falls on a nan, not ever after as in a recursion."""
    missing = ~np.isfinite(values)
    if not missing.any():
        return np.asarray(lfilter(taps, NO_FEEDBACK, values, axis=-1))
    result = lfilter(taps, NO_FEEDBACK, np.where(missing, 0.0, values), axis=-1)
    touched = lfilter(np.ones(len(taps)), NO_FEEDBACK, missing.astype(float), axis=-1) > 0.5
    return np.where(touched, np.nan, result)


def fit_colour(remainder: Array, *, order: int | None = None) -> Noise:
    """Autoregressions of the channels of (w, s, 4), pooled over windows, all of one order.

    Args:
        remainder: nan where not measured.
        order: None to choose it by Schwarz's criterion; zero for white noise.
    """
    longest = remainder.shape[1] // SHORTEST_PER_ORDER
    orders = [p for p in ORDERS if p <= max(1, longest)] if order is None else [order]
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
            floor = FLOOR * float(np.mean(target**2))
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


def wander_covariance(count: int, spacing_s: float, time_s: float) -> Array:
    """(2 count, 2 count) of hat coefficients, north then east, for unit standard deviation."""
    apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count))) * spacing_s
    return np.asarray(np.kron(np.eye(2), np.exp(-apart / time_s)), dtype=float)


def hats(steps: int, step_s: float, spacing_s: float) -> Array:
    """(count, steps) piecewise linear functions that sum to one."""
    time = np.arange(steps) * step_s
    count = max(2, round(time[-1] / spacing_s) + 1)
    knots = np.linspace(0.0, time[-1], count)
    return np.stack([np.interp(time, knots, row) for row in np.eye(count)])
