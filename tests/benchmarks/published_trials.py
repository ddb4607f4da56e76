"""Standard trials of ships as published models simulate them, independent of the package.

A model is a function of (state, helm [rad], engine order) -> accelerations. Helm is positive to starboard. State: u, v,
r about midships, SI.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

KNOT = 1852.0 / 3600.0
Rates = Callable[[np.ndarray, float, float], np.ndarray]


@dataclass(frozen=True, kw_only=True)
class Model:
    """A published model with its steering gear."""

    length_m: float
    speed_mps: float  # steady at order 1
    rates: Rates
    helm_rate_radps: float


def run(model: Model, speed: float, helm: Callable[[float, np.ndarray], float], order: float, until, longest=80.0):
    """Times and states (u, v, r, x, y, heading), by Runge-Kutta steps of a hundredth of the time for a length."""
    step = 0.01 * model.length_m / speed
    state, angle, time_s = np.array([speed, 0, 0, 0, 0, 0.0]), 0.0, 0.0
    times, states = [0.0], [state]

    def rates(x: np.ndarray, delta: float) -> np.ndarray:
        u, v, _, _, _, psi = x
        c, s = math.cos(psi), math.sin(psi)
        return np.array([*model.rates(x[:3], delta, order), u * c - v * s, u * s + v * c, x[2]])

    while not until(state) and time_s < longest * model.length_m / speed:
        wanted = helm(time_s, state)
        change = np.clip(wanted - angle, -model.helm_rate_radps * step, model.helm_rate_radps * step)
        middle, angle = angle + change / 2, angle + change
        k1 = rates(state, middle)
        k2 = rates(state + step / 2 * k1, middle)
        k3 = rates(state + step / 2 * k2, middle)
        k4 = rates(state + step * k3, middle)
        state, time_s = state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4), time_s + step
        times.append(time_s)
        states.append(state)
    return np.array(times), np.array(states)


def froude(model: Model, scale: float) -> Model:
    """The same ship, so many times as long, by Froude's law: times grow with the root of lengths."""
    root = math.sqrt(scale)

    def rates(x: np.ndarray, delta: float, order: float) -> np.ndarray:
        return model.rates(x / (root, root, 1.0 / root), delta, order) * (1.0, 1.0, 1.0 / scale)

    return Model(
        length_m=model.length_m * scale, speed_mps=model.speed_mps * root, rates=rates,
        helm_rate_radps=model.helm_rate_radps / root,
    )  # fmt: skip


def order_for(model: Model, speed: float) -> float:
    """Engine order at which a speed is steady."""
    low, high = 0.0, 2.0
    for _ in range(60):
        middle = (low + high) / 2
        gains = model.rates(np.array([speed, 0.0, 0.0]), 0.0, middle)[0] > 0
        low, high = (low, middle) if gains else (middle, high)
    return high


def circle(model: Model, *, speed: float, helm_deg: float) -> dict[str, float]:
    """Advance, transfer, tactical diameter [m], times to 90 and 180 degrees [s], speeds there [m/s]."""
    angle = math.radians(helm_deg)
    times, x = run(model, speed, lambda _t, _x: angle, order_for(model, speed), lambda s: abs(s[5]) > math.radians(181))
    psi, sign = np.abs(x[:, 5]), math.copysign(1.0, helm_deg)
    if psi[-1] < math.pi:
        return {}

    def at(column, degrees: float) -> float:
        return float(np.interp(math.radians(degrees), psi, column))

    swift = np.hypot(x[:, 0], x[:, 1])
    return {
        "advance_m": at(x[:, 3], 90), "transfer_m": sign * at(x[:, 4], 90),
        "tactical_diameter_m": sign * at(x[:, 4], 180), "time_90_s": at(times, 90), "time_180_s": at(times, 180),
        "speed_90_mps": at(swift, 90), "speed_180_mps": at(swift, 180),
    }  # fmt: skip


def zigzag(model: Model, *, speed: float, angle_deg: float) -> dict[str, float]:
    """First and second overshoot [rad]."""
    angle, stage = math.radians(angle_deg), [0]

    def helm(_t: float, x: np.ndarray) -> float:
        if stage[0] == 0 and x[5] >= angle:
            stage[0] = 1
        if stage[0] == 1 and x[5] <= -angle:
            stage[0] = 2
        return angle if stage[0] != 1 else -angle

    _, x = run(model, speed, helm, order_for(model, speed), lambda s: stage[0] == 2 and s[2] > 0)
    return {"overshoot_1_rad": float(x[:, 5].max()) - angle, "overshoot_2_rad": -float(x[:, 5].min()) - angle}
