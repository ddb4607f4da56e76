"""Waves of helm and engine order about the approach's: inputs unlike steps, to validate with what steps gave.

Source: B.-O. H. Eriksen and M. Breivik, Modeling, identification and control of high-speed ASVs: theory and
experiments, in Sensing and Control for Autonomous Vehicles (2017).
"""

from __future__ import annotations

import numpy as np

from expdesign.dictionary.families.orders.orders import APPROACH, helm_setting, ordered, run_times, steered
from expdesign.dictionary.spec import DURATION, Excitation, Family, PrimitiveSpec, Setting
from expdesign.errors import InputError
from expdesign.simulation.helm import steady_ahead
from expdesign.vessel import Vessel


def _orders(vessel: Vessel, request: PrimitiveSpec) -> Excitation:
    settings, time_s = request.settings, run_times(vessel, request)
    approach = steered(steady_ahead(vessel, settings["speed_mps"]))
    swing = settings["engine_swing"]
    if not swing <= approach.drive <= 1.0 - swing:
        raise InputError(
            f"engine_swing is {swing:g}, expected at most {min(approach.drive, 1.0 - approach.drive):.3g}, so that the "
            f"engine order of the approach, {approach.drive:.3g}, stays between 0 and 1"
        )
    helm = settings["helm_rad"] * np.sin(2 * np.pi * time_s / settings["helm_period_s"])
    drive = approach.drive + swing * np.sin(2 * np.pi * time_s / settings["engine_period_s"])
    return ordered(approach, drive, settings["helm_offset_rad"] + helm)


HELM_AND_ENGINE_WAVES = Family(
    name="helm_and_engine_waves",
    summary="helm and engine order go up and down in sine waves about the approach's",
    settings=(
        DURATION,
        APPROACH,
        helm_setting("amplitude of the helm; positive begins to starboard"),
        Setting(name="helm_period_s", meaning="period of the helm", low=1e-2, high=1e4, searched="time"),
        Setting(
            name="engine_swing",
            meaning="amplitude of the engine order, as a share of full ahead",
            default=0.0,
            low=0,
            high=0.5,
            searched="share",
        ),
        Setting(name="engine_period_s", meaning="period of the engine order", low=1e-2, high=1e4, searched="time"),
        Setting(
            name="helm_offset_rad", meaning="steady helm added to it", default=0.0, low=-1.5, high=1.5, searched="helm"
        ),
    ),
    orders=_orders,
)
