"""Throttle steps: the engine order goes up in steps and down again, each held, at a helm that is held.

The orders are those of equally spaced steady speeds by the nominal model. Equal steps of the order would crowd the
speeds where an engine does little, and leave a gap where it does most.

Source: B.-O. H. Eriksen and M. Breivik, Modeling, identification and control of high-speed ASVs: theory and
experiments, in Sensing and Control for Autonomous Vehicles (2017).
"""

from __future__ import annotations

from expdesign.dictionary.families.orders.orders import APPROACH, helm_setting
from expdesign.dictionary.families.step_trials.staircase import (
    STAIR_DURATION,
    STAIRCASE_SETTINGS,
    Level,
    eased,
    rises,
    staircase,
)
from expdesign.dictionary.spec import Excitation, Family, PrimitiveSpec, Setting
from expdesign.simulation.helm import steady_ahead
from expdesign.vessel import Vessel


def _orders(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    settings = request.settings
    speeds = settings["speed_mps"] * (1.0 + (settings["rise"] - 1.0) * rises(request))
    approaches = [steady_ahead(vessel, speed) for speed in speeds.tolist()]
    levels = [Level(approach=one, helm_rad=eased(request, one.drive, settings["helm_rad"])) for one in approaches]
    return staircase(request, steady_ahead(vessel, settings["speed_mps"]), levels)


THROTTLE_STEPS = Family(
    name="throttle_steps",
    summary="engine order in steps up to the highest speed and down again, each held until steady; helm held",
    settings=(
        STAIR_DURATION,
        APPROACH,
        helm_setting("helm held throughout, positive to starboard", default=0.0),
        Setting(name="rise", meaning="highest steady speed over the approach speed", default=1.5, low=1.01, high=50),
        *STAIRCASE_SETTINGS,
    ),
    orders=_orders,
)
