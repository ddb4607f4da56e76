"""Engine and helm orders from a steady straight approach, for families defined by commands."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from expdesign.dictionary.spec import Excitation, PrimitiveSpec, Setting
from expdesign.errors import InputError
from expdesign.simulation.helm import Approach, steady_ahead
from expdesign.values import Array
from expdesign.vessel import Vessel

APPROACH = Setting(name="speed_mps", meaning="approach speed, more than 0", low=1e-6, high=50, searched="surge")
HALF_TURN = np.pi / 2


def helm_setting(meaning: str, *, default: float | None = None) -> Setting:
    """A helm angle; positive turns to starboard, independent of the sign of the actuator's angle."""
    return Setting(name="helm_rad", meaning=meaning, default=default, low=-HALF_TURN, high=HALF_TURN, searched="helm")


def run_times(vessel: Vessel, request: PrimitiveSpec) -> Array:
    """(k,) times at which commands are given."""
    count = round(request.settings["duration_s"] / vessel.sample_time_s)
    return np.asarray(np.arange(count) * vessel.sample_time_s, dtype=float)


def steered(approach: Approach) -> Approach:
    """The approach, if its helm turns the vessel.

    Raises:
        InputError: the helm does not turn the vessel.
    """
    if not approach.starboard:
        raise InputError(
            f"the helm of vessel {approach.helm.vessel.name!r}, {approach.helm.description or 'none'}, does not turn it"
        )
    return approach


def ordered(approach: Approach, drive: Array, helm_rad: Array) -> Excitation:
    """Engine orders (k,) and helm (k,), counted from the approach's and positive to starboard, as commands.

    Raises:
        InputError: an actuator cannot give the largest helm at the approach's engine order.
    """
    angles = approach.angle_rad + approach.starboard * helm_rad
    for angle in (float(angles.min()), float(angles.max())):
        approach.helm.check(approach.drive, angle)
    pairs, place = np.unique(np.stack([drive, angles], axis=1), axis=0, return_inverse=True)
    rows = np.array([approach.helm.inputs(*pair) for pair in pairs.tolist()])
    return Excitation(velocity=approach.velocity, inputs=approach.inputs, commands=rows[place.ravel()])


def helm_family(
    helm: Callable[[PrimitiveSpec, Array], Array],
) -> Callable[[Vessel, PrimitiveSpec], Excitation]:
    """Orders with the approach's engine order and the helm `helm`(request, time_s (k,)) -> (k,) rad."""

    def orders(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
        approach = steered(steady_ahead(vessel, request.settings["speed_mps"]))
        time_s = run_times(vessel, request)
        return ordered(approach, np.full_like(time_s, approach.drive), helm(request, time_s))

    return orders
