"""Legs go no faster through water than stated, whatever the water itself does, and take no less than is possible."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.dictionary.build import trim
from expdesign.plan.bounds.displacement import Headway
from expdesign.plan.bounds.repositioning import reposition_bound_s
from expdesign.plan.legs import LegTask, LegWater
from expdesign.plan.legs.dubins import curved_leg
from expdesign.plan.legs.water import through_water
from expdesign.simulation import Environment, steady_ahead
from helm_case import coaster, open_water
from plan_case import find_leg, leg_water

OPEN = shapely.box(-1500, -1500, 1500, 1500)
CURRENTS = {
    "against": np.array([-0.5, 0.0]),
    "with": np.array([0.5, 0.0]),
    "across": np.array([0.0, 0.5]),
}
WATER = leg_water(OPEN)
STATED_MPS = 1.001 * WATER.ship.transit_speed_mps


def state(north: float, through: np.ndarray, current: np.ndarray) -> np.ndarray:
    """(6,) at a place on the way north, heading along it, with a velocity (3,) through water."""
    return np.r_[north, 0.0, 0.0, through[0] + current[0], through[1] + current[1], through[2]]


def task(metres: float, speed: float, current: np.ndarray) -> LegTask:
    """Straight ahead from one place to another, both at the same speed through water."""
    moving = np.array([speed, 0.0, 0.0])
    inputs = trim(WATER.vessel, moving)
    ends = state(0.0, moving, current), state(metres, moving, current)
    return LegTask(start=ends[0], end=ends[1], start_inputs=inputs, end_inputs=inputs, seed=1)


def fastest_mps(water: LegWater, leg: LegTask, values: np.ndarray) -> float:
    """Largest speed through water at the samples of a leg."""
    track = water.sail(leg.start, values, leg.past)
    states = np.column_stack([track.pose, track.velocity])
    return max(float(np.hypot(*through_water(water.environment, row)[:2])) for row in states)


@pytest.mark.parametrize("way", CURRENTS)
@pytest.mark.parametrize(("metres", "along"), [(60.0, find_leg), (150.0, curved_leg), (300.0, find_leg)])
def test_legs_between_moving_ends_keep_the_stated_speed_and_zermelos_time(way, metres, along):
    current = CURRENTS[way]
    water = replace(WATER, environment=Environment(current_to=current))
    leg = task(metres, water.ship.transit_speed_mps, current)
    found = along(leg, water)
    assert found is not None
    values = found.commands if along is curved_leg else found
    assert fastest_mps(water, leg, values) <= 1.001 * STATED_MPS  # between nodes, and where steered, a little more
    least_s = float(Headway(speed_mps=STATED_MPS, current_to=current).seconds(leg.end[:2] - leg.start[:2]))
    seconds = len(values) * water.vessel.sample_time_s
    assert least_s <= seconds <= 1.03 * least_s + 2.0


@pytest.mark.thorough
def test_a_leg_that_turns_across_a_current_round_a_wall_keeps_the_stated_speed():
    current = np.array([0.1, 0.2])
    sea = shapely.box(-700, -700, 700, 700).difference(shapely.box(-20, -700, 20, 200))
    water = replace(leg_water(sea), environment=Environment(current_to=current))
    start, end = state(-300.0, np.zeros(3), current), state(-300.0, np.zeros(3), current)
    start[1], end[1] = -200.0, 200.0
    leg = LegTask(start=start, end=end, start_inputs=np.zeros(4), end_inputs=np.zeros(4), seed=1)
    values = find_leg(leg, water)
    assert values is not None
    assert fastest_mps(water, leg, values) <= 1.001 * STATED_MPS


@pytest.mark.parametrize("way", CURRENTS)
def test_legs_from_rest_to_rest_take_no_less_than_the_bound(way):
    current = CURRENTS[way]
    water = replace(WATER, environment=Environment(current_to=current))
    leg = task(150.0, 0.0, current)
    bound_s = reposition_bound_s(
        water.vessel,
        water.area,
        water.environment,
        clearance_m=water.clearance_m,
        primitives=(),
        repeats={},
        ends=(leg.start[:3], leg.end[:3]),
        transit_mps=water.ship.transit_speed_mps,
        yaw_rate_radps=water.ship.spot_rate_radps + water.ship.yaw_rate_radps,
    )
    values = find_leg(leg, water)
    assert values is not None
    assert fastest_mps(water, leg, values) <= 1.001 * STATED_MPS
    assert bound_s <= len(values) * water.vessel.sample_time_s


@pytest.mark.thorough
def test_ships_with_a_helm_keep_the_stated_speed_against_a_current():
    still = open_water(coaster())
    length, fastest = still.vessel.length_m, still.ship.transit_speed_mps
    current = np.array([-0.15 * fastest, 0.0])
    water = replace(still, environment=Environment(current_to=current))
    ahead = steady_ahead(still.vessel, 0.9 * fastest)
    start, end = (state(north, np.array(ahead.velocity), current) for north in (0.0, 10 * length))
    leg = LegTask(start=start, end=end, start_inputs=ahead.inputs, end_inputs=ahead.inputs, seed=1)
    values = find_leg(leg, water)
    assert values is not None
    assert fastest_mps(water, leg, values) <= 1.002 * fastest
