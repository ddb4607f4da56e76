"""The example coaster and other ships that are steered by a helm, for tests of the planner's parts."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import shapely

from expdesign.plan import PlanSettings
from expdesign.plan.chart.goal_distance import clearance_field
from expdesign.plan.control.ships import capability
from expdesign.plan.legs import LegWater
from expdesign.scenario import load_vessel
from expdesign.simulation import CALM
from expdesign.vessel import Actuator, Limit, Response, Term, Vessel, VesselModel
from plan_case import VESSELS, area


@cache
def coaster() -> Vessel:
    """80 m, one propeller, one rudder."""
    return load_vessel(VESSELS / "coaster-80m.toml")


@cache
def open_water(vessel: Vessel) -> LegWater:
    """Calm open water for legs."""
    half = 30 * vessel.length_m
    sea = area(shapely.box(-half, -half, half, half))
    return LegWater(
        vessel=vessel,
        environment=CALM,
        ship=capability(vessel, PlanSettings(clearance_m=vessel.length_m / 2)),
        area=sea,
        clearance_m=vessel.length_m / 2,
        field=clearance_field(sea, resolution_m=vessel.length_m / 4),
    )


@cache
def catamaran() -> Vessel:
    """2 m, two fixed propellers with quadratic thrust and no rudder: steers by their difference."""
    rows = {
        Term("u", "X_u", "u"): -0.4,
        Term("u", "X_vr", "v*r"): 1.4,
        Term("u", "X_nn", "abs(n1)*n1+abs(n2)*n2"): 0.0018,
        Term("v", "Y_v", "v"): -1.0,
        Term("v", "Y_ur", "u*r"): -0.6,
        Term("r", "N_r", "r"): -1.2,
        Term("r", "N_uv", "u*v"): -0.1,
        Term("r", "N_nn", "abs(n1)*n1-abs(n2)*n2"): 0.004,
    }
    limit = Limit(low=-15.0, high=15.0)
    actuators = tuple(
        Actuator(kind="propeller", number=number, starboard_m=side, limits=(limit,), responses=(Response(rate=30.0),))
        for number, side in ((1, -0.4), (2, 0.4))
    )
    model = VesselModel(
        terms=tuple(rows),
        parameters=np.array(list(rows.values())),
        parameter_std=np.zeros(len(rows)),
        form="continuous",
        sample_time_s=0.2,
        actuators=actuators,
    )
    return Vessel(name="catamaran", length_m=2.0, beam_m=1.1, draught_m=0.2, sample_time_s=0.2, model=model)


@cache
def offshore_vessel() -> Vessel:
    """45 m, two azimuths astern and a bow tunnel: steered by a helm under way, by thrusters at rest."""
    return load_vessel(Path(__file__).parent / "data" / "vessels" / "offshore-45m.toml")


@cache
def ahead_only(vessel: Vessel) -> Vessel:
    """The same ship with azimuths whose propellers do not reverse."""
    actuators = tuple(
        replace(one, limits=(replace(one.limits[0], low=0.0), *one.limits[1:])) if one.kind == "azimuth" else one
        for one in vessel.actuators
    )
    return replace(vessel, name=f"{vessel.name}-ahead", model=replace(vessel.model, actuators=actuators))
