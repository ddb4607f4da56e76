"""Rauch-Tung-Striebel smoother of a constant-velocity model, solved as the banded system that it is.

Each signal is an integrated random walk observed in white noise: x' = w, w' = white noise of intensity q. With a flat
prior, the smoothed states are the minimum of a quadratic form whose matrix is block tridiagonal, so one banded Cholesky
factorisation gives the result of the forward and backward recursions, and the likelihood. The ratio of q to the
measurement variance is the one that makes the data most likely.

Sources: H. E. Rauch, F. Tung, C. T. Striebel, AIAA Journal 3 (1965) 1445-1450; B. M. Bell, SIAM Journal on
Optimization 4 (1994) 626-636 (the smoother as a least-squares problem).
"""

from __future__ import annotations

import numpy as np
import scipy

from expdesign.records.tuning import TUNING
from expdesign.values import Array


def smooth(values: Array, sample_time_s: float, *, noise_std: float | None = None) -> tuple[Array, Array]:
    """Smoothed signals and their rates.

    Args:
        values: (k, m) signals with the same noise and the same liveliness, k of 4 or more.
        sample_time_s: time between samples [s].
        noise_std: of the measurements, or None to learn it too.

    Returns:
        Smoothed values (k, m) and rates (k, m) [per second].
    """
    surplus = max(len(values) - TUNING.learning_samples, 0) // 2
    ratio = _likeliest_ratio(values[surplus : len(values) - surplus], noise_std)
    state = _solve(values, ratio)[0]
    return state[:, 0], state[:, 1] / sample_time_s


def _likeliest_ratio(values: Array, noise_std: float | None) -> float:
    """Maximum of the restricted likelihood over the ratio: the best of a grid, refined between its neighbours."""

    def cost(exponent: float) -> float:
        return _minus_log_likelihood(values, 10.0**exponent, noise_std)

    grid = np.arange(TUNING.log10_ratios[0], TUNING.log10_ratios[1] + 0.5)
    best = float(grid[np.argmin([cost(exponent) for exponent in grid])])
    bounds = (max(best - 1.0, TUNING.log10_ratios[0]), min(best + 1.0, TUNING.log10_ratios[1]))
    return float(
        10.0 ** scipy.optimize.minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 0.02}).x
    )


def _minus_log_likelihood(values: Array, ratio: float, noise_std: float | None) -> float:
    """Twice the negative restricted log likelihood, up to a constant; the variance at its best unless it is given."""
    count, signals = values.shape
    _, misfit, log_det = _solve(values, ratio)
    freedom = signals * (count - 2)
    tiny = np.finfo(float).tiny + (1e-15 * np.ptp(values)) ** 2
    variance = max(misfit / freedom, tiny) if noise_std is None else max(noise_std**2, tiny)
    return float(freedom * np.log(variance) + misfit / variance + signals * (log_det + 2 * (count - 1) * np.log(ratio)))


def _solve(values: Array, ratio: float) -> tuple[Array, float, float]:
    """States (k, 2, m) [value, change per sample], the least misfit in units of the variance, log det of the matrix."""
    count, signals = values.shape
    line = values[0] + np.linspace(0.0, 1.0, count)[:, None] * (values[-1] - values[0])
    rest = np.zeros((count, 2, signals))
    rest[:, 0] = values - line
    factor = scipy.linalg.cholesky_banded(_matrix(count, ratio), check_finite=False)
    state = scipy.linalg.cho_solve_banded(
        (factor, False), rest.reshape(2 * count, signals), check_finite=False
    ).reshape(rest.shape)
    kick = np.stack([np.diff(state[:, 0], axis=0) - state[:-1, 1], np.diff(state[:, 1], axis=0)])
    misfit = np.sum((rest[:, 0] - state[:, 0]) ** 2) + np.einsum("ikm,ij,jkm->", kick, WEIGHT, kick) / ratio
    state[:, 0] += line
    state[:, 1] += (values[-1] - values[0]) / (count - 1)
    return state, float(misfit), float(2.0 * np.log(factor[-1]).sum())


WEIGHT = np.array([[12.0, -6.0], [-6.0, 4.0]])
"""Inverse of [[1/3, 1/2], [1/2, 1]], the covariance of one sample's kick for unit intensity."""
STEP = np.array([[1.0, 1.0], [0.0, 1.0]])


def _matrix(count: int, ratio: float) -> Array:
    """Upper banded form (4, 2 k) of the information matrix of all states, in units of the variance."""
    onward, across = STEP.T @ WEIGHT @ STEP / ratio, -STEP.T @ WEIGHT / ratio
    blocks = np.zeros((count, 2, 2))
    blocks[:-1] += onward
    blocks[1:] += WEIGHT / ratio
    blocks[:, 0, 0] += 1.0
    banded = np.zeros((4, 2 * count))
    banded[3, 0::2], banded[3, 1::2], banded[2, 1::2] = blocks[:, 0, 0], blocks[:, 1, 1], blocks[:, 0, 1]
    banded[1, 2::2], banded[0, 3::2] = across[0, 0], across[0, 1]
    banded[2, 2::2], banded[1, 3::2] = across[1, 0], across[1, 1]
    return banded
