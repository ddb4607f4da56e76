"""Output error of a yaw model, for many voyages at once, and first values from data alone."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from expdesign.monitoring.yaw.model import YawData, YawModel
from expdesign.simulation.motion import State, rk4_step
from expdesign.values import Array, sealed

SEARCH_STEPS = 25
LARGEST_RATE = 10.0
"""Yaw rates of a simulation are held within this [rad/s]: a poor model of an unstable ship runs away."""


@sealed(parameters="n p", std="n p", fit="n")
class YawEstimate:
    """Estimates from n voyages."""

    model: YawModel  # the structure
    parameters: Array  # (n, p) SI
    std: Array  # (n, p) standard errors from the residual, as if it were white; noise of the inputs is not counted
    fit: Array  # (n,) 100 (1 - |r - r_hat| / |r - mean r|) [%]

    def of(self, name: str) -> Array:
        """(n,) estimates of one parameter."""
        return self.parameters[:, self.model.parameters.index(name)]


def simulate_yaw(model: YawModel, data: YawData, parameters: Array) -> tuple[Array, Array]:
    """Yaw rate (n, k) from its first measured value, and its sensitivities (n, k, p), by Runge-Kutta of order four.

    The sensitivities are the exact derivatives of the Runge-Kutta steps: along the yaw rate they follow a linear
    recursion, whose coefficients are found for all samples at once.

    Args:
        data: inputs; what they multiply is taken as straight lines between samples.
        parameters: (n, p), or (p,) for all voyages.
    """
    theta = np.broadcast_to(parameters, (len(data.r), len(model.parameters)))
    shapes = model.shapes(data)
    by = _coefficients(shapes, data, theta)
    rates = _integrated(by, data)
    by_rate, by_parameters = _step_derivatives(shapes, by, theta[:, 0], rates, data.sample_time_s)
    sensitivity = np.zeros((*rates.shape, theta.shape[1]))
    for index in range(len(rates) - 1):
        sensitivity[index + 1] = by_rate[index] * sensitivity[index] + by_parameters[index]
    return rates.T, np.moveaxis(sensitivity, 0, 1)


def _coefficients(shapes: Array, data: YawData, theta: Array) -> Array:
    """(4, k, n) of 1, r, |r| and r|r| in dr/dt."""
    by = np.einsum("pknj,nj->pkn", shapes, theta[:, 1:])
    by[0] += data.moment.T
    return np.asarray(by / theta[:, 0])


def _rate(c: Array, r: Array) -> Array:
    return np.asarray(c[0] + c[1] * r + (c[2] + c[3] * r) * np.abs(r))


def _turn(c: Array, state: State) -> State:
    return (_rate(c, state[0]),)


def _integrated(by: Array, data: YawData) -> Array:
    """(k, n) yaw rates from their first measured values."""
    middle, step = _middle(by), data.sample_time_s
    rates: Array = np.empty_like(by[0])
    rates[0] = r = data.r[:, 0]
    for index in range(len(rates) - 1):
        now, soon, then = (partial(_turn, c) for c in (by[:, index], middle[:, index], by[:, index + 1]))
        (after,) = rk4_step(now, (r,), step, (soon, then))
        rates[index + 1] = r = np.clip(after, -LARGEST_RATE, LARGEST_RATE)
    return rates


def _middle(values: Array) -> Array:
    return np.asarray(0.5 * (values[:, :-1] + values[:, 1:]))


def _step_derivatives(shapes: Array, by: Array, inertia: Array, rates: Array, step: float) -> tuple[Array, Array]:
    """Derivatives of the yaw rate after each step: (k - 1, n, 1) by that before, (k - 1, n, p) by the parameters."""
    begin, middle, end = (shapes[:, :-1], by[:, :-1]), (_middle(shapes), _middle(by)), (shapes[:, 1:], by[:, 1:])
    own = np.zeros((*rates[:-1].shape, shapes.shape[-1] + 2))
    own[..., 0] = 1.0
    r, by_all, total = rates[:-1], own, np.zeros_like(own)
    stages = ((begin, 1.0, step / 2), (middle, 2.0, step / 2), (middle, 2.0, step), (end, 1.0, 0.0))
    for (shape, c), weight, ahead in stages:
        rate, size = _rate(c, r), np.abs(r)
        slope = (c[1] + c[2] * np.sign(r) + 2.0 * c[3] * size)[..., None] * by_all
        slope[..., 1] -= rate / inertia
        slope[..., 2:] += _rate(shape, r[..., None]) / inertia[:, None]
        total += weight * slope
        r, by_all = rates[:-1] + ahead * rate, own + ahead * slope
    by_all = own + step / 6 * total
    return by_all[..., :1], by_all[..., 1:]


def estimate_yaw(
    model: YawModel, data: YawData, start: Mapping[str, float], *, groups: NDArray[np.int_] | None = None
) -> YawEstimate:
    """Parameters with the least squared error of the simulated yaw rate, within bounds of their signs.

    Levenberg-Marquardt from a start, for all voyages side by side. The inertia is kept positive, damping negative.

    Args:
        data: of n voyages.
        start: value of every parameter [SI].
        groups: (n,) number from 0 of the ship that each voyage is of, so that voyages of one share its parameters; by
            default every voyage is of its own.

    Returns:
        Of each group.
    """
    owner = np.arange(len(data.r)) if groups is None else groups
    pool = np.eye(owner.max() + 1)[:, owner]
    scale = np.array([abs(start[name]) for name in model.parameters])
    p = len(scale)
    x = np.tile(np.array([start[name] for name in model.parameters]) / scale, (len(pool), 1))
    low, high = signs(model)

    def tried(x: Array) -> tuple[Array, Array, Array]:
        rates, slopes = simulate_yaw(model, data, (x * scale)[owner])
        return data.r - rates, slopes * scale, pool @ ((data.r - rates) ** 2).sum(axis=1)

    error, J, cost = tried(x)
    damping = np.full(len(pool), 1e-3)
    for _ in range(SEARCH_STEPS):
        A, g = _pooled(pool, J, J), pool @ np.einsum("nki,nk->ni", J, error)
        lifted = A + (damping[:, None] * (np.einsum("nii->ni", A) + 1e-12))[:, :, None] * np.eye(p)
        new = np.clip(x + np.linalg.solve(lifted, g[..., None])[..., 0], low, high)
        new_error, new_J, new_cost = tried(new)
        better = new_cost < cost
        gain = np.where(better, (cost - new_cost) / np.maximum(cost, 1e-300), 0.0)
        x, cost = np.where(better[:, None], new, x), np.where(better, new_cost, cost)
        J = np.where(better[owner][:, None, None], new_J, J)
        error = np.where(better[owner][:, None], new_error, error)
        damping = np.clip(np.where(better, damping / 10.0, damping * 10.0), 1e-9, 1e9)
        if np.all(gain < 1e-9) and np.all(better | (damping > 1e3)):
            break
    samples = pool.sum(axis=1) * data.r.shape[1]
    spread = np.linalg.pinv(_pooled(pool, J, J), hermitian=True) * (cost / np.maximum(samples - p, 1))[:, None, None]
    return YawEstimate(
        model=model,
        parameters=x * scale,
        std=np.sqrt(np.einsum("nii->ni", spread)) * scale,
        fit=fit_of(data, error, pool),
    )


def signs(model: YawModel) -> tuple[Array, Array]:
    """(p,) lowest and highest parameters in units of their start: inertia is positive, damping negative."""
    low = [0.01 if name == "I_r" else -np.inf for name in model.parameters]
    high = [-1e-6 if name in model.damping else np.inf for name in model.parameters]
    return np.array(low), np.array(high)


def fit_of(data: YawData, error: Array, pool: Array) -> Array:
    """(g,) 100 (1 - |r - r_hat| / |r - mean r|) [%] of groups of voyages, for errors (n, k)."""
    varied = pool @ ((data.r - data.r.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
    return np.asarray(100.0 * (1.0 - np.sqrt(pool @ (error**2).sum(axis=1) / np.maximum(varied, 1e-300))))


def _pooled(pool: Array, A: Array, B: Array) -> Array:
    """(g, p, p) sums of A^T B over the voyages of each group."""
    return np.asarray(np.einsum("gn,nij->gij", pool, np.swapaxes(A, 1, 2) @ B))


FACTOR = 3.0  # between parameters of two halves of a voyage, from which on they differ


def halves_differ(one: YawEstimate, other: YawEstimate) -> Array:
    """(n, p) parameters of two halves of a voyage that differ by more than a factor, or in sign.

    Where they do although both halves are fitted alike, the voyage does not determine these parameters.
    """
    a, b = one.parameters, other.parameters
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = a / b
    return np.asarray(~((ratio > 1.0 / FACTOR) & (ratio < FACTOR)))


INTERVAL_S = 5.0  # over which the equation is integrated [s]
LEAST_SHARE = 1e-3  # of the moment, that a parameter of the wrong sign gives at first


def start_values(model: YawModel, data: YawData) -> dict[str, float]:
    """A value of every parameter, none of them zero, from all voyages together.

    I_r (r(t + T) - r(t)) - sum of parameters times integrals of their terms = integral of the moment is linear in all
    parameters. Noise of the inputs biases them; they are where `estimate_yaw` begins.
    """
    width = max(1, round(INTERVAL_S / data.sample_time_s))
    edges = np.arange(0, data.r.shape[1] - width, width)
    terms = np.moveaxis(model.terms(data), -1, 0)

    def over(values: Array) -> Array:
        summed = np.cumsum(values, axis=1) * data.sample_time_s
        return np.asarray((summed[:, edges + width] - summed[:, edges]).reshape(-1))

    half = max(1, width // 4)
    level = np.stack([data.r[:, edges + shift] for shift in range(half)]).mean(axis=0)
    later = np.stack([data.r[:, edges + width - shift] for shift in range(half)]).mean(axis=0)
    turned = width / max(width - half + 1, 1) * (later - level).reshape(-1)
    columns = np.column_stack([turned, *(-over(term) for term in terms)])
    moment = over(data.moment)
    size = np.sqrt((columns**2).mean(axis=0))
    size = np.where(size > 0, size, 1.0)
    found = np.linalg.lstsq(columns / size, moment, rcond=1e-8)[0]
    least = LEAST_SHARE * float(np.sqrt((moment**2).mean()))
    signs = np.array([1.0 if name == "I_r" else -1.0 if name in model.damping else 0.0 for name in model.parameters])
    wrong = (signs * found < 0) | (np.abs(found) < least)
    found = np.where(wrong, np.where(signs == 0.0, -1.0, signs) * max(least, 1e-300), found) / size
    return dict(zip(model.parameters, found.tolist(), strict=True))
