"""From a request to a primitive: wished velocities, the commands that give them, the simulated answer."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from expdesign.dictionary.families import FAMILIES
from expdesign.dictionary.primitive import Primitive
from expdesign.dictionary.spec import Family, PrimitiveSpec
from expdesign.errors import InputError, UnknownName
from expdesign.signals import Commands
from expdesign.simulation import simulate
from expdesign.values import Array
from expdesign.vessel import SCALAR, Vessel, allocate, generalised_force, required_force

STEADY = 1e-6
"""Share of its speed that a vessel may lose or gain per sample where an entry state counts as held."""


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
    """Every requested primitive, in order."""
    return tuple(build_primitive(vessel, spec) for spec in specs)


def build_primitive(vessel: Vessel, spec: PrimitiveSpec) -> Primitive:
    """One primitive: feed-forward commands by the inverse nominal model, within limits and rates, then simulated.

    The simulated motion is what counts from here on; where limits or unmodelled directions keep the vessel from the
    wished velocities it differs from them.

    Raises:
        InputError: the run is shorter than two samples, or the actuators cannot hold its entry state.
        Diverged: the nominal model is unstable under the commands.
    """
    count = round(spec.settings["duration_s"] / vessel.sample_time_s)
    if count < 2:
        raise InputError(
            f"primitive {spec.name!r}: duration_s is {spec.settings['duration_s']:g}, "
            f"expected at least two samples of {vessel.sample_time_s:g} s"
        )
    time_s = np.arange(count + 1, dtype=float) * vessel.sample_time_s
    try:
        wished = family(spec.family).reference(spec.settings, time_s)
    except InputError as error:
        raise InputError(f"primitive {spec.name!r}: {error}") from None
    if not np.isfinite(wished).all():
        raise InputError(f"primitive {spec.name!r}: its settings give velocities that are not numbers")
    slopes = np.diff(wished, axis=0) / vessel.sample_time_s
    middles = (wished[:-1] + wished[1:]) / 2
    force = np.array([required_force(vessel.model, nu, rate) for nu, rate in zip(middles, slopes, strict=True)])
    entry = _ready(vessel, _entry_inputs(vessel, spec.name, wished[0]), force)
    values = allocate(vessel.actuators, force, sample_time_s=vessel.sample_time_s, before=entry)
    commands = Commands(sample_time_s=vessel.sample_time_s, names=vessel.model.inputs, values=values)
    return Primitive(
        name=spec.name,
        family=spec.family,
        settings=spec.settings,
        commands=commands,
        entry_inputs=entry,
        trajectory=simulate(vessel, commands, velocity=wished[0]),
    )


def _ready(vessel: Vessel, entry: Array, force: Array) -> Array:
    """Entry commands with every azimuth that gives no thrust turned to where the run will need it first."""
    ready, place = entry.copy(), 0
    pushes = np.linalg.norm(force, axis=1) > 1e-3 * np.linalg.norm(force, axis=1).max(initial=1e-12)
    first = allocate(vessel.actuators, force[pushes][:1], sample_time_s=vessel.sample_time_s)
    for actuator in vessel.actuators:
        if actuator.kind == "azimuth" and abs(entry[place]) < 1e-9 and len(first):
            ready[place + 1] = first[0, place + 1]
        place += len(actuator.limits)
    return ready


def trim(vessel: Vessel, velocity: Array) -> Array:
    """Commands (m,) that hold a velocity (3,) through calm water, as far as the actuators can."""
    force = required_force(vessel.model, velocity, np.zeros(3))
    return np.asarray(allocate(vessel.actuators, force[None], sample_time_s=vessel.sample_time_s)[0])


def drift(vessel: Vessel, velocity: Array, inputs: Array) -> Array:
    """Acceleration (3,) at a velocity through calm water under given commands."""
    motion = velocity.tolist()
    return np.array(vessel.model.accelerations(motion, motion[:2], inputs.tolist(), SCALAR))


def _entry_inputs(vessel: Vessel, name: str, velocity: Array) -> Array:
    inputs = trim(vessel, velocity)
    wanted = required_force(vessel.model, velocity, np.zeros(3))
    given = np.array(generalised_force(vessel.actuators, dict(zip(vessel.model.inputs, inputs, strict=True)), SCALAR))
    lost = np.abs(drift(vessel, velocity, inputs)).max() * vessel.sample_time_s
    if lost > STEADY * max(1e-9, np.abs(velocity).max()):
        raise InputError(
            f"primitive {name!r}: the actuators cannot hold its entry state u = {velocity[0]:g} m/s, "
            f"v = {velocity[1] + 0.0:g} m/s: needed tau_x = {wanted[0]:.4g}, tau_y = {wanted[1]:.4g}, "
            f"they give {given[0]:.4g}, {given[1]:.4g}"
        )
    return inputs
