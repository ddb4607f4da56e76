"""Indices of a run with known rudder or engine orders."""

from __future__ import annotations

import math

import numpy as np

from expdesign.indices.criteria import ZIGZAG_DEVIATION_RAD, Circle, Execute, Stop, ZigZag
from expdesign.indices.steered_run import SteeredRun, crossing
from expdesign.values import Array

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


def read_stop(run: SteeredRun, *, order_s: float, course_rad: float, speed_mps: float) -> Stop | None:
    """A stopping trial, or None when the ship keeps headway."""
    gone = np.flatnonzero((run.velocity[:, 0] <= 0) & (run.time_s > order_s))
    if not len(gone) or gone[0] == 0:
        return None
    index = int(gone[0])
    surge = run.velocity[:, 0]
    end = crossing(lambda t: float(np.interp(t, run.time_s, surge)), run.time_s[index - 1], run.time_s[index])
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
