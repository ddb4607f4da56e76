from __future__ import annotations

import numpy as np
import pytest
import shapely
from plan_case import area

from expdesign.plan.field import OCTILE_EXCESS, clearance_field, goal_field, narrowest_passage


def test_clearance_of_a_square_is_the_distance_to_its_nearest_side():
    field = clearance_field(area(shapely.box(-500, -500, 500, 500)), resolution_m=5.0)
    points = np.random.default_rng(0).uniform(-480, 480, (500, 2))
    exact = 500 - np.abs(points).max(axis=1)
    assert np.abs(field.at(points) - exact).max() <= field.error_m


def test_points_outside_the_water_have_no_clearance():
    field = clearance_field(area(shapely.box(-500, -500, 500, 500)), resolution_m=5.0)
    assert not field.at(np.array([[0.0, 900.0], [-2000.0, 0.0], [505.0, 0.0]])).any()


def test_open_water_distances_lie_between_the_straight_line_and_the_octile_excess():
    field = clearance_field(area(shapely.box(-500, -500, 500, 500)), resolution_m=5.0)
    way = goal_field(field, np.zeros(2), clearance_m=10.0)
    points = np.random.default_rng(1).uniform(-450, 450, (300, 2))
    straight = np.hypot(*points.T)
    grid = way.distance_m[way.flat(points)]
    slack = 2 * field.error_m
    assert (grid >= straight - slack).all()
    assert (grid <= OCTILE_EXCESS * straight + slack).all()
    assert all(way.lower_bound(point) <= length for point, length in zip(points, straight, strict=True))


def test_the_way_goes_round_a_wall_and_its_bound_stays_below_the_true_detour():
    wall = shapely.box(-10, -500, 10, 300)  # open at the north end
    field = clearance_field(area(shapely.box(-500, -500, 500, 500).difference(wall)), resolution_m=4.0)
    start, goal = np.array([0.0, -200.0]), np.array([0.0, 200.0])
    way = goal_field(field, goal, clearance_m=0.1)
    detour = 2 * np.hypot(300.0, 190.0) + 20.0  # round both corners of the wall's end
    assert way.lower_bound(start) <= detour
    assert way.distance_m[way.flat(start)] >= detour - 2 * field.error_m
    track = way.way(start)
    assert track[np.abs(track[:, 1]) < 10, 0].min() > 300


def test_a_closed_wall_leaves_no_way():
    wall = shapely.box(-10, -600, 10, 600)
    field = clearance_field(area(shapely.box(-500, -500, 500, 500).difference(wall)), resolution_m=5.0)
    start, goal = np.array([0.0, -200.0]), np.array([0.0, 200.0])
    assert np.isinf(goal_field(field, goal, clearance_m=1.0).to_goal(start))
    widest, _ = narrowest_passage(field, start, goal)
    assert widest <= field.cell_m


@pytest.mark.parametrize("gap_m", [60.0, 120.0])
def test_the_narrowest_passage_is_half_the_gap_and_is_found_where_it_is(gap_m):
    wall = shapely.box(-10, -600, 10, 600).difference(shapely.box(-20, 100, 20, 100 + gap_m))
    field = clearance_field(area(shapely.box(-500, -500, 500, 500).difference(wall)), resolution_m=4.0)
    widest, place = narrowest_passage(field, np.array([-300.0, -300.0]), np.array([-300.0, 300.0]))
    assert widest == pytest.approx(gap_m / 2, abs=field.error_m)
    assert abs(place[1]) < 10 + 3 * field.error_m + gap_m / 2
    assert 100 <= place[0] <= 100 + gap_m


def test_a_pier_thinner_than_a_cell_is_not_overlooked():
    pier = shapely.box(-0.3, -600, 0.3, 300)
    field = clearance_field(area(shapely.box(-500, -500, 500, 500).difference(pier)), resolution_m=4.0)
    north = np.linspace(-400, 250, 60)
    assert field.at(np.stack([north, 0 * north], axis=1)).max() <= field.cell_m
    way = goal_field(field, np.array([0.0, 200.0]), clearance_m=5.0)
    assert way.to_goal(np.array([0.0, -200.0])) > 2 * np.hypot(300, 200) * 0.95


def test_near_a_berth_no_more_clearance_is_asked_than_the_berth_has():
    field = clearance_field(area(shapely.box(-500, -500, 500, 500)), resolution_m=4.0)
    berth, goal = np.array([0.0, -480.0]), np.array([0.0, 0.0])
    assert np.isinf(goal_field(field, goal, clearance_m=40.0).to_goal(berth))
    berths = np.array([berth])
    assert np.isfinite(goal_field(field, goal, clearance_m=40.0, berths=berths, berth_m=60.0).to_goal(berth))
