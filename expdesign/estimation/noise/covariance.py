"""Covariances of sums of noise: long-run, from the parts of the noise, and of whitened residuals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.errors import UnknownName
from expdesign.estimation.noise.components import SENSOR, Components, Slow, Stretch, Timeline, filtered
from expdesign.estimation.regression import Integers, batch_slices
from expdesign.values import Array

SPECTRUM_MISFIT = 1.628  # Bartlett's statistic at 1 % (Kolmogorov's distribution)
WHITENING_PASSES = 2  # the second filter finds a slow disturbance below the measurement noise
SLOWEST_POLE = 0.98  # bound on the autoregressive coefficient of a whitening filter
LONGEST_LAG_SHARE = 8  # automatic lags end at the longest batch divided by this
FEW_LAGS = 10  # up to this number, sums of products are faster than Fourier transforms


# Long-run covariance of a vector series: how its sum varies when samples depend on each other.
#
#     Omega = sum over lags l of w(l / (L + 1)) Gamma(l),    Gamma(l) = sum over k of s(k) s(k - l)^T
#
# Lags never reach from one batch into another. Kernels are positive semidefinite, and so is Omega.
#
# Where lags nearly cancel lag zero, as noise does that enters with opposite sign a sample later, Bartlett's kernel
# (Newey and West) loses a share 1 / L of that cancellation, Parzen's only about 6 / L^2; Parzen's is therefore the
# default.
#
# Source: W. K. Newey and K. D. West, Econometrica 55 (1987), 703-708, and Review of Economic Studies 61 (1994),
# 631-653; D. W. K. Andrews, Econometrica 59 (1991), 817-858.


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
    limit = max(1, max(len(rows) for rows in batches) // LONGEST_LAG_SHARE)
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
    if lags <= FEW_LAGS:
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


def score_covariance(
    W: Sequence[Array], residuals: Array, fitted: Sequence[Components], parts: Sequence[Stretch]
) -> tuple[list[list[Array]], list[Array]]:
    """The covariance of sum W_o eps_o, and how well the variances are known that it is made of.

    Parts of different outputs are as correlated as the outputs' residuals are at the same sample.

    Args:
        W: (k, p_o) for each output.
        residuals: (k, n).
        fitted: the parts of each output.
        parts: `stretches`.

    Returns:
        (p_o, p_o') covariances of the sums of outputs o and o', and (p_o,) variance of each estimated variance.
    """
    variances = np.array([item.variances for item in fitted])
    doubted = np.array([np.diag(item.uncertainty) > 0 for item in fitted])
    blocks, units = sums_of_parts(W, variances, fitted[0].slow, _common(residuals, variances), parts, doubted)
    doubts = [np.einsum("ip,ij,jp->p", own, item.uncertainty, own) for own, item in zip(units, fitted, strict=True)]
    return blocks, doubts


def sums_of_parts(
    W: Sequence[Array],
    variances: Array,
    slow: Sequence[Slow],
    common: Array,
    parts: Sequence[Stretch],
    doubted: NDArray[np.bool_],
) -> tuple[list[list[Array]], list[Array]]:
    """Covariances (p_o, p_o') of sum W_o eps_o, and what each part adds to variances if its own is one (2 + m, p_o).

    Args:
        W: (k, p_o) for each output.
        variances: (n, 2 + m) of each output's parts.
        slow: the m slow parts.
        common: (n, n) correlation of the outputs' parts.
        parts: `stretches`.
        doubted: (n, 2 + m) parts without variance whose own sums are asked for all the same.
    """
    blocks = [[np.zeros((a.shape[1], b.shape[1])) for b in W] for a in W]
    units = [np.zeros((variances.shape[1], a.shape[1])) for a in W]
    for part in parts:
        wide = [part.spread(item[part.rows]) for item in W]
        for index, scale in enumerate(np.sqrt(variances.T)):
            for o in np.flatnonzero((scale > 0) | doubted[:, index]).tolist():
                turned = filtered(index, slow, wide[o], part.turn)
                units[o][index] += np.einsum("kp,kp->p", wide[o], turned)
                for other in np.flatnonzero(scale[: o + 1] * common[o, : o + 1]).tolist():
                    blocks[other][o] += scale[o] * scale[other] * common[o, other] * (wide[other].T @ turned)
    for o in range(len(W)):
        for other in range(o):
            blocks[o][other] = blocks[other][o].T
    return blocks, units


def _common(residuals: Array, variances: Array) -> Array:
    """(n, n) correlation that parts with variances (n, 2 + m) share."""
    level, roots = np.ones(variances.shape[1]), np.sqrt(variances)
    level[SENSOR] = 2.0
    moments, explained = residuals.T @ residuals / len(residuals), (roots * level) @ roots.T
    return as_correlation(np.divide(moments, explained, out=np.zeros_like(moments), where=explained > 0))


def as_correlation(found: Array) -> Array:
    """(n, n) correlation matrix near the one found: ones on the diagonal, none above one, positive semidefinite."""
    found = np.clip(found, -1.0, 1.0)
    np.fill_diagonal(found, 1.0)
    least = float(np.linalg.eigvalsh(found)[0])
    return found if least >= 0 else np.asarray((found - least * np.eye(len(found))) / (1.0 - least))


# Whitened residuals, with instruments transformed so that the IV equations stay the same.
#
# A residual eps is modelled as ARMA(1, 1), (1 - a q^-1) eps(k) = (1 + c q^-1) n(k). Written as eps = T n with the lower
# triangular matrix T of that filter, its score is
#
#     sum Z(k) eps(k) = sum zeta(k) n(k),    zeta = T^T Z, the same filter run backwards,
#
# whatever a and c are. The terms zeta(k) n(k) depend on each other far less than Z(k) eps(k): measurement noise enters
# a one-step residual at k and again, nearly cancelling, at k - 1, and no kernel with few lags sees that cancellation,
# while one with many loses variance to the estimated parameters. What colour is left is for the kernel to count.
# Filters start as stationary noise does, not from zero, so that the ends of many short batches count too.
#
# A disturbance that lasts many samples under much measurement noise is only partly seen so: with a current that wanders
# for 100 s the standard deviations of the surge parameters come out about a fifth too small. `components` sees it.
#
# Source: prewhitening after D. W. K. Andrews and J. C. Monahan, Econometrica 60 (1992), 953-966, here of the residuals
# and exact; noise in one-step predictors: F. Ljungberg, doctoral thesis, Linköping University, (5.63)-(5.66).

MOVING_AVERAGES = np.tanh(np.linspace(-2.3, 2.3, 18))  # values tried for c, from -0.98 to 0.98; they need not be exact


@dataclass(frozen=True)
class Colour:
    """The filter: a of the autoregressive part, c of the moving average."""

    a: float
    c: float


WHITE = Colour(0.0, 0.0)


def white_parts(Z: Array, residuals: Array, when: Timeline, *, passes: int = WHITENING_PASSES) -> tuple[Array, Array]:
    """zeta (t, n, p) and n (t, n) from instruments (k, n, p) and residuals (k, n); no filter crosses batches."""
    zeta, white = when.spread(Z).copy(), when.spread(residuals).copy()
    batches, present = batch_slices(when.batch), when.spread(np.ones(len(when.place)))
    for output, _ in product(range(white.shape[1]), range(passes)):
        colour = fitted_colour([white[rows, output] for rows in batches], [present[rows] for rows in batches])
        if colour == WHITE:
            continue
        for rows in batches:
            zeta[rows, output], white[rows, output] = innovations(zeta[rows, output], white[rows, output], colour)
    return zeta, white


def innovations(Z: Array, eps: Array, colour: Colour) -> tuple[Array, Array]:
    """zeta (k, p) and n (k,) of one batch, n of equal variance from the first sample on.

    What the noise before the batch still does, x a^k, is uncertain by (a + c)^2 / (1 - a^2) variances of n at first and
    known ever better (a Kalman filter, written as sums); without it the ends of batches would be missing from sums.
    """
    a, c = colour.a, colour.c
    n = scipy.signal.lfilter([1.0, -a], [1.0, c], eps)
    zeta = scipy.signal.lfilter([1.0, c], [1.0, -a], Z[::-1], axis=0)[::-1]
    left = np.power(-c, np.arange(len(eps)))  # of x in n
    known = 1.0 / max((a + c) ** 2 / (1.0 - a**2), 1e-12) + np.cumsum(left**2)
    before = known - left**2
    x = np.cumsum(left * n) / known
    n[1:] -= left[1:] * x[:-1]
    later = np.cumsum((left[:, None] * zeta)[:0:-1], axis=0)[::-1]
    zeta[:-1] += (left / known)[:-1, None] * later
    scale = np.sqrt(1.0 + left**2 / before)
    return zeta * scale[:, None], n / scale


def fitted_colour(series: Sequence[Array], present: Sequence[Array]) -> Colour:
    """Least sum of squared one-step errors over a grid of c, with the best a for each; white unless that is worse.

    Worse means by more than two parameters may earn by chance (Schwarz's criterion).

    Args:
        series: residuals (k,) of each batch, zero where a sample was left out.
        present: (k,) one, or zero there.
    """
    count = sum(float(ones.sum()) for ones in present)
    power = sum(float((rows * ones) @ rows) for rows, ones in zip(series, present, strict=True))
    error, colour = min((_fitted(series, present, float(c)) for c in MOVING_AVERAGES), key=lambda item: item[0])
    return colour if error < power * (1.0 - 2.0 * np.log(count) / count) else WHITE


def _fitted(series: Sequence[Array], present: Sequence[Array], c: float) -> tuple[float, Colour]:
    filtered = [scipy.signal.lfilter([1.0], [1.0, c], rows) * ones for rows, ones in zip(series, present, strict=True)]
    power = sum(float(x @ x) for x in filtered)
    crossed = sum(float(x[1:] @ x[:-1]) for x in filtered)
    a = float(np.clip(crossed / power, -SLOWEST_POLE, SLOWEST_POLE)) if power > 0 else 0.0
    return power - 2.0 * a * crossed + a**2 * power, Colour(a, c)
