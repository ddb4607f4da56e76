"""Linearised motion of all windows, and its responses to small disturbances.

The response to a disturbance is that of the linearised motion to its change of acceleration along the simulated path.
All disturbances share one linearisation, so hundreds of them cost little more than one simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion.equations_of_motion import rates_by_term
from expdesign.diagnosis.motion.exogenous_inputs import ExogenousInputs, exogenous_inputs
from expdesign.diagnosis.motion.integration import (
    parts_of_step,
    propagated,
    stacked_rates,
    state_jacobian,
    transition_matrices,
)
from expdesign.diagnosis.motion.motion import LinearisedMotion, Motion
from expdesign.diagnosis.motion.sensors import sensor_outputs, simpson_mean
from expdesign.diagnosis.motion.tuning import TUNING
from expdesign.values import Array

INNER, OUTER = {"theta", "term", "gain", "inertia", "asymmetry"}, {"lever", "log", "gyro", "late"}
"""Kinds of effects that change neither exogenous signals nor sensors, and those that change sensors alone."""


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
    return None if differ or not apart < TUNING.newton_tolerance else replace(near, motion=motion)


@dataclass(frozen=True, kw_only=True, eq=False)
class Disturbance:
    """A small disturbance along a path.

    Attributes:
        force: (w, k - 1, n) change of the rates per unit of the disturbance, or None.
        sensor: (w, s, 4) direct change of the sensor outputs, or None.
    """

    force: Array | None
    sensor: Array | None


def disturbance_of(linear: LinearisedMotion, changed: ExtendedModel, per: float) -> Disturbance:
    """The disturbance by a change of effects along the path, divided by `per`."""
    motion = linear.motion
    kinds = {key.split(":")[0] for key in _differing(motion.ship, changed)}
    sensor = force = np.zeros(1)
    if kinds - INNER:
        sensor = sensor_outputs(changed, motion.states, motion.windows, motion.heading_change) - motion.predicted
    if kinds - OUTER:
        known = not kinds - INNER and (
            "u_w" in motion.exogenous or not any(part.reads_air for part in changed.scaled_terms)
        )
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
    if any(key.startswith(("heading", "lever", "log", "gyro", "late")) for key in motion.ship.effects):
        size = 1e-4
        still = sensor_outputs(motion.ship, motion.states, windows)
        for index in range(count):
            states = motion.states + size * moved[..., index]
            result[index] = (sensor_outputs(motion.ship, states, windows) - still) / size
        return result
    for channel, name in enumerate("uvr"):
        result[..., channel] = np.moveaxis(moved[:, :: windows.steps_per_sample, channel], -1, 0)
        if name in windows.derived:
            result[..., channel] = simpson_mean(result[..., channel], windows.rows_per_step)
    rate = result[..., 2]
    result[..., 3] = rate if "r" in windows.derived else simpson_mean(rate, windows.rows_per_step)
    return result
