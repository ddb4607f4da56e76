from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.plan import PlanSettings
from expdesign.plan.chart.goal_distance import clearance_field
from expdesign.plan.control.ships import capability
from expdesign.plan.legs import LegTask, LegWater, _ompl, agile, agile_leg, dubins, optimise
from expdesign.plan.legs._ompl import SEARCH_BATCHES, dubins_curve, search_dubins
from expdesign.plan.legs.dubins import find_path
from expdesign.plan.legs.optimise import solve_leg
from expdesign.plan.legs.problem import leg_problem
from expdesign.plan.legs.water import nearest_turns
from expdesign.scenario import load_vessel
from expdesign.simulation import CALM
from expdesign.vessel.vessel import swept_area
from plan_case import VESSELS, area, at_rest, find_leg, leg_water

OPEN = shapely.box(-1500, -1500, 1500, 1500)
BASIN = shapely.box(-350, -350, 350, 350)
WALL = shapely.box(-20, -350, 20, 100)


def length(path: np.ndarray) -> float:
    return float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum())


def task(start, end, inputs=(0.0, 0.0, 0.0, 0.0), end_inputs=(0.0, 0.0, 0.0, 0.0)) -> LegTask:
    return LegTask(start=start, end=end, start_inputs=inputs, end_inputs=end_inputs, seed=1)


def test_dubins_curves_have_their_closed_form_lengths():
    straight = dubins_curve(np.zeros(3), np.array([300.0, 0.0, 0.0]), radius_m=50.0, spacing_m=1.0)
    assert length(straight) == pytest.approx(300.0, rel=1e-6)
    half_turn = dubins_curve(np.zeros(3), np.array([0.0, 100.0, np.pi]), radius_m=50.0, spacing_m=0.5)
    assert length(half_turn) == pytest.approx(50 * np.pi, rel=1e-4)
    assert half_turn[len(half_turn) // 2, 0] == pytest.approx(50.0, abs=0.5)  # first ahead, then to starboard


@pytest.mark.thorough
def test_a_path_round_a_wall_is_found_and_its_hull_is_clear():
    water = leg_water(BASIN.difference(WALL))
    start, end = at_rest(0, -150, 0.0), at_rest(0, 150, np.pi)
    path = find_path(task(start, end), water)
    assert path is not None
    path = path.points
    assert shapely.contains_properly(water.safe, swept_area(path, water.vessel.hull_b))
    shortest = 2 * np.hypot(100 + 20, 150 - 20) + 2 * 20  # taut string round the wall's end at the clearance
    assert shortest < length(path) < 1.4 * shortest


@pytest.mark.parametrize("excess", [(1.03, 1.03), (1.03, 1.05, 1.05)])
def test_a_leg_that_is_too_fast_between_nodes_is_sought_slower_at_them(excess, monkeypatch):
    """The solver gives the ship some per cent more speed between nodes than it was asked to allow at them."""
    water = leg_water(OPEN)
    orders = np.linspace(1.0, 14.0, 14)
    begin = at_rest(0, 0, 0.0)

    def steady(n: float) -> np.ndarray:
        return np.tile([n, 0.0, n, 0.0], (300, 1))

    speeds = [water.states(begin, steady(n), None)[-1, 3] for n in orders]
    asked = []

    def solved(problem):
        asked.append(problem.top_speed_mps)
        return steady(float(np.interp(excess[len(asked) - 1] * problem.top_speed_mps, speeds, orders))), 0.0

    monkeypatch.setattr(optimise, "_solved", solved)
    path = np.column_stack([np.linspace(0.0, 100.0, 9), np.zeros((9, 2))])
    problem = leg_problem(
        task(begin, at_rest(100, 0, 0.0)),
        water,
        end=at_rest(100, 0, 0.0),
        states=np.column_stack([path, np.zeros((9, 3))]),
        inputs=np.zeros((9, 4)),
        path=path,
        duration_s=100.0,
        turning_rate_radps=0.1,
    )
    values = solve_leg(problem, water)
    assert values is not None
    assert len(asked) == len(excess)
    assert water.states(begin, values, None)[:, 3].max() <= 1.005 * problem.top_speed_mps


def test_a_path_to_a_place_without_room_is_not_searched_for(monkeypatch):
    water = leg_water(BASIN)
    monkeypatch.setattr(dubins, "search_dubins", lambda *ends, **rest: pytest.fail("searched"))
    for place in (at_rest(345, 0, 0.0), at_rest(0, 400, 1.0)):
        assert find_path(task(at_rest(0, 0, 0.0), place), water) is None
        assert find_path(task(place, at_rest(0, 0, 0.0)), water) is None


def test_a_search_without_a_way_on_draws_no_more_than_its_batches(monkeypatch):
    drawn, batches = [], _ompl._batches
    monkeypatch.setattr(_ompl, "_batches", lambda planner: drawn.append(batches(planner)) or drawn[-1])

    def free(poses: np.ndarray) -> bool:
        return bool((np.abs(poses[:, :2] - (30.0, 0.0)) > (25.0, 100.0)).any(axis=1).all())  # a wall ahead of the start

    low, high = np.array([-200.0, -300.0]), np.array([500.0, 300.0])
    ends = np.zeros(3), np.array([300.0, 0.0, 0.0])
    assert search_dubins(*ends, radius_m=40.0, spacing_m=10.0, low=low, high=high, holds=free, seed=1) is None
    assert max(drawn) == SEARCH_BATCHES + 1  # ended by these, not by iterations


def test_a_walled_in_vessel_has_no_leg():
    water = leg_water(BASIN.difference(shapely.box(-20, -350, 20, 350)))
    assert find_leg(task(at_rest(0, -150, 0.0), at_rest(0, 150, 0.0)), water) is None


@pytest.mark.parametrize(
    ("start", "end"),
    [
        (at_rest(0, 0, 0.0), at_rest(400, 100, 0.5)),
        (np.array([0.0, 0.0, 0.0, 1.2, 0.0, 0.0]), np.array([250.0, 150.0, 1.5, 0.5, 0.0, 0.0])),
        (np.array([0.0, 0.0, 0.0, 0.8, 0.3, -0.05]), at_rest(300, -200, -2.0)),
    ],
)
def test_commands_take_the_vessel_to_the_desired_state_within_limits_and_rates(start, end):
    water = leg_water(OPEN)
    begin = np.array([5.0, 0.3, -2.0, 0.1])
    values = find_leg(task(start, end, begin), water)
    assert values is not None
    track = water.sail(start, values)
    assert np.allclose(track.pose[-1, :2], end[:2], atol=0.03)
    assert abs((track.pose[-1, 2] - end[2] + np.pi) % (2 * np.pi) - np.pi) < 1e-3
    assert np.allclose(track.velocity[-1], end[3:], atol=2e-3)
    low = [limit.low for limit in water.vessel.limits]
    high = [limit.high for limit in water.vessel.limits]
    rate = water.vessel.rates.tolist()
    assert (values >= np.array(low) - 1e-6).all()
    assert (values <= np.array(high) + 1e-6).all()
    steps = np.abs(np.diff(np.vstack([begin, values]), axis=0))
    assert (steps <= np.array(rate) * water.vessel.sample_time_s * (1 + 1e-6)).all()
    assert shapely.contains_properly(water.safe, swept_area(track.pose, water.vessel.hull_b))


@pytest.mark.thorough
def test_a_leg_without_a_solution_in_its_corridor_is_found_where_the_whole_water_holds_one(monkeypatch):
    solved = agile.solve_leg
    monkeypatch.setattr(agile, "solve_leg", lambda problem, water: None if problem.bounded else solved(problem, water))
    channel, parted = leg_water(shapely.box(-60, -350, 60, 350)), leg_water(BASIN.difference(WALL))
    for water, begin, end in (
        (channel, at_rest(-40, 0, 0.0), at_rest(60, 0, 0.4)),
        (parted, at_rest(0, -70, 0.0), at_rest(0, 70, 0.0)),  # round the wall
    ):
        values = agile_leg(task(begin, end), water, water.ship)
        assert values is not None
        track = water.sail(begin, values.commands)
        assert np.allclose(track.pose[-1, :2], end[:2], atol=0.03)
        assert shapely.contains_properly(water.safe, swept_area(track.pose, water.vessel.hull_b))


def test_a_leg_through_a_gap_keeps_the_hull_clear_of_both_sides():
    gap = shapely.box(-60, -1500, 60, -40).union(shapely.box(-60, 40, 60, 1500))
    water = leg_water(OPEN.difference(gap))
    values = find_leg(task(at_rest(-150, -350, 0.5), at_rest(150, 350, 1.0)), water)
    assert values is not None
    track = water.sail(at_rest(-150, -350, 0.5), values)
    assert shapely.contains_properly(water.safe, swept_area(track.pose, water.vessel.hull_b))


def test_the_mirrored_leg_takes_as_long():
    water = leg_water(OPEN)
    mirror = np.array([1, -1, -1, 1, -1, -1])
    start, end = at_rest(0, 0, 0.0), at_rest(300, 200, 1.0)
    left, right = (find_leg(task(start * flip, end * flip), water) for flip in (np.ones(6), mirror))
    assert left is not None
    assert right is not None
    assert abs(len(left) - len(right)) <= 1  # times that differ by the tolerance may round to two samples


def test_whole_turns_are_added_to_azimuths_without_limits_alone():
    vessel = leg_water(OPEN).vessel
    assert vessel.turns_freely.tolist() == [False, True, False, True]
    inputs, near = np.array([7.0, 0.3, -1.0, -3.0]), np.array([0.0, 6.5, 7.0, 3.2])
    np.testing.assert_allclose(nearest_turns(vessel, inputs, near), [7.0, 0.3 + 2 * np.pi, -1.0, -3.0 + 2 * np.pi])
    stops = tuple(
        replace(item, limits=(item.limits[0], replace(item.limits[1], low=-9.0, high=9.0))) for item in vessel.actuators
    )
    limited = replace(vessel, model=replace(vessel.model, actuators=stops))
    np.testing.assert_array_equal(nearest_turns(limited, inputs, near), inputs)


def test_a_leg_is_not_faster_than_top_speed_and_not_slower_than_twice_the_estimate():
    water = leg_water(OPEN)
    values = find_leg(task(at_rest(0, 0, 0.0), at_rest(600, 0, 0.0)), water)
    assert values is not None
    seconds = len(values) * water.vessel.sample_time_s
    assert 600 / water.ship.transit_speed_mps < seconds < 2 * 600 / water.ship.transit_speed_mps


def test_legs_do_not_cheat_the_transit_speed_by_going_sideways():
    vessel = load_vessel(VESSELS / "model-ship.toml")
    sea = area(shapely.box(-80, -80, 80, 80))
    water = LegWater(
        vessel=vessel,
        environment=CALM,
        ship=capability(vessel, PlanSettings()),
        area=sea,
        clearance_m=1.0,
        field=clearance_field(sea, resolution_m=0.5),
    )
    start, end = at_rest(-50, 0, 0.0), at_rest(50, 0, 0.0)
    values = find_leg(task(start, end, np.zeros(3), np.zeros(3)), water)
    assert values is not None
    speed = np.hypot(*water.sail(start, values).velocity[:, :2].T)
    assert speed.max() < 1.01 * water.ship.transit_speed_mps
