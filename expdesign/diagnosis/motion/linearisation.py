"""A simulation of all windows as values, its sensor outputs, and its linearisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS, rotated
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion.equations_of_motion import (
    SAMPLES_AT_ONCE,
    parts_of_step,
    propagated,
    rates_by_term,
    stacked_rates,
    state_jacobian,
    transition_matrices,
)
from expdesign.diagnosis.motion.inputs import ExogenousInputs, exogenous_inputs
from expdesign.values import Array
from expdesign.vessel.quantities import SENSOR, TERMS, acts_on

LARGEST_SPEED = 60.0  # state beyond which a simulation has diverged [m/s, rad/s]
NEWTON_TOLERANCE = 1e-8  # correction below which it has converged


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A simulation of all windows."""

    ship: ExtendedModel  # the simulated model
    windows: Windows  # the data it is compared with
    exogenous: ExogenousInputs  # exogenous signals
    states: Array  # (w, k, n) at integrator steps
    heading_change: Array  # (w, k) heading since the start [rad]
    predicted: Array  # (w, s, 4) sensor outputs

    @cached_property
    def ends(self) -> Array:
        """(2, w, k - 1, n) states at the beginning and at the end of every step; components lie apart in memory."""
        components = np.moveaxis(self.states, -1, 0)
        return np.moveaxis(np.stack([components[..., :-1], components[..., 1:]], axis=1), 0, -1)

    @property
    def error(self) -> Array:
        """(w, s, 4) measured less simulated, nan where not measured."""
        return np.asarray(self.windows.measured - self.predicted)

    @property
    def diverged(self) -> bool:
        """Whether a speed exceeds `LARGEST_SPEED`."""
        return bool(self.diverged_windows.any())

    @property
    def diverged_windows(self) -> NDArray[np.bool_]:
        """(w,) in which windows it does."""
        return np.asarray(~(np.abs(self.states).max(axis=(1, 2)) < LARGEST_SPEED))


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearisedMotion:
    """The linearised motion along a simulation."""

    motion: Motion  # the simulation
    transition: Array  # (w, k - 1, n, n) transition over each step
    forcing: Array  # (w, k - 1, n, n) effect of a constant acceleration over each step
    path_rates: Array  # (2, w, k - 1, n) rates along the path at both ends of every step, with its inputs

    @cached_property
    def mean_rates(self) -> Array:
        """(w, k - 1, n) means of the rates at both ends."""
        return np.asarray(self.path_rates.mean(axis=0))

    def selected(self, keep: NDArray[np.bool_]) -> LinearisedMotion:
        """Only some of the windows, by a mask (w,)."""
        motion = replace(
            self.motion,
            windows=self.motion.windows.selected(keep),
            exogenous=ExogenousInputs({name: values[keep] for name, values in self.motion.exogenous.items()}),
            states=self.motion.states[keep],
            heading_change=self.motion.heading_change[keep],
            predicted=self.motion.predicted[keep],
        )
        return LinearisedMotion(
            motion=motion,
            transition=self.transition[keep],
            forcing=self.forcing[keep],
            path_rates=self.path_rates[:, keep],
        )


def sensor_outputs(ship: ExtendedModel, states: Array, windows: Windows, heading_change: Array | None = None) -> Array:
    """(w, s, 4) sensor outputs.

    Args:
        states: (w, k, n) at integrator steps.
        windows: measured channels and times.
        heading_change: (w, k) heading since the start; integrated from the yaw rate when None.
    """
    u, v, r = np.moveaxis(states[:, :: windows.steps_per_sample, :3], -1, 0)
    finer = windows.rows_per_step
    u, v = u - ship.get("lever:starboard") * r, v + ship.get("lever:forward") * r
    headings = None if heading_change is None else heading_change[:, :: windows.steps_per_sample]
    from_position = {"u", "v"} & set(windows.derived)
    if from_position:
        if headings is None:
            u, v = simpson_mean(u, finer), simpson_mean(v, finer)
        else:
            u, v = simpson_mean_of_track(u, v, headings, finer)
    u, v = rotated((u, v), ship.get("heading_bias"))  # axes anticlockwise of the ship's: surge leaks into sway
    if not from_position:
        u, v = _with_faults(ship, "u", u), _with_faults(ship, "v", v)
    if from_position and ship.get("late:psi"):
        u, v = rotated((u, v), _turn(ship.get("late:psi"), r, headings, windows))
    channels = {"u": u, "v": v, "r": _with_faults(ship, "r", r), "psi_rate": simpson_mean(r, finer)}
    if headings is not None and finer == 1:
        channels["psi_rate"] = heading_differences(headings, channels["psi_rate"], windows)
    if "r" in windows.derived:
        channels["r"] = channels["psi_rate"]
    late = LATE | {"r": ("psi",)} if "r" in windows.derived else LATE
    for name, keys in late.items():
        delay = sum(ship.get(f"late:{key}") for key in keys)
        if delay:
            channels[name] = _shifted(channels[name], delay / windows.sample_s)
    if from_position and ship.get("late:position"):
        turn = _turn(ship.get("late:position"), r, headings, windows)
        channels["u"], channels["v"] = rotated((channels["u"], channels["v"]), -turn)
    return np.stack(list(channels.values()), axis=-1)


def ship_velocities(ship: ExtendedModel, predicted: Array) -> Array:
    """(w, 3) velocities of the ship for sensor outputs (w, 3), without delays."""
    gains, offsets = np.transpose([ship.gain_and_offset(name) for name in OUTPUTS])
    u, v, r = ((predicted - offsets) / gains).T
    u, v = rotated((u, v), -ship.get("heading_bias"))
    return np.stack([u + ship.get("lever:starboard") * r, v - ship.get("lever:forward") * r, r], axis=-1)


def _with_faults(ship: ExtendedModel, signal: str, true: Array) -> Array:
    gain, offset = ship.gain_and_offset(signal)
    return gain * true + offset


LATE = {"u": ("u", "position"), "v": ("v", "position"), "r": ("r",), "psi_rate": ("psi",)}
"""Delays that shift a channel; a yaw rate from the heading has the heading's."""


def heading_differences(heading_change: Array, otherwise: Array, windows: Windows) -> Array:
    """Central differences (w, s) of a heading; at the ends the given values."""
    result = otherwise.copy()
    result[:, 1:-1] = (heading_change[:, 2:] - heading_change[:, :-2]) / (2 * windows.sample_s)
    return result


def simpson_mean(values: Array, finer: int = 1) -> Array:
    """Central differences that belong to a velocity (..., w, s): its mean over two samples, by Simpson's rule.

    Args:
        values: at instants of comparison.
        finer: samples of the differences between two of these instants.
    """
    result = values.copy()
    bend = values[..., :-2] - 2 * values[..., 1:-1] + values[..., 2:]
    result[..., 1:-1] += bend / (6 * finer**2)
    return result


def simpson_mean_of_track(u: Array, v: Array, heading: Array, finer: int = 1) -> tuple[Array, Array]:
    """Central differences of positions: the mean velocity over two samples, along the axes of the middle one.

    The ship turns meanwhile, so this differs from the mean of u and v.
    """
    north, east = (simpson_mean(part, finer) for part in rotated((u, v), heading))
    return rotated((north, east), -heading)


def _turn(delay_s: float, r: Array, headings: Array | None, windows: Windows) -> Array:
    """(w, s) turn of the ship since as long ago as a delay; at the present rate where no heading tells it [rad]."""
    if headings is None:
        return r * delay_s
    then = np.arange(headings.shape[1]) - delay_s / windows.sample_s
    known = (then >= 0) & (then <= headings.shape[1] - 1)
    return np.where(known, headings - _shifted(headings, delay_s / windows.sample_s), r * delay_s)


def _shifted(values: Array, samples: float) -> Array:
    """Delayed by a number of samples, with linear interpolation; before the window, its first value."""
    place = np.clip(np.arange(values.shape[1]) - samples, 0, values.shape[1] - 1)
    low = np.floor(place).astype(int)
    share = place - low
    high = np.minimum(low + 1, values.shape[1] - 1)
    return np.asarray(values[:, low] * (1 - share) + values[:, high] * share)


# Linearised motion of all windows, and its responses to small disturbances.
#
# The response to a disturbance is that of the linearised motion to its change of acceleration along the simulated path.
# All disturbances share one linearisation, so hundreds of them cost little more than one simulation.

TURNS = "heading_bias"  # the effect of a sensor that also turns current and wind, where the heading is the compass's


def linearise(motion: Motion) -> LinearisedMotion:
    """Transition matrices from finite differences of the rates, all steps at once."""
    exogenous = motion.exogenous.without_last_step
    path_rates = stacked_rates(motion.ship, motion.ends, exogenous)
    jacobian = state_jacobian(motion.ship, motion.ends, exogenous).mean(axis=0)
    step_s = motion.windows.step_s
    transition, forcing = transition_matrices(jacobian, step_s, parts_of_step(motion.ship, step_s))
    return LinearisedMotion(motion=motion, transition=transition, forcing=forcing, path_rates=path_rates)


def linearised_like(motion: Motion, near: LinearisedMotion | None) -> LinearisedMotion | None:
    """The linearisation of a motion along the path of another one, with the same; None where path or ship differ.

    Ships are the same here if all effects in which they differ are zero, so that the other has none of them.
    """
    if near is None or near.motion.states.shape != motion.states.shape:
        return None
    differ = any(motion.ship.get(key) != near.motion.ship.get(key) for key in _differing(motion.ship, near.motion.ship))
    apart = np.abs(motion.states - near.motion.states).max()
    return None if differ or not apart < NEWTON_TOLERANCE else replace(near, motion=motion)


@dataclass(frozen=True, kw_only=True, eq=False)
class Disturbance:
    """A small disturbance along a path."""

    force: Array | None  # (w, k - 1, n) change of the rates per unit of the disturbance, or None
    sensor: Array | None  # (w, s, 4) direct change of the sensor outputs, or None


def disturbance_of(linear: LinearisedMotion, changed: ExtendedModel, per: float) -> Disturbance:
    """The disturbance by a change of effects along the path, divided by `per`."""
    motion = linear.motion
    keys = _differing(motion.ship, changed)
    terms_alone = all(acts_on(key, TERMS) for key in keys)
    sensor = force = np.zeros(1)
    if not terms_alone:
        sensor = sensor_outputs(changed, motion.states, motion.windows, motion.heading_change) - motion.predicted
    if not all(acts_on(key, SENSOR) and key != TURNS for key in keys):
        known = terms_alone and ("u_w" in motion.exogenous or not any(part.reads_air for part in changed.scaled_terms))
        exogenous = motion.exogenous if known else _exogenous_after(motion, changed)
        exogenous = exogenous.without_last_step
        force = stacked_rates(changed, motion.ends, exogenous).mean(axis=0) - linear.mean_rates
    return Disturbance(
        force=force / per if np.any(force) else None,
        sensor=sensor / per if np.any(sensor) else None,
    )


def _exogenous_after(motion: Motion, changed: ExtendedModel) -> ExogenousInputs:
    return exogenous_inputs(changed, motion.windows, known=(motion.ship, motion.exogenous))


def term_disturbances(linear: LinearisedMotion, keys: Sequence[str]) -> dict[str, Disturbance]:
    """Effect -> disturbance per unit, exactly, for those that add to a term along the path: its regressor.

    Left out are other effects, and terms that read a wind or a yaw moment which the path does not have.
    """
    motion, ship = linear.motion, linear.motion.ship
    units = {key: ship.unit_terms[key] for key in keys if key in ship.unit_terms}
    parts = {
        key: part
        for key, part in units.items()
        if not (part.reads_air and "u_w" not in motion.exogenous)
        and not (part.reads_turn and ship.get("asymmetry") and key.startswith("term:"))
    }
    if not parts:
        return {}
    exogenous = motion.exogenous.without_last_step
    found = rates_by_term(ship, tuple(parts.values()), tuple(np.moveaxis(motion.ends, -1, 0)), exogenous)
    return {
        key: Disturbance(force=np.stack([(ends[0] + ends[1]) / 2 for ends in rates], axis=-1), sensor=None)
        for key, rates in zip(parts, found, strict=True)
    }


def _differing(one: ExtendedModel, other: ExtendedModel) -> set[str]:
    """Effects that two ships do not share."""
    keys = {*one.effects, *other.effects}
    return {key for key in keys if one.effects.get(key) != other.effects.get(key)}


def responses(linear: LinearisedMotion, disturbances: Sequence[Disturbance]) -> Array:
    """(c, w, s, 4) responses of the channels to each disturbance, from undisturbed initial states.

    Responses of an unstable motion may overflow. Channels lie apart in memory.
    """
    forces = {index: item.force for index, item in enumerate(disturbances) if item.force is not None}
    result = channels_apart(len(disturbances), linear.motion.predicted.shape[:2])
    if len(forces) < len(disturbances):
        result[:] = 0.0
    if forces:
        with np.errstate(over="ignore", invalid="ignore"):
            result[list(forces)] = _shown(linear.motion, _driven(linear, list(forces.values())))
    for index, disturbance in enumerate(disturbances):
        if disturbance.sensor is not None:
            result[index] += disturbance.sensor
    return np.nan_to_num(result, copy=False, nan=0.0, posinf=0.0, neginf=0.0)


def _driven(linear: LinearisedMotion, forces: Sequence[Array]) -> Array:
    """(w, k, n, c) states from rest under each force (w, k - 1, n)."""
    w, k, n = linear.motion.states.shape
    path = np.empty((w, k, n, len(forces)))
    path[:, 0] = 0.0
    np.matmul(linear.forcing, np.stack(forces, axis=-1), out=path[:, 1:])
    for step in range(1, k - 1):
        path[:, step + 1] += linear.transition[:, step] @ path[:, step]
    return path


def start_responses(motion: Motion, transition: Array) -> Array:
    """(3, w, s, 4) responses to unit initial velocities of every window; roll begins at rest."""
    w, k, n = motion.states.shape
    still = np.zeros((w, k - 1, n))
    with np.errstate(over="ignore", invalid="ignore"):
        paths = [propagated(transition, np.tile(unit, (w, 1)), still) for unit in np.eye(n)[:3]]
        return _shown(motion, np.stack(paths, axis=-1))


def channels_apart(count: int, shape: tuple[int, ...]) -> Array:
    """(count, w, s, 4), not filled, for windows of shape (w, s): the channels lie apart in memory."""
    return np.moveaxis(np.empty((4, count, *shape)), 0, -1)


def _shown(motion: Motion, moved: Array) -> Array:
    """(c, w, s, 4) changes of the channels for changes of the states (w, k, n, c).

    Sensors are nearly linear in the states.
    """
    windows, count = motion.windows, moved.shape[-1]
    result = channels_apart(count, motion.predicted.shape[:2])
    if any(acts_on(key, SENSOR) for key in motion.ship.effects):
        size = 1e-4
        still = sensor_outputs(motion.ship, motion.states, windows)
        at_once = max(1, SAMPLES_AT_ONCE // motion.states[..., 0].size)
        for low in range(0, count, at_once):
            states = motion.states + size * np.moveaxis(moved[..., low : low + at_once], -1, 0)
            seen = sensor_outputs(motion.ship, states.reshape(-1, *states.shape[2:]), windows)
            result[low : low + at_once] = (seen.reshape(-1, *still.shape) - still) / size
        return result
    for channel, name in enumerate("uvr"):
        result[..., channel] = np.moveaxis(moved[:, :: windows.steps_per_sample, channel], -1, 0)
        if name in windows.derived:
            result[..., channel] = simpson_mean(result[..., channel], windows.rows_per_step)
    rate = result[..., 2]
    result[..., 3] = rate if "r" in windows.derived else simpson_mean(rate, windows.rows_per_step)
    return result
