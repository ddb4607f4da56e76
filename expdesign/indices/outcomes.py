"""The outcomes of a vessel's standard trials, simulated, with their gradients by central differences."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.errors import InputError, NoAnswer
from expdesign.indices.criteria import Circle, Stop, ZigZag
from expdesign.indices.read import read_circle, read_stop, read_zigzag, steered_run
from expdesign.progress import Progress, silent
from expdesign.simulation import Conduct, stopping, turning_circle, zigzag
from expdesign.simulation.helm import steady_ahead
from expdesign.values import Array
from expdesign.vessel import Vessel

PARAMETER_STEP = 1e-3  # relative step of central differences in a parameter
GRADIENT_AGREEMENT = 0.05  # change of a gradient when the step is halved, relative to the outcome's largest gradient


def outcome_gradients(
    vessel: Vessel,
    names: Sequence[str],
    parameters: Sequence[str],
    *,
    speed_mps: float | None = None,
    progress: Progress = silent,
) -> tuple[Array, Array]:
    """Named outcomes (o,) at the nominal model, and their gradients (o, p) by named parameters.

    Args:
        names: keys of `indices.OUTCOMES`.
        speed_mps: approach speed for all parameter values; that of the nominal model when not given.

    Raises:
        InputError: the vessel cannot run a trial, or a name is not an outcome.
        NoAnswer: a trial does not end, or an outcome is not smooth in a parameter.
    """
    speed = float(steady_ahead(vessel, speed_mps).velocity[0])
    theta = vessel.model.parameters

    def found(values: Array) -> Array:
        table = outcomes(vessel, speed_mps=speed, parameters=values, names=tuple(names))
        return np.array([table[name] for name in names])

    base = found(theta)
    slopes, sizes = [], []
    for number, name in enumerate(parameters):
        progress("simulating standard trials with other parameters", number / len(parameters))
        index = vessel.model.names.index(name)
        sizes.append(abs(float(theta[index])) or float(np.median(np.abs(theta[theta != 0]))))
        slopes.append(_slopes(found, theta, index, sizes[-1]))
    coarse, fine = np.array(slopes).transpose(1, 2, 0)  # (o, p) each
    _check_smooth(coarse * sizes, fine * sizes, names, parameters)
    return base, (4 * fine - coarse) / 3


def _slopes(found: Callable[[Array], Array], theta: Array, index: int, size: float) -> list[Array]:
    """Central differences (o,) in one parameter, with the step and with half of it."""
    slopes = []
    for step in (PARAMETER_STEP * size, PARAMETER_STEP * size / 2):
        moved = np.zeros_like(theta)
        moved[index] = step
        slopes.append((found(theta + moved) - found(theta - moved)) / (2 * step))
    return slopes


def _check_smooth(coarse: Array, fine: Array, names: Sequence[str], parameters: Sequence[str]) -> None:
    """Refuse gradients (o, p), as effects of relative changes, that depend on the step."""
    jumps = np.argwhere(np.abs(coarse - fine) > GRADIENT_AGREEMENT * np.abs(fine).max(axis=1, keepdims=True))
    if len(jumps):
        o, p = jumps[0]
        raise NoAnswer(
            f"outcome {names[o]} is not smooth in {parameters[p]}: its derivative by a relative change is "
            f"{coarse[o, p]:.3g} with a step of {PARAMETER_STEP:g} and {fine[o, p]:.3g} with half of that"
        )


OUTCOMES = {
    "advance_m": "advance in the turning circle",
    "transfer_m": "transfer in the turning circle",
    "tactical_diameter_m": "tactical diameter of the turning circle",
    "initial_turning_m": "distance to 10 degrees of heading at 10 degrees of helm",
    "overshoot_10_10_rad": "first overshoot of the 10/10 zig-zag",
    "second_overshoot_10_10_rad": "second overshoot of the 10/10 zig-zag",
    "overshoot_20_20_rad": "first overshoot of the 20/20 zig-zag",
    "stopping_distance_m": "track reach of the stop at full astern",
}
"""Name -> meaning of every outcome."""
ZIGZAGS = (math.radians(10.0), math.radians(20.0))


@dataclass(frozen=True, kw_only=True)
class StandardResults:
    """All standard trials of one vessel at one approach speed."""

    speed_mps: float  # approach speed
    helm: str  # steering actuators, in words
    # circles, zigzags, stops: the trials, starboard before port
    circles: tuple[Circle, ...]
    zigzags: tuple[ZigZag, ...]
    stops: tuple[Stop, ...]
    not_run: tuple[str, ...]  # why a trial could not be run, one sentence each

    @property
    def trials(self) -> tuple[Circle | ZigZag | Stop, ...]:
        """All of them in order."""
        return (*self.circles, *self.zigzags, *self.stops)


def standard_results(
    vessel: Vessel,
    *,
    speed_mps: float | None = None,
    sides: tuple[str, ...] = ("starboard", "port"),
) -> StandardResults:
    """Turning circles, 10/10 and 20/20 zig-zags and the stop of a vessel in calm water.

    Args:
        vessel: with its nominal model.
        speed_mps: approach speed, or None for the speed at 85 % of the engines' power.
        sides: of the first turn.

    Raises:
        InputError: the vessel cannot hold a steady course at that speed.
    """
    approach = steady_ahead(vessel, speed_mps)
    speed = float(approach.velocity[0])
    conduct = Conduct(speed_mps=speed)
    circles, zigzags, stops, not_run = [], [], [], []
    for side in sides:
        try:
            circles.append(simulated_circle(vessel, side=side, conduct=conduct))
        except (InputError, NoAnswer) as error:
            not_run.append(f"turning circle to {side}: {error}")
        for angle in ZIGZAGS:
            try:
                zigzags.append(simulated_zigzag(vessel, angle_rad=angle, side=side, conduct=conduct))
            except (InputError, NoAnswer) as error:
                not_run.append(f"zig-zag {math.degrees(angle):.0f}/{math.degrees(angle):.0f} to {side}: {error}")
    try:
        stops.append(simulated_stop(vessel, conduct=conduct))
    except (InputError, NoAnswer) as error:
        not_run.append(str(error))
    return StandardResults(
        speed_mps=approach.speed_mps,
        helm=approach.helm.description,
        circles=tuple(circles),
        zigzags=tuple(zigzags),
        stops=tuple(stops),
        not_run=tuple(not_run),
    )


def simulated_circle(vessel: Vessel, *, side: str, conduct: Conduct) -> Circle:
    """A simulated turning circle."""
    commands, motion = turning_circle(vessel, side=side, conduct=conduct)
    run = steered_run(vessel, commands, motion, name=f"circle to {side}")
    return read_circle(
        run,
        order_s=0.0,
        course_rad=0.0,
        side=1 if side == "starboard" else -1,
        helm_rad=abs(float(run.helm_rad[-1])),
        speed_mps=float(math.hypot(*motion.velocity[0, :2])),
        current=False,
    )


def simulated_zigzag(vessel: Vessel, *, angle_rad: float, side: str, conduct: Conduct) -> ZigZag:
    """A simulated zig-zag with equal angles of heading and helm."""
    commands, motion = zigzag(vessel, heading_rad=angle_rad, helm_rad=angle_rad, side=side, conduct=conduct)
    degrees = f"{math.degrees(angle_rad):.0f}"
    run = steered_run(vessel, commands, motion, name=f"zig-zag {degrees}/{degrees} to {side}")
    sign = 1 if side == "starboard" else -1
    first = run.first_turned(sign * angle_rad, since_s=0.0, course_rad=0.0)
    second = None if first is None else run.first_turned(-sign * angle_rad, since_s=first, course_rad=0.0)
    return read_zigzag(
        run,
        orders_s=tuple(time for time in (0.0, first, second) if time is not None),
        course_rad=0.0,
        side=sign,
        helm_rad=angle_rad,
        speed_mps=float(math.hypot(*motion.velocity[0, :2])),
        heading_rad=angle_rad,
    )


def simulated_stop(vessel: Vessel, *, conduct: Conduct) -> Stop:
    """A simulated stop at full astern."""
    commands, motion = stopping(vessel, conduct=conduct)
    run = steered_run(vessel, commands, motion, name="full astern")
    found = read_stop(run, order_s=0.0, course_rad=0.0, speed_mps=float(math.hypot(*motion.velocity[0, :2])))
    if found is None:
        raise NoAnswer(f"stopping: vessel {vessel.name!r} keeps its headway")
    return found


def outcomes(
    vessel: Vessel,
    *,
    speed_mps: float | None = None,
    parameters: Array | None = None,
    names: tuple[str, ...] = tuple(OUTCOMES),
) -> dict[str, float]:
    """Named outcomes of the standard trials, for criterion V.

    First turns are to starboard. Outcomes vary continuously with the parameters: orders fall between samples, and
    crossings are interpolated.

    Args:
        speed_mps: approach speed, or None for the speed at 85 % of the engines' power *of these parameters*; give it
            when parameters vary, so that the trial stays the same.
        parameters: (p,) other parameter values, or None for the vessel's.
        names: keys of `OUTCOMES`, in the desired order; only the trials they need are run.

    Raises:
        InputError: the vessel cannot run a trial, or a name is not an outcome.
        NoAnswer: a trial does not end.
    """
    ship = vessel if parameters is None else replace(vessel, model=vessel.model.with_parameters(parameters))
    unknown = [name for name in names if name not in OUTCOMES]
    if unknown:
        raise InputError(f"outcome {unknown[0]!r} is not known, expected some of {', '.join(OUTCOMES)}")
    conduct = Conduct(speed_mps=float(steady_ahead(ship, speed_mps).velocity[0]))
    values: dict[str, float | None] = {}
    if {"advance_m", "transfer_m", "tactical_diameter_m"} & set(names):
        circle = simulated_circle(ship, side="starboard", conduct=conduct)
        values |= {key: getattr(circle, key) for key in ("advance_m", "transfer_m", "tactical_diameter_m")}
    if {"initial_turning_m", "overshoot_10_10_rad", "second_overshoot_10_10_rad"} & set(names):
        ten = simulated_zigzag(ship, angle_rad=ZIGZAGS[0], side="starboard", conduct=conduct)
        first, second = (*ten.overshoots_rad, None, None)[:2]
        values["initial_turning_m"] = ten.initial_turning_m
        values |= {"overshoot_10_10_rad": first, "second_overshoot_10_10_rad": second}
    if "overshoot_20_20_rad" in names:
        twenty = simulated_zigzag(ship, angle_rad=ZIGZAGS[1], side="starboard", conduct=conduct)
        values["overshoot_20_20_rad"] = (*twenty.overshoots_rad, None)[0]
    if "stopping_distance_m" in names:
        values["stopping_distance_m"] = simulated_stop(ship, conduct=conduct).track_reach_m
    return {name: _shown(ship, name, values[name]) for name in names}


def _shown(vessel: Vessel, name: str, value: float | None) -> float:
    if value is None:
        raise NoAnswer(f"vessel {vessel.name!r}: its trial gives no {OUTCOMES[name]}")
    return value
