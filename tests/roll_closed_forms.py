"""Closed forms of roll: the equation closed over the accelerometer, a pendulum on a cart, the inverse bilinear map.

The accelerometer reads the roll that it drives: a_s = F_y y - a_y, F_y = (z_s p^2 + g) / p, a_y = v' + U r. With that,

    y = G0 (-a_y + F_r r + F_delta delta),               G0 = beta p / ((1 - beta z_s) p^2 + alpha1 p + alpha2 - beta g)
    a_s = F_y G0 (F_r r + F_delta delta) - S0 a_y,       S0 = (p^2 + alpha1 p + alpha2) / the same

G0 is the ship itself, 1 - beta z_s = A1 / A2 and alpha2 - beta g = (k + g S1) / A2, and stable where she is; the
equation that reads the accelerometer need not be, and is never simulated by itself.

Source: doctoral thesis on grey-box identification of roll with few sensors, proposition 4.1, (4.7)-(4.35) and
(5.25)-(5.33), with the sign of U r as a_s = F_y y - v' - U r has it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.roll import named
from expdesign.values import Array, seal
from expdesign.vessel.roll import G_MPS2, Body, Load, axis_inertia, first_moment

System = tuple[Array, Array, Array, Array]


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedLoop:
    """Transfer functions, coefficients of falling powers of p.

    Attributes:
        roll: (3,) numerator of G0.
        sensor: (3,) numerator of S0.
        loop: (3,) numerator of F_y G0.
        below: (3,) their common denominator.
        gains: (2,) F_r and F_delta.
    """

    roll: Array
    sensor: Array
    loop: Array
    below: Array
    gains: Array

    def __post_init__(self) -> None:
        seal(self, roll="3", sensor="3", loop="3", below="3", gains="2")

    @property
    def stable(self) -> bool:
        """Whether all coefficients of the denominator have one sign."""
        return bool((self.below > 0).all() or (self.below < 0).all())


def closed_loop(coefficients: Array, z_s: float) -> ClosedLoop:
    """The loop of continuous coefficients (5,), with the accelerometer z_s below the rotation axis [m]."""
    alpha1, alpha2, beta, kappa, gamma = coefficients.tolist()
    return ClosedLoop(
        roll=np.array([0.0, beta, 0.0]),
        sensor=np.array([1.0, alpha1, alpha2]),
        loop=beta * np.array([z_s, 0.0, G_MPS2]),
        below=np.array([1.0 - beta * z_s, alpha1, alpha2 - beta * G_MPS2]),
        gains=np.array([kappa / beta, gamma / beta]),
    )


def simulated(loop: ClosedLoop, driven: Array, step_s: float) -> tuple[Array, Array]:
    """Roll rate and accelerometer reading (k,), from rest, sampled by the bilinear map.

    Args:
        loop: stable.
        driven: (k, 3) side acceleration a_y, yaw rate r and rudder angle delta.
        step_s: time between samples [s].
    """
    a_y, inner = driven[:, 0], driven[:, 1:] @ loop.gains
    roll = filtered(loop.roll, loop.below, inner - a_y, step_s)
    sensed = filtered(loop.loop, loop.below, inner, step_s) - filtered(loop.sensor, loop.below, a_y, step_s)
    return roll, sensed


def filtered(above: Array, below: Array, signal: Array, step_s: float) -> Array:
    """A signal (k,) through a transfer function of p, by the bilinear map."""
    return np.asarray(scipy.signal.lfilter(*scipy.signal.bilinear(above, below, fs=1.0 / step_s), signal))


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


def continuous(values: Array, step_s: float) -> Array:
    """Continuous coefficients (5,) from those of the sampled equation (5,), the inverse of the bilinear map."""
    a1, a2, *gains = values
    below = 1.0 - a1 + a2
    rates = 4.0 / step_s * (1.0 - a2) / below, 4.0 / step_s**2 * (1.0 + a1 + a2) / below
    return np.array([*rates, *(8.0 / step_s * gain / below for gain in gains)])
