"""Rows of the sampled equation: y(t) on its past and on differences of accelerometer, yaw rate and rudder.

Source: doctoral thesis on grey-box identification of roll with few sensors, (4.33), (5.54).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.roll.runs import Run
from expdesign.roll.tuning import TUNING
from expdesign.values import Array, seal


def delayed(signal: Array, lags: Sequence[int]) -> Array:
    """(k, n) a signal (k,) so many samples ago, zero before its beginning."""
    result = np.zeros((len(signal), len(lags)))
    for column, lag in enumerate(lags):
        result[lag:, column] = signal[: len(signal) - lag]
    return result


def difference(signals: Array) -> Array:
    """x(t) - x(t-2) of signals (k, ...), which the bilinear map makes of a derivative; zero for the first two."""
    result = np.zeros_like(signals)
    result[2:] = signals[2:] - signals[:-2]
    return result


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows:
    """The equation y = X theta + noise of one case, every run without its mean.

    Attributes:
        y: (n,) roll rate.
        X: (n, 5) regressors.
        Z: (n, q) instruments.
        run, step: (n,) run, and sample in it.
    """

    y: Array
    X: Array
    Z: Array
    run: Array
    step: Array

    def __post_init__(self) -> None:
        seal(self, y="n", X="n 5", Z="n q", run="n", step="n")

    def residuals(self, values: Array) -> Array:
        """(n,) of coefficients (5,)."""
        return np.asarray(self.y - self.X @ values)


def regressors(signals: Array) -> Array:
    """(k, 5) of signals (k, 4) as in a run, measured or simulated."""
    return np.column_stack([-delayed(signals[:, 0], (1, 2)), difference(signals[:, 1:])])


def instrument_columns(simulated: Array) -> Array:
    """(k, q) lags of simulated signals (k, 4): the regressors without noise, and some more."""
    roll_rate, *others = np.column_stack([simulated[:, :1], difference(simulated[:, 1:])]).T
    lags = [TUNING.lags, TUNING.lags, TUNING.rudder_lags]
    parts = [delayed(signal, range(count)) for signal, count in zip(others, lags, strict=True)]
    return np.column_stack([delayed(roll_rate, range(1, 1 + TUNING.lags)), *parts])


def build_rows(runs: Sequence[Run], instruments: Sequence[Array] | None, noise: NoiseModel) -> Rows:
    """Rows of a case.

    Args:
        runs: prepared.
        instruments: (k, q) of each run; None for the regressors themselves, which is least squares.
        noise: of the residuals, which whitens them.
    """
    parts = []
    for number, run in enumerate(runs):
        X = regressors(run.signals)
        Z = X if instruments is None else instruments[number]
        table = noise.whitened(np.column_stack([run.signals[:, 0], X, Z]))
        table = table[TUNING.left_out_samples :]
        steps = np.arange(len(table))
        parts.append(np.column_stack([table - table.mean(axis=0), np.full(len(table), number), steps]))
    whole = np.concatenate(parts)
    return Rows(y=whole[:, 0], X=whole[:, 1:6], Z=whole[:, 6:-2], run=whole[:, -2], step=whole[:, -1])


@dataclass(frozen=True, kw_only=True, eq=False)
class NoiseModel:
    """Residuals e = (C / D) n with white n, in powers of the delay; its inverse whitens.

    Attributes:
        past: (o + 1,) D, 1 first.
        moving: (o + 1,) C, 1 first.
    """

    past: Array
    moving: Array

    def __post_init__(self) -> None:
        seal(self, past="a", moving="c")

    def whitened(self, signals: Array) -> Array:
        """Signals (k, ...) through D / C."""
        return np.asarray(scipy.signal.lfilter(self.past, self.moving, signals, axis=0))


WHITE = NoiseModel(past=np.ones(1), moving=np.ones(1))


def noise_model(residuals: Sequence[Array], past: Array, order: int) -> NoiseModel:
    """Model of residuals (k,) of each run: noise of the sensors, coloured by an autoregression.

    Noise of the roll rate enters through A = 1 + a1 q^-1 + a2 q^-2, that of other signals and white moments through
    1 - q^-2. Both have zeros on or near the unit circle, which no short autoregression sees; C is the factor with
    C C* = rho A A* + (1 - q^-2)(1 - q^2), with the rho that leaves the least innovations.

    Args:
        residuals: of one case.
        past: (2,) a1 and a2.
        order: of the autoregression.
    """
    if not sum(float(e @ e) for e in residuals) > 0:
        return WHITE
    models = []
    for rho in TUNING.noise_ratios:
        moving = _sensor_factor(past, rho)
        left = [scipy.signal.lfilter([1.0], moving, e) for e in residuals]
        found, innovation = _autoregression(left, order)
        models.append((innovation, NoiseModel(past=found, moving=moving)))
    return min(models, key=lambda pair: pair[0])[1]


def _sensor_factor(past: Array, rho: float) -> Array:
    """C (3,), 1 first."""
    own, others = np.array([1.0, *past]), np.array([1.0, 0.0, -1.0])
    power = rho * np.convolve(own, own[::-1]) + np.convolve(others, others[::-1])
    roots = np.roots(power)
    within = roots[np.argsort(np.abs(roots))[:2]]
    return inside(np.asarray(np.poly(within).real, dtype=float))


def _autoregression(residuals: Sequence[Array], order: int) -> tuple[Array, float]:
    """(order + 1,) 1, -c1, -c2, ... by Yule and Walker, and the variance of its innovations."""
    count = sum(map(len, residuals))
    power = np.array([sum(float(e[: len(e) - lag] @ e[lag:]) for e in residuals) for lag in range(order + 1)]) / count
    power[0] *= 1.0 + 1e-10  # residuals of data without noise may be a sum of few oscillations
    found = scipy.linalg.solve_toeplitz(power[:-1], power[1:])
    return np.concatenate([[1.0], -found]), float(power[0] - found @ power[1:])


def inside(polynomial: Array) -> Array:
    """The polynomial in powers of the delay, with roots beyond the largest allowed circle mirrored at it."""
    roots = np.roots(polynomial)
    sizes = np.maximum(np.abs(roots), 1e-9)
    wanted = np.minimum(np.minimum(sizes, 1.0 / sizes), TUNING.largest_pole)
    return np.asarray(np.poly(roots * (wanted / sizes)).real)
