"""A pendulum on a cart: the ship without sway, yaw and rudder forces, and one data set at a time.

Source: doctoral thesis on grey-box identification of roll with few sensors, (4.7)-(4.35).
"""

from __future__ import annotations

import numpy as np

from expdesign.roll.model import named
from expdesign.values import Array
from expdesign.vessel.masses import G_MPS2, Body, Load, axis_inertia, first_moment

System = tuple[Array, Array, Array, Array]


def pendulum_system(theta: Array, body: Body, load: Load) -> System:
    """Matrices A, B, C, D: states roll and roll rate, input a_y, outputs roll rate and accelerometer reading.

    Args:
        theta: (9,) parameters, of which k, A_x and d count.
        body, load: at rest relative to the pendulum.
    """
    values = named(theta)
    inertia, moment = axis_inertia(values["A_x"], body, load), first_moment(body, load)
    lean = np.array([-(values["k"] + G_MPS2 * moment), -values["d"]]) / inertia
    return (
        np.array([[0.0, 1.0], lean]),
        np.array([[0.0], [moment / inertia]]),
        np.array([[0.0, 1.0], body.z_s * lean + [G_MPS2, 0.0]]),
        np.array([[0.0], [body.z_s * moment / inertia - 1.0]]),
    )


def own_parameters(coefficients: Array, body: Body, load: Load) -> tuple[float, float, float]:
    """k, I_x and d of a pendulum with a known load, from alpha1, alpha2, beta1 (4.34)."""
    alpha1, alpha2, beta = coefficients[:3].tolist()
    moment, ballast = first_moment(body, load), load.mass_kg * load.z_m * (load.z_m - body.z_s)
    ship = body.mass_kg * body.z_g * (body.z_g - body.z_s)
    inertia = -moment / beta - ship - ballast - load.inertia_kgm2
    return -alpha2 / beta * moment, inertia, -alpha1 / beta * moment


def load_from(coefficients: Array, body: Body, *, inertia: float, damping: float) -> Load:
    """The load of a pendulum that is known without it, from alpha1 and beta1 (4.35).

    The mass is a square over a product: an estimate of it above zero is no evidence.
    """
    alpha1, _, beta = coefficients[:3].tolist()
    W = alpha1 * (inertia + body.mass_kg * body.z_g**2) + damping * (beta * body.z_s - 1.0)
    top = beta * damping + alpha1 * body.mass_kg * body.z_g
    return Load(mass_kg=-(top**2) / (alpha1 * W), z_m=W / top)
