"""Measured standard trials: the kind of a run, the times of its orders, and its indices.

The helm of a standard trial is held at one angle to each side; what the helmsman does on the approach is no order. An
order is timed where the rudder leaves for such an angle. A recorded input stands from its sample to the next, so a step
begins at the sample that first shows it; where a logger reads the rudder, it began up to one sample earlier.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.errors import InputError
from expdesign.indices.criteria import Circle, Stop, ZigZag
from expdesign.indices.read import SIDE_NAMES, SteeredRun, orders, read_circle, read_stop, read_zigzag
from expdesign.signals import Batch
from expdesign.simulation import Helm, steady_ahead
from expdesign.vessel import Vessel

# speed by the root of the length [m^0.5/s] (a Froude number of 0.016) below which a ship is not under way
UNDER_WAY = 0.05
HELD_LENGTHS = 1.0  # ship lengths sailed while the helm is held at an angle of the trial, once to each side
TOUCHED = 0.1  # share of the longest stretch of held helm below which a shorter one, or a gap in one, is steering
LEAST_MOVE = 0.2  # share of its final angle by which the helm moves with the first order at least
STEADY_APPROACH = 0.05  # change of speed, by the speed, over the last ship length of a steady approach at most
CURRENT = 0.02  # uniform current, by the approach speed, that is told when it is removed
AT_REST = 0.02  # surge speed at the end of a record, by the approach speed, up to which the ship has stopped
TOLD_CURRENT_MPS = 0.1  # current by which is told what one that nobody removed does to distances
LEAST_HELM_RAD = math.radians(2.0)
GONE_ON = 5.0  # ship lengths ahead after a stop, from which a record is of more than one trial
TURNED_RAD = math.radians(80.0)
ENGINE_HELD = 0.5  # change of the engine order, by that of the approach, within which a turn's is one; shafts slow down
THRUSTER_STILL = 0.1  # share of a tunnel thruster's largest order below which it stands still
ORDER_HELD = 0.1  # change, by its median, of an engine order that is held for half a ship length
SELDOM = 0.2  # share of a turn in which either may be otherwise
Samples = NDArray[np.intp]


@dataclass(frozen=True, kw_only=True)
class NotStandard:
    """A run that is no standard trial."""

    name: str  # of the run
    reason: str  # one phrase


Found = Circle | ZigZag | Stop | NotStandard
WIDEST_SWING_RAD = math.pi / 2  # heading, from the approach course, to which a zig-zag goes at most


def measured_trial(vessel: Vessel, batch: Batch, *, reference_forward_m: float = 0.0) -> Found:
    """The indices of one measured run: a zig-zag, a turning circle or a stop.

    Args:
        vessel: for length, actuators, and the side to which its helm turns it.
        batch: with pose and velocity.
        reference_forward_m: how far forward of amidships the recorded positions and velocities are [m].

    Raises:
        InputError: positions or headings are not recorded.
    """
    if batch.pose is None or not np.isfinite(batch.pose).all():
        raise InputError(f"{batch.name}: has no complete positions and headings, which the indices need")
    run = _steered_run(vessel, batch, reference_forward_m)
    held = _held(run)
    turned = float(np.ptp(run.pose[:, 2]))
    one_sided = len({stretch.level_rad > 0 for stretch in held}) == 1
    still = one_sided and held[0].order_s is None and turned < TURNED_RAD
    if held and not still:
        trial = run.until(held[-1].last)
        found = (_late if held[0].order_s is None else _steered)(vessel, trial, held)
        pushed = _pushed(vessel, batch, trial, held[0].order_s)
        return NotStandard(name=batch.name, reason=pushed) if pushed and not isinstance(found, NotStandard) else found
    helm = "no helm is held over"
    if still:
        helm = f"the helm stays at {_degrees(held[0].level_rad)} and the heading changes by {_degrees(turned)} only"
    astern = _astern(run)
    if astern is None:
        return NotStandard(name=batch.name, reason=f"{helm}, and the engines are not ordered to stop")
    course, speed, remarks = _approach(run, astern)
    stop = read_stop(run, order_s=astern, course_rad=course, speed_mps=speed, rest_mps=AT_REST * speed)
    if stop is None or speed < _slow(run):
        last = f"makes {run.velocity[-1, 0]:.2g} m/s ahead where the record ends"
        return NotStandard(name=batch.name, reason=f"{helm}, and the ship {last}")
    gone_on = _ahead_again(run, astern + stop.time_s)
    if gone_on > GONE_ON:
        reason = (
            f"the ship stops after {stop.time_s + astern - run.time_s[0]:.0f} s and then sails {gone_on:.0f} ship "
            "lengths ahead, expected one trial in a file"
        )
        return NotStandard(name=batch.name, reason=reason)
    return replace(stop, remarks=(*remarks, _over_ground("track reach and head reach", stop.time_s)))


def _steered_run(vessel: Vessel, batch: Batch, forward_m: float) -> SteeredRun:
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
        tolerance_s=batch.sample_time_s,
        **orders(Helm(vessel=vessel), batch.input_names, batch.inputs),
    )


@dataclass(frozen=True, kw_only=True)
class _Held:
    """A stretch over which the helm is held."""

    order_s: float | None  # when the helm was ordered there, or None where the record begins with the helm over
    level_rad: float  # the angle held
    last: int  # last sample of the stretch


def _held(run: SteeredRun) -> tuple[_Held, ...]:
    """Stretches of held helm in time order; none where the helm is steered or stays amidships."""
    stretches = _stretches(run)
    if not stretches or 2 * sum(map(len, stretches)) < stretches[-1][-1] - stretches[0][0]:
        return ()
    levels = [float(np.median(run.helm_rad[part])) for part in stretches]
    orders_s = [_first_order(run, int(stretches[0][0]), levels[0])]
    for (one, other), (before, after) in zip(pairwise(stretches), pairwise(levels), strict=True):
        turned = before * after < 0  # else the helm was let go between, and the run will be refused
        orders_s.append(
            _left(run, int(one[-1]), int(other[0]), before, after) if turned else float(run.time_s[other[0]])
        )
    return tuple(
        _Held(order_s=order, level_rad=level, last=int(part[-1]))
        for order, level, part in zip(orders_s, levels, stretches, strict=True)
    )


def _stretches(run: SteeredRun) -> list[Samples]:
    """Samples of every stretch in which the helm is held at the angle of its side, but for short interruptions.

    That is the largest angle held while the ship sails her own length; a steering helmsman moves on sooner.
    """
    helm = run.helm_rad
    length_s = run.length_m / max(run.median_speed_mps, 1e-9)
    held = max(3, math.ceil(HELD_LENGTHS * length_s / run.sample_time_s))
    if held > len(helm):
        return []
    top, bottom = (f(helm, held) for f in (scipy.ndimage.maximum_filter1d, scipy.ndimage.minimum_filter1d))
    middle = (top + bottom) / 2
    narrow = top - bottom <= 2 * np.minimum(LEAST_HELM_RAD, np.abs(middle) / 5)
    levels = middle[narrow & (np.abs(middle) >= LEAST_HELM_RAD)]
    largest = np.abs(levels).max(initial=0.0)
    near = min(LEAST_HELM_RAD, largest / 5)
    sides = np.zeros(len(helm), dtype=int)
    for side in (1, -1):
        level = (side * levels).max(initial=0.0)
        if level > largest / 2:
            level = np.median(side * helm[np.abs(side * helm - level) <= near])  # noise raises the largest
            sides[np.abs(side * helm - level) <= near] = side
    parts = [part for part in np.split(np.arange(len(sides)), np.flatnonzero(np.diff(sides)) + 1) if sides[part[0]]]
    shortest = TOUCHED * max(map(len, parts), default=0)
    stretches: list[Samples] = []
    for part in (part for part in parts if len(part) >= shortest):
        same = bool(stretches) and sides[stretches[-1][0]] == sides[part[0]]
        if same and part[0] - stretches[-1][-1] <= shortest:
            stretches[-1] = np.concatenate([stretches[-1], part])
        else:
            stretches.append(part)
    return stretches


def _first_order(run: SteeredRun, arrived: int, level: float) -> float | None:
    """When the helm left for the first angle that is held, or None where the record does not show it.

    The move reaches back to where the helm was about as long before its beginning as it took.
    """
    way = run.helm_rad / level
    for length in range(1, arrived):
        begin, earlier = arrived - length, max(arrived - 2 * length, 0)
        moved = way[arrived] - way[begin]
        if moved > LEAST_MOVE and abs(way[begin] - way[earlier]) < moved / 4:
            before = float(np.median(way[max(arrived - math.ceil(1.5 * length), 0) : arrived - int(1.2 * length) + 1]))
            close = np.flatnonzero(way[earlier:arrived] < before + moved / 10)
            return _left(run, earlier + int(close[-1]), arrived, before * level, level)
    return None


def _left(run: SteeredRun, first: int, arrived: int, before: float, after: float) -> float:
    """When the helm left one angle for another, at a constant rate between two samples.

    Inputs stand from their sample to the next, so that a change between two samples lies at the second, and a ramp
    gives means over samples. Its middle is the mean time of the changes; its duration follows from their variance, of
    which a sample before and one after the ramp, filled in part, add a sixth of a squared sample.
    """
    more = 1 + (arrived - first) // 4
    first, last = max(first - more, 0), min(arrived + more, len(run.helm_rad) - 1)
    way = np.clip((run.helm_rad[first : last + 1] - before) / (after - before), 0.0, 1.0)
    way[0], way[-1] = 0.0, 1.0
    time, share = run.time_s[first + 1 : last + 1], np.diff(way)
    middle = float(share @ time)
    width_s = math.sqrt(max(0.0, 12 * float(share @ (time - middle) ** 2) - 2 * run.sample_time_s**2))
    return max(float(run.time_s[0]), middle - width_s / 2)


def _pushed(vessel: Vessel, batch: Batch, run: SteeredRun, order_s: float | None) -> str:
    """Why a run with held helm is no standard turn: what else drives the ship round, or ""."""
    turn = slice(int(np.searchsorted(run.time_s, run.time_s[0] if order_s is None else order_s)), len(run.time_s))
    for one in vessel.actuators:
        if one.kind == "tunnel" and one.signals[0] in batch.input_names:
            pushes = np.abs(batch.inputs[: len(run.time_s), batch.input_names.index(one.signals[0])][turn])
            if np.mean(pushes > THRUSTER_STILL * one.limits[0].high) > SELDOM:
                return f"the tunnel thruster {one.signals[0]} pushes while the helm is held"
    ordered = float(np.median(run.drive[max(turn.start - 2, 0) : turn.start + 3]))
    other = np.abs(run.drive[turn] - ordered) > ENGINE_HELD * abs(ordered)
    if np.mean(other) <= SELDOM:
        return ""
    low, high = np.quantile(run.drive[turn], [0.05, 0.95]).tolist()
    return f"the engine order changes between {low:.2g} and {high:.2g} while the helm is held, expected one order"


def _steered(vessel: Vessel, run: SteeredRun, held: tuple[_Held, ...]) -> Found:
    times = tuple(stretch.order_s for stretch in held if stretch.order_s is not None)
    course, speed, approach = _approach(run, times[0])
    if speed < _slow(run):
        return NotStandard(name=run.name, reason=f"the ship makes {speed:.3g} m/s when the helm is ordered")
    swung = run.at(times[1] if len(times) > 1 else float(run.time_s[-1]))[2] - course
    side = 1 if swung > 0 else -1
    remarks = approach + _against(vessel, side, held[0])
    if len(held) == 1:
        if abs(swung) < TURNED_RAD:
            reason = f"one helm order, and the heading changes by {_degrees(swung)} only"
            return NotStandard(name=run.name, reason=reason)
        size = abs(held[0].level_rad)
        circle = read_circle(
            run, order_s=times[0], course_rad=course, side=side, helm_rad=size, speed_mps=speed, current=True
        )
        half = run.first_turned(side * math.pi, since_s=times[0], course_rad=course)
        half_turn_s = (float(run.time_s[-1]) if half is None else half) - times[0]
        return replace(circle, remarks=(*remarks, *_removed(circle, half_turn_s)))
    if reason := _unlike(held):
        return NotStandard(name=run.name, reason=reason)
    found = read_zigzag(run, orders_s=times, course_rad=course, side=side, helm_rad=_size(held), speed_mps=speed)
    swings = [execute.heading_rad for execute in found.executes[1:]]
    if any(one * other >= 0 for one, other in pairwise(swings)) or found.heading_rad < math.radians(0.5):
        return NotStandard(name=run.name, reason="the heading does not swing to both sides of the approach course")
    if reason := _too_far(found):
        return NotStandard(name=run.name, reason=reason)
    return replace(found, remarks=remarks)


def _over_ground(distances: str, time_s: float) -> str:
    """A remark on distances over ground: what a current that is not known does to them in this time."""
    shift = TOLD_CURRENT_MPS * time_s
    return (
        f"no current is taken out of {distances}, for which a circle of 540 deg is needed: "
        f"{TOLD_CURRENT_MPS:g} m/s of it changes them by up to {shift:.2g} m"
    )


def _removed(circle: Circle, half_turn_s: float) -> tuple[str, ...]:
    """A remark on the current that was taken out, where it matters, or that it was not.

    Args:
        half_turn_s: time from the order to 180 degrees of turn, or to the end of the record [s].
    """
    if circle.current_north_mps is None:
        return (_over_ground("advance, transfer and tactical diameter", half_turn_s),)
    flow = math.hypot(circle.current_north_mps or 0.0, circle.current_east_mps or 0.0)
    if flow <= CURRENT * (circle.speed_mps or math.inf):
        return ()
    return (f"a drift of {flow:.2g} m/s is taken for a uniform current and removed",)


def with_drift_of_circles(seen: Sequence[Found]) -> tuple[Found, ...]:
    """Runs measured together, with a remark on all that are over ground where circles show a current."""
    drifts = [
        math.hypot(one.current_north_mps or 0.0, one.current_east_mps or 0.0)
        for one in seen
        if isinstance(one, Circle) and one.current_north_mps is not None
    ]
    drift_mps = float(np.median(drifts)) if drifts else 0.0

    def told(one: Found) -> Found:
        if isinstance(one, (Circle, NotStandard)) or drift_mps <= CURRENT * (one.speed_mps or math.inf):
            return one
        what = "speed, initial turning, and limits by L/V" if isinstance(one, ZigZag) else "speed and distances"
        remark = (
            f"{what} are over ground: circles of these data drift by {drift_mps:.2g} m/s, which is not taken out, "
            f"{100.0 * drift_mps / (one.speed_mps or math.inf):.0f} % of the approach speed"
        )
        return replace(one, remarks=(*one.remarks, remark))

    return tuple(told(one) for one in seen)


def _late(vessel: Vessel, run: SteeredRun, held: tuple[_Held, ...]) -> Found:
    """What a record shows that begins with the helm over."""
    times = tuple(stretch.order_s for stretch in held if stretch.order_s is not None)
    begins = "the record begins with the helm over"
    if not times:
        turned = float(run.pose[-1, 2] - run.pose[0, 2])
        side = 1 if turned > 0 else -1
        circle = read_circle(
            run, order_s=float(run.time_s[0]), course_rad=float(run.pose[0, 2]), side=side,
            helm_rad=abs(held[0].level_rad), speed_mps=None, current=True,
        )  # fmt: skip
        if circle.steady_diameter_m is None:
            reason = f"{begins} and turns by {_degrees(turned)}, expected 270 deg or more for a steady diameter"
            return NotStandard(name=run.name, reason=reason)
        remark = f"{begins}: advance, transfer and tactical diameter, which count from the order, cannot be had"
        return replace(
            circle, advance_m=None, transfer_m=None, tactical_diameter_m=None, initial_turning_m=None, tolerance_m=0.0,
            remarks=(remark, *_against(vessel, side, held[0])),
        )  # fmt: skip
    if len(times) == 1:
        return NotStandard(name=run.name, reason=f"{begins} and shows one reversal, expected two or more")
    if reason := _unlike(held):
        return NotStandard(name=run.name, reason=reason)
    headings = [float(run.at(time)[2]) for time in times]
    middle = float(np.mean(headings[::2]) + np.mean(headings[1::2])) / 2
    side = 1 if headings[1] > headings[0] else -1
    found = read_zigzag(run, orders_s=times, course_rad=middle, side=side, helm_rad=_size(held), speed_mps=None)
    if reason := _too_far(found):
        return NotStandard(name=run.name, reason=reason)
    remark = (
        f"{begins}: approach course and speed and the numbers of the overshoots cannot be had; those from the second "
        "recorded reversal on are given, and headings are from the middle of the swings"
    )
    remarks = (remark, *_against(vessel, side, held[1]))
    return replace(found, side="", initial_turning_m=None, tolerance_m=0.0, remarks=remarks)


def _unlike(held: tuple[_Held, ...]) -> str:
    """Why stretches of held helm are none of a zig-zag, or ""."""
    if any(one.level_rad * other.level_rad > 0 for one, other in pairwise(held)):
        return "the helm is held over to one side, let go, and held over to the same side, expected one trial in a file"
    sizes = np.abs([stretch.level_rad for stretch in held])
    if sizes.max() > 1.3 * sizes.min():
        return f"the helm is ordered to different angles, {_degrees(sizes.min())} and {_degrees(sizes.max())}"
    return ""


def _too_far(found: ZigZag) -> str:
    """Why a ship turned too far for a zig-zag before the helm was reversed, or ""."""
    furthest = max(abs(execute.heading_rad) for execute in found.executes)
    if furthest <= WIDEST_SWING_RAD:
        return ""
    turned = f"the ship turned by {_degrees(furthest)} before the helm was reversed"
    return f"{turned}, expected {_degrees(WIDEST_SWING_RAD)} or less in a zig-zag: are these turning circles?"


def _size(held: tuple[_Held, ...]) -> float:
    """Half the angle between the helm to starboard and to port, wherever amidships is [rad]."""
    return float(np.ptp([stretch.level_rad for stretch in held])) / 2


def _against(vessel: Vessel, side: int, held: _Held) -> tuple[str, ...]:
    """A remark where the ship turns to the other side than the vessel's model does with this helm."""
    try:
        sense = steady_ahead(vessel).starboard
    except InputError:  # the model cannot be trimmed, so nobody knows how it turns
        return ()
    if sense * side * held.level_rad >= 0:
        return ()
    return (
        f"the ship turns to {SIDE_NAMES[side]} with helm that turns the vessel of the file to {SIDE_NAMES[-side]}: "
        "is the sign of the recorded helm right?",
    )


def _approach(run: SteeredRun, order_s: float) -> tuple[float, float, tuple[str, ...]]:
    """Mean heading and speed over the last ship length before an order, or what of it was recorded; and remarks."""
    speeds = np.hypot(*run.velocity[:, :2].T)
    before = np.flatnonzero(run.time_s <= order_s)
    last = float(speeds[before[-1]])
    length_s = run.length_m / max(last, 1e-9)
    stretch = before[run.time_s[before] >= min(order_s - length_s, run.time_s[before[-1]])]
    recorded = order_s - run.time_s[0]
    remarks = []
    if recorded < 0.99 * length_s:
        remarks.append(f"{recorded / length_s:.1f} ship lengths of approach are recorded, expected 1 or more")
    third = max(len(stretch) // 3, 1)
    start, end = (float(speeds[part].mean()) for part in (stretch[:third], stretch[-third:]))
    if abs(end - start) > STEADY_APPROACH * (end + start) / 2:
        remarks.append(f"the approach is not steady: {start:.3g} m/s becomes {end:.3g} m/s over the last ship length")
    return float(run.pose[stretch, 2].mean()), float(speeds[stretch].mean()), tuple(remarks)


def _slow(run: SteeredRun) -> float:
    return UNDER_WAY * math.sqrt(run.length_m)


def _astern(run: SteeredRun) -> float | None:
    """When the engines leave the last order that they held for one that is not ahead; the first, where they held none.

    An earlier change of a speed ahead, to that of the approach, is no order to stop.
    """
    stopped = np.flatnonzero(run.drive <= 0)
    if not len(stopped) or not stopped[0]:
        return None
    drive = run.drive[: stopped[0] + 1]
    held = max(3, math.ceil(run.length_m / 2 / max(run.median_speed_mps, 1e-9) / run.sample_time_s))
    begin = 0
    if held < len(drive):
        windows = np.lib.stride_tricks.sliding_window_view(drive, held)
        steady = np.flatnonzero(np.ptp(windows, axis=1) <= ORDER_HELD * np.median(windows, axis=1))
        begin = int(steady[-1]) if len(steady) else 0
    first = float(np.median(drive[begin : begin + max(3, len(run.drive) // 200)]))
    left = np.flatnonzero(np.abs(drive[begin:] - first) > 0.02 * first)
    return float(run.time_s[begin + left[0]]) if first > 0 and len(left) else None


def _ahead_again(run: SteeredRun, since_s: float) -> float:
    """Ship lengths that the ship goes ahead after a time."""
    surge = run.velocity[run.time_s > since_s, 0]
    return float(np.maximum(surge, 0.0).sum() * run.sample_time_s / run.length_m)


def _degrees(angle_rad: float) -> str:
    return f"{abs(math.degrees(angle_rad)):.1f} deg"
