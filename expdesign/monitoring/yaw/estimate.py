"""Output error of a yaw model, for many voyages at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

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
    """Yaw rate (n, k) from its first measured value, and its sensitivities (n, k, p), by Heun's method.

    Args:
        model: the structure.
        data: inputs, taken as straight lines between samples.
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
        first, moved = _acceleration(shapes[:, index], moment[index], theta, r, slope)
        ahead, there = _acceleration(
            shapes[:, index + 1], moment[index + 1], theta, r + step * first, slope + step * moved
        )
        r = np.clip(r + step / 2 * (first + ahead), -LARGEST_RATE, LARGEST_RATE)
        slope = slope + step / 2 * (moved + there)
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


def estimate_yaw(model: YawModel, data: YawData, start: Mapping[str, float]) -> YawEstimate:
    """Parameters with the least squared error of the simulated yaw rate, within bounds of their signs.

    Levenberg-Marquardt from a start, for all voyages side by side. The inertia is kept positive, damping negative.

    Args:
        model: the structure.
        data: of n voyages.
        start: value of every parameter [SI].
    """
    scale = np.array([abs(start[name]) for name in model.parameters])
    n, p = len(data.r), len(scale)
    x = np.tile(np.array([start[name] for name in model.parameters]) / scale, (n, 1))
    low = np.array([0.01 if name == "I_r" else -np.inf for name in model.parameters])
    high = np.array([-1e-6 if name in model.damping else np.inf for name in model.parameters])
    damping = np.full(n, 1e-3)
    rates, slopes = simulate_yaw(model, data, x * scale)
    error = data.r - rates
    cost = (error**2).sum(axis=1)
    for _ in range(SEARCH_STEPS):
        J = slopes * scale
        A, g = np.einsum("nki,nkj->nij", J, J), np.einsum("nki,nk->ni", J, error)
        lifted = A + (damping[:, None] * (np.einsum("nii->ni", A) + 1e-12))[:, :, None] * np.eye(p)
        tried = np.clip(x + np.linalg.solve(lifted, g[..., None])[..., 0], low, high)
        new_rates, new_slopes = simulate_yaw(model, data, tried * scale)
        new_cost = ((data.r - new_rates) ** 2).sum(axis=1)
        better = new_cost < cost
        gain = np.where(better, (cost - new_cost) / np.maximum(cost, 1e-300), 0.0)
        x = np.where(better[:, None], tried, x)
        slopes = np.where(better[:, None, None], new_slopes, slopes)
        error = np.where(better[:, None], data.r - new_rates, error)
        cost = np.where(better, new_cost, cost)
        damping = np.clip(np.where(better, damping / 10.0, damping * 10.0), 1e-9, 1e9)
        if np.all(gain < 1e-9) and np.all(better | (damping > 1e3)):
            break
    J = slopes * scale
    A = np.einsum("nki,nkj->nij", J, J)
    spread = np.linalg.pinv(A, hermitian=True) * (cost / max(data.r.shape[1] - p, 1))[:, None, None]
    varied = ((data.r - data.r.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
    return YawEstimate(
        model=model,
        parameters=x * scale,
        std=np.sqrt(np.einsum("nii->ni", spread)) * scale,
        fit=100.0 * (1.0 - np.sqrt(cost / np.maximum(varied, 1e-300))),
    )


def halves_differ(one: YawEstimate, other: YawEstimate, *, factor: float = 3.0) -> Array:
    """(n, p) parameters of two halves of a voyage that differ by more than a factor, or in sign.

    Where they do although both halves are fitted alike, the voyage does not tell these parameters.
    """
    a, b = one.parameters, other.parameters
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = a / b
    return np.asarray(~((ratio > 1.0 / factor) & (ratio < factor)))
