"""Responses to steps: one by one, and with a shape in common."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.values import Array

# Responses to one step: first order, and second order with a zero, both after a dead time.
#
# First order:   x(t) = x- + (x+ - x-) (1 - exp(-(t - t_d)/T))                                   for t > t_d
# Second order:  T1 T2 x'' + (T1 + T2) x' + x = K (tau + T3 tau'),  T1, T2 real or complex conjugate
#
# Both plateaus are known, so that the inertia m = k T follows from T alone, with k the change of command per change of
# state. Of a second order response it follows from T1 + T2 - T3, the first order time constant with the same area
# between response and plateau (K. Nomoto et al., On the steering qualities of ships, Int. Shipbuilding Progress 4,
# 1957).

NARROW_S = 1e-6  # half the distance between the bounds of a dead time that is fixed [s]
Curve = Callable[[Array, Array], Array]
"""(parameters, time_s) -> (k,) share of the step that is done."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """A fitted response."""

    time_constant_s: float  # T, or T1 + T2 - T3 of a second order [s]
    time_constant_std_s: float  # standard error, errors of both plateaus included [s]
    # delay_s, delay_std_s: dead time [s]
    delay_s: float
    delay_std_s: float
    rms: float  # root mean square of the residuals, unit of the state
    independent: float  # how many samples count as independent
    damping: float  # zeta of a second order; 1 for a first order
    zero_s: float  # T3, 0 for a first order [s]
    parameters: Array  # of its curve


@dataclass(frozen=True, kw_only=True, eq=False)
class Transient:
    """Data of one step from the change of command on."""

    time_s: Array  # (k,) from the change of command [s]
    values: Array  # (k,) the state
    # before, after: the plateaus
    before: float
    after: float
    # before_std, after_std: their standard errors
    before_std: float = 0.0
    after_std: float = 0.0
    density: float = 0.0  # of the noise at low frequencies, where it is known: variance of a mean times samples

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


def _residuals_transients(data: Transient, curve: Curve, parameters: Array) -> Array:
    return np.asarray(data.before + data.size * curve(parameters, data.time_s) - data.values)


def _best_start(data: Transient, curve: Curve, starts: list[Array]) -> Array:
    return min(starts, key=lambda start: float(np.sum(_residuals_transients(data, curve, start) ** 2)))


def _fitted(data: Transient, curve: Curve, start: Array, low: list[float], high: list[float]) -> tuple[Array, float]:
    """Parameters, and samples per independent one."""
    inside = np.clip(start, np.array(low) + 1e-9, np.array(high) - 1e-10)
    found = scipy.optimize.least_squares(
        lambda p: _residuals_transients(data, curve, p), inside, bounds=(low, high), x_scale="jac"
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
    noise = max(
        scale * float(np.sum(_residuals_transients(data, curve, found) ** 2)) / max(len(data.time_s) - len(found), 1),
        data.density,
    )
    done = curve(found, data.time_s)
    plateaus = inverse @ slopes.T @ np.stack([(1 - done) * data.before_std, done * data.after_std], axis=1)
    covariance = noise * inverse + plateaus @ plateaus.T
    weights = np.zeros((2, len(found)))
    weights[0] = np.eye(len(found))[0] if combined is None else combined
    weights[1, -1] = 1.0
    return np.sqrt(np.maximum(np.diag(weights @ covariance @ weights.T), 0.0))


def _quality(data: Transient, curve: Curve, found: Array, scale: float) -> dict[str, float]:
    mean_square = max(float(np.mean(_residuals_transients(data, curve, found) ** 2)), (1e-6 * data.size) ** 2, 1e-300)
    return {"rms": math.sqrt(mean_square), "independent": len(data.time_s) / scale}


def preference(first: Response, second: Response) -> float:
    """Decrease of Akaike's information criterion from a first order response to a second order one."""
    return second.independent * 2 * math.log(first.rms / second.rms) - 2 * (
        len(second.parameters) - len(first.parameters)
    )


# The dead time of the rudder, from all of its steps together.
#
# Sway makes the yaw rate begin faster than a first order response, which makes the dead time of one too short. All
# responses have one shape instead, second order with a zero, each stretched in time, as the time constants of a hull go
# with length over speed (K. Nomoto et al., Int. Shipbuilding Progress 4, 1957). One step in noise cannot separate dead
# time and shape. All steps together can, with a prior on hulls in general: T3 is less than T1 + T2, and the poles are
# real or nearly so. The plateaus are estimated too, within their standard errors.

SHAPE = (math.log(1.5), math.log(0.6))
SHAPE_STD = (0.4, 0.5)
"""Logarithms of zeta and of T3/T0 of hulls, and their standard deviations; most hulls lie within two of these."""
MOST_STEPS, TOLERANCE = 6, 1e-5
WIDTH_S, POINTS, FINE = 0.8, 17, 801
"""Width and points of the grid of dead times around those of first order responses, and points of the finer grid."""
OWN = 3  # parameters of each step: logarithm of T0, errors of both plateaus in their standard errors
MOST_LOG = 20.0  # largest logarithm during the search: longer times have no effect that a hold could show


def shared_delay(steps: Sequence[Transient], *, most_s: float) -> tuple[float, float]:
    """Dead time [s] of responses of one shape, and its standard error, from 0 to `most_s`.

    Mean and standard deviation by the likelihood of dead times on a grid, each with the shape that fits it best: it may
    have two peaks, of which the largest alone would say too little.
    """
    first = [fit_first_order(step, delay_s=(0.0, min(most_s, float(step.time_s[-1]) / 3))) for step in steps]
    noise = [one.rms * math.sqrt(len(step.time_s) / one.independent) for one, step in zip(first, steps, strict=True)]
    constants = np.log([one.time_constant_s for one in first]) - math.log(2 * math.exp(SHAPE[0]) - math.exp(SHAPE[1]))
    own = np.stack([constants, np.zeros(len(steps)), np.zeros(len(steps))], axis=1)
    x, pattern = np.concatenate([SHAPE, own.ravel()]), _pattern(steps)
    middle = float(np.median([one.delay_s for one in first]))
    grid = np.linspace(max(0.0, middle - WIDTH_S), min(most_s, middle + WIDTH_S), POINTS)
    costs = []
    for delay in grid.tolist():
        found = scipy.optimize.least_squares(
            _residuals_shared_shape,
            x,
            x_scale="jac",
            jac_sparsity=pattern,
            max_nfev=MOST_STEPS,
            ftol=TOLERANCE,
            args=(delay, steps, noise),
        )
        x = found.x
        costs.append(found.cost)
    fine = np.linspace(grid[0], grid[-1], FINE)
    cost = scipy.interpolate.CubicSpline(grid, costs)(fine)
    weight = np.exp(cost.min() - cost)
    mean = float(weight @ fine / weight.sum())
    return mean, math.sqrt(float(weight @ (fine - mean) ** 2 / weight.sum()))


def _residuals_shared_shape(x: Array, delay: float, steps: Sequence[Transient], noise: Sequence[float]) -> Array:
    """Residuals of the shape against that of hulls, and of all steps against the shape."""
    parts = [
        _apart(step, by, delay, x[:2], x[2 + OWN * place : 2 + OWN * (place + 1)])
        for place, (step, by) in enumerate(zip(steps, noise, strict=True))
    ]
    return np.concatenate([(x[:2] - SHAPE) / SHAPE_STD, *parts])


def _apart(step: Transient, noise: float, delay: float, shape: Array, own: Array) -> Array:
    """Residuals of one step and of its plateaus, in standard deviations."""
    damping, zero, natural = np.exp(np.minimum([shape[0], shape[1], own[0]], MOST_LOG)).tolist()
    before, after = step.before + own[1] * step.before_std, step.after + own[2] * step.after_std
    done = second_order(np.array([natural, damping, zero * natural, delay]), step.time_s)
    return np.append((before + (after - before) * done - step.values) / noise, own[1:])


def _pattern(steps: Sequence[Transient]) -> scipy.sparse.lil_matrix:
    """Which parameters each residual depends on."""
    rows = 2 + sum(len(step.time_s) + 2 for step in steps)
    pattern = scipy.sparse.lil_matrix((rows, 2 + OWN * len(steps)), dtype=int)
    pattern[:, :2] = 1
    first = 2
    for place, step in enumerate(steps):
        pattern[first : first + len(step.time_s) + 2, 2 + OWN * place : 2 + OWN * (place + 1)] = 1
        first += len(step.time_s) + 2
    return pattern
