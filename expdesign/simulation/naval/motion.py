"""Voyages of the naval vessel, many at once."""

from __future__ import annotations

from dataclasses import dataclass

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
    drives, inverse = Pods() if pods is None else pods, np.linalg.inv(hull.inertia)

    def rates(x: Array, order: Array) -> Array:
        u, v, p, r, phi = x[:5].tolist()
        push = drives.forces(u, v, p, r, *order.tolist())
        accelerations = inverse @ np.add(hull.forces(u, v, p, r, phi), push)
        return np.array([*accelerations, p, r * np.cos(phi)])

    x = np.zeros(6) if start is None else np.array(start, dtype=float)
    orders = np.column_stack([angle, speed])
    step, change = sample_time_s / SUBSTEPS, np.diff(orders, axis=0, append=orders[-1:]) / SUBSTEPS
    states, sway, moment = np.empty((len(angle), 6)), np.empty(len(angle)), np.empty(len(angle))
    for k, order in enumerate(orders):
        states[k], sway[k] = x, rates(x, order)[1]
        moment[k] = drives.forces(float(x[0]), float(x[1]), float(x[2]), float(x[3]), *order.tolist())[3]
        for part in range(SUBSTEPS):
            begin, middle, end = (order + (part + share) * change[k] for share in (0.0, 0.5, 1.0))
            k1 = rates(x, begin)
            k2 = rates(x + step / 2 * k1, middle)
            k3 = rates(x + step / 2 * k2, middle)
            k4 = rates(x + step * k3, end)
            x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return Voyage(sample_time_s=sample_time_s, states=states, sway_acceleration=sway, moment=moment)
