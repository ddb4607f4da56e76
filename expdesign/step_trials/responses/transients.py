"""Responses to one step: first order, and second order with a zero, both after a dead time.

First order:   x(t) = x- + (x+ - x-) (1 - exp(-(t - t_d)/T))                                   for t > t_d
Second order:  T1 T2 x'' + (T1 + T2) x' + x = K (tau + T3 tau'),  T1, T2 real or complex conjugate

Both plateaus are known, so that the inertia m = k T follows from T alone, with k the change of command per change of
state. Of a second order response it follows from T1 + T2 - T3, the first order time constant with the same area between
response and plateau (K. Nomoto et al., On the steering qualities of ships, Int. Shipbuilding Progress 4, 1957).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.values import Array

NARROW_S = 1e-6
"""Half the distance between the bounds of a dead time that is fixed [s]."""
Curve = Callable[[Array, Array], Array]
"""(parameters, time_s) -> (k,) share of the step that is done."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """A fitted response.

    Attributes:
        time_constant_s: T, or T1 + T2 - T3 of a second order [s].
        time_constant_std_s: standard error, errors of both plateaus included [s].
        delay_s, delay_std_s: dead time [s].
        rms: root mean square of the residuals, unit of the state.
        independent: how many samples count as independent.
        damping: zeta of a second order; 1 for a first order.
        zero_s: T3, 0 for a first order [s].
        parameters: of its curve.
    """

    time_constant_s: float
    time_constant_std_s: float
    delay_s: float
    delay_std_s: float
    rms: float
    independent: float
    damping: float
    zero_s: float
    parameters: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Transient:
    """Data of one step from the change of command on.

    Attributes:
        time_s: (k,) from the change of command [s].
        values: (k,) the state.
        before, after: the plateaus.
        before_std, after_std: their standard errors.
    """

    time_s: Array
    values: Array
    before: float
    after: float
    before_std: float = 0.0
    after_std: float = 0.0

    @property
    def size(self) -> float:
        """The step, signed."""
        return self.after - self.before


def first_order(parameters: Array, time_s: Array) -> Array:
    """Share of the step done, for (T, t_d)."""
    constant, delay = parameters
    return np.asarray(1.0 - np.exp(-np.maximum(time_s - delay, 0.0) / max(constant, 1e-9)))


def second_order(parameters: Array, time_s: Array) -> Array:
    """Share of the step done, for (T0, zeta, T3, t_d): T1 T2 = T0^2 and T1 + T2 = 2 zeta T0."""
    natural, damping, zero, delay = parameters
    split = np.sqrt(complex(damping**2 - 1.0))
    split = split if abs(split) > 1e-4 else 1e-4
    one, two = natural * (damping + split), natural * (damping - split)
    after = np.maximum(time_s - delay, 0.0)
    share = 1.0 - ((one - zero) * np.exp(-after / one) - (two - zero) * np.exp(-after / two)) / (one - two)
    return np.asarray(np.where(time_s > delay, share.real, 0.0))


def fit_first_order(data: Transient, *, delay_s: tuple[float, float]) -> Response:
    """T and t_d by least squares over the whole transient, the dead time included, from the best point of a grid.

    The dead time lies between two bounds, which may be equal.
    """
    span = float(data.time_s[-1])
    constants = np.geomspace(max(span / 200, float(data.time_s[1]) / 4), 2 * span, 40)
    delays = np.linspace(*delay_s, 11 if delay_s[1] > delay_s[0] else 1)
    start = _best_start(data, first_order, [np.array([c, d]) for c in constants for d in delays])
    low, high = [1e-3 * span, delay_s[0] - NARROW_S], [10 * span, delay_s[1] + NARROW_S]
    found, scale = _fitted(data, first_order, start, low, high)
    std = _errors(data, first_order, found, scale, fixed=delay_s[0] == delay_s[1])
    return Response(
        time_constant_s=float(found[0]), time_constant_std_s=float(std[0]), delay_s=float(found[1]),
        delay_std_s=float(std[1]), damping=1.0, zero_s=0.0, parameters=found,
        **_quality(data, first_order, found, scale),
    )  # fmt: skip


def fit_second_order(data: Transient, first: Response, *, delay_s: tuple[float, float]) -> Response:
    """T0, zeta from 0.3 to 1.2, T3 and t_d by least squares, from several starts about the first order response.

    The printed bounds of the method, zeta of 0.9 and more and an inertia above that of the first order, would forbid
    overshoot: a response with overshoot from a zero has a larger inertia, one of two poles alone a smaller one.
    """
    t = first.time_constant_s
    starts = [
        np.array([t * scale, damping, t * zero, first.delay_s])
        for scale in (0.5, 1.0) for damping in (0.5, 0.8, 1.1) for zero in (0.0, 0.5, 1.5)
    ]  # fmt: skip
    start = _best_start(data, second_order, starts)
    low, high = [0.05 * t, 0.3, 0.0, delay_s[0] - NARROW_S], [5 * t, 1.2, 3 * t, delay_s[1] + NARROW_S]
    found, scale = _fitted(data, second_order, start, low, high)
    combined = np.array([2 * found[1], 2 * found[0], -1.0, 0.0])
    std = _errors(data, second_order, found, scale, combined, fixed=delay_s[0] == delay_s[1])
    natural, damping, zero, delay = found.tolist()
    return Response(
        time_constant_s=2 * damping * natural - zero, time_constant_std_s=float(std[0]), delay_s=delay,
        delay_std_s=float(std[1]), damping=damping, zero_s=zero, parameters=found,
        **_quality(data, second_order, found, scale),
    )  # fmt: skip


def _residuals(data: Transient, curve: Curve, parameters: Array) -> Array:
    return np.asarray(data.before + data.size * curve(parameters, data.time_s) - data.values)


def _best_start(data: Transient, curve: Curve, starts: list[Array]) -> Array:
    return min(starts, key=lambda start: float(np.sum(_residuals(data, curve, start) ** 2)))


def _fitted(data: Transient, curve: Curve, start: Array, low: list[float], high: list[float]) -> tuple[Array, float]:
    """Parameters, and samples per independent one."""
    inside = np.clip(start, np.array(low) + 1e-9, np.array(high) - 1e-10)
    found = scipy.optimize.least_squares(
        lambda p: _residuals(data, curve, p), inside, bounds=(low, high), x_scale="jac"
    )
    return np.asarray(found.x), _dependence(found.fun)


def _dependence(residuals: Array) -> float:
    """(1 + a)/(1 - a) for a first-order autocorrelation a of the residuals."""
    power = float(residuals @ residuals)
    share = float(residuals[1:] @ residuals[:-1]) / power if power > 0 else 0.0
    return float(np.clip((1 + share) / (1 - min(share, 0.99)), 1.0, len(residuals) / 4))


def _errors(
    data: Transient, curve: Curve, found: Array, scale: float, combined: Array | None = None, *, fixed: bool
) -> Array:
    """(2,) standard errors of the time constant and of the dead time, the last parameter, which may be fixed."""
    slopes, eps = np.empty((len(data.time_s), len(found))), 1e-4
    for place, value in enumerate(found.tolist()):
        step = eps * max(abs(value), float(data.time_s[1]) * 0.1)
        ahead, back = found.copy(), found.copy()
        ahead[place], back[place] = value + step, value - step
        slopes[:, place] = data.size * (curve(ahead, data.time_s) - curve(back, data.time_s)) / (2 * step)
    slopes[:, -1] *= not fixed
    inverse = np.linalg.pinv(slopes.T @ slopes, rcond=1e-10)
    noise = scale * float(np.sum(_residuals(data, curve, found) ** 2)) / max(len(data.time_s) - len(found), 1)
    done = curve(found, data.time_s)
    plateaus = inverse @ slopes.T @ np.stack([(1 - done) * data.before_std, done * data.after_std], axis=1)
    covariance = noise * inverse + plateaus @ plateaus.T
    weights = np.zeros((2, len(found)))
    weights[0] = np.eye(len(found))[0] if combined is None else combined
    weights[1, -1] = 1.0
    return np.sqrt(np.maximum(np.diag(weights @ covariance @ weights.T), 0.0))


def _quality(data: Transient, curve: Curve, found: Array, scale: float) -> dict[str, float]:
    mean_square = max(float(np.mean(_residuals(data, curve, found) ** 2)), (1e-6 * data.size) ** 2, 1e-300)
    return {"rms": math.sqrt(mean_square), "independent": len(data.time_s) / scale}


def preference(first: Response, second: Response) -> float:
    """Decrease of Akaike's information criterion from a first order response to a second order one."""
    return second.independent * 2 * math.log(first.rms / second.rms) - 2 * (
        len(second.parameters) - len(first.parameters)
    )
