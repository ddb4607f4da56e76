"""Runs begin at another speed where it decays before it moves them, so slow ships need not go around in vain."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.plan.control import capability
from expdesign.plan.monte_carlo.procedure import speed_decay_s, tolerances
from expdesign.plan.values import PlanSettings
from expdesign.scenario import load_scenario
from expdesign.signals import Commands
from expdesign.simulation import simulate
from plan_case import leg_water
from scenario_files import SCENARIOS

OPEN = shapely.box(-400, -300, 400, 500)


def test_a_speed_decays_as_the_damping_of_the_model_says_and_moves_the_ship_so_far():
    ship = load_scenario(SCENARIOS / "helsinki.toml").vessel
    decay_s = speed_decay_s(ship, 1.2)
    assert decay_s == pytest.approx(1 / 0.2)  # X_u = -0.2, Y_v = -0.3: surge decays more slowly
    commands = Commands(sample_time_s=1.0, names=ship.model.inputs, values=np.zeros((120, len(ship.limits))))
    ends = [simulate(ship, commands, velocity=np.array([u, 0.0, 0.0])).pose[-1, 0] for u in (1.0, 1.2)]
    assert ends[1] - ends[0] == pytest.approx(0.2 * decay_s, rel=0.11)  # the model's own step is 1 s


def test_the_tolerance_moves_the_run_by_a_share_of_that_of_its_place_within_its_limits():
    water = leg_water(OPEN)
    decay_s = speed_decay_s(water.vessel, water.ship.transit_speed_mps)
    for spare_m in (0.0, 10.0, 40.0, 1000.0):
        transit = water.ship.transit_speed_mps
        found = tolerances(water, spare_m, transit)
        assert 0.1 * transit <= found.speed_mps * (1 + 1e-9)
        assert found.speed_mps <= 0.3 * transit * (1 + 1e-9)
        if 0.11 * transit < found.speed_mps < 0.29 * transit:
            assert found.speed_mps * decay_s == pytest.approx(found.position_m / 2)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 1.0])
def test_a_slow_run_does_not_begin_at_another_speed_altogether(share):
    """Within 30 % of its own speed, or a tenth of the speed on legs where that is more."""
    water = leg_water(OPEN)
    transit = water.ship.transit_speed_mps
    found = tolerances(water, 1e6, share * transit)
    assert found.speed_mps == pytest.approx(max(0.1, 0.3 * share) * transit)


def test_a_ship_that_keeps_its_way_for_minutes_begins_within_a_tenth_of_its_speed():
    case = load_scenario(SCENARIOS / "coaster.toml")
    ship = capability(case.vessel, PlanSettings(clearance_m=20.0))
    water = replace(leg_water(OPEN), vessel=case.vessel, ship=ship)
    assert speed_decay_s(case.vessel, ship.transit_speed_mps) > 100.0
    assert tolerances(water, 0.0, ship.transit_speed_mps).speed_mps == pytest.approx(0.1 * ship.transit_speed_mps)


def test_starts_are_as_many_times_less_exact_as_the_plan_allows():
    water = leg_water(OPEN)
    usual, wider = (tolerances(replace(water, start_tolerance=times), 1e6) for times in (1.0, 3.0))
    assert wider.position_m == pytest.approx(3 * usual.position_m)
    assert wider.heading_rad == pytest.approx(3 * usual.heading_rad)
    assert wider.yaw_rate_radps == pytest.approx(3 * usual.yaw_rate_radps)
    assert tolerances(replace(water, start_tolerance=3.0), 2.0).position_m == tolerances(water, 2.0).position_m  # room
    slow = tolerances(water).speed_mps, tolerances(replace(water, start_tolerance=3.0)).speed_mps
    assert slow[1] >= slow[0]
    assert slow[1] >= 0.3 * water.ship.transit_speed_mps * (1 - 1e-9)
