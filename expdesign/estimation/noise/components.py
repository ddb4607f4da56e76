"""Residual noise as a sum of independent parts, each with a known shape in time, and their effect on an estimate.

    cov eps(i), eps(j) = white [i = j] + sensor (2 [i = j] - [|i - j| = 1])
        + sum over m of (slow_m + turning_m cos(psi(i) - psi(j))) exp(-|i - j| / m)

White are gusts and eddies new at every sample, and the part of the sensor noise that damping lets through; sensor is
noise that enters at one sample and leaves at the next, eps(k) = e(k + 1) - (1 + J) e(k), whose low frequencies cancel;
slow are disturbances that last m samples, or as long as a batch, and keep their side of the ship; turning are those
that keep their side of the chart, as currents and winds do, seen from a ship with heading psi: north and east vary
alike and independently, so that any fixed combination of their components along and across the ship has this
covariance. The variances are none of them negative. They are estimated from the periodograms of the batches, whose
expectations for batches of finite length, with or without gaps, are linear in them, by Whittle's likelihood. Slow parts
count only if they earn more likelihood than one parameter may by chance (Schwarz's criterion), and then those of the
ship or those of the chart, whichever are likelier: from few turns both together can hardly be told apart. The
covariance of sum W eps then follows for any W, ends of batches included, without kernel or lags.

Residuals are less than the noise by what the parameters take up: r = eps - Phi sum W eps. From few data that is much of
the slow noise. With Sigma the covariance matrix of a part, the expected periodogram is that of

    Sigma - Phi W^T Sigma - Sigma W Phi^T + Phi W^T Sigma W Phi^T

Whether the parts fit is tested: the periodogram over its expectation must spread its sum evenly over frequencies
(Bartlett's test, 1 %).

Source: F. Ljungberg, doctoral thesis, Linköping University, (5.63)-(5.66), for the parts; A. M. Sykulski, S. C. Olhede,
A. P. Guillaumin, J. M. Lilly and J. J. Early, Biometrika 106 (2019), 251-266, for the likelihood; M. S. Bartlett, An
Introduction to Stochastic Processes (1955), for the test.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.estimation.noise.parts import Slow, alternatives, covariance_along, directions_of, filtered, slow_parts
from expdesign.estimation.noise.periodograms import binned, expected_periodogram, misfit_of, periodograms
from expdesign.estimation.noise.timeline import Stretch
from expdesign.estimation.regression import Integers
from expdesign.estimation.tuning import TUNING
from expdesign.values import Array


@dataclass(frozen=True, eq=False)
class Components:
    """The parts of one output's noise.

    Attributes:
        variances: (2 + m,) white, sensor, slow.
        slow: the m slow parts.
        misfit: Bartlett's statistic.
        uncertainty: (2 + m, 2 + m) covariance of the variances; see `directions_of`.
    """

    variances: Array
    slow: tuple[Slow, ...]
    misfit: float
    uncertainty: Array


@dataclass(frozen=True, eq=False)
class Fitted:
    """What estimated parameters took from the noise of an output: residuals are eps - Phi sum over k of W(k) eps(k).

    Attributes:
        Phi: (k, p) regressors, without the mean where residuals are.
        W: (k, p).
    """

    Phi: Array
    W: Array


def fit_components(residuals: Array, parts: Sequence[Stretch], by: Sequence[Fitted] = ()) -> list[Components]:
    """The parts of the noise in each output's residuals (k, n).

    Args:
        residuals: of an estimate.
        parts: `stretches`; without headings there are no turning parts.
        by: what the estimate took from each output's noise; () for noise of which nothing was taken.
    """
    slow = slow_parts(parts)
    left = left_shapes(parts, slow, by or [nothing_taken(len(residuals))] * residuals.shape[1])
    return [_fitted(column, parts, own, slow) for column, own in zip(residuals.T, left, strict=True)]


def nothing_taken(rows: int) -> Fitted:
    """An estimate of no parameters, which took nothing from the noise of so many rows."""
    return Fitted(*np.zeros((2, rows, 0)))


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
    left = [np.maximum(new, TUNING.least_left * old) for new, old in zip(result, expected, strict=True)]
    return [np.where(np.abs(shape) > TUNING.rounding, shape, 0.0) for shape in left]


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
    for _ in range(TUNING.spectrum_iterations):
        weight = np.sqrt(count) / expected
        variances, _ = scipy.optimize.nnls((shapes * weight).T, ordinates * weight, maxiter=100 * len(shapes))
        expected = np.maximum(variances @ shapes, 1e-9 * np.max(variances @ shapes))
    return variances, float(count @ (np.log(expected) + ordinates / expected))
