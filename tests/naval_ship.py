"""A multipurpose naval vessel with two podded drives in four degrees of freedom: surge, sway, roll, yaw.

It is a truth to simulate, for trials of models that are simpler; vessel files cannot name it, as roll and pods in
oblique flow are not linear in parameters. What becomes of it in vessel files: the coupling of sway and yaw is
`[model.inertia]`, roll is the linear mode of `[model.roll]`, and everything in u, v, r is `[[model.terms]]`. Its yaw
equation is the yaw model of `expdesign monitor`, which reads roll and the drives' moment from the data.

Frames: b-frame x forward, y to starboard, z down; roll positive to starboard, yaw clockwise. A positive pod angle
pushes the stern to starboard, so that the ship turns to port.

Sources: M. Blanke and A. Christensen (1993) and T. Perez, Ship Motion Control (2005), for hull and coefficients;
W. Gierusz (2015), simplified, for the pods; both as listed in a master's thesis on the estimation of a ship's yaw
dynamics in operation. Where its text and tables disagree, the sign that obeys Newton's law was taken: -C(nu) nu.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from expdesign.values import Array, seal

WATER, GRAVITY, DISPLACED_M3, GM_M = 1025.0, 9.82, 350.0, 0.776
WEIGHT = WATER * GRAVITY * DISPLACED_M3

ADDED = {
    ("u", "u"): -17400.0, ("v", "v"): -0.393e6, ("v", "p"): -0.296e6, ("v", "r"): -1.4e6, ("p", "v"): 0.296e6,
    ("p", "p"): -0.774e6, ("r", "v"): 0.538e6, ("r", "r"): -28.7e6,
}  # fmt: skip
"""Force in an equation per acceleration: X_udot and so on, SI."""
COEFFICIENTS: Mapping[str, Mapping[str, float]] = {
    "u": {"u|u|": -1960.0, "vr": 0.33 * 359e3},
    "v": {
        "|u|v": -11800.0, "ur": 0.131e6, "v|v|": -3700.0, "v|r|": -0.794e6, "r|v|": -0.182e6, "phi|uv|": 10800.0,
        "phi|ur|": 0.251e6, "phi uu": -74.0,
    },
    "p": {
        "|u|v": 9260.0, "ur": -0.102e6, "v|v|": 29300.0, "v|r|": 0.621e6, "r|v|": 0.142e6, "phi|uv|": -8400.0,
        "phi|ur|": -0.196e6, "phi uu": -1180.0, "|u|p": -15500.0, "p|p|": -0.416e6, "p": -0.5e6,
        "phi": -GM_M * WEIGHT, "phi^3": -0.325 * WEIGHT,
    },
    "r": {
        "|u|v": -92000.0, "|u|r": -4.71e6, "r|r|": -202e6, "r|v|": -15.6e6, "phi|uv|": -0.214e6, "phi u|r|": -4.98e6,
        "phi u|u|": -8000.0,
    },
}  # fmt: skip
"""Equation -> term -> coefficient, SI."""


def terms(u: Any, v: Any, p: Any, r: Any, phi: Any) -> dict[str, Any]:
    """Every product that a coefficient multiplies."""
    au, av, ar = np.abs(u), np.abs(v), np.abs(r)
    return {
        "u|u|": u * au, "vr": v * r, "|u|v": au * v, "ur": u * r, "v|v|": v * av, "v|r|": v * ar, "r|v|": r * av,
        "|u|r": au * r, "r|r|": r * ar, "phi|uv|": phi * au * av, "phi|ur|": phi * au * ar, "phi uu": phi * u * u,
        "phi u|r|": phi * u * ar, "phi u|u|": phi * u * au, "|u|p": au * p, "p|p|": p * np.abs(p), "p": p, "phi": phi,
        "phi^3": phi**3,
    }  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Hull:
    """Inertia and coefficients.

    Attributes:
        mass_kg: m.
        roll_inertia_kgm2, yaw_inertia_kgm2: I_x, I_z.
        forward_m, down_m: centre of gravity x_g, z_g [m].
        coefficients: as `COEFFICIENTS`.
    """

    mass_kg: float = 359e3
    roll_inertia_kgm2: float = 3.4e6
    yaw_inertia_kgm2: float = 33.7e6
    forward_m: float = -3.38
    down_m: float = -1.75
    coefficients: Mapping[str, Mapping[str, float]] = field(default_factory=lambda: COEFFICIENTS)

    @property
    def inertia(self) -> Array:
        """(4, 4) rigid body and added, for (u, v, p, r)."""
        m, x, z = self.mass_kg, self.forward_m, self.down_m
        rigid = np.array(
            [
                [m, 0, 0, 0],
                [0, m, -m * z, m * x],
                [0, -m * z, self.roll_inertia_kgm2, 0],
                [0, m * x, 0, self.yaw_inertia_kgm2],
            ]
        )
        added = np.array([[ADDED.get((row, column), 0.0) for column in "uvpr"] for row in "uvpr"])
        return np.asarray(rigid - added)

    def forces(self, u: Any, v: Any, p: Any, r: Any, phi: Any) -> list[Any]:
        """Hydrodynamic, restoring and Coriolis forces in (u, v, p, r), all but those of the drives [N, N, Nm, Nm]."""
        values = terms(u, v, p, r, phi)
        m, x, z = self.mass_kg, self.forward_m, self.down_m
        coriolis = (m * r * (-v + z * p - x * r), m * r * u, -m * z * r * u, m * x * r * u)
        return [
            sum(coefficient * values[name] for name, coefficient in self.coefficients[equation].items()) - turning
            for equation, turning in zip("uvpr", coriolis, strict=True)
        ]


NOMINAL = Hull()


@dataclass(frozen=True, kw_only=True)
class Pods:
    """Two equal pods; one does not disturb the other.

    Attributes:
        diameter_m, strut_m2: of propeller and strut.
        motive_x, motive_y: coefficients of thrust without advance and per advance ratio, along and across the ship.
        resistive_x: of the strut along the flow: one that turns with twice the angle, and a constant.
        resistive_y: of the strut across the flow.
        forward_m, starboard_m, down_m: places [m]; the pods lie on either side.
    """

    diameter_m: float = 0.42
    strut_m2: float = 2.5
    motive_x: tuple[float, float] = (0.484, -0.47)
    motive_y: tuple[float, float] = (0.484, 0.7)
    resistive_x: tuple[float, float] = (1.2, -1.2)
    resistive_y: float = 1.2
    forward_m: float = -23.5
    starboard_m: float = 1.0
    down_m: float = 1.2

    def forces(self, u: Any, v: Any, p: Any, r: Any, angle: Any, speed: Any) -> list[Any]:
        """Forces of both pods in (u, v, p, r) [N, N, Nm, Nm], for a pod angle [rad] and a propeller speed [1/s]."""
        ahead: Any = 0.0
        aside: Any = 0.0
        across = v + self.forward_m * r - self.down_m * p
        for side in (-self.starboard_m, self.starboard_m):
            along = u - side * r
            flow, inflow = np.hypot(along, across), np.arctan2(across, along)
            x, y = pod_force(self, flow, angle - inflow, speed)
            c, s = np.cos(inflow), np.sin(inflow)
            ahead, aside = ahead + x * c - y * s, aside + x * s + y * c
        return [ahead, aside, -self.down_m * aside, self.forward_m * aside]


def pod_force(pods: Pods, flow: Any, angle: Any, speed: Any) -> tuple[Any, Any]:
    """Forces of one pod along and across the flow [N].

    Args:
        pods: coefficients.
        flow: speed of the water past the pod [m/s], not negative.
        angle: of the pod to the flow [rad].
        speed: of the propeller [1/s], not negative; without it there is no thrust.
    """
    d = pods.diameter_m
    disc, strut = WATER * d**4, 0.5 * WATER * pods.strut_m2 * flow**2
    without, advance = speed**2, speed * flow / d
    (x1, x2), (y1, y2) = pods.motive_x, pods.motive_y
    along = disc * (x1 * np.cos(angle) * without + x2 * advance)
    across = disc * np.sin(angle) * (y1 * without + y2 * advance)
    c1, c2 = pods.resistive_x
    return along + strut * (c1 * np.cos(2 * angle) + c2), across + strut * pods.resistive_y * np.sin(2 * angle)


STATES = ("u", "v", "p", "r", "phi", "psi")


@dataclass(frozen=True, kw_only=True, eq=False)
class Voyage:
    """Motion sampled at the beginning of every sample.

    Attributes:
        sample_time_s: time between samples [s].
        states: (k, 6) u, v [m/s], p, r [rad/s], roll, heading [rad].
        sway_acceleration: (k,) dv/dt [m/s2].
        moment: (k,) yaw moment of the pods [Nm].
    """

    sample_time_s: float
    states: Array
    sway_acceleration: Array
    moment: Array

    def __post_init__(self) -> None:
        seal(self, states="k 6", sway_acceleration="k", moment="k")

    def column(self, name: str) -> Array:
        """(k,) one of `STATES`."""
        return self.states[:, STATES.index(name)]


def sail(
    hull: Hull,
    angle: Array,
    speed: Array,
    *,
    sample_time_s: float = 0.1,
    pods: Pods | None = None,
    start: Array | None = None,
) -> Voyage:
    """Sail by pod angles and propeller speeds; Runge-Kutta of order four.

    Args:
        hull: of the ship.
        angle, speed: (k,) of both pods [rad], [1/s], straight lines between samples.
        sample_time_s: time between samples [s].
        pods: the nominal ones by default.
        start: (6,) first state; at rest by default.
    """
    begin = None if start is None else start[None]
    return sail_many(hull, angle[None], speed[None], sample_time_s=sample_time_s, pods=pods, start=begin)[0]


def sail_many(
    hull: Hull,
    angle: Array,
    speed: Array,
    *,
    sample_time_s: float = 0.1,
    pods: Pods | None = None,
    start: Array | None = None,
) -> tuple[Voyage, ...]:
    """`sail` n voyages of a ship side by side, which takes little longer than one: orders (n, k), start (n, 6)."""
    drives, inverse, n = Pods() if pods is None else pods, np.linalg.inv(hull.inertia), len(angle)

    def rates(x: Array, order: Array) -> Array:
        u, v, p, r, phi = numbers(x[:5])
        push = drives.forces(u, v, p, r, *numbers(order))
        accelerations = inverse @ np.add(hull.forces(u, v, p, r, phi), push)
        return np.concatenate([accelerations, [p, r * np.cos(phi)]])

    def numbers(rows: Array) -> list[Any]:
        """Rows of one voyage as plain numbers, which are quicker."""
        return list(rows.tolist()) if n == 1 else list(rows)

    x = np.zeros((6, n)) if start is None else np.array(start.T, dtype=float)
    orders = np.stack([angle.T, speed.T], axis=1)  # (k, 2, n)
    if n == 1:
        x, orders = x[:, 0], orders[:, :, 0]
    change = np.diff(orders, axis=0, append=orders[-1:])
    states = np.empty((len(orders), *x.shape))
    sway, moment = np.empty((2, len(orders), *x.shape[1:]))
    for k, order in enumerate(orders):
        states[k], sway[k] = x, rates(x, order)[1]
        moment[k] = drives.forces(*numbers(x[:4]), *numbers(order))[3]
        k1 = rates(x, order)
        k2 = rates(x + sample_time_s / 2 * k1, order + change[k] / 2)
        k3 = rates(x + sample_time_s / 2 * k2, order + change[k] / 2)
        k4 = rates(x + sample_time_s * k3, order + change[k])
        x = x + sample_time_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    states, sway, moment = states.reshape(len(orders), 6, n), sway.reshape(-1, n), moment.reshape(-1, n)
    return tuple(
        Voyage(sample_time_s=sample_time_s, states=states[..., i], sway_acceleration=sway[:, i], moment=moment[:, i])
        for i in range(n)
    )


YAW_TRUE: Mapping[str, float] = {
    "I_r": 62.4e6, "M_v": -1.75142e6, "A": -3.49658e6, "N_rr": -202e6, "N_rv": -15.6e6, "N_phiur": -4.98e6,
    "N_uv": -92e3, "N_phiuv": -0.214e6, "N_phiuu": -8e3, "N_abs_u_r": -4.71e6,
    "m_xg": -1.21342e6,
}  # fmt: skip
"""Of her yaw models, `expdesign.monitoring.yaw.YAW_MODELS`."""
