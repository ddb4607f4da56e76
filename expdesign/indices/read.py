"""A run of a steered ship, and its indices where rudder or engine orders are known."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy

from expdesign.conventions import rotated, wrap_angle
from expdesign.indices.criteria import ZIGZAG_DEVIATION_RAD, Circle, Execute, Stop, ZigZag
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Helm
from expdesign.values import Array, sealed
from expdesign.vessel import KINDS, Vessel

Curve = Callable[[float], float]


@sealed(time_s="k", pose="k 3", velocity="k 3", helm_rad="j", drive="j")
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

    @cached_property
    def _motion(self) -> scipy.interpolate.CubicHermiteSpline:
        u, v, r = self.velocity.T
        rates = np.stack([*rotated((u, v), self.pose[:, 2]), r], axis=1)
        return scipy.interpolate.CubicHermiteSpline(self.time_s, self.pose, rates)

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
    for one in helm.vessel.actuators:
        if one.kind == "azimuth" and set(one.signals) <= column.keys():  # turned round, it pushes astern
            thrust_name, angle_name = one.signals
            astern = np.cos(column[angle_name]) < 0.0
            column[thrust_name] = np.where(astern, -column[thrust_name], column[thrust_name])
            column[angle_name] = np.where(astern, wrap_angle(column[angle_name] - np.pi), column[angle_name])
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


TEN = math.radians(10.0)
SIDE_NAMES = {1: "starboard", -1: "port"}


def read_circle(
    run: SteeredRun,
    *,
    order_s: float,
    course_rad: float,
    side: int,
    helm_rad: float,
    speed_mps: float | None,
    current: bool,
) -> Circle:
    """A turning circle.

    Args:
        run: with one rudder order.
        order_s: time of the order.
        course_rad: heading of the approach.
        side: +1 to starboard, -1 to port.
        helm_rad: size of the helm.
        speed_mps: approach speed, or None where unknown.
        current: whether to estimate and subtract a uniform current, which needs 540 degrees of turn.
    """
    drift = uniform_current(run, order_s=order_s, course_rad=course_rad, side=side) if current else None
    flow = np.zeros(2) if drift is None else drift
    start = run.at(order_s)
    ahead = np.array([math.cos(course_rad), math.sin(course_rad)])
    across = side * np.array([-math.sin(course_rad), math.cos(course_rad)])

    def distance(degrees: float, direction: Array) -> float | None:
        time = run.first_turned(side * math.radians(degrees), since_s=order_s, course_rad=course_rad)
        return None if time is None else float((run.at(time)[:2] - start[:2] - flow * (time - order_s)) @ direction)

    return Circle(
        name=run.name,
        side=SIDE_NAMES[side],
        helm_rad=helm_rad,
        speed_mps=speed_mps,
        advance_m=distance(90, ahead),
        transfer_m=distance(90, across),
        tactical_diameter_m=distance(180, across),
        initial_turning_m=sailed_to(run, order_s=order_s, course_rad=course_rad, change_rad=side * TEN),
        steady_diameter_m=_steady_diameter(run, order_s=order_s, course_rad=course_rad, side=side, flow=flow),
        current_north_mps=None if drift is None else float(drift[0]),
        current_east_mps=None if drift is None else float(drift[1]),
        tolerance_m=run.tolerance_m(order_s),
    )


def sailed_to(run: SteeredRun, *, order_s: float, course_rad: float, change_rad: float) -> float | None:
    """Distance sailed from the order until the heading has changed by so much [m]."""
    time = run.first_turned(change_rad, since_s=order_s, course_rad=course_rad)
    return None if time is None else run.sailed_m(order_s, time)


def uniform_current(run: SteeredRun, *, order_s: float, course_rad: float, side: int) -> Array | None:
    """(2,) north, east [m/s]: drift between equal headings one full turn apart, from 180 degrees on; None if too short.

    Source: IMO MSC/Circ.1053 (2002), on turning trials in a current.
    """
    drifts = []
    for degrees in np.arange(180.0, 3600.0, 5.0):
        pair = [
            run.first_turned(side * math.radians(d), since_s=order_s, course_rad=course_rad)
            for d in (degrees, degrees + 360.0)
        ]
        if pair[0] is None or pair[1] is None:
            break
        drifts.append((run.at(pair[1])[:2] - run.at(pair[0])[:2]) / (pair[1] - pair[0]))
    return np.mean(drifts, axis=0) if drifts else None


def _steady_diameter(run: SteeredRun, *, order_s: float, course_rad: float, side: int, flow: Array) -> float | None:
    """Length through the water of the last half turn beyond 270 degrees, as the diameter of that half circle."""
    last = side * (run.pose[-1, 2] - course_rad)
    since = run.first_turned(side * (last - math.pi), since_s=order_s, course_rad=course_rad)
    if last < 1.5 * math.pi or since is None:
        return None
    times = np.linspace(since, run.time_s[-1], 400)
    places = np.array([run.at(time)[:2] - flow * time for time in times])
    return 2 * float(np.hypot(*np.diff(places, axis=0).T).sum()) / math.pi


def read_zigzag(
    run: SteeredRun,
    *,
    orders_s: tuple[float, ...],
    course_rad: float,
    side: int,
    helm_rad: float,
    speed_mps: float | None,
    heading_rad: float | None = None,
) -> ZigZag:
    """A zig-zag.

    Args:
        run: with its rudder orders.
        orders_s: times of the orders, the first included where it is known.
        course_rad: heading of the approach.
        side: of the turn that follows the first of these, +1 to starboard.
        helm_rad: size of the helm.
        speed_mps: approach speed, or None where unknown.
        heading_rad: nominal change of heading at the orders, or None for the actual ones.
    """
    executes = tuple(
        Execute(time_s=t, heading_rad=side * float(run.at(t)[2] - course_rad), tolerance_rad=run.tolerance_rad(t))
        for t in orders_s
    )
    swings = [(-1) ** n for n in range(len(orders_s))]
    nominal = heading_rad
    if nominal is None:
        nominal = float(np.mean([abs(execute.heading_rad) for execute in executes[1:]])) if executes[1:] else 0.0
    overshoots = []
    for number, execute in enumerate(executes[1:], start=1):
        until = orders_s[number + 1] if number + 1 < len(orders_s) else float(run.time_s[-1])
        sign = swings[number - 1]
        top = run.turning_point(execute.time_s, until, side=side * sign)
        if top is None:
            break
        reached = sign * side * (top[1] - course_rad)
        overshoots.append(reached - (sign * execute.heading_rad if heading_rad is None else heading_rad))
    return ZigZag(
        name=run.name,
        side=SIDE_NAMES[side],
        heading_rad=nominal,
        helm_rad=helm_rad,
        speed_mps=speed_mps,
        executes=executes,
        overshoots_rad=tuple(overshoots),
        initial_turning_m=None
        if nominal < TEN - ZIGZAG_DEVIATION_RAD
        else sailed_to(run, order_s=orders_s[0], course_rad=course_rad, change_rad=side * TEN),
        tolerance_m=run.tolerance_m(orders_s[0]),
    )


def read_stop(
    run: SteeredRun, *, order_s: float, course_rad: float, speed_mps: float, rest_mps: float = 0.0
) -> Stop | None:
    """A stopping trial, or None when the ship keeps headway.

    Args:
        run: with one order astern.
        order_s: time of the order.
        course_rad: heading of the approach.
        speed_mps: approach speed.
        rest_mps: surge speed up to which a ship counts as stopped where its record ends before it moves astern.
    """
    surge = run.velocity[:, 0]
    gone = np.flatnonzero((surge <= 0) & (run.time_s > order_s))
    if len(gone) and gone[0] > 0:
        index = int(gone[0])
        end = crossing(lambda t: float(np.interp(t, run.time_s, surge)), run.time_s[index - 1], run.time_s[index])
    elif run.time_s[-1] > order_s and 0 < surge[-1] <= rest_mps:
        end = float(run.time_s[-1])
    else:
        return None
    start, last = run.at(order_s), run.at(end)
    c, s = math.cos(course_rad), math.sin(course_rad)
    north, east = last[:2] - start[:2]
    return Stop(
        name=run.name,
        speed_mps=speed_mps,
        track_reach_m=run.sailed_m(order_s, end),
        head_reach_m=float(north * c + east * s),
        lateral_m=float(east * c - north * s),
        heading_change_rad=float(last[2] - course_rad),
        time_s=end - order_s,
        tolerance_m=run.tolerance_m(order_s),
    )
