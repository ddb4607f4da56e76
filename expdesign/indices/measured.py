"""Measured standard trials: the kind of a run, the times of its orders, and its indices.

A helm order is timed where the rudder leaves its old angle: linear extrapolation from the times at 10 % and 50 % of its
travel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from expdesign.errors import InputError
from expdesign.indices.read import read_circle, read_stop, read_zigzag
from expdesign.indices.steered_run import SteeredRun, orders
from expdesign.indices.tuning import TUNING
from expdesign.indices.values import Circle, Stop, ZigZag
from expdesign.signals import Batch
from expdesign.simulation import Helm
from expdesign.values import Array
from expdesign.vessel import Vessel

LEAST_HELM_RAD = math.radians(2.0)
TURNED_RAD = math.radians(80.0)


@dataclass(frozen=True, kw_only=True)
class NotStandard:
    """A run that is no standard trial.

    Attributes:
        name: of the run.
        reason: one phrase.
    """

    name: str
    reason: str


Found = Circle | ZigZag | Stop | NotStandard


def measured_trial(vessel: Vessel, batch: Batch, *, reference_forward_m: float = 0.0) -> Found:
    """The indices of one measured run: a zig-zag, a turning circle or a stop.

    Args:
        vessel: for length and actuators.
        batch: with pose and velocity.
        reference_forward_m: how far forward of amidships the recorded positions and velocities are [m].

    Raises:
        InputError: positions or headings are not recorded.
    """
    if batch.pose is None or not np.isfinite(batch.pose).all():
        raise InputError(f"{batch.name}: has no complete positions and headings, which the indices need")
    helm = Helm(vessel=vessel)
    run = _steered_run(vessel, batch, helm, reference_forward_m)
    turned = _orders(run)
    if turned:
        return _steered(run, turned)
    astern = _astern(run)
    if astern is None:
        return NotStandard(name=batch.name, reason="neither the helm nor the engines are ordered to move")
    course, speed = _approach(run, astern)
    stop = read_stop(run, order_s=astern, course_rad=course, speed_mps=speed) if speed > _slow(run) else None
    return stop or NotStandard(name=batch.name, reason="the helm stays amidships and the ship keeps its headway")


def _steered_run(vessel: Vessel, batch: Batch, helm: Helm, forward_m: float) -> SteeredRun:
    assert batch.pose is not None
    pose, velocity = np.array(batch.pose), np.array(batch.velocity)
    if not np.isfinite(velocity).all():
        raise InputError(f"{batch.name}: has no complete velocities, which the indices need")
    pose[:, :2] -= forward_m * np.stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])], axis=1)
    velocity[:, 1] -= forward_m * velocity[:, 2]
    return SteeredRun(
        name=batch.name,
        length_m=vessel.length_m,
        time_s=batch.time_s,
        pose=pose,
        velocity=velocity,
        order_time_s=batch.time_s + batch.sample_time_s / 2,  # inputs are held: a value belongs to its sample's middle
        **orders(helm, batch.input_names, batch.inputs),
    )


@dataclass(frozen=True, kw_only=True)
class _Order:
    """A helm order: when it was given and the angle it led to, from neutral."""

    time_s: float
    helm_rad: float


def _orders(run: SteeredRun) -> tuple[_Order, ...]:
    """Helm orders in time order; successive plateaus lie on alternate sides of neutral."""
    neutral = float(np.median(run.helm_rad[: max(3, len(run.helm_rad) // 200)]))
    helm = run.helm_rad - neutral
    largest = float(np.abs(helm).max())
    if largest < LEAST_HELM_RAD:
        return ()
    side = np.where(helm > largest / 2, 1, np.where(helm < -largest / 2, -1, 0))
    firm = np.flatnonzero(side)
    stretches = np.split(firm, np.flatnonzero(np.diff(side[firm]) != 0) + 1)
    levels = [float(np.median(helm[stretch])) for stretch in stretches]
    times = [_left(run.order_time_s, helm, stretches[0][0], 0.0, levels[0])]
    for (_, late), (before, after) in zip(pairwise(stretches), pairwise(levels), strict=True):
        times.append(_left(run.order_time_s, helm, late[0], before, after))
    return tuple(_Order(time_s=time, helm_rad=level) for time, level in zip(times, levels, strict=True))


def _left(time_s: Array, helm: Array, arrived: int, before: float, after: float) -> float:
    """Time at which the helm left one level for another, which it had reached at sample `arrived`."""
    way = (helm - before) / (after - before)
    moments = []
    for share in (0.1, 0.5):
        below = np.flatnonzero(way[: arrived + 1] < share)
        index = int(below[-1]) if len(below) else 0
        high = min(index + 1, arrived)
        moments.append(float(np.interp(share, way[[index, high]], time_s[[index, high]])))
    return float(max(time_s[0], moments[0] - (moments[1] - moments[0]) / 4))


def _steered(run: SteeredRun, turned: tuple[_Order, ...]) -> Found:
    course, speed = _approach(run, turned[0].time_s)
    if speed < _slow(run):
        return NotStandard(name=run.name, reason=f"the ship makes {speed:.3g} m/s when the helm is ordered")
    until = turned[1].time_s if len(turned) > 1 else float(run.time_s[-1])
    swung = run.at(until)[2] - course
    side = 1 if swung > 0 else -1
    size = abs(turned[0].helm_rad)
    if len(turned) == 1:
        if abs(swung) < TURNED_RAD:
            return NotStandard(
                name=run.name, reason=f"one helm order, and the heading changes by {_degrees(swung)} only"
            )
        return read_circle(
            run, order_s=turned[0].time_s, course_rad=course, side=side, helm_rad=size, speed_mps=speed, current=True
        )
    sizes = np.abs([order.helm_rad for order in turned])
    if sizes.max() > 1.3 * sizes.min():
        sides = f"{_degrees(sizes.min())} and {_degrees(sizes.max())}"
        return NotStandard(name=run.name, reason=f"the helm is ordered to different angles, {sides}")
    times = tuple(order.time_s for order in turned)
    found = read_zigzag(
        run, orders_s=times, course_rad=course, side=side, helm_rad=float(np.mean(sizes)), speed_mps=speed
    )
    swings = [execute.heading_rad for execute in found.executes[1:]]
    if any(one * other >= 0 for one, other in pairwise(swings)) or found.heading_rad < math.radians(0.5):
        return NotStandard(name=run.name, reason="the heading does not swing to both sides of the approach course")
    return found


def _approach(run: SteeredRun, order_s: float) -> tuple[float, float]:
    """Mean heading and speed over the last ship length before an order, or over the part of it that was recorded."""
    before = run.time_s <= order_s
    speeds = np.hypot(*run.velocity[:, :2].T)
    last = float(speeds[before][-1]) if before.any() else float(speeds[0])
    stretch = before & (run.time_s >= order_s - run.length_m / max(last, 1e-9))
    if not stretch.any():
        stretch = np.arange(len(run.time_s)) == 0
    return float(run.pose[stretch, 2].mean()), float(speeds[stretch].mean())


def _slow(run: SteeredRun) -> float:
    return TUNING.under_way * math.sqrt(run.length_m)


def _astern(run: SteeredRun) -> float | None:
    """When the engines leave their first order for one that is not ahead."""
    first = float(np.median(run.drive[: max(3, len(run.drive) // 200)]))
    stopped = np.flatnonzero(run.drive <= 0)
    if first <= 0 or not len(stopped):
        return None
    left = np.flatnonzero(np.abs(run.drive[: stopped[0] + 1] - first) > 0.02 * first)
    return float(run.order_time_s[max(int(left[0]) - 1, 0)]) if len(left) else None


def _degrees(angle_rad: float) -> str:
    return f"{abs(math.degrees(angle_rad)):.1f} deg"
