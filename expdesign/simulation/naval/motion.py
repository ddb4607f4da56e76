"""Voyages of the naval vessel, many at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from expdesign.simulation.naval.hull import Hull
from expdesign.simulation.naval.pods import Pods
from expdesign.values import Array, seal

STATES = ("u", "v", "p", "r", "phi", "psi")
SUBSTEPS = 2


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
    step, change = sample_time_s / SUBSTEPS, np.diff(orders, axis=0, append=orders[-1:]) / SUBSTEPS
    states = np.empty((len(orders), *x.shape))
    sway, moment = np.empty((2, len(orders), *x.shape[1:]))
    for k, order in enumerate(orders):
        states[k], sway[k] = x, rates(x, order)[1]
        moment[k] = drives.forces(*numbers(x[:4]), *numbers(order))[3]
        for part in range(SUBSTEPS):
            begin, middle, end = (order + (part + share) * change[k] for share in (0.0, 0.5, 1.0))
            k1 = rates(x, begin)
            k2 = rates(x + step / 2 * k1, middle)
            k3 = rates(x + step / 2 * k2, middle)
            k4 = rates(x + step * k3, end)
            x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    states, sway, moment = states.reshape(len(orders), 6, n), sway.reshape(-1, n), moment.reshape(-1, n)
    return tuple(
        Voyage(sample_time_s=sample_time_s, states=states[..., i], sway_acceleration=sway[:, i], moment=moment[:, i])
        for i in range(n)
    )
