"""Output error of a yaw model, for many voyages at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.monitoring.yaw.model import YawData, YawModel
from expdesign.values import Array, seal

SEARCH_STEPS = 25
LARGEST_RATE = 10.0
"""Yaw rates of a simulation are held within this [rad/s]: a poor model of an unstable ship runs away."""


@dataclass(frozen=True, kw_only=True, eq=False)
class YawEstimate:
    """Estimates from n voyages.

    Attributes:
        model: the structure.
        parameters: (n, p) SI.
        std: (n, p) standard errors from the residual, as if it were white; noise of the inputs is not counted.
        fit: (n,) 100 (1 - |r - r_hat| / |r - mean r|) [%].
    """

    model: YawModel
    parameters: Array
    std: Array
    fit: Array

    def __post_init__(self) -> None:
        seal(self, parameters="n p", std="n p", fit="n")

    def of(self, name: str) -> Array:
        """(n,) estimates of one parameter."""
        return self.parameters[:, self.model.parameters.index(name)]


def simulate_yaw(model: YawModel, data: YawData, parameters: Array) -> tuple[Array, Array]:
    """Yaw rate (n, k) from its first measured value, and its sensitivities (n, k, p), by Runge-Kutta of order four.

    Args:
        model: the structure.
        data: inputs; what they multiply is taken as straight lines between samples.
        parameters: (n, p), or (p,) for all voyages.
    """
    n, k = data.r.shape
    theta = np.broadcast_to(parameters, (n, len(model.parameters)))
    shapes, moment, step = model.shapes(data), np.ascontiguousarray(data.moment.T), data.sample_time_s
    r, slope = data.r[:, 0].copy(), np.zeros(theta.shape)
    rates, sensitivity = np.empty((k, n)), np.empty((k, *theta.shape))
    for index in range(k):
        rates[index], sensitivity[index] = r, slope
        if index + 1 == k:
            break
        begin, end = (shapes[:, index], moment[index]), (shapes[:, index + 1], moment[index + 1])
        middle = (0.5 * (begin[0] + end[0]), 0.5 * (begin[1] + end[1]))
        a, A = _acceleration(*begin, theta, r, slope)
        b, B = _acceleration(*middle, theta, r + step / 2 * a, slope + step / 2 * A)
        c, C = _acceleration(*middle, theta, r + step / 2 * b, slope + step / 2 * B)
        d, D = _acceleration(*end, theta, r + step * c, slope + step * C)
        r = np.clip(r + step / 6 * (a + 2 * b + 2 * c + d), -LARGEST_RATE, LARGEST_RATE)
        slope = slope + step / 6 * (A + 2 * B + 2 * C + D)
    return rates.T, np.moveaxis(sensitivity, 0, 1)


def _acceleration(shapes: Array, moment: Array, theta: Array, r: Array, slope: Array) -> tuple[Array, Array]:
    """(n,) dr/dt and (n, p) its derivative by the parameters along the motion."""
    size, inertia = np.abs(r)[:, None], theta[:, :1]
    constant, linear, even, odd = shapes
    values = constant + linear * r[:, None] + (even + odd * r[:, None]) * size
    by_rate = linear + even * np.sign(r)[:, None] + 2.0 * odd * size
    own = theta[:, 1:]
    acceleration = ((own * values).sum(axis=1) + moment)[:, None] / inertia
    moved = (own * by_rate).sum(axis=1)[:, None] * slope
    moved[:, :1] -= acceleration
    moved[:, 1:] += values
    return acceleration[:, 0], moved / inertia


def yaw_rates(model: YawModel, data: YawData, parameters: Array) -> Array:
    """`simulate_yaw` without sensitivities, in a fraction of the time: yaw rates (n, k)."""
    theta = np.broadcast_to(parameters, (len(data.r), len(model.parameters)))
    inertia, step = theta[:, 0], data.sample_time_s
    by = np.einsum("pknj,nj->pkn", model.shapes(data), theta[:, 1:])
    by[0] += data.moment.T
    by /= inertia
    middle = 0.5 * (by[:, :-1] + by[:, 1:])

    def rate(c: Array, r: Array) -> Array:
        return np.asarray(c[0] + c[1] * r + (c[2] + c[3] * r) * np.abs(r))

    rates = np.empty_like(by[0])
    rates[0] = r = data.r[:, 0]
    for index in range(len(rates) - 1):
        a = rate(by[:, index], r)
        b = rate(middle[:, index], r + step / 2 * a)
        c = rate(middle[:, index], r + step / 2 * b)
        d = rate(by[:, index + 1], r + step * c)
        rates[index + 1] = r = np.clip(r + step / 6 * (a + 2 * b + 2 * c + d), -LARGEST_RATE, LARGEST_RATE)
    return np.asarray(rates.T)


def estimate_yaw(
    model: YawModel, data: YawData, start: Mapping[str, float], *, groups: NDArray[np.int_] | None = None
) -> YawEstimate:
    """Parameters with the least squared error of the simulated yaw rate, within bounds of their signs.

    Levenberg-Marquardt from a start, for all voyages side by side. The inertia is kept positive, damping negative.

    Args:
        model: the structure.
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


def halves_differ(one: YawEstimate, other: YawEstimate, *, factor: float = 3.0) -> Array:
    """(n, p) parameters of two halves of a voyage that differ by more than a factor, or in sign.

    Where they do although both halves are fitted alike, the voyage does not tell these parameters.
    """
    a, b = one.parameters, other.parameters
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = a / b
    return np.asarray(~((ratio > 1.0 / factor) & (ratio < factor)))
