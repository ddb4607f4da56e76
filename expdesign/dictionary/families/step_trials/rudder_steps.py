"""Rudder steps: the helm goes over in steps and back again, each held, at the approach's engine order.

The angles are those of equally spaced steady yaw rates by the nominal model.

Source: B.-O. H. Eriksen and M. Breivik, Modeling, identification and control of high-speed ASVs: theory and
experiments, in Sensing and Control for Autonomous Vehicles (2017).
"""

from __future__ import annotations

import numpy as np

from expdesign.dictionary.families.orders.orders import APPROACH, HALF_TURN, helm_setting, steered
from expdesign.dictionary.families.step_trials.staircase import (
    STAIR_DURATION,
    STAIRCASE_SETTINGS,
    Level,
    eased,
    rises,
    staircase,
    turn_near,
)
from expdesign.dictionary.spec import Excitation, Family, PrimitiveSpec, Setting
from expdesign.errors import InputError
from expdesign.simulation.helm import Approach, steady_ahead
from expdesign.values import Array
from expdesign.vessel import Vessel

TRIED = 13
"""Helm angles whose steady turns are computed."""


def _orders(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    settings = request.settings
    approach = steered(steady_ahead(vessel, settings["speed_mps"]))
    most = eased(request, approach.drive, settings["helm_rad"])
    approach.helm.check(approach.drive, approach.angle_rad + approach.starboard * most)
    least = float(np.copysign(settings["least_helm_rad"], most))
    if abs(least) >= abs(most):
        raise InputError(f"least_helm_rad is {abs(least):g}, expected less than the largest helm, {abs(most):g}")
    angles = _evenly_turning(approach, least, most, rises(request))
    return staircase(request, approach, [Level(approach=approach, helm_rad=angle) for angle in angles.tolist()])


def _evenly_turning(approach: Approach, least: float, most: float, shares: Array) -> Array:
    """(n,) helm angles whose steady yaw rates are at shares (n,) of the way from that of `least` to that of `most`.

    Raises:
        InputError: more helm does not turn the vessel faster everywhere.
    """
    angles = np.linspace(0.0, most, TRIED)
    motion, rates = approach.velocity, [0.0]
    for angle in angles[1:].tolist():
        motion = turn_near(approach, angle, motion)
        rates.append(float(motion[2]))
    size = np.abs(rates)
    if np.any(np.diff(size) <= 0):
        raise InputError(f"helm_rad is {most:g}, expected one up to which more helm turns the vessel faster")
    slowest = float(np.interp(abs(least), np.abs(angles), size))
    return np.asarray(np.interp(slowest + (size[-1] - slowest) * shares, size, angles))


RUDDER_STEPS = Family(
    name="rudder_steps",
    summary="helm over in steps and back again, each held until steady; engine order held",
    settings=(
        STAIR_DURATION,
        APPROACH,
        helm_setting("largest helm, positive to starboard", default=float(np.radians(15.0))),
        Setting(
            name="least_helm_rad",
            meaning="smallest helm, to the same side: 0 for straight ahead, more to turn all the time in little room",
            default=0.0,
            low=0.0,
            high=HALF_TURN,
        ),
        *STAIRCASE_SETTINGS,
    ),
    orders=_orders,
)
