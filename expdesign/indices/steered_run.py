"""A run of a steered ship: motion between samples, helm, engine order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy

from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Helm
from expdesign.values import Array, seal
from expdesign.vessel import KINDS, Vessel

Curve = Callable[[float], float]


@dataclass(frozen=True, kw_only=True, eq=False)
class SteeredRun:
    """Motion and orders of one run; between samples positions and heading are cubics that fit the velocities."""

    name: str  # for reports
    length_m: float  # of the ship
    time_s: Array  # (k,)
    pose: Array  # (k, 3) midship point north, east [m]; heading [rad], continuous
    velocity: Array  # (k, 3) over ground, b-frame
    helm_rad: Array  # (j,) helm angle in the actuators' own sense, each from its sample to the next
    drive: Array  # (j,) engine order or mean propeller speed, ahead positive, likewise
    tolerance_s: float  # of the times of orders: one sample of a record, 0 in a simulation

    def __post_init__(self) -> None:
        seal(self, time_s="k", pose="k 3", velocity="k 3", helm_rad="j", drive="j")

    @cached_property
    def _motion(self) -> scipy.interpolate.CubicHermiteSpline:
        c, s = np.cos(self.pose[:, 2]), np.sin(self.pose[:, 2])
        u, v, r = self.velocity.T
        return scipy.interpolate.CubicHermiteSpline(
            self.time_s, self.pose, np.stack([u * c - v * s, u * s + v * c, r], axis=1)
        )

    @property
    def sample_time_s(self) -> float:
        """Time between samples [s]."""
        return float(self.time_s[1] - self.time_s[0])

    @property
    def median_speed_mps(self) -> float:
        """Over ground [m/s]."""
        return float(np.median(np.hypot(*self.velocity[:, :2].T)))

    def until(self, last: int) -> SteeredRun:
        """The run up to a sample."""
        part = slice(last + 1)
        return replace(
            self, time_s=self.time_s[part], pose=self.pose[part], velocity=self.velocity[part],
            helm_rad=self.helm_rad[part], drive=self.drive[part],
        )  # fmt: skip

    def at(self, time_s: float) -> Array:
        """(3,) pose at a time within the run."""
        return np.asarray(self._motion(time_s), dtype=float)

    def sailed_m(self, first_s: float, last_s: float) -> float:
        """Distance sailed between two times [m]."""
        inner = self.time_s[(self.time_s > first_s) & (self.time_s < last_s)]
        times = np.concatenate([[first_s], inner, [last_s]])
        fine = np.concatenate([*(np.linspace(a, b, 4, endpoint=False) for a, b in pairwise(times)), [last_s]])
        return float(np.hypot(*np.diff(self._motion(fine)[:, :2], axis=0).T).sum())

    def tolerance_m(self, order_s: float) -> float:
        """Way made within the tolerance of an order's time [m]."""
        first_s, last_s = self._order_sample(order_s)
        return self.sailed_m(first_s, last_s)

    def tolerance_rad(self, order_s: float) -> float:
        """Change of heading within the tolerance of an order's time [rad]."""
        first_s, last_s = self._order_sample(order_s)
        return abs(float(self.at(last_s)[2] - self.at(first_s)[2]))

    def _order_sample(self, order_s: float) -> tuple[float, float]:
        first_s = max(order_s - self.tolerance_s, float(self.time_s[0]))
        return first_s, min(first_s + self.tolerance_s, float(self.time_s[-1]))

    def first_turned(self, change_rad: float, *, since_s: float, course_rad: float) -> float | None:
        """When the heading first differs by `change_rad` (signed) from the course, or None."""
        beyond = np.sign(change_rad) * (self.pose[:, 2] - course_rad - change_rad)
        found = np.flatnonzero((beyond >= 0) & (self.time_s >= since_s))
        if not len(found) or found[0] == 0:
            return None
        index = int(found[0])
        return crossing(
            lambda t: float(self._motion(t)[2]) - course_rad - change_rad, self.time_s[index - 1], self.time_s[index]
        )

    def turning_point(self, first_s: float, last_s: float, *, side: int) -> tuple[float, float] | None:
        """(time, heading) of the largest heading to a side (+1 starboard) strictly between two times, or None."""
        inside = np.flatnonzero((self.time_s >= first_s) & (self.time_s <= last_s))
        if len(inside) < 3:
            return None
        top = int(inside[np.argmax(side * self.pose[inside, 2])])
        if top == len(self.time_s) - 1 or self.time_s[top] >= last_s:
            return None
        low, high = self.time_s[max(top - 1, 0)], self.time_s[top + 1]
        fine = np.linspace(low, high, 401)
        headings = self._motion(fine)[:, 2]
        best = int(np.argmax(side * headings))
        return float(fine[best]), float(headings[best])


def crossing(curve: Curve, low: float, high: float) -> float:
    """Where a curve changes sign between two times; the nearer end where it does not quite."""
    first, last = curve(low), curve(high)
    if first * last > 0:
        return low if abs(first) < abs(last) else high
    return float(scipy.optimize.brentq(curve, low, high, xtol=1e-9))


def steered_run(vessel: Vessel, commands: Commands, motion: Trajectory, *, name: str) -> SteeredRun:
    """A simulated trial."""
    helm = Helm(vessel=vessel)
    return SteeredRun(
        name=name,
        length_m=vessel.length_m,
        time_s=motion.time_s,
        pose=motion.pose,
        velocity=motion.velocity,
        tolerance_s=0.0,
        **orders(helm, commands.names, commands.values),
    )


def orders(helm: Helm, names: tuple[str, ...], values: Array) -> dict[str, Array]:
    """`helm_rad` and `drive` (k,) of recorded actuator signals (k, m); zero without such signals."""
    column = {name: values[:, index] for index, name in enumerate(names)}
    thrust = [column[a.signals[0]] for a in helm.vessel.actuators if KINDS[a.kind][0] == "n" and a.signals[0] in column]
    if "tau_x" in column:
        thrust = [column["tau_x"]]
    by_propellers = helm.means == "propeller"
    turned = [
        column[a.signals[-1]]
        for a in helm.steering
        if a.kind != "force" and a.signals[-1] in column and not by_propellers
    ]
    if by_propellers and (sides := [(a, column[a.signals[0]]) for a in helm.steering if a.signals[0] in column]):
        port, right = ([n / a.limits[0].high for a, n in sides if side * a.starboard_m > 0] for side in (-1, 1))
        if port and right:
            turned = [np.arcsin(np.clip((np.mean(port, axis=0) - np.mean(right, axis=0)) / 2.0, -1.0, 1.0))]
    if not turned and {"tau_x", "tau_y"} <= column.keys():
        turned = [np.arctan2(column["tau_y"], np.abs(column["tau_x"]))]
    zero = np.zeros(len(values))
    return {
        "helm_rad": np.mean(turned, axis=0) if turned else zero,
        "drive": np.mean(thrust, axis=0) if thrust else zero,
    }
