"""Throttle steps: the engine order goes up in steps and down again, each held, at a helm that is held.

The orders are those of equally spaced steady speeds by the nominal model. Equal steps of the order would crowd the
speeds where an engine does little, and leave a gap where it does most.

Source: B.-O. H. Eriksen and M. Breivik, Modeling, identification and control of high-speed ASVs: theory and
experiments, in Sensing and Control for Autonomous Vehicles (2017).
"""

from __future__ import annotations

import numpy as np

from expdesign.dictionary.families.orders.orders import APPROACH, DURATION, helm_setting, ordered, run_times
from expdesign.dictionary.families.orders.staircase import STEPS_SETTING, staircase
from expdesign.dictionary.spec import Excitation, Family, PrimitiveSpec, Setting
from expdesign.simulation.helm import steady_ahead
from expdesign.vessel import Vessel


def _orders(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    settings, time_s = request.settings, run_times(vessel, request)
    approach = steady_ahead(vessel, settings["speed_mps"])
    speeds = settings["speed_mps"] * np.linspace(1.0, settings["rise"], round(settings["steps"]) + 1)
    drives = np.array([steady_ahead(vessel, speed).drive for speed in speeds.tolist()])
    return ordered(approach, staircase(drives, time_s, settings["duration_s"]), settings["helm_rad"] + 0.0 * time_s)


THROTTLE_STEPS = Family(
    name="throttle_steps",
    summary="engine order in steps up to the highest speed and down again, each held for the same time; helm held",
    settings=(
        DURATION,
        APPROACH,
        helm_setting("helm held throughout, positive to starboard", default=0.0),
        Setting(name="rise", meaning="highest steady speed over the approach speed", default=1.5, low=1.01, high=50),
        STEPS_SETTING,
    ),
    orders=_orders,
)
