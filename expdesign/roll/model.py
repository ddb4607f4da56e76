"""Roll of a ship with a load, as an equation between the readings of an inertial sensor and the rudder.

    A1 phi'' = -(k + g S1) phi - d phi' + (K_vd + S1) v' + (K_ur + S1) U r + K_delta delta + tau

With the reading a_s = z_s phi'' + g phi - v' - U r of an accelerometer (to port) the sway, which is not measured, is
eliminated:

    A2 phi'' = -(k - K_vd g) phi - d phi' - (K_vd + S1) a_s + K_r r + K_delta delta + tau,    K_r = (K_ur - K_vd) U
    A2 = A_x + M z_g (z_g - z_s) + m z_m (z_m - z_s) - K_vd z_s

so that y = phi' = G (a_s + (kappa r + gamma delta + ...) / beta) with G = beta p / (p^2 + alpha1 p + alpha2). The
second equation may be unstable where the first is not: a_s feeds back G through F_y = (z_s p^2 + g) / p. A pendulum
is the ship without K_vd, K_r, K_delta and with z_f = 0.

Source: doctoral thesis on grey-box identification of roll with few sensors, (4.21)-(4.33), (5.8)-(5.24), (5.54)-(5.61);
the lumped quantities of its table are functions of `loads`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.errors import UnknownName
from expdesign.values import Array, sealed
from expdesign.vessel.roll import G_MPS2, Body, Load
from expdesign.waves import froude_factor

UNITS = {
    "k": "N m/rad", "A_x": "kg m2", "d": "N m s/rad", "K_r": "N m s/rad", "K_vd": "kg m", "K_delta": "N m/rad",
    "z_f": "m", "m": "kg", "z_m": "m",
}  # fmt: skip
"""Parameter -> unit."""
PARAMETERS = tuple(UNITS)  # names of the parameters, in the order of all their vectors (9,)
MEANINGS = {
    "k": "restoring moment of hull and speed, without the weight's share g S1",
    "A_x": "roll inertia about the centre of mass, added inertia included",
    "d": "roll damping",
    "K_r": "roll moment per yaw rate beyond that of the side acceleration",
    "K_vd": "roll moment per side acceleration (added mass)",
    "K_delta": "roll moment per rudder angle",
    "z_f": "rotation axis above the body origin",
    "m": "mass of the unknown load",
    "z_m": "place of the unknown load, down from the body origin",
}
FROUDE = {
    "k": "moment", "A_x": "inertia", "d": "damping", "K_r": "damping", "K_vd": "moment", "K_delta": "moment",
    "z_f": "length", "m": "mass", "z_m": "length",
}  # fmt: skip
"""Parameter -> quantity of Froude's law that it scales as; kg m scales as a moment, as gravity does not change."""


def parameters(**values: float) -> Array:
    """(9,) parameters by name; zero where none is given.

    Raises:
        UnknownName: there is no such parameter.
    """
    for name in values:
        if name not in UNITS:
            raise UnknownName("roll parameter", name, known=PARAMETERS)
    return np.array([values.get(name, 0.0) for name in PARAMETERS])


def named(values: Array) -> dict[str, float]:
    """Parameters (9,) by name."""
    return dict(zip(PARAMETERS, values.tolist(), strict=True))


def froude_scaled(values: Array, scale: float) -> Array:
    """Parameters (9,), or standard deviations, of a ship so many times as long as her model, in the same water."""
    return np.asarray(values * [froude_factor(FROUDE[name], scale) for name in PARAMETERS])


@sealed(values="c", jacobian="c 9")
class Coefficients:
    """Coefficients with derivatives by the parameters."""

    values: Array  # (5,)
    jacobian: Array  # (5, 9)


def coefficients(theta: Array, body: Body, load: Load | None) -> Coefficients:
    """alpha1, alpha2, beta1, kappa1, gamma1 of the continuous equation.

    They are d, k - K_vd g, -(K_vd + S1), K_r and K_delta, each over A2.

    Args:
        theta: (9,) parameters.
        load: on board; None for the unknown one, which is among the parameters.
    """
    sums = _sums(theta, body, load)
    tops, rises = _numerators(theta, sums)
    inertia = sums.inertia
    jacobian = (rises - np.outer(tops / inertia, sums.inertia_by)) / inertia
    return Coefficients(values=tops / inertia, jacobian=jacobian)


def discrete(theta: Array, body: Body, load: Load | None, step_s: float) -> Coefficients:
    """Coefficients a1, a2, b0, k0, g0 of the equation sampled by p = (2/T) (q - 1) / (q + 1), (5,).

        y(t) = -a1 y(t-1) - a2 y(t-2) + b0 (a_s(t) - a_s(t-2)) + k0 (r(t) - r(t-2)) + g0 (delta(t) - delta(t-2)) + noise

    Args:
        theta, body, load: as in `coefficients`.
        step_s: time between samples [s].
    """
    T, sums = step_s, _sums(theta, body, load)
    tops, rises = _numerators(theta, sums)
    inertia, d, k = (sums.inertia, sums.inertia_by), (tops[0], rises[0]), (tops[1], rises[1])
    parts = [
        tuple(2.0 * T * T * k[i] - 8.0 * inertia[i] for i in (0, 1)),
        tuple(-2.0 * T * d[i] + T * T * k[i] + 4.0 * inertia[i] for i in (0, 1)),
        *((2.0 * T * top, 2.0 * T * rise) for top, rise in zip(tops[2:], rises[2:], strict=True)),
    ]
    below, below_by = (2.0 * T * d[i] + T * T * k[i] + 4.0 * inertia[i] for i in (0, 1))
    values = np.array([part[0] for part in parts]) / below
    slopes = np.array([part[1] for part in parts])
    return Coefficients(values=values, jacobian=(slopes - np.outer(values, below_by)) / below)


def stiffness(theta: Array, body: Body, load: Load | None) -> float:
    """k + g S1, the moment per angle that rights the ship [N m/rad]; negative for one that does not stay upright."""
    return float(theta[0] + G_MPS2 * _sums(theta, body, load).moment)


def roll_frequency(theta: Array, body: Body, load: Load | None) -> float:
    """Frequency of the undamped roll [Hz], zero for a ship that does not stay upright."""
    values = coefficients(theta, body, load).values
    beta, z_s = float(values[2]), body.sensor(float(theta[PARAMETERS.index("z_f")]))
    return float(np.sqrt(max(0.0, (values[1] - beta * G_MPS2) / (1.0 - beta * z_s))) / (2.0 * np.pi))


def relative_sensitivity(theta: Array, body: Body, loads: Sequence[Load | None], free: Sequence[str]) -> Array:
    """(c, p) d log coefficient / d log parameter; coefficients that are zero, as a pendulum's, are left out.

    Args:
        theta: (9,) parameters, the free ones not zero.
        loads: of the cases; None for the unknown one.
    """
    places = [PARAMETERS.index(name) for name in free]
    found = [coefficients(theta, body, load) for load in loads]
    values = np.concatenate([one.values for one in found])
    slopes = np.concatenate([one.jacobian for one in found])[:, places] * theta[places]
    there = values != 0.0
    return np.asarray(slopes[there] / values[there, None])


@dataclass(frozen=True)
class _Sums:
    """A2 and S1, with derivatives (9,) by the parameters."""

    inertia: float
    inertia_by: Array
    moment: float
    moment_by: Array


def _sums(theta: Array, body: Body, load: Load | None) -> _Sums:
    _, A_x, _, _, K_vd, _, z_f, m, z_m = theta.tolist()
    unknown = load is None
    m, z_m, own = (m, z_m, 0.0) if load is None else (load.mass_kg, load.z_m, load.inertia_kgm2)
    M, z_g, z, z_s = body.mass_kg, body.z_g + z_f, z_m + z_f, body.sensor(z_f)
    moves = 0.0 if body.sensor_from_axis else 1.0  # of z_s with z_f
    return _Sums(
        inertia=A_x + own + M * z_g * (z_g - z_s) + m * z * (z - z_s) - K_vd * z_s,
        inertia_by=parameters(
            A_x=1.0,
            K_vd=-z_s,
            z_f=M * (2.0 * z_g - z_s - moves * z_g) + m * (2.0 * z - z_s - moves * z) - moves * K_vd,
            m=unknown * z * (z - z_s),
            z_m=unknown * m * (2.0 * z - z_s),
        ),
        moment=M * z_g + m * z,
        moment_by=parameters(z_f=M + m, m=unknown * z, z_m=unknown * m),
    )


def _numerators(theta: Array, sums: _Sums) -> tuple[Array, Array]:
    """d, k - K_vd g, -(K_vd + S1), K_r, K_delta, (5,), with derivatives (5, 9)."""
    k, _, d, K_r, K_vd, K_delta, *_ = theta.tolist()
    values = np.array([d, k - K_vd * G_MPS2, -(K_vd + sums.moment), K_r, K_delta])
    slopes = [
        parameters(d=1.0),
        parameters(k=1.0, K_vd=-G_MPS2),
        -(parameters(K_vd=1.0) + sums.moment_by),
        parameters(K_r=1.0),
        parameters(K_delta=1.0),
    ]
    return values, np.array(slopes)
