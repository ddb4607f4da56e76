from __future__ import annotations

import numpy as np
import pytest
import shapely

from expdesign.plan.chart.goal_distance import clearance_field, narrowest_passage
from plan_case import area


def test_clearance_of_a_square_is_the_distance_to_its_nearest_side():
    field = clearance_field(area(shapely.box(-500, -500, 500, 500)), resolution_m=5.0)
    points = np.random.default_rng(0).uniform(-480, 480, (500, 2))
    exact = 500 - np.abs(points).max(axis=1)
    assert np.abs(field.at(points) - exact).max() <= field.error_m


def test_points_outside_the_water_have_no_clearance():
    field = clearance_field(area(shapely.box(-500, -500, 500, 500)), resolution_m=5.0)
    assert not field.at(np.array([[0.0, 900.0], [-2000.0, 0.0], [505.0, 0.0]])).any()


def test_a_closed_wall_leaves_no_passage():
    wall = shapely.box(-10, -600, 10, 600)
    field = clearance_field(area(shapely.box(-500, -500, 500, 500).difference(wall)), resolution_m=5.0)
    start, goal = np.array([0.0, -200.0]), np.array([0.0, 200.0])
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
    widest, place = narrowest_passage(field, np.array([0.0, -200.0]), np.array([0.0, 200.0]))
    assert widest == pytest.approx(100.0, abs=field.error_m)  # round its end, not through it
    assert 300 < place[0] < 500


def test_of_several_passages_in_a_row_one_of_the_narrowest_is_named():
    water = shapely.box(-500, -500, 900, 500)
    for east, north in ((-100, 350), (300, -350), (700, 300)):
        wall = shapely.box(east - 10, -600, east + 10, 600)
        water = water.difference(wall.difference(shapely.box(east - 20, north - 40, east + 20, north + 40)))
    field = clearance_field(area(water), resolution_m=4.0)
    widest, place = narrowest_passage(field, np.array([-300.0, -300.0]), np.array([-300.0, 800.0]))
    assert widest == pytest.approx(40.0, abs=field.error_m)
    gaps = np.array([[350.0, -100.0], [-350.0, 300.0], [300.0, 700.0]])
    assert np.hypot(*(gaps - place).T).min() < 40.0 + 10.0 + 3 * field.error_m
