"""The parts of drawn trials: fleets move like single ships, references are steady motion, ways and hulls are exact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.plan.chart.visibility_graph import polyline_length
from expdesign.plan.control.ships import capability
from expdesign.plan.control.tracking import Helmsman
from expdesign.plan.monte_carlo.procedure import steady_states
from expdesign.plan.monte_carlo.return_paths import build_return_paths
from expdesign.plan.monte_carlo.risk import CollisionCheck, upper_limit
from expdesign.plan.runs import FEW_SHIPS, Fleet, Truths, draw_truths
from expdesign.plan.values import PlanSettings
from expdesign.plan.verify import hull_clearance
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import CALM, Environment, Variation, simulate
from expdesign.vessel import IDEAL, Response
from nomoto_ship import nomoto_ship
from plan_case import area, leg_water, ship

RESPONSES = {
    "prompt": IDEAL,
    "lag": Response(lag_s=2.0),
    "lag, delay and dead band": Response(lag_s=1.5, delay_s=2.4, deadband=0.3, offset=0.02),
}


def slow(response):
    vessel = ship()
    actuators = tuple(replace(item, responses=(response,) * len(item.limits)) for item in vessel.actuators)
    return replace(vessel, model=replace(vessel.model, actuators=actuators))


def truths(vessel, count=1, current=(0.0, 0.0)):
    return Truths(
        parameters=np.tile(vessel.model.parameters, (count, 1)),
        current_to=np.tile(current, (count, 1)),
        wind_to=np.zeros((count, 2)),
    )


@pytest.mark.parametrize("name", RESPONSES)
def test_a_fleet_of_one_sails_like_a_single_ship(name):
    vessel, rng = slow(RESPONSES[name]), np.random.default_rng(0)
    values = np.cumsum(rng.normal(0, [0.5, 0.05, 0.5, 0.05], (60, 4)), axis=0)
    weather = Environment(current_to=np.array([0.2, -0.1]))
    told = Commands(sample_time_s=1.0, names=vessel.model.inputs, values=values)
    alone = simulate(vessel, told, environment=weather, standing=np.zeros(4))
    fleet = Fleet(vessel, CALM, truths(vessel, 1, (0.2, -0.1)), state=np.zeros(6), standing=np.zeros(4), rng=rng)
    for row in values:
        fleet.advance(row[None])
    np.testing.assert_allclose(fleet.states[0], np.r_[alone.pose[-1], alone.velocity[-1]], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", RESPONSES)
def test_a_part_of_a_fleet_sails_as_it_would_in_the_whole(name):
    vessel, rng = slow(RESPONSES[name]), np.random.default_rng(0)
    values = np.cumsum(rng.normal(0, [0.5, 0.05, 0.5, 0.05], (20, 4, 4)), axis=0)
    wavering = Environment(current_variation=Variation(std_mps=0.3, correlation_s=20.0))
    whole, parted = (
        Fleet(
            vessel, wavering, truths(vessel, 4), state=np.zeros(6), standing=np.zeros(4), rng=np.random.default_rng(7)
        )
        for _ in range(2)
    )
    some = np.array([3, 1])
    part = parted.part(some)
    for row in values:
        whole.advance(row)
        part.advance(row[some])
    parted.rejoin(part, some)
    np.testing.assert_allclose(parted.states[some], whole.states[some], rtol=1e-12)
    np.testing.assert_allclose(parted.delivered[some], whole.delivered[some], rtol=1e-12)
    np.testing.assert_array_equal(parted.states[[0, 2]], 0.0)


@pytest.mark.parametrize("name", RESPONSES)
def test_many_ships_at_once_sail_as_few_do_one_by_one(name):
    vessel, count = slow(RESPONSES[name]), 2 * FEW_SHIPS
    drawn = draw_truths(vessel, Environment(current_std_mps=0.2, wind_std_mps=1.0), count, np.random.default_rng(5))
    fleet = Fleet(vessel, CALM, drawn, state=np.zeros(6), standing=np.zeros(4), rng=np.random.default_rng(0))
    some = np.arange(0, count, 3)
    few = fleet.part(some)
    assert len(some) <= FEW_SHIPS < count
    for row in np.cumsum(np.random.default_rng(0).normal(0, [0.5, 0.05, 0.5, 0.05], (20, count, 4)), axis=0):
        fleet.advance(row)
        few.advance(row[some])
    np.testing.assert_allclose(few.states, fleet.states[some], rtol=1e-9, atol=1e-12)


def test_weather_of_a_fleet_varies_with_its_size_and_memory():
    vessel, ships, std, memory_s = ship(), 2000, 0.3, 20.0
    wavering = Environment(current_variation=Variation(std_mps=std, correlation_s=memory_s))
    still = np.zeros(6), np.zeros(4)
    fleet = Fleet(
        vessel,
        wavering,
        truths(vessel, ships),
        state=still[0],
        standing=still[1],
        rng=np.random.default_rng(2),
    )
    fleet.weather.draw()
    first = fleet.weather.now[:2].copy()
    for _ in range(9):
        fleet.weather.draw()
    later = fleet.weather.now[:2]
    spread = std / np.sqrt(2 * 2 * ships)
    assert abs(first.std() - std) < 4 * spread
    assert abs(later.std() - std) < 4 * spread
    kept = np.exp(-9.0 / memory_s)
    assert abs(np.mean(first * later) / std**2 - kept) < 4 * np.sqrt((1 + kept**2) / (2 * ships))


def test_steady_motion_keeps_its_velocity_through_the_current_and_leads_through_the_state():
    current = np.array([0.2, -0.3])
    helm = Helmsman(vessel=ship(), environment=Environment(current_to=current), ship=capability(ship(), PlanSettings()))
    state = np.array([10.0, -20.0, 0.7, 1.2, 0.3, 0.02])
    samples = np.arange(-50, 51)
    states = steady_states(helm, state, samples)
    np.testing.assert_allclose(states[50], state)
    c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
    ground = np.stack([states[:, 3] * c - states[:, 4] * s, states[:, 3] * s + states[:, 4] * c], axis=1)
    through = ground - current
    in_body = np.stack([through[:, 0] * c + through[:, 1] * s, through[:, 1] * c - through[:, 0] * s], axis=1)
    np.testing.assert_allclose(in_body, np.tile(in_body[50], (101, 1)))
    np.testing.assert_allclose(np.diff(states[:, 2]), 0.02)
    # places are the integral of the velocity: Simpson's rule over two samples is exact to the fifth order
    simpson = (ground[:-2:2] + 4 * ground[1:-1:2] + ground[2::2]) / 3
    np.testing.assert_allclose(np.diff(states[::2, :2], axis=0), simpson, atol=1e-7)


def test_return_paths_of_many_ships_are_as_short_as_each_ships_own():
    basin = shapely.box(-400, -400, 400, 400).difference(shapely.box(-100, -250, 100, 250))
    water = leg_water(basin)
    place, rng = np.array([20.0, 300.0]), np.random.default_rng(3)
    tree = build_return_paths(water.narrowest_graph, place)
    points = rng.uniform(-330, 330, (40, 2))
    points = points[(np.abs(points[:, 1]) > 140) | (np.abs(points[:, 0]) > 290)]
    for point, way in zip(points, tree.find(points), strict=True):
        shortest = water.narrowest_graph.shortest(point, place)
        assert polyline_length(way) == pytest.approx(polyline_length(shortest), abs=1e-6)
        np.testing.assert_allclose(way[[0, -1]], [point, place])


def test_hulls_exit_where_their_clearance_ends():
    coast = shapely.box(-200, -200, 200, 200).difference(shapely.Point(30, 40).buffer(25))
    sea, vessel, rng = area(coast), ship(), np.random.default_rng(4)
    tracks = [
        np.cumsum(rng.normal(0, [1.0, 1.0, 0.1], (60, 3)), axis=0) + np.r_[rng.uniform(-150, 150, 2), 0.0]
        for _ in range(60)
    ]
    watch = CollisionCheck(area=sea, vessel=vessel)
    left = ~np.isnan(watch.exits(np.stack(tracks, axis=1))[:, 0])
    for track, gone in zip(tracks, left, strict=True):
        motion = Trajectory(sample_time_s=1.0, pose=track, velocity=np.zeros_like(track))
        assert gone == (hull_clearance(sea, motion, vessel.hull_b).min() <= 0.0)
    assert 0 < left.sum() < len(tracks)


def test_none_among_many_bounds_a_share_by_its_closed_form():
    assert upper_limit(0, 200) == pytest.approx(1.0 - 0.05 ** (1 / 200))
    assert upper_limit(200, 200) == 1.0


def test_a_helmsman_brings_a_ship_with_a_rudder_to_a_course_and_holds_its_speed():
    vessel = nomoto_ship()
    settings = PlanSettings(transit_speed_mps=7.0)
    helm = Helmsman(vessel=vessel, environment=CALM, ship=capability(vessel, settings))
    assert not helm.ship.keeps_station
    start = np.array([0.0, 0.0, 0.0, 7.0, 0.0, 0.0])
    standing = np.array(helm.ship.approach.inputs)
    other = truths(vessel, 2)
    unlike = other.parameters.copy()
    unlike[1] *= 1.1  # a ship that is not the nominal one
    drawn = Truths(parameters=unlike, current_to=other.current_to, wind_to=other.wind_to)
    fleet = Fleet(vessel, CALM, drawn, state=start, standing=standing, rng=np.random.default_rng(0))
    unexplained = np.zeros((2, 3))
    for _ in range(800):
        before = fleet.states
        wanted = np.column_stack([before[:, :2], np.full(2, 0.6), np.full(2, 6.0), np.zeros((2, 2))])
        fleet.advance(helm.commands(wanted, before, fleet.given, unexplained=unexplained))
        unexplained = helm.unexplained(unexplained, before, fleet.states, fleet.delivered)
    np.testing.assert_allclose(fleet.states[:, 2], 0.6, atol=0.01)
    np.testing.assert_allclose(fleet.states[:, 3], 6.0, atol=0.05)
