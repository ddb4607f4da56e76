"""Rudder steps: the helm goes over in steps and back again, each held, at the approach's engine order.

The angles are those of equally spaced steady yaw rates by the nominal model.

Source: B.-O. H. Eriksen and M. Breivik, Modeling, identification and control of high-speed ASVs: theory and
experiments, in Sensing and Control for Autonomous Vehicles (2017).
"""

from __future__ import annotations

import numpy as np
import scipy

from expdesign.dictionary.families.orders.orders import APPROACH, DURATION, helm_setting, ordered, run_times, steered
from expdesign.dictionary.families.orders.staircase import STEPS_SETTING, staircase
from expdesign.dictionary.spec import Excitation, Family, PrimitiveSpec
from expdesign.errors import InputError
from expdesign.simulation.helm import Approach, steady_ahead
from expdesign.values import Array
from expdesign.vessel import Vessel

TRIED = 13
"""Helm angles whose steady turns are computed."""
STEADY_MPS2 = 1e-6


def _orders(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    settings, time_s = request.settings, run_times(vessel, request)
    approach = steered(steady_ahead(vessel, settings["speed_mps"]))
    approach.helm.check(approach.drive, approach.angle_rad + approach.starboard * settings["helm_rad"])
    angles = _evenly_turning(approach, settings["helm_rad"], round(settings["steps"]) + 1)
    helm = staircase(angles, time_s, settings["duration_s"])
    return ordered(approach, np.full_like(time_s, approach.drive), helm)


def _evenly_turning(approach: Approach, helm_rad: float, count: int) -> Array:
    """(count,) helm angles from 0 to `helm_rad` of equally spaced steady yaw rates.

    Raises:
        InputError: more helm does not turn the vessel faster everywhere.
    """
    angles = np.linspace(0.0, helm_rad, TRIED)
    motion, rates = approach.velocity, [0.0]
    for angle in angles[1:].tolist():
        motion = steady_turn(approach, angle, near=motion)
        rates.append(float(motion[2]))
    size = np.abs(rates)
    if np.any(np.diff(size) <= 0):
        raise InputError(f"helm_rad is {helm_rad:g}, expected one up to which more helm turns the vessel faster")
    return np.asarray(np.interp(np.linspace(0.0, size[-1], count), size, angles))


def steady_turn(approach: Approach, helm_rad: float, *, near: Array) -> Array:
    """(3,) u, v, r that a helm, positive to starboard, and the approach's engine order hold.

    Raises:
        InputError: none is found near the motion given.
    """
    angle = approach.angle_rad + approach.starboard * helm_rad
    places = ["uvr".index(name) for name in approach.helm.vessel.model.outputs]

    def excess(x: Array) -> list[float]:
        motion = np.zeros(3)
        motion[places] = x
        rates = approach.helm.acceleration((motion[0], motion[1], motion[2]), approach.drive, angle)
        return [rates[place] for place in places]

    found = scipy.optimize.root(excess, near[places], tol=1e-12)
    if max(map(abs, excess(found.x))) > STEADY_MPS2:
        raise InputError(f"the vessel has no steady turn with a helm of {helm_rad:g} rad, expected less helm")
    motion = np.zeros(3)
    motion[places] = found.x
    return motion


RUDDER_STEPS = Family(
    name="rudder_steps",
    summary="helm over in steps and back again, each held for the same time; engine order held",
    settings=(
        DURATION,
        APPROACH,
        helm_setting("largest helm, positive to starboard", default=float(np.radians(15.0))),
        STEPS_SETTING,
    ),
    orders=_orders,
)
