"""From a specification to a primitive: commands within limits, and the simulated motion."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress

import numpy as np

from expdesign.dictionary.families import FAMILIES
from expdesign.dictionary.spec import Excitation, Family, Primitive, PrimitiveSpec
from expdesign.dictionary.trim import STEADY_CHANGE, drift, lost, motion_text, reach_text, trim
from expdesign.errors import InputError, NoAnswer, SpeedOutOfReach, UnknownName, Unreachable
from expdesign.signals import Commands
from expdesign.simulation import simulate
from expdesign.values import Array, sealed
from expdesign.vessel import (
    NUMPY,
    Vessel,
    by_force,
    commands_for,
    generalised_force,
    pushed_everywhere,
    required_push,
    within_limits,
)

# deviation, as a share of the largest desired speed or yaw rate, above which a primitive is reported
REPORTED_DEVIATION = 0.1
DRIFT_STEPS = 4  # of a sample, in which the sway of ships that drift is integrated
FOLLOWED_SAMPLES = 300_000  # samples of desired velocities whose commands are found at a time


def family(name: str) -> Family:
    """A manoeuvre family by name.

    Raises:
        UnknownName: there is none.
    """
    for candidate in FAMILIES:
        if candidate.name == name:
            return candidate
    raise UnknownName("manoeuvre family", name, known=[candidate.name for candidate in FAMILIES])


def build_dictionary(vessel: Vessel, specs: Iterable[PrimitiveSpec]) -> tuple[Primitive, ...]:
    """All primitives of the specifications, in order; commands of desired velocities are found for many at a time."""
    requests = tuple(specs)
    followed = _followed(vessel, requests)
    return tuple(
        _simulated(vessel, spec, followed[index]) if index in followed else build_primitive(vessel, spec)
        for index, spec in enumerate(requests)
    )


def build_primitive(vessel: Vessel, spec: PrimitiveSpec) -> Primitive:
    """One primitive: commands of its family, or by the inverse nominal model, within limits and rates, then simulated.

    Designs use the simulated motion, which differs from the desired one where limits are active.

    Raises:
        InputError: the run is shorter than two samples, or the vessel cannot run the family; the message names the
            primitive and, where it has one, its file and key.
        Unreachable: the actuators cannot hold its entry state; the message states their limit.
        Diverged: the nominal model is unstable under the commands.
    """
    try:
        found = excitation(vessel, spec)
    except (InputError, Unreachable) as error:
        named = f"{spec.place}: primitive {spec.name!r}" if spec.place else f"primitive {spec.name!r}"
        kind = Unreachable if isinstance(error, Unreachable | SpeedOutOfReach) else InputError
        raise kind(f"{named}: {error}") from None
    return _simulated(vessel, spec, found)


def _simulated(vessel: Vessel, spec: PrimitiveSpec, found: Excitation) -> Primitive:
    """The primitive of a specification, from its commands."""
    commands = Commands(sample_time_s=vessel.sample_time_s, names=vessel.model.inputs, values=found.commands)
    return Primitive(
        name=spec.name,
        family=spec.family,
        settings=spec.settings,
        commands=commands,
        entry_inputs=found.inputs,
        trajectory=simulate(vessel, commands, velocity=found.velocity, standing=found.inputs),
    )


def _followed(vessel: Vessel, specs: tuple[PrimitiveSpec, ...]) -> dict[int, Excitation]:
    """Excitation by index of the specifications with desired velocities; those that cannot be had are left out."""
    lengths: dict[int, dict[int, Array]] = {}
    for index, spec in enumerate(specs):
        with suppress(InputError):
            if family(spec.family).reference is not None:
                desired = desired_velocities(vessel, spec)
                lengths.setdefault(len(desired), {})[index] = desired
    found: dict[int, Excitation] = {}
    for samples, group in lengths.items():
        if samples > 2:
            most, items = max(1, FOLLOWED_SAMPLES // samples), list(group.items())
            for first in range(0, len(items), most):
                found |= _followed_together(vessel, dict(items[first : first + most]))
    return found


def _followed_together(vessel: Vessel, desired: dict[int, Array]) -> dict[int, Excitation]:
    """`_followed` for velocities (k + 1, 3) of one length by index."""
    velocities = np.array(list(desired.values()))
    inputs, values = follow(vessel, velocities)
    held = lost(vessel, velocities[:, 0], inputs) <= STEADY_CHANGE
    return {
        index: Excitation(velocity=velocities[row, 0], inputs=inputs[row], commands=values[row])
        for row, index in enumerate(desired)
        if held[row]
    }


def excitation(vessel: Vessel, spec: PrimitiveSpec) -> Excitation:
    """Entry state and commands (k, m) of a specification, within limits and rates.

    Raises:
        InputError, SpeedOutOfReach, Unreachable: as in `build_primitive`.
    """
    kind = family(spec.family)
    length_s = spec.settings["duration_s"]
    if (length_s or kind.orders is None) and round(length_s / vessel.sample_time_s) < 2:
        raise InputError(f"duration_s is {length_s:g}, expected at least two samples of {vessel.sample_time_s:g} s")
    if kind.orders is not None:
        desired = desired_commands(vessel, spec)
        values = within_limits(
            vessel.actuators, desired.commands, sample_time_s=vessel.sample_time_s, before=desired.inputs
        )
        return Excitation(velocity=desired.velocity, inputs=desired.inputs, commands=values)
    velocities = desired_velocities(vessel, spec)
    inputs, values = follow(vessel, velocities)
    if lost(vessel, velocities[0], inputs) > STEADY_CHANGE:
        raise Unreachable(_not_held(vessel, velocities[0]))
    return Excitation(velocity=velocities[0], inputs=inputs, commands=values)


def desired_commands(vessel: Vessel, spec: PrimitiveSpec) -> Excitation:
    """Commands of a family with orders, before limits and rates.

    Raises:
        InputError: the vessel cannot follow them.
    """
    orders = family(spec.family).orders
    assert orders is not None
    return orders(vessel, spec)


def desired_velocities(vessel: Vessel, spec: PrimitiveSpec) -> Array:
    """(k + 1, 3) desired velocities of a family with a reference.

    Raises:
        InputError: its settings contradict each other.
    """
    reference = family(spec.family).reference
    assert reference is not None
    count = round(spec.settings["duration_s"] / vessel.sample_time_s)
    desired = reference(spec.settings, np.arange(count + 1, dtype=float) * vessel.sample_time_s)
    if not np.isfinite(desired).all():
        raise InputError("its settings give velocities that are not numbers")
    return desired


def follow(vessel: Vessel, desired: Array) -> tuple[Array, Array]:
    """Entry commands (..., m) and commands (..., k, m) for desired velocities (..., k + 1, 3), by the inverse model.

    A ship whose actuators do not push sideways at rest is given surge and yaw rate, and drifts as she does.
    """
    slopes = np.diff(desired, axis=-2) / vessel.sample_time_s
    middles = (desired[..., :-1, :] + desired[..., 1:, :]) / 2
    if by_force(vessel.model):
        push = required_push(vessel.model, middles, slopes)
    else:
        push = _from_sample_to_sample(vessel, middles, slopes, desired[..., 0, 1])
    entry = _ready(vessel, trim(vessel, desired[..., 0, :]), push)
    return entry, commands_for(vessel.model, push, sample_time_s=vessel.sample_time_s, before=entry)


def _from_sample_to_sample(vessel: Vessel, motions: Array, slopes: Array, sway: Array) -> Array:
    """(..., k, c) what gives accelerations (..., k, 3) at motions (..., k, 3), each sample near the one before.

    Where the actuators do not push sideways, the ship drifts as she does: with a sway (...,) at first, then by the
    model.
    """
    model, sample_s = vessel.model, vessel.sample_time_s
    everywhere, before, given = pushed_everywhere(model), None, list[Array]()
    for motion, slope in zip(np.moveaxis(motions, -2, 0), np.moveaxis(slopes, -2, 0), strict=True):
        at = motion if everywhere else np.stack([motion[..., 0], sway, motion[..., 2]], axis=-1)
        given.append(required_push(model, at, slope, sway=everywhere, near=before))
        before = commands_for(model, given[-1][..., None, :], sample_time_s=sample_s, near=before)[..., 0, :]
        for _ in range(0 if everywhere else DRIFT_STEPS):
            at[..., 1] += drift(vessel, at, before)[..., 1] * sample_s / DRIFT_STEPS
        sway = at[..., 1]
    return np.stack(given, axis=-2)


def _ready(vessel: Vessel, entry: Array, push: Array) -> Array:
    """Entry commands with idle azimuths turned to the first direction that the run needs."""
    size = np.linalg.norm(push, axis=-1)
    pushes = size > 1e-3 * np.maximum(size.max(axis=-1, keepdims=True), 1e-12)
    first = np.take_along_axis(push, np.argmax(pushes, axis=-1)[..., None, None], axis=-2)
    turned = commands_for(vessel.model, first, sample_time_s=vessel.sample_time_s)[..., 0, :]
    ready, place = entry.copy(), 0
    for actuator in vessel.actuators:
        if actuator.kind == "azimuth":
            idle = (np.abs(entry[..., place]) < 1e-9) & pushes.any(axis=-1)
            ready[..., place + 1] = np.where(idle, turned[..., place + 1], entry[..., place + 1])
        place += len(actuator.limits)
    return ready


def _not_held(vessel: Vessel, velocity: Array) -> str:
    inputs = trim(vessel, velocity)
    found = f"the actuators cannot hold its entry state {motion_text(velocity)}; {reach_text(vessel, velocity)}: "
    if not by_force(vessel.model):
        left = drift(vessel, velocity, inputs)
        return f"{found}they leave du/dt = {left[0]:.3g} m/s2, dv/dt = {left[1]:.3g} m/s2, dr/dt = {left[2]:.3g} rad/s2"
    wanted = required_push(vessel.model, velocity, np.zeros(3))
    given = generalised_force(vessel.actuators, dict(zip(vessel.model.inputs, inputs, strict=True)), NUMPY)
    return f"{found}needed tau_x = {wanted[0]:.4g}, tau_y = {wanted[1]:.4g}, they give {given[0]:.4g}, {given[1]:.4g}"


@sealed(possible="n", velocity="n 3", entry_inputs="n m", commands="n k m")
class ExcitedRuns:
    """Commands and entry states of specifications of one duration."""

    possible: Array  # (n,) 1 where the settings are consistent and the vessel can hold the entry state, else 0
    velocity: Array  # (n, 3) entry u, v, r through water
    entry_inputs: Array  # (n, m) commands before the run
    commands: Array  # (n, k, m) within limits and rates


def excite_many(vessel: Vessel, specs: Sequence[PrimitiveSpec]) -> ExcitedRuns:
    """Commands of many specifications; impossible ones are marked instead of raising.

    Args:
        specs: of the same duration.
    """
    samples = round(specs[0].settings["duration_s"] / vessel.sample_time_s)
    possible, velocity = np.zeros(len(specs)), np.zeros((len(specs), 3))
    entry = np.zeros((len(specs), len(vessel.limits)))
    commands = np.zeros((len(specs), samples, len(vessel.limits)))
    desired: dict[int, Array] = {}
    for index, spec in enumerate(specs):
        try:
            if family(spec.family).reference is not None:
                desired[index] = desired_velocities(vessel, spec)
                continue
            found = desired_commands(vessel, spec)
        except (InputError, NoAnswer):
            continue
        if len(found.commands) == samples:
            possible[index], velocity[index], entry[index] = 1.0, found.velocity, found.inputs
            commands[index] = found.commands
    ordered = np.flatnonzero(possible)
    commands[ordered] = within_limits(
        vessel.actuators, commands[ordered], sample_time_s=vessel.sample_time_s, before=entry[ordered]
    )
    if desired:
        rows = np.array(list(desired))
        references = np.array(list(desired.values()))
        before, followed = follow(vessel, references)
        possible[rows] = lost(vessel, references[:, 0], before) <= STEADY_CHANGE
        velocity[rows], entry[rows], commands[rows] = references[:, 0], before, followed
    return ExcitedRuns(possible=possible, velocity=velocity, entry_inputs=entry, commands=commands)


# Deviation of the simulated motion from the desired one; designs use the simulated motion.


def desired_motion(primitive: Primitive) -> Array | None:
    """(k + 1, 3) desired u, v, r, or None where the family gives commands instead."""
    try:
        reference = family(primitive.family).reference
    except InputError:
        return None
    return None if reference is None else reference(primitive.settings, primitive.trajectory.time_s)


def deviation(primitive: Primitive) -> float:
    """Largest deviation from the desired motion: of u and v per largest desired speed, of r per largest yaw rate.

    Zero for families without desired velocities.
    """
    desired = desired_motion(primitive)
    if desired is None:
        return 0.0
    apart = np.abs(primitive.trajectory.velocity - desired).max(axis=0)
    speed = max(float(np.hypot(*desired[:, :2].T).max()), 1e-9)
    turn = float(np.abs(desired[:, 2]).max()) or speed
    return float(max(apart[0] / speed, apart[1] / speed, apart[2] / turn))


def deviating(primitives: Sequence[Primitive]) -> tuple[Primitive, ...]:
    """Primitives that deviate from the desired motion by more than `REPORTED_DEVIATION`."""
    return tuple(item for item in primitives if deviation(item) > REPORTED_DEVIATION)
