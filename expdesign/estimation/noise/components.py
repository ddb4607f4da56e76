"""Residual noise as a sum of independent parts, each with a known shape in time, fitted to periodograms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.estimation.regression import Integers, batch_slices
from expdesign.values import Array

SPECTRUM_BINS = 80  # bins of the periodogram, of equal width in the logarithm of frequency
SPECTRUM_ITERATIONS = 12  # of reweighted non-negative least squares
LEAST_LEFT = 0.05  # share of a part of the noise that parameters leave in residuals at a frequency, at least
MEMORY_DOUBLINGS = 1.0  # how far the memory of a slow part may be from the found one, standard deviation of log2
ROUNDING = 1e-9  # expected periodogram of a part with unit variance below which it is rounding errors
LONG_GAP_SAMPLES = 500  # missing samples in a row after which the noise starts again
Turn = NDArray[np.complex128]
"""exp(i psi) of headings psi."""
Numbers = TypeVar("Numbers", NDArray[np.float64], Turn)


@dataclass(frozen=True, eq=False)
class Stretch:
    """Rows in a row, with short gaps at most."""

    rows: slice  # of the data
    places: Integers  # (k,) their sample numbers from the begin of the stretch
    # (t,) exp(i psi) of the heading psi at every sample, zero where one was left out; None without headings
    turn: Turn | None = None

    @property
    def samples(self) -> int:
        """Number of samples from the first to the last, those left out included."""
        return int(self.places[-1]) + 1

    @property
    def padded(self) -> int:
        """Samples with zeros behind, up to a product of small primes: transforms of others may take 20 times longer."""
        return int(scipy.fft.next_fast_len(self.samples))

    def spread(self, rows: Array) -> Array:
        """(t, ...) from (k, ...), zero where a sample was left out."""
        return spread(rows, self.places)


def stretches(batch: Integers, step: Integers, heading: Array | None = None) -> list[Stretch]:
    """Every stretch; long gaps part a batch."""
    result = []
    for rows in batch_slices(batch):
        edges = [
            0,
            *(np.flatnonzero(np.diff(step[rows]) > LONG_GAP_SAMPLES) + 1).tolist(),
            rows.stop - rows.start,
        ]
        for low, high in pairwise(edges):
            part = slice(rows.start + low, rows.start + high)
            places = step[part] - step[part][0]
            turn = None if heading is None else spread(np.exp(1j * heading[part]), places)
            result.append(Stretch(part, places, turn))
    return result


def spread(rows: Numbers, places: Integers) -> Numbers:
    """(t, ...) from (k, ...), zero where a sample was left out."""
    if len(rows) == places[-1] + 1:
        return rows
    result = np.zeros((places[-1] + 1, *rows.shape[1:]), dtype=rows.dtype)
    result[places] = rows
    return result


@dataclass(frozen=True, eq=False)
class Timeline:
    """All samples from the first to the last of every stretch, those left out included."""

    place: Integers  # (k,) where each row of the data stands
    # batch, step: (t,) number of the stretch and sample number in it
    batch: Integers
    step: Integers

    def spread(self, rows: Array) -> Array:
        """(t, ...) from (k, ...), zero where a sample was left out."""
        return rows if len(rows) == len(self.batch) else spread(rows, self.place)


def timeline(batch: Integers, step: Integers) -> Timeline:
    """The timeline of rows (k,) with their batch and sample numbers."""
    place, numbers, steps, begin = [], [], [], 0
    for number, part in enumerate(stretches(batch, step)):
        place.append(begin + part.places)
        numbers.append(np.full(part.samples, number))
        steps.append(np.arange(part.samples))
        begin += part.samples
    return Timeline(np.concatenate(place), np.concatenate(numbers), np.concatenate(steps))


# Parts that noise may consist of: white, of the sensors, and slow ones, with their covariances in time.

WHITE, SENSOR = 0, 1  # places of the quick parts among the variances; slow ones follow
MEMORIES = 2.0 ** np.arange(1, 11)
"""Memories of slow parts [samples], at most the longest stretch; one more part lasts for ever."""


@dataclass(frozen=True)
class Slow:
    """A disturbance that lasts."""

    memory: float  # how long [samples]
    turning: bool = False  # whether it keeps its side of the chart while the ship turns, not its side of the ship


def slow_parts(parts: Sequence[Stretch]) -> tuple[Slow, ...]:
    """Slow parts that noise may have in stretches so long; those of the chart only where headings are known."""
    longest = max(part.samples for part in parts)
    memories = MEMORIES[longest >= MEMORIES].tolist()
    turns = any(part.turn is not None and np.ptp(part.turn) > ROUNDING for part in parts)
    ship, chart = [Slow(memory) for memory in (*memories, np.inf)], [Slow(memory, turning=True) for memory in memories]
    return (*ship, *chart) if turns else tuple(ship)


def alternatives(slow: Sequence[Slow], ordinates: int) -> list[tuple[Integers, float]]:
    """Parts that noise may consist of, and what they must earn: no slow ones, those of the ship, those of the chart."""
    quick = np.arange(2)
    kinds = [2 + np.flatnonzero([part.turning == kind for part in slow]) for kind in (False, True)]
    earned = np.log(ordinates) / 2
    return [(quick, 0.0), *((np.append(quick, kind), earned) for kind in kinds if len(kind))]


def directions_of(variances: Array, slow: Sequence[Slow]) -> tuple[Array, Array]:
    """How variances (2 + m,) may be wrong: directions (2 + m, d), and what is known about each beforehand (d,).

    The parts that are there may be larger or smaller, and slow ones may have the memory of their neighbours: what lasts
    long is known much worse than by the size of a part whose memory is given.
    """
    there = np.flatnonzero(variances)
    columns, before = list(np.eye(len(variances))[there]), [0.0] * len(there)
    for place in there[there > SENSOR].tolist():
        turning = slow[place - 2].turning
        ends = [other for other in (place - 1, place, place + 1) if 0 <= other - 2 < len(slow)]
        ends = [other for other in ends if slow[other - 2].turning == turning]
        if len(ends) > 1:
            column = np.zeros(len(variances))
            column[[ends[0], ends[-1]]] = np.array([-1.0, 1.0]) * variances[place] / (ends[-1] - ends[0])
            columns.append(column)
            before.append(MEMORY_DOUBLINGS**-2.0)
    return np.reshape(columns, (-1, len(variances))).T, np.array(before)


def covariance_along(directions: tuple[Array, Array], information: Array) -> Array:
    """Covariance (q, q) of variances with this information (q, q) that are wrong in these `directions` only."""
    T, before = directions
    own = T.T @ information @ T + np.diag(before)
    size = np.sqrt(np.diag(own))
    size[size == 0] = 1.0
    return np.asarray(T @ (np.linalg.pinv(own / np.outer(size, size), hermitian=True) / np.outer(size, size)) @ T.T)


def filtered(index: int, slow: Sequence[Slow], W: Array, turn: Turn | None = None) -> Array:
    """(t, p) covariance matrix of a part, with unit variance, times W (t, p), under headings exp(i psi) (t,)."""
    if index == WHITE:
        return W
    if index == SENSOR:
        result = 2.0 * W
        result[1:] -= W[:-1]
        result[:-1] -= W[1:]
        return result
    part = slow[index - 2]
    if not part.turning:
        return _remembered(W, part.memory)
    assert turn is not None  # without headings there are no turning parts
    c, s = turn.real[:, None], turn.imag[:, None]
    return np.asarray(c * _remembered(c * W, part.memory) + s * _remembered(s * W, part.memory))


def _remembered(W: Array, memory: float) -> Array:
    keep = np.exp(-1.0 / memory)
    past = scipy.signal.lfilter([1.0], [1.0, -keep], W, axis=0)
    return np.asarray(past + scipy.signal.lfilter([1.0], [1.0, -keep], W[::-1], axis=0)[::-1] - W)


# Periodograms of residuals, and their expectations for each part of the noise.
#
# Stretches may have gaps; expectations are exact for the samples that are there.


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
    place = np.where(frequency > 0, 1 + (SPECTRUM_BINS * position).astype(int), 0)
    _, place, count = np.unique(place, return_inverse=True, return_counts=True)
    weight = np.asarray(np.bincount(place, np.where(frequency > 0, 1.0, 0.5)), dtype=float)
    return np.array([np.bincount(place, row) / count for row in rows]), weight


def misfit_of(frequency: Array, ordinates: Array, level: Array) -> float:
    """Bartlett's statistic: how far the cumulated ratio of periodogram to expectation is from a straight line."""
    floor = 1e-12 * max(level.max(), ordinates.max())
    if not floor > 0:  # data without noise
        return 0.0
    ratio = ordinates / np.maximum(level, floor)
    order = np.argsort(frequency, kind="stable")
    rising = np.cumsum(ratio[order[frequency[order] > 0]])
    if not rising[-1] > 0:
        return 0.0
    even = np.arange(1, len(rising) + 1) / len(rising)
    return float(np.abs(rising / rising[-1] - even).max() * np.sqrt(len(rising)))


# Residual noise as a sum of independent parts, each with a known shape in time, and their effect on an estimate.
#
#     cov eps(i), eps(j) = white [i = j] + sensor (2 [i = j] - [|i - j| = 1])
#         + sum over m of (slow_m + turning_m cos(psi(i) - psi(j))) exp(-|i - j| / m)
#
# White are gusts and eddies new at every sample, and the part of the sensor noise that damping lets through; sensor is
# noise that enters at one sample and leaves at the next, eps(k) = e(k + 1) - (1 + J) e(k), whose low frequencies
# cancel; slow are disturbances that last m samples, or as long as a batch, and keep their side of the ship; turning are
# those that keep their side of the chart, as currents and winds do, seen from a ship with heading psi: north and east
# vary alike and independently, so that any fixed combination of their components along and across the ship has this
# covariance. The variances are none of them negative. They are estimated from the periodograms of the batches, whose
# expectations for batches of finite length, with or without gaps, are linear in them, by Whittle's likelihood. Slow
# parts count only if they earn more likelihood than one parameter may by chance (Schwarz's criterion), and then those
# of the ship or those of the chart, whichever are likelier: from few turns both together can hardly be told apart. The
# covariance of sum W eps then follows for any W, ends of batches included, without kernel or lags.
#
# Residuals are less than the noise by what the parameters take up: r = eps - Phi sum W eps. From few data that is much
# of the slow noise. With Sigma the covariance matrix of a part, the expected periodogram is that of
#
#     Sigma - Phi W^T Sigma - Sigma W Phi^T + Phi W^T Sigma W Phi^T
#
# Whether the parts fit is tested: the periodogram over its expectation must spread its sum evenly over frequencies
# (Bartlett's test, 1 %).
#
# Source: F. Ljungberg, doctoral thesis, Linköping University, (5.63)-(5.66), for the parts; A. M. Sykulski, S. C.
# Olhede, A. P. Guillaumin, J. M. Lilly and J. J. Early, Biometrika 106 (2019), 251-266, for the likelihood; M. S.
# Bartlett, An Introduction to Stochastic Processes (1955), for the test.


@dataclass(frozen=True, eq=False)
class Components:
    """The parts of one output's noise."""

    variances: Array  # (2 + m,) white, sensor, slow
    slow: tuple[Slow, ...]  # the m slow parts
    misfit: float  # Bartlett's statistic
    uncertainty: Array  # (2 + m, 2 + m) covariance of the variances; see `directions_of`


@dataclass(frozen=True, eq=False)
class Fitted:
    """What estimated parameters took from the noise of an output: residuals are eps - Phi sum over k of W(k) eps(k)."""

    Phi: Array  # (k, p) regressors, without the mean where residuals are
    W: Array  # (k, p)


def fit_components(residuals: Array, parts: Sequence[Stretch], by: Sequence[Fitted] = ()) -> list[Components]:
    """The parts of the noise in each output's residuals (k, n).

    Args:
        parts: `stretches`; without headings there are no turning parts.
        by: what the estimate took from each output's noise; () for noise of which nothing was taken.
    """
    slow = slow_parts(parts)
    left = left_shapes(parts, slow, by or [Fitted(*np.zeros((2, len(residuals), 0)))] * residuals.shape[1])
    return [_fitted(column, parts, own, slow) for column, own in zip(residuals.T, left, strict=True)]


def left_shapes(parts: Sequence[Stretch], slow: tuple[Slow, ...], by: Sequence[Fitted]) -> Iterator[list[Array]]:
    """Expected periodograms (2 + m, f) of the stretches for parts of unit variance, output by output."""
    shapes = _shapes(parts, slow)
    return (_less(shapes, parts, slow, own) for own in by)


def _shapes(parts: Sequence[Stretch], slow: tuple[Slow, ...]) -> list[Array]:
    """Expected periodograms (2 + m, f) of each stretch; those of stretches alike are computed once."""
    known: dict[bytes, Array] = {}
    result = []
    for part in parts:
        key = part.places.tobytes() + (b"" if part.turn is None else part.turn.tobytes())
        if key not in known:
            known[key] = expected_periodogram(part, slow)
        result.append(known[key])
    return result


def _less(expected: Sequence[Array], parts: Sequence[Stretch], slow: tuple[Slow, ...], by: Fitted) -> list[Array]:
    """Expected periodograms (2 + m, f) of each stretch, less what the parameters took; not below a share of it."""
    p = by.Phi.shape[1]
    if not p:
        return list(expected)
    wide = [part.spread(by.W[part.rows]) for part in parts]
    spectra = [np.fft.rfft(part.spread(by.Phi[part.rows]), part.padded, axis=0) for part in parts]
    result = [np.array(shape) for shape in expected]
    for index in range(2 + len(slow)):
        turned = [filtered(index, slow, W, part.turn) for W, part in zip(wide, parts, strict=True)]
        C = sum((W.T @ own for W, own in zip(wide, turned, strict=True)), start=np.zeros((p, p)))
        for number, part in enumerate(parts):
            Phi = spectra[number]
            there = turned[number] if len(part.places) == part.samples else _where(turned[number], part.places)
            mixed = 0.5 * Phi @ C - np.fft.rfft(there, part.padded, axis=0)
            result[number][index] += 2.0 * (Phi.conj() * mixed).real.sum(axis=1) / len(part.places)
    left = [np.maximum(new, LEAST_LEFT * old) for new, old in zip(result, expected, strict=True)]
    return [np.where(np.abs(shape) > ROUNDING, shape, 0.0) for shape in left]


def _where(rows: Array, places: Integers) -> Array:
    """Rows (t, p), zero where a sample was left out."""
    result = np.zeros_like(rows)
    result[places] = rows[places]
    return result


def _fitted(eps: Array, parts: Sequence[Stretch], expected: Sequence[Array], slow: tuple[Slow, ...]) -> Components:
    power = float(eps @ eps) / len(eps)
    variances = np.zeros(2 + len(slow))
    variances[0] = power
    frequency, ordinates, shapes = periodograms(eps, parts, expected)
    if not power > 0 or not (frequency > 0).any():
        return Components(variances, slow, 0.0, np.zeros((len(variances),) * 2))
    binned_power, binned_shapes, count = binned(frequency, ordinates / power, shapes)
    cost = np.inf
    for places, penalty in alternatives(slow, len(frequency)):
        found, own_cost = _most_likely(binned_power, binned_shapes[places], count)
        if own_cost + penalty < cost:
            variances[:], cost = 0.0, own_cost + penalty
            variances[places] = power * found
    own = binned_shapes / np.maximum((variances / power) @ binned_shapes, 1e-300)
    uncertainty = covariance_along(directions_of(variances / power, slow), (own * count) @ own.T)
    misfit = misfit_of(frequency, ordinates, variances @ shapes)
    return Components(variances, slow, misfit, power**2 * uncertainty)


def _most_likely(ordinates: Array, shapes: Array, count: Array) -> tuple[Array, float]:
    """Variances (parts,) of parts with these shapes, and minus the logarithm of their likelihood."""
    expected = shapes[0] + shapes[1]
    for _ in range(SPECTRUM_ITERATIONS):
        weight = np.sqrt(count) / expected
        variances, _ = scipy.optimize.nnls((shapes * weight).T, ordinates * weight, maxiter=100 * len(shapes))
        expected = np.maximum(variances @ shapes, 1e-9 * np.max(variances @ shapes))
    return variances, float(count @ (np.log(expected) + ordinates / expected))
