from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest

from expdesign.errors import NoPlan
from expdesign.plan.control.ships import capability
from expdesign.plan.values import PlanSettings
from expdesign.scenario import load_scenario, load_vessel
from expdesign.vessel import STRUCTURES
from expdesign.workflows.steps.planned import leg_remarks
from plan_case import VESSELS, ship
from scenario_files import SCENARIOS

capability_module = importlib.import_module("expdesign.plan.control.ships")


def test_top_speed_is_the_steady_speed_at_full_thrust():
    vessel = ship()
    theta = dict(zip(vessel.model.names, vessel.model.parameters, strict=True))
    # nominal model: X_u u + X_mu tau_x = 0 with both propellers at 15 rps
    exact = -theta["X_mu"] * 30.0 / theta["X_u"]
    assert capability(vessel, PlanSettings()).top_speed_mps == pytest.approx(exact, rel=0.02)


def test_turns_can_be_held_and_are_no_tighter_than_asked():
    vessel = load_vessel(VESSELS / "model-ship.toml")
    found = capability(vessel, PlanSettings(turning_radius_m=8.0))
    assert found.turning_radius_m == 8.0
    assert found.transit_speed_mps / found.turning_radius_m <= found.yaw_rate_radps


@pytest.mark.parametrize(
    ("settings", "current", "words"),
    [
        (PlanSettings(transit_speed_mps=9.0), 0.0, "transit_speed_mps is 9"),
        (PlanSettings(turning_radius_m=0.05), 0.0, "turning_radius_m is 0.05"),
        (PlanSettings(), 2.0, "current of 2 m/s"),
    ],
)
def test_settings_beyond_the_ship_are_refused_with_both_numbers(settings, current, words):
    with pytest.raises(NoPlan, match=words):
        capability(load_vessel(VESSELS / "model-ship.toml"), settings, current_mps=current)


def test_a_ship_without_a_yaw_equation_cannot_be_steered():
    vessel = ship()
    terms = STRUCTURES["surge"]
    model = replace(vessel.model, terms=terms, parameters=np.array([-0.2, 0, 0, 0.01]), parameter_std=np.zeros(4))
    with pytest.raises(NoPlan, match="no r equation"):
        capability(replace(vessel, model=model), PlanSettings())


def test_a_ship_that_should_be_steered_by_a_helm_but_has_none_is_planned_by_her_thrusters_and_that_is_said(monkeypatch):
    case = load_scenario(SCENARIOS / "helsinki.toml")
    assert capability(case.vessel, case.plan).note == ""
    assert leg_remarks(case) == ()

    def refused(*_: object) -> None:
        raise NoPlan("no steady turn to both sides")

    monkeypatch.setattr(capability_module, "WIDEST_WITHOUT_DRIFT", 0.0)
    monkeypatch.setattr(capability_module, "_helm_ship", refused)
    (said,) = leg_remarks(case)
    assert said == capability(case.vessel, case.plan).note
    assert "no helm for legs was found (no steady turn to both sides)" in said
    assert "on the spot" in said
