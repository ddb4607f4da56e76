"""Residual noise as a sum of independent parts, each with a known shape in time, and their effect on an estimate.

    cov eps(i), eps(j) = white [i = j] + sensor (2 [i = j] - [|i - j| = 1]) + sum over m of slow_m exp(-|i - j| / m)

White are gusts and eddies new at every sample, and the part of the sensor noise that damping lets through; sensor is
noise that enters at one sample and leaves at the next, eps(k) = e(k + 1) - (1 + J) e(k), whose low frequencies cancel;
slow are disturbances that last m samples, or
as long as a batch. The variances are none of them negative. They are estimated from the
periodograms of the batches, whose expectations for batches of finite length, with or without gaps, are linear in them,
by Whittle's likelihood. Slow parts count only if they earn more likelihood than one parameter may by chance (Schwarz's
criterion). The covariance of sum W eps then follows for any W, ends of batches included, without kernel or lags.

Residuals are less than the noise by what the parameters take up: r = eps - Phi sum W eps. From few data that is much of
the slow noise. With Sigma the covariance matrix of a part, the expected periodogram is that of

    Sigma - Phi W^T Sigma - Sigma W Phi^T + Phi W^T Sigma W Phi^T

Turns of the ship modulate a disturbance that comes from one side, which no slow part describes quite: with a current
that wanders for 100 s stated standard deviations were 0.95 to 1.05 of those found, but 0.86 for one thrust parameter.

Whether the parts fit is tested: the periodogram over its expectation must spread its sum evenly over frequencies
(Bartlett's test, 1 %).

Source: F. Ljungberg, doctoral thesis, Linköping University, (5.63)-(5.66), for the parts; A. M. Sykulski, S. C. Olhede,
A. P. Guillaumin, J. M. Lilly and J. J. Early, Biometrika 106 (2019), 251-266, for the likelihood; M. S. Bartlett, An
Introduction to Stochastic Processes (1955), for the test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.estimation.noise.timeline import spread
from expdesign.estimation.regression import Integers
from expdesign.estimation.tuning import TUNING
from expdesign.values import Array

MEMORIES = 2.0 ** np.arange(1, 11)
"""Of the slow parts [samples]; a quarter of the longest stretch at most, and one that lasts for ever."""


@dataclass(frozen=True, eq=False)
class Components:
    """The parts of one output's noise.

    Attributes:
        variances: (2 + m,) white, sensor, slow.
        memories: (m,) of the slow parts [samples].
        misfit: Bartlett's statistic.
    """

    variances: Array
    memories: Array
    misfit: float


@dataclass(frozen=True, eq=False)
class Fitted:
    """What estimated parameters took from the noise of an output: residuals are eps - Phi sum over k of W(k) eps(k).

    Attributes:
        Phi: (k, p) regressors, without the mean where residuals are.
        W: (k, p).
    """

    Phi: Array
    W: Array


def fit_components(
    residuals: Array, parts: Sequence[tuple[slice, Integers]], by: Sequence[Fitted] = ()
) -> list[Components]:
    """The parts of the noise in each output's residuals (k, n).

    Args:
        residuals: of an estimate.
        parts: `stretches`.
        by: what the estimate took from each output's noise; () for noise of which nothing was taken.
    """
    longest = max(int(places[-1]) + 1 for _, places in parts)
    memories = np.append(MEMORIES[longest / 4 >= MEMORIES], np.inf)
    expected: dict[bytes, Array] = {}
    for _, places in parts:
        if (key := places.tobytes()) not in expected:
            expected[key] = _expected(places, memories)
    shapes = [expected[places.tobytes()] for _, places in parts]
    left = [_less(shapes, parts, memories, own) for own in by] or [shapes] * residuals.shape[1]
    return [_fitted(column, parts, own, memories) for column, own in zip(residuals.T, left, strict=True)]


def _less(
    expected: Sequence[Array], parts: Sequence[tuple[slice, Integers]], memories: Array, by: Fitted
) -> list[Array]:
    """Expected periodograms (2 + m, f) of each stretch, less what the parameters took; not below a share of it."""
    p = by.Phi.shape[1]
    if not p:
        return list(expected)
    wide = [(spread(by.Phi[rows], places), spread(by.W[rows], places)) for rows, places in parts]
    spectra = [np.fft.rfft(Phi, axis=0) for Phi, _ in wide]
    result = [np.array(shape) for shape in expected]
    for index in range(2 + len(memories)):
        turned = [filtered(index, memories, W) for _, W in wide]
        C = sum((W.T @ own for (_, W), own in zip(wide, turned, strict=True)), start=np.zeros((p, p)))
        for number, (_, places) in enumerate(parts):
            Phi = spectra[number]
            there = turned[number] if len(places) == len(turned[number]) else _where(turned[number], places)
            mixed = 0.5 * Phi @ C - np.fft.rfft(there, axis=0)
            result[number][index] += 2.0 * (Phi.conj() * mixed).real.sum(axis=1) / len(places)
    left = [np.maximum(new, TUNING.least_left * old) for new, old in zip(result, expected, strict=True)]
    return [np.where(np.abs(shape) > TUNING.rounding, shape, 0.0) for shape in left]


def _where(rows: Array, places: Integers) -> Array:
    """Rows (t, p), zero where a sample was left out."""
    result = np.zeros_like(rows)
    result[places] = rows[places]
    return result


def _fitted(
    eps: Array, parts: Sequence[tuple[slice, Integers]], expected: Sequence[Array], memories: Array
) -> Components:
    power = float(eps @ eps) / len(eps)
    variances = np.zeros(2 + len(memories))
    variances[0] = power
    frequency, ordinates, shapes = _periodograms(eps, parts, expected)
    if not power > 0 or not (frequency > 0).any():
        return Components(variances, memories, 0.0)
    binned = _binned(frequency, ordinates / power, shapes)
    quick, quick_cost = _most_likely(*binned, 2)
    slow, slow_cost = _most_likely(*binned, len(variances))
    variances[:2] = power * quick
    if quick_cost - slow_cost > np.log(len(frequency)) / 2:
        variances = power * slow
    level = variances @ shapes
    ratio = ordinates / np.maximum(level, 1e-12 * level.max())
    return Components(variances, memories, _misfit(frequency, ratio))


def filtered(index: int, memories: Array, W: Array) -> Array:
    """(t, p) covariance matrix of a part, with unit variance, times W (t, p)."""
    if index == 0:
        return W
    if index == 1:
        result = 2.0 * W
        result[1:] -= W[:-1]
        result[:-1] -= W[1:]
        return result
    keep = np.exp(-1.0 / memories[index - 2])
    past = scipy.signal.lfilter([1.0], [1.0, -keep], W, axis=0)
    return np.asarray(past + scipy.signal.lfilter([1.0], [1.0, -keep], W[::-1], axis=0)[::-1] - W)


def score_covariance(
    W: Sequence[Array], residuals: Array, fitted: Sequence[Components], parts: Sequence[tuple[slice, Integers]]
) -> list[list[Array]]:
    """Blocks (p_o, p_o') of the covariance of sum W_o eps_o, for outputs o and o'.

    Parts of different outputs are as correlated as the outputs' residuals are at the same sample.

    Args:
        W: (k, p_o) for each output.
        residuals: (k, n).
        fitted: the parts of each output.
        parts: `stretches`.
    """
    common = _correlation(residuals, fitted)
    blocks = [[np.zeros((a.shape[1], b.shape[1])) for b in W] for a in W]
    for rows, places in parts:
        wide = [spread(item[rows], places) for item in W]
        for index in range(len(fitted[0].variances)):
            scale = np.sqrt([item.variances[index] for item in fitted])
            for o in np.flatnonzero(scale).tolist():
                turned = filtered(index, fitted[o].memories, wide[o])
                for other in np.flatnonzero(scale[: o + 1] * common[o, : o + 1]).tolist():
                    blocks[other][o] += scale[o] * scale[other] * common[o, other] * (wide[other].T @ turned)
    for o in range(len(W)):
        for other in range(o):
            blocks[o][other] = blocks[other][o].T
    return blocks


def _correlation(residuals: Array, fitted: Sequence[Components]) -> Array:
    """(n, n) correlation that all parts share, positive semidefinite."""
    level = np.ones(len(fitted[0].variances))
    level[1] = 2.0
    roots = np.sqrt([item.variances for item in fitted])
    explained = np.einsum("oi,i,qi->oq", roots, level, roots)
    moments = residuals.T @ residuals / len(residuals)
    found = np.clip(np.divide(moments, explained, out=np.zeros_like(moments), where=explained > 0), -1.0, 1.0)
    np.fill_diagonal(found, 1.0)
    least = float(np.linalg.eigvalsh(found)[0])
    return found if least >= 0 else np.asarray((found - least * np.eye(len(found))) / (1.0 - least))


def _periodograms(
    eps: Array, parts: Sequence[tuple[slice, Integers]], expected: Sequence[Array]
) -> tuple[Array, Array, Array]:
    """Frequencies (f,), the periodogram there, and each part's expected one (2 + m, f), of all stretches in a row.

    Frequency zero is there only where the mean is, not where it was subtracted.
    """
    found = []
    for (rows, places), shapes in zip(parts, expected, strict=True):
        count, own = int(places[-1]) + 1, eps[rows]
        ordinates = np.abs(np.fft.rfft(spread(own, places))) ** 2 / len(places)
        frequency = 2 * np.pi * np.arange(len(ordinates)) / count
        first = int(abs(own.sum()) <= 1e-9 * np.sqrt(len(own)) * np.linalg.norm(own))
        found.append((frequency[first:], ordinates[first:], shapes[:, first:]))
    frequency, ordinates, shapes = (np.concatenate(items, axis=-1) for items in zip(*found, strict=True))
    return frequency, ordinates, shapes


def _expected(places: Integers, memories: Array) -> Array:
    """(2 + m, f) expected periodogram of every part with unit variance, where the samples at `places` are there."""
    count = int(places[-1]) + 1
    lags = np.arange(count)
    pairs = np.asarray(count - lags, dtype=float)
    if count > len(places):
        spectrum = np.fft.rfft(spread(np.ones(len(places)), places), 2 * count)
        pairs = np.fft.irfft(np.abs(spectrum) ** 2, 2 * count)[:count]
    covariances = np.zeros((2 + len(memories), count))
    covariances[:2, 0] = 1.0, 2.0
    covariances[1, 1:2] = -1.0
    covariances[2:] = np.exp(-lags / memories[:, None])
    covariances *= pairs / len(places)
    covariances[:, 1:] += covariances[:, :0:-1].copy()
    return np.asarray(np.fft.rfft(covariances, axis=1).real)


def _binned(frequency: Array, ordinates: Array, shapes: Array) -> tuple[Array, Array, Array]:
    """Mean ordinates (b,) and shapes (2 + m, b) of bins, and how many frequencies each holds, half for zero."""
    least = frequency[frequency > 0].min()
    position = np.log(np.maximum(frequency, least) / least) / np.log(1.001 * np.pi / least)
    place = np.where(frequency > 0, 1 + (TUNING.spectrum_bins * position).astype(int), 0)
    _, place, count = np.unique(place, return_inverse=True, return_counts=True)
    means = [np.bincount(place, row) / count for row in (ordinates, *shapes)]
    weight = np.asarray(np.bincount(place, np.where(frequency > 0, 1.0, 0.5)), dtype=float)
    return means[0], np.array(means[1:]), weight


def _most_likely(ordinates: Array, shapes: Array, count: Array, parts: int) -> tuple[Array, float]:
    """Variances (parts,) of the first parts, and minus the logarithm of their likelihood."""
    shapes = shapes[:parts]
    expected = shapes[0] + shapes[1]
    for _ in range(TUNING.spectrum_iterations):
        weight = np.sqrt(count) / expected
        variances, _ = scipy.optimize.nnls((shapes * weight).T, ordinates * weight, maxiter=100 * parts)
        expected = np.maximum(variances @ shapes, 1e-9 * np.max(variances @ shapes))
    return variances, float(count @ (np.log(expected) + ordinates / expected))


def _misfit(frequency: Array, ratio: Array) -> float:
    """Bartlett's statistic: how far the cumulated ratio of periodogram to expectation is from a straight line."""
    order = np.argsort(frequency, kind="stable")
    rising = np.cumsum(ratio[order[frequency[order] > 0]])
    if not rising[-1] > 0:
        return 0.0
    even = np.arange(1, len(rising) + 1) / len(rising)
    return float(np.abs(rising / rising[-1] - even).max() * np.sqrt(len(rising)))
