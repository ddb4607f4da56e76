"""Long-run covariance of a vector series: how its sum varies when samples depend on each other.

    Omega = sum over lags l of w(l / (L + 1)) Gamma(l),    Gamma(l) = sum over k of s(k) s(k - l)^T

Lags never reach from one batch into another. Kernels are positive semidefinite, and so is Omega.

Where lags nearly cancel lag zero, as noise does that enters with opposite sign a sample later, Bartlett's kernel (Newey
and West) loses a share 1 / L of that cancellation, Parzen's only about 6 / L^2; Parzen's is therefore the default.

Source: W. K. Newey and K. D. West, Econometrica 55 (1987), 703-708, and Review of Economic Studies 61 (1994), 631-653;
D. W. K. Andrews, Econometrica 59 (1991), 817-858.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from expdesign.errors import UnknownName
from expdesign.estimation.regression import Integers
from expdesign.estimation.tuning import TUNING
from expdesign.values import Array


def bartlett(x: Array) -> Array:
    """1 - x, zero from x = 1 on."""
    return np.asarray(np.clip(1.0 - x, 0.0, None))


def parzen(x: Array) -> Array:
    """Two cubic pieces, flat at zero lag, zero from x = 1 on."""
    near, far = 1.0 - 6.0 * x**2 * (1.0 - x), 2.0 * np.clip(1.0 - x, 0.0, None) ** 3
    return np.asarray(np.where(x <= 0.5, near, far))


KERNELS: dict[str, Callable[[Array], Array]] = {"bartlett": bartlett, "parzen": parzen}
PLUG_IN = {"bartlett": (1, 1.1447), "parzen": (2, 2.6614)}
"""Kernel -> order of its bias in 1 / L and Andrews's constant."""


def long_run_covariance(scores: Array, batch: Integers, step: Integers, *, lags: int, kernel: str = "parzen") -> Array:
    """Omega (q, q) of scores (k, q), a sum and not a mean.

    Args:
        scores: (k, q) series.
        batch, step: (k,) batch number and sample number within the batch.
        lags: L, the last lag counted; 0 leaves the covariance robust to heteroscedasticity alone.
        kernel: a key of `KERNELS`.

    Raises:
        UnknownName: no such kernel.
    """
    if kernel not in KERNELS:
        raise UnknownName("kernel", kernel, known=KERNELS)
    if lags == 0:
        return np.asarray(scores.T @ scores)
    total = np.zeros((scores.shape[1],) * 2)
    for series in _filled(scores, batch, step):
        total += _windowed(series, KERNELS[kernel](np.arange(lags + 1) / (lags + 1.0)))
    return total


def lost_share(count: int, *, lags: int, kernel: str) -> float:
    """Share of Omega that is missing because the scores of an estimate sum to zero.

    Their ordinate at frequency zero is gone, which carries this share of the window's weight; for no lags it is the
    familiar 1 / N of a variance around a mean.
    """
    weights = KERNELS[kernel](np.arange(1, lags + 1) / (lags + 1.0))
    return float(min(0.5, (1.0 + 2.0 * weights.sum()) / count))


def automatic_lags(scores: Array, batch: Integers, step: Integers, *, kernel: str = "parzen") -> int:
    """L for scores (k, q): Andrews's plug-in of a first-order autoregression.

    The plug-in of a single column is noisy, and the largest of many is always too long: the median is taken.
    """
    order, constant = PLUG_IN[kernel]
    batches = _filled(scores, batch, step)
    power = sum(((rows**2).sum(axis=0) for rows in batches), start=np.zeros(scores.shape[1]))
    lagged = sum(((rows[1:] * rows[:-1]).sum(axis=0) for rows in batches), start=np.zeros(scores.shape[1]))
    if not (power > 0).any():
        return 0
    rho = np.clip(lagged[power > 0] / power[power > 0], -0.97, 0.97)
    alpha = 4.0 * rho**2 / (1.0 - rho) ** 4 if order == 2 else 4.0 * rho**2 / (1.0 - rho**2) ** 2
    limit = max(1, max(len(rows) for rows in batches) // TUNING.longest_lag_share)
    lags = constant * (float(np.median(alpha)) * len(scores)) ** (1.0 / (2 * order + 1))
    return int(np.clip(np.ceil(lags), 1, limit))


def _filled(scores: Array, batch: Integers, step: Integers) -> list[Array]:
    """One array per batch, zero where a sample was left out."""
    result = []
    for number in np.unique(batch):
        chosen = batch == number
        steps = step[chosen] - step[chosen][0]
        rows = np.zeros((steps[-1] + 1, scores.shape[1]))
        rows[steps] = scores[chosen]
        result.append(rows)
    return result


def _windowed(series: Array, weights: Array) -> Array:
    """Sum over lags of w(l) Gamma(l); for many lags by way of the cross-periodogram."""
    lags = len(weights) - 1
    if lags <= TUNING.few_lags:
        near = series * (weights[0] / 2.0)
        for lag in range(1, min(lags, len(series) - 1) + 1):
            near[lag:] += weights[lag] * series[:-lag]
        half = series.T @ near
        return np.asarray(half + half.T)
    size = 1 << int(np.ceil(np.log2(len(series) + lags)))
    circular = np.zeros(size)
    circular[: lags + 1] = weights
    circular[size - lags :] = weights[:0:-1]
    window = np.fft.rfft(circular).real
    spectrum = np.fft.rfft(series, size, axis=0)
    both_sides = np.full(len(window), 2.0)
    both_sides[[0, -1]] = 1.0
    weighted = spectrum * (window * both_sides)[:, None]
    return np.asarray((spectrum.real.T @ weighted.real + spectrum.imag.T @ weighted.imag) / size)
