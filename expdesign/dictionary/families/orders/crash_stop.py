"""Crash stop: engines astern from a steady approach, helm unchanged."""

from __future__ import annotations

import numpy as np

from expdesign.dictionary.families.orders.orders import APPROACH, ordered, run_times
from expdesign.dictionary.spec import DURATION, Excitation, Family, PrimitiveSpec, Setting
from expdesign.simulation.helm import steady_ahead
from expdesign.vessel import Vessel


def _orders(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    approach = steady_ahead(vessel, request.settings["speed_mps"])
    time_s = run_times(vessel, request)
    braking = time_s < request.settings["astern_fraction"] * request.settings["duration_s"]
    return ordered(approach, np.where(braking, -request.settings["astern"], 0.0), 0.0 * time_s)


CRASH_STOP = Family(
    name="crash_stop",
    summary="engines astern from a straight approach for a share of the run, then stopped; helm unchanged",
    settings=(
        DURATION,
        APPROACH,
        Setting(name="astern", meaning="engine order, 1 for full astern", default=1.0, low=0, high=1, searched="share"),
        Setting(
            name="astern_fraction",
            meaning="share of the run that engines go astern",
            default=1.0,
            low=0.01,
            high=1,
            searched="share",
        ),
    ),
    orders=_orders,
)
