"""A plan does not depend on how much empty or unreachable chart surrounds it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign import workflows
from expdesign.plan.assembly import ship_on_legs, waters
from expdesign.plan.chart import connects, reachable, resolved
from expdesign.plan.chart.goal_distance import grid_cell_m
from expdesign.plan.solve import plan_trial
from expdesign.plan.values import PlanProblem
from expdesign.scenario import load_scenario
from expdesign.workflows import plan_problem
from plan_case import area
from short_examples import SHORTER, copied, example_run

ENDS = np.array([[0.0, -200.0], [0.0, 200.0]])


@pytest.fixture(scope="module")
def problem(tmp_path_factory) -> PlanProblem:
    case = load_scenario(copied(tmp_path_factory.mktemp("copy"), "model-ship", SHORTER["model-ship"]))
    information = workflows.scored(case)
    return plan_problem(case, information, workflows.designed(case, information), seed=1)


def square(half_m: float) -> shapely.Polygon:
    return shapely.box(-half_m, -half_m, half_m, half_m)


def test_the_reachable_water_is_the_part_round_the_ends_that_is_connected_to_them():
    lake, sea = square(1000.0), square(30_000.0).difference(square(1100.0))
    found = reachable(area(lake.union(sea)), ENDS, np.inf)
    assert found.water.equals(lake)
    near = reachable(area(square(30_000.0)), ENDS, 500.0)
    assert near.water.equals(shapely.box(-700.0, -500.0, 700.0, 500.0))


def test_water_that_the_grid_resolves_is_taken_as_it_is():
    whole = area(square(1000.0))
    assert resolved(whole, ENDS, 5000.0, hull_m=30.0)[0] is whole


@pytest.mark.parametrize("half_m", [20_000.0, 80_000.0])
def test_the_grid_is_as_fine_in_a_large_chart_as_in_a_small_one(half_m):
    found, reach_m = resolved(area(square(half_m)), ENDS, 60_000.0, hull_m=30.0)
    assert grid_cell_m(found, 30.0 / 8) <= 0.25 * 30.0
    assert reach_m >= 60 * 30.0


def test_a_detour_that_joins_the_ends_is_not_cut_off():
    wall = shapely.box(-10, -30_000, 10, 9000)
    whole = area(square(30_000.0).difference(wall))
    found, reach_m = resolved(whole, ENDS, 60_000.0, hull_m=30.0)
    assert connects(found, ENDS)
    assert 9000 < reach_m < 30_000


def waters_of(problem):
    return waters(problem, ship_on_legs(problem))


def plan_in(problem, water):
    plan = plan_trial(replace(problem, area=replace(problem.area, water=shapely.multipolygons([*water]))))
    assert plan.verification.passed
    assert plan.leave_water_probability <= 1 - problem.settings.confidence
    return plan


@pytest.mark.parametrize("half_m", [16_000.0, 64_000.0])
def test_the_water_that_is_planned_in_is_the_same_in_bounds_of_any_size(problem, half_m):
    first = [next(waters_of(replace(problem, area=area(square(size))))) for size in (4000.0, half_m)]
    assert first[0].water.equals(first[1].water)


@pytest.mark.slow
def test_the_plan_is_the_same_in_bounds_of_any_size(problem):
    few, many = (plan_in(problem, [square(half_m)]) for half_m in (4000.0, 32_000.0))
    np.testing.assert_array_equal(few.trajectory.pose, many.trajectory.pose)
    assert few.risk == many.risk
    assert few.reposition_bound_s == pytest.approx(many.reposition_bound_s, abs=1e-3)


def behind_land(problem):
    """The water of a problem, and a sea with islands that no ship comes to from there."""
    sea = square(16_000.0).difference(square(1000.0))
    isles = [shapely.Point(x, y).buffer(400.0) for x in range(-9000, 9001, 3000) for y in (5e3, 8e3)]
    return [*problem.area.water.geoms, sea.difference(shapely.union_all(isles))]


def test_the_water_that_is_planned_in_is_the_same_whatever_lies_behind_land(problem):
    whole = replace(problem, area=replace(problem.area, water=shapely.multipolygons(behind_land(problem))))
    first = [next(waters_of(case)) for case in (problem, whole)]
    assert first[0].water.equals(first[1].water)


@pytest.mark.slow
def test_the_plan_is_the_same_whatever_lies_behind_land(problem, made_once):
    folder, _ = example_run(made_once, "model-ship")
    alone = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    plan = plan_in(problem, behind_land(problem))
    assert plan.seconds("reposition") == alone["reposition_s"]
    assert plan.leave_water_probability == alone["leave_water_probability"]
    assert plan.reposition_bound_s == pytest.approx(alone["reposition_bound_s"], abs=1e-3)


def test_where_the_near_water_has_no_room_more_and_more_of_the_chart_is_tried(problem):
    problem = replace(problem, area=area(square(32_000.0)))
    tried = [water.water.area for water in waters_of(problem)]
    assert tried == sorted(tried)
    assert 2 < len(tried) < 10
    assert tried[-1] == problem.area.water.area
