"""Ships as published models simulate them, each written here from its paper and independent of the package."""

from __future__ import annotations

import math

import numpy as np

from published_trials import KNOT, Model


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
        u_r = (
            epsilon
            * u
            * (1.0 - w)
            * math.sqrt(
                eta * (1.0 + kappa * (math.sqrt(1.0 + 8.0 * max(k_t, 0.0) / (math.pi * j * j)) - 1.0)) ** 2 + 1.0 - eta
            )
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


def kvlcc2(scale: float = 1.0, wake: float = 0.40) -> Model:
    """The 7 m model of KVLCC2 (Yasukawa and Yoshimura 2015, tables 1 to 3); 1.179 m/s as 15.5 kn of the ship."""
    speed = 1.179 * math.sqrt(scale)
    return mmg(
        length=7.0 * scale, beam=1.27 * scale, draught=0.455 * scale, volume=3.27 * scale**3, gravity=0.244 * scale,
        rho=1000.0, m_x=0.022, m_y=0.223, j_z=0.011, r_0=0.022, hull_x=(-0.040, 0.002, 0.011, 0.771),
        hull_y=np.array([-0.315, 0.083, -1.607, 0.379, -0.391, 0.008]),
        hull_n=np.array([-0.137, -0.049, -0.030, -0.294, 0.055, -0.013]),
        propeller=(0.216 * scale, -0.48, 0.2931, -0.2753, -0.1385, 10.4 / math.sqrt(scale)),
        rudder=(0.0539 * scale**2, -0.5, 2.747, 0.626, 0.50, 1.09, 0.640, 0.395, -0.710, 0.387, 0.312, -0.464),
        t_p=0.220, w_p=wake, wake=(1.6, 1.1), speed=speed, helm_rate=math.radians(15.8) / math.sqrt(scale),
    )  # fmt: skip


def kvlcc2_ship() -> Model:
    """KVLCC2 of 320 m, with the wake of the ship, 0.35, in place of the model's; no such ship was built."""
    return kvlcc2(320.0 / 7.0, 0.35)


def kcs() -> Model:
    """KCS, full scale: Y. Yoshimura et al., Analysis of steady hydrodynamic force components and prediction of
    manoeuvering ship motion with KVLCC1, KVLCC2 and KCS, SIMMAN 2008; the wake does not change in turns."""
    length, draught = 230.0, 10.8
    unit = 0.5 * length**2 * draught
    m_x, m_y = 1790.85 / unit, 44324.18 / unit
    return mmg(
        length=length, beam=32.2, draught=draught, volume=0.651 * length * 32.2 * draught, gravity=-3.404, rho=1025.0,
        m_x=m_x, m_y=m_y, j_z=140067300 / unit / length**2, r_0=None,
        hull_x=(-0.0549, 0.1084 - m_y, -0.0120, -0.0417),
        hull_y=np.array([-0.2252, 0.0398 + m_x, -1.7179, -0.4832, -0.8341, -0.0050]),
        hull_n=np.array([-0.1111, -0.0465, -0.1752, -0.6168, -0.0512, -0.0387]),
        propeller=(7.9, -0.4565, 0.5228, -0.4390, -0.0609, 1.925),
        rudder=(
            length * draught / 54.86, -0.5, 3.005, 0.7979, 0.633, 0.956, 0.492, 0.338, -0.755, 0.258, 0.361, -0.436,
        ),
        t_p=0.207, w_p=0.355, speed=12.35, helm_rate=math.radians(2.32),
    )  # fmt: skip


def seiun_maru() -> Model:
    """The training ship Seiun Maru (Yoshimura and Masumoto 2012), full scale; speed of a Froude number of 0.26."""
    return mmg(
        length=105.0, beam=17.91, draught=5.966, volume=5701.6, gravity=-2.249, rho=1000.0, m_x=0.0167, m_y=0.1576,
        j_z=0.009, r_0=0.016, hull_x=(-0.0804, -0.072, 0.022, 0.439),
        hull_y=np.array([-0.317, 0.052, -1.604, -0.75, -0.8599, -0.051]),
        hull_n=np.array([-0.1136, -0.0795, -0.3095, -0.6257, -0.3143, -0.0502]),
        propeller=(4.7, -0.5, 0.4, -0.4, 0.0, 2.2),
        rudder=(13.405, -0.5, 2.88, 0.960, 0.676, 1.033, 0.394, 0.312, -0.947, 0.341, 0.236, -0.40),
        t_p=0.21, w_p=0.204, speed=8.3, helm_rate=math.radians(2.32),
    )  # fmt: skip


def mariner() -> Model:
    """The Mariner class at 15 kn: tests of M. S. Chislett and J. Stroem-Tejsen, HyA Report Hy-5 (1965)."""
    length, speed = 160.93, 15 * KNOT
    m, i_z, x_g = 798e-5, 39.2e-5, -0.023
    left = np.array([[m + 748e-5, m * x_g + 9.354e-5], [m * x_g - 4.646e-5, i_z + 43.8e-5]])

    def rates(x: np.ndarray, delta: float, order: float) -> np.ndarray:
        start = speed * order
        swift = math.hypot(x[0], x[1])
        u, v, r, d = (x[0] - start) / swift, x[1] / swift, x[2] * length / swift, -delta
        total_x = (
            -184 * u - 110 * u**2 - 215 * u**3 - 899 * v**2 + 18 * r**2 + 798 * r * v - 95 * d**2 - 190 * u * d**2
            + 93 * v * d + 93 * u * v * d
        )  # fmt: skip
        total_y = (
            -1160 * v - 499 * r - 8078 * v**3 + 15356 * v**2 * r - 1160 * v * u - 499 * r * u
            + 278 * d - 90 * d**3 + 556 * u * d + 278 * u**2 * d - 4 * v * d**2 + 1190 * v**2 * d
            - 4 - 8 * u - 4 * u**2
        )  # fmt: skip
        total_n = (
            -264 * v - 166 * r + 1636 * v**3 - 5483 * v**2 * r - 264 * v * u - 166 * r * u
            - 139 * d + 45 * d**3 - 278 * u * d - 139 * u**2 * d + 13 * v * d**2 - 489 * v**2 * d
            + 3 + 6 * u + 3 * u**2
        )  # fmt: skip
        dv, dr = np.linalg.solve(left, np.array([total_y, total_n]) * 1e-5)
        return np.array([total_x * 1e-5 / (m + 42e-5), dv, dr / length]) * swift**2 / length

    return Model(length_m=length, speed_mps=speed, rates=rates, helm_rate_radps=math.radians(2.5))


def s175() -> Model:
    """The container ship S-175 upright: K. Son and K. Nomoto, J. SNAJ 150 (1981); its roll is left out."""
    length, d_p = 175.0, 6.533
    m, m_x, m_y, i_z = 0.00792, 0.000238, 0.007049, 0.000456 + 0.000419
    cubes_y = np.array([-0.0116, 0.00242, -0.109, 0.0214, -0.0405, 0.00177])
    cubes_n = np.array([-0.0038545, -0.00222, 0.001492, -0.0424, 0.00156, -0.00229])

    def rates(x: np.ndarray, delta: float, order: float) -> np.ndarray:
        swift = max(math.hypot(x[0], x[1]), 1e-6)
        u, v, r = x[0] / swift, x[1] / swift, x[2] * length / swift
        n = max(order * 80.0 / 60.0, 1e-6)
        v_r = 0.088 * v - 0.156 * r - 0.275 * r**3 + 1.96 * r**2 * v
        u_p = u * ((1 - 0.184) + 1.09 * (v - 0.526 * r) ** 2)
        j = max(u_p * swift / (n * d_p), 1e-3)
        k_t = 0.527 - 0.455 * j
        u_r = u_p * 0.921 * math.sqrt(1 + 8 * 0.631 * max(k_t, 0.0) / (math.pi * j * j))
        f_n = -(6.13 * 1.8219 / (1.8219 + 2.25)) * (33.0376 / length**2) * (u_r**2 + v_r**2)
        f_n *= math.sin(delta + math.atan2(v_r, u_r))
        thrust = 2 * d_p**4 / (swift * length) ** 2 * k_t * n * n
        terms = np.array([v, r, v**3, v * v * r, v * r * r, r**3])
        total_x = -0.0004226 * u**2 + (1 - 0.175) * thrust - 0.00311 * v * r - 0.00386 * v**2 + 0.00020 * r**2
        total_x += 0.71 * f_n * math.sin(delta) + (m + m_y) * v * r
        total_y = float(terms @ cubes_y) + (1 + 0.237) * f_n * math.cos(delta) - (m + m_x) * u * r
        total_n = float(terms @ cubes_n) + (-0.5 - 0.237 * 0.48) * f_n * math.cos(delta)
        du, dv, dr = total_x / (m + m_x), total_y / (m + m_y), total_n / i_z / length
        return np.array([du, dv, dr]) * swift**2 / length

    return Model(length_m=length, speed_mps=7.0, rates=rates, helm_rate_radps=math.radians(2.32))


def tanker_190k() -> Model:
    """A tanker of 190 000 dwt in deep water: W. B. van Berlekom and T. A. Goddard, Transactions SNAME 80 (1972)."""
    length = 304.8

    def rates(x: np.ndarray, delta: float, order: float) -> np.ndarray:
        u, v, r = x
        d, n, beta = -delta, order * 80.0 / 60.0, math.atan2(v, u)
        thrust = -0.00695 * u * u / length - 0.00063 * u * n + length * 0.0000354 * n * n
        c2 = 0.605 * u * n + 38.2 * n * n
        side = -c2 * abs(beta) * beta * abs(d)
        du = (
            -0.0377 * u * u + length * 2.020 * v * r + 0.3 * v * v - 0.093 * c2 * d * d + 0.152 * c2 * beta * d
            + length * thrust * (1 - 0.22)
        ) / length / 1.050  # fmt: skip
        dv = (
            -1.205 * u * v - 2.400 * abs(v) * v + 0.208 * c2 * d - 0.752 * length * u * r + 2.16 * side
            + 0.04 * thrust * length
        ) / length / 2.020  # fmt: skip
        dr = (
            -0.451 * u * v - 0.300 * length * abs(v) * r - 0.098 * c2 * d - 0.231 * length * u * r - 0.688 * side
            - 0.02 * thrust * length
        ) / length**2 / 0.1232  # fmt: skip
        return np.array([du, dv, dr])

    return Model(length_m=length, speed_mps=8.23, rates=rates, helm_rate_radps=math.radians(2.33))


def esso_osaka() -> Model:
    """The 3 m model of Esso Osaka with the unified hull forces for harbour speeds, as Y. Miyauchi, A. Maki, N. Umeda,
    D. M. Rachman and Y. Akimoto give them, J. Marine Science and Technology 27 (2022), initial parameters."""
    length, draught, rho, d_p, area = 3.0, 0.20114, 998.0, 0.084, 0.01063
    unit = rho / 2 * length * draught
    mass, x_g = 0.27078 * unit * length, 0.03119 * length
    m_x, m_y, i_zz = 0.0467 * unit * length, 0.2579 * unit * length, 0.0286 * unit * length**3
    left = np.array([[mass + m_y, mass * x_g], [mass * x_g, i_zz + mass * x_g**2]])
    strips = np.linspace(-0.5, 0.5, 101)
    height = math.sqrt(area * 1.539)
    eta, slope = min(d_p / height, 1.0), 6.13 * 1.539 / (2.25 + 1.539)

    def rates(x: np.ndarray, delta: float, order: float) -> np.ndarray:
        u, v, r = x
        swift, n = max(math.hypot(u, v), 1e-6), max(order * 10.0, 1e-6)
        across, rate = v / swift, r * length
        side = across - 0.517 * rate / swift
        wake = float(np.clip(0.614 - 0.871 * abs(side) + 0.359 * side**2, 0.0, 1.0))
        u_p = u * (1.0 - wake)
        j = u_p / (n * d_p)
        k_t = 0.3278 - 0.3323 * j - 0.156 * j * j
        thrust = (1.0 - 0.22) * rho * d_p**4 * n * n * k_t
        jet = math.sqrt(max(u_p**2 + 8.0 * k_t * n * n * d_p * d_p / math.pi, 0.0))
        u_r = 1.42 * math.sqrt(eta * (u_p + 0.288 / 1.42 * (jet - u_p)) ** 2 + (1.0 - eta) * u_p**2)
        v_r = -(0.3506 if v - length / 2 * r >= 0 else 0.4406) * (v - 1.08 * rate)
        f_n = rho / 2 * area * (u_r**2 + v_r**2) * slope * math.sin(delta - math.atan2(v_r, u_r))
        flow_y, flow_n = v + 2.217 * rate * strips, v + 0.8097 * rate * strips
        drag_y = 0.9665 * float(np.trapezoid(np.abs(flow_y) * flow_y, strips))
        drag_n = 0.9665 * float(np.trapezoid(np.abs(flow_n) * flow_n * strips, strips))
        beta = abs(math.atan2(v, u))
        total_x = unit * ((-0.02139 - 0.0105 * beta / math.pi) * u * swift + 0.4535 * v * rate) + thrust
        total_x -= (1.0 - 0.19) * f_n * math.sin(delta)
        total_y = unit * (-0.3728 * v * abs(u) + 0.116 * rate * u - drag_y) - 1.393 * f_n * math.cos(delta)
        total_n = unit * length * (-0.1458 * v * u - 0.04849 * rate * abs(u) - drag_n)
        total_n += (0.5 + 0.393 * 0.45) * length * f_n * math.cos(delta)
        du = (total_x + mass * v * r + mass * x_g * r * r) / (mass + m_x)
        dv, dr = np.linalg.solve(left, [total_y - (mass + m_x) * u * r, total_n - mass * x_g * u * r])
        return np.array([du, dv, dr])

    return Model(length_m=length, speed_mps=0.4, rates=rates, helm_rate_radps=math.radians(20.0))


def otter() -> Model:
    """The Otter, a catamaran of 2 m: T. I. Fossen, MSS (2024); helm is the sine by which the sides' orders differ.

    Its surge damping is linear and stated for the top speed, near which it is therefore compared.
    """
    length, rho, beam, mass, x_g = 2.0, 1025.0, 0.25, 55.0, 0.2
    draught = mass / rho / (2 * 0.4 * beam * length)
    i_z = mass * (0.25 * length) ** 2 + mass * x_g**2
    added = 2.7 * rho * (mass / rho) ** (5 / 3) / length**2
    m_y, j_z = 1.5 * mass, 1.7 * i_z
    left = np.array([[mass + m_y, mass * x_g], [mass * x_g, i_z + j_z]])
    strips = np.linspace(-length / 2, length / 2, 41)

    def rates(x: np.ndarray, delta: float, order: float) -> np.ndarray:
        u, v, r = x
        full, back = 24.4 * 9.81 / 2, 13.6 * 9.81 / 2
        sides = [float(np.clip(order + side * math.sin(delta), -1, 1)) for side in (1, -1)]  # port, starboard
        port, starboard = (full * s * s if s > 0 else -back * s * s for s in sides)
        flow = v + strips * r
        drag = -rho / 2 * draught * 0.6 * np.abs(flow) * flow
        total_x = port + starboard - 24.4 * 9.81 / (6 * KNOT) * u + (mass + m_y) * v * r + mass * x_g * r * r
        total_y = -(mass + m_y) / 1.0 * v + float(np.trapezoid(drag, strips)) - (mass + added) * u * r
        total_n = 0.395 * (port - starboard) - (i_z + j_z) * (1 + 10 * abs(r)) * r
        total_n += float(np.trapezoid(drag * strips, strips)) - mass * x_g * u * r - (m_y - added) * u * v
        dv, dr = np.linalg.solve(left, np.array([total_y, total_n]))
        return np.array([total_x / (mass + added), dv, dr])

    return Model(length_m=length, speed_mps=5.5 * KNOT, rates=rates, helm_rate_radps=100.0)


def naval_vessel() -> Model:
    """A naval vessel of 51.5 m upright: M. Blanke and A. Christensen (1993), as T. Perez gives it (MSS, navalvessel.m).

    Its roll is left out. Rudder forces are the lift of two of the rudders in the ship's own flow, with the lift slope
    and the stall angle stated; the thrust is that which holds the speed, as the model has no propeller.
    """
    length, rho, speed = 51.5, 1014.0, 8.0
    mass, x_g, i_z, lever = 357.0 * rho, -3.38, 47.934e6, 20.41 + 3.38
    left = np.array([[mass + 393000.0, mass * x_g + 1400000.0], [mass * x_g - 538000.0, i_z + 38.7e6]])
    area, slope, stall = 2 * 1.5, math.degrees(0.054), math.radians(23.0)

    def rates(x: np.ndarray, delta: float, order: float) -> np.ndarray:
        u, v, r = x
        inflow = delta + math.atan2(v - lever * r, max(abs(u), 1e-6))
        lift = rho / 2 * area * (u * u + (v - lever * r) ** 2) * slope * float(np.clip(inflow, -stall, stall))
        total_x = -1960.0 * u * abs(u) + 0.33 * mass * v * r + mass * (r * v + x_g * r * r)
        total_x += 1960.0 * (order * speed) ** 2 - abs(lift * math.sin(delta))
        total_y = -11800.0 * abs(u) * v + 131000.0 * u * r - 3700.0 * v * abs(v) - 794000.0 * v * abs(r)
        total_y += -182000.0 * r * abs(v) - mass * u * r - lift * math.cos(delta)
        total_n = -92000.0 * abs(u) * v - 4710000.0 * abs(u) * r - 202000000.0 * r * abs(r) - 15600000.0 * r * abs(v)
        total_n += -mass * x_g * u * r + lever * lift * math.cos(delta)
        dv, dr = np.linalg.solve(left, np.array([total_y, total_n]))
        return np.array([total_x / (mass + 17400.0), dv, dr])

    return Model(length_m=length, speed_mps=speed, rates=rates, helm_rate_radps=math.radians(2.32))


def car_carrier() -> Model:
    """A wind-powered car carrier of 206.6 m under engine: SSPA report RI40199079-06-00-C (2020), captive tests and
    computations, with resistance and machinery, as the simulator in github.com/cahe9710/MT-ASB has them.

    The equations are those of Seaman, in which weight makes forces non-dimensional. Surge's added mass is a twentieth
    of the displacement, as that of the file, 2.7 times it, cannot be meant. Heel, sails and fins are left out.
    """
    length, draught, rho, gravity, x_g, x_r = 206.6, 8.5, 1025.0, 9.81, -9.8, -99.4
    mass, beam, block = 30843.0 * rho, 39.4, 0.4463
    root = math.sqrt(length * gravity)
    unit = -math.pi * (draught / length) ** 2 * rho / 2 * length**3  # of added masses by Clarke
    m_y = -unit * (1 + 0.16 * block * beam / draught - 5.1 * (beam / length) ** 2)
    y_r = -unit * length * (0.67 * beam / length - 0.0033 * (beam / draught) ** 2)
    n_v = -unit * length * (1.1 * beam / length - 0.041 * beam / draught)
    j_z = -unit * length**2 * (1 / 12 + 0.017 * block * beam / draught - 0.33 * beam / length)
    left = np.array([[mass + m_y, mass * x_g + y_r], [mass * x_g + n_v, mass * (0.25 * length) ** 2 + j_z]])
    strips = length * (np.arange(20) / 20 - 0.475)
    knots = np.array([0, 8, 10, 12, 14, 16, 18, 20.0]) * KNOT
    newtons = np.array([0, 140238, 220963, 324425, 449530, 607078, 807456, 1052533.0])

    def rates(x: np.ndarray, delta: float, order: float) -> np.ndarray:
        u, v, r = x
        swift, angle = max(abs(u), 0.1), -delta  # the rudder's angle is positive to port there
        thrust = 0.5 * min(1.0, swift / 5.0) * 8e6 * order**3 / swift
        slip = angle - 0.5 * v / swift - 0.5 * (x_r - x_g) * r / swift
        stalled = 1.0 - 0.8 * slip**2
        flow = 2 * 0.4819 * u * abs(u) * mass / length
        slipstream = 2 * 0.1267 * thrust * angle * (1 + 7.28 * swift / root)
        rudder = (flow * slip + slipstream) * stalled
        drag = 1.0069 * rho / 2 * draught * length / 20
        side = v + strips * r
        ahead = v + (strips + 0.1442 * length) * r
        total_x = thrust - math.copysign(float(np.interp(abs(u), knots, newtons)), u)
        total_x += mass * (0.3165 * v * v / length - 0.7561 * v * r + 0.1456 * length * r * r)
        total_x += -0.4156 * angle * (flow * angle + slipstream) + mass * (v * r + x_g * r * r)
        total_y = mass * (-0.4839 * u * v / length - 0.2473 * u * u * v / length / root)
        total_y += mass * (0.3730 * u * r - 0.01559 * u * u * r / root) - mass * u * r
        total_y += rudder - drag * float(np.sum(np.abs(side) * side))
        total_n = mass * (-0.3513 * u * v + 0.7360 * u * u * v / root)
        total_n += mass * length * (-0.1588 * u * r - 0.2288 * u * u * r / root) - mass * x_g * u * r
        total_n += (x_r - x_g) * rudder - drag * float(np.sum(np.abs(ahead) * ahead * (strips + 0.1442 * length)))
        dv, dr = np.linalg.solve(left, [total_y, total_n])
        return np.array([total_x / (1.05 * mass), dv, dr])

    return Model(length_m=length, speed_mps=15.0 * KNOT, rates=rates, helm_rate_radps=math.radians(4.8))
