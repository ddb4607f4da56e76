"""Ships as published models simulate them, each written here from its paper and independent of the package.

A model is a function of (state, helm [rad], engine order) -> accelerations; `sailed` runs a standard trial with it.
Helm is positive to starboard. State: u, v, r about midships, SI.
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
    times, x = run(
        model, speed, lambda _t, _x: angle, order_for(model, speed), lambda s: abs(s[5]) > math.radians(181)
    )
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


def mmg(
    *, length, beam, draught, volume, gravity, rho, m_x, m_y, j_z, r_0, hull_x, hull_y, hull_n, propeller, rudder, t_p,
    w_p, speed, helm_rate, wake=(1.0, 1.0),
) -> Model:  # fmt: skip
    """The MMG standard model (Yasukawa and Yoshimura 2015); `r_0` None for thrust that balances at `speed`.

    Args:
        hull_x: X' vv, vr, rr, vvvv; hull_y and hull_n: v, r, vvv, vvr, vrr, rrr.
        propeller: D, x', k_0, k_1, k_2, rps at order 1.
        wake: C_2 of the wake at positive and negative inflow angle, 1 where it does not change.
        rudder: A, x', f_alpha, eta, kappa, epsilon, gamma of positive and negative inflow angle, l_R', t_R, a_H, x_H'.
    """
    mass = rho * volume
    half = rho / 2
    m_x, m_y = m_x * half * length**2 * draught, m_y * half * length**2 * draught
    j_z = j_z * half * length**4 * draught
    i_z = mass * (0.25 * length) ** 2
    d_p, x_p, k_0, k_1, k_2, rps = propeller
    area, x_r, f_alpha, eta, kappa, epsilon, gamma_plus, gamma_minus, l_r, t_r, a_h, x_h = rudder
    x_g = gravity

    def thrust(u: float, w: float, n: float) -> tuple[float, float]:
        inflow = u * (1.0 - w)
        j = inflow / (n * d_p)
        return rho * n * n * d_p**4 * (k_0 + k_1 * j + k_2 * j * j), (k_0 + k_1 * j + k_2 * j * j)

    def rates(x: np.ndarray, delta: float, order: float) -> np.ndarray:
        u, v_m, r = x
        v = v_m
        swift = max(math.hypot(u, v), 1e-6)
        beta, rate = math.atan2(-v, u), r * length / swift
        vp = v / swift
        beta_p = beta - x_p * rate
        w = 1.0 - (1.0 - w_p) * (1.0 + (1.0 - math.exp(-2.0 * abs(beta_p))) * (wake[int(beta_p < 0)] - 1.0))
        n = max(order * rps, 1e-6)
        force, k_t = thrust(u, w, n)
        j = max(u * (1.0 - w) / (n * d_p), 1e-3)
        u_r = epsilon * u * (1.0 - w) * math.sqrt(
            eta * (1.0 + kappa * (math.sqrt(1.0 + 8.0 * max(k_t, 0.0) / (math.pi * j * j)) - 1.0)) ** 2 + 1.0 - eta
        )
        beta_r = beta - l_r * rate
        gamma = gamma_plus if beta_r > 0 else gamma_minus
        v_r = swift * gamma * beta_r
        f_n = half * area * (u_r**2 + v_r**2) * f_alpha * math.sin(delta - math.atan2(v_r, u_r))
        unit = half * length * draught * swift**2
        x_vv, x_vr, x_rr, x_vvvv = hull_x
        cubes = np.array([vp, rate, vp**3, vp * vp * rate, vp * rate * rate, rate**3])
        drag = r_0 * half * length * draught * u * abs(u)
        total_x = -drag + unit * (x_vv * vp**2 + x_vr * vp * rate + x_rr * rate**2 + x_vvvv * vp**4)
        total_x += (1.0 - t_p) * force - (1.0 - t_r) * f_n * math.sin(delta)
        total_y = unit * float(cubes @ hull_y) - (1.0 + a_h) * f_n * math.cos(delta)
        total_n = unit * length * float(cubes @ hull_n) - (x_r + a_h * x_h) * length * f_n * math.cos(delta)
        du = (total_x + (mass + m_y) * v * r + x_g * mass * r * r) / (mass + m_x)
        left = np.array([[mass + m_y, x_g * mass], [x_g * mass, i_z + x_g**2 * mass + j_z]])
        right = np.array([total_y - (mass + m_x) * u * r, total_n - x_g * mass * u * r])
        dv, dr = np.linalg.solve(left, right)
        return np.array([du, dv, dr])

    if r_0 is None:
        force, _ = thrust(speed, w_p, rps)
        r_0 = (1.0 - t_p) * force / (half * length * draught * speed**2)
    return Model(length_m=length, speed_mps=speed, rates=rates, helm_rate_radps=helm_rate)


def kvlcc2() -> Model:
    """The 7 m model of KVLCC2 (Yasukawa and Yoshimura 2015, tables 1 to 3); 1.179 m/s as 15.5 kn of the ship."""
    return mmg(
        length=7.0, beam=1.27, draught=0.455, volume=3.27, gravity=0.244, rho=1000.0, m_x=0.022, m_y=0.223, j_z=0.011,
        r_0=0.022, hull_x=(-0.040, 0.002, 0.011, 0.771),
        hull_y=np.array([-0.315, 0.083, -1.607, 0.379, -0.391, 0.008]),
        hull_n=np.array([-0.137, -0.049, -0.030, -0.294, 0.055, -0.013]),
        propeller=(0.216, -0.48, 0.2931, -0.2753, -0.1385, 10.4),
        rudder=(0.0539, -0.5, 2.747, 0.626, 0.50, 1.09, 0.640, 0.395, -0.710, 0.387, 0.312, -0.464),
        t_p=0.220, w_p=0.40, wake=(1.6, 1.1), speed=1.179, helm_rate=math.radians(15.8),
    )  # fmt: skip
