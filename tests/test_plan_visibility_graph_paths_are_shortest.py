"""Visibility-graph paths against closed forms, and in turned, mirrored and shifted charts."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import shapely

from expdesign.plan.chart import visibility_graph
from expdesign.plan.chart.goal_distance import (
    build_goal_distance,
    clearance_field,
    first_bends,
    shortest_path_tree,
    taut_bends,
)
from expdesign.plan.chart.visibility_graph import (
    VisibilityGraph,
    build_visibility_graph,
    polyline_length,
    sight_lines,
    simplified,
)
from plan_case import area, leg_water

OPEN = shapely.box(-500, -500, 500, 500)
WALL = shapely.box(-10, -500, 10, 300)


def rocks(seed: int) -> shapely.Geometry:
    rng = np.random.default_rng(seed)
    return OPEN.difference(
        shapely.union_all(shapely.buffer(shapely.points(rng.uniform(-350, 350, (15, 2))), rng.uniform(20, 90, 15)))
    )


def turned(geometry, angle):
    """Turned clockwise on the chart, as headings are counted."""
    c, s = np.cos(angle), np.sin(angle)
    return shapely.transform(geometry, lambda xy: xy @ np.array([[c, -s], [s, c]]))


def turned_point(point, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]]) @ point


def shortest_m(water: shapely.Geometry, start: np.ndarray, end: np.ndarray) -> float:
    """Length of the shortest path."""
    path = build_visibility_graph(water).shortest(start, end)
    assert path is not None
    return polyline_length(path)


def test_in_open_water_the_shortest_path_is_straight():
    path = build_visibility_graph(OPEN).shortest(np.array([-400.0, -300.0]), np.array([400.0, 300.0]))
    assert len(path) == 2
    assert polyline_length(path) == pytest.approx(1000.0)


def test_round_a_wall_the_shortest_path_bends_at_both_corners():
    path = build_visibility_graph(OPEN.difference(WALL)).shortest(np.array([0.0, -200.0]), np.array([0.0, 200.0]))
    assert polyline_length(path) == pytest.approx(2 * np.hypot(300, 190) + 20, abs=1e-2)
    np.testing.assert_allclose(path[1:3], [[300, -10], [300, 10]], atol=1e-2)


def test_a_closed_wall_leaves_no_path():
    water = OPEN.difference(shapely.box(-10, -600, 10, 600))
    assert build_visibility_graph(water).shortest(np.array([0.0, -200.0]), np.array([0.0, 200.0])) is None


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("angle", [0.3, 1.1, 2.5])
def test_turning_and_mirroring_the_chart_changes_no_length(seed, angle):
    start, end = np.array([-450.0, -420.0]), np.array([440.0, 460.0])
    length = shortest_m(rocks(seed), start, end)
    again = shortest_m(turned(rocks(seed), angle), turned_point(start, angle), turned_point(end, angle))
    assert again == pytest.approx(length, abs=0.02)
    mirrored = shapely.transform(rocks(seed), lambda xy: xy * [-1, 1])
    assert shortest_m(mirrored, start * [1, -1], end * [1, -1]) == pytest.approx(length, abs=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_simplified_water_holds_or_is_held(seed):
    water = leg_water(rocks(seed)).safe
    more, less = (simplified(water, grow=grow, tolerance_m=2.0) for grow in (True, False))
    assert more.covers(water)
    assert water.covers(less)
    start, end = np.array([-450.0, -420.0]), np.array([440.0, 460.0])
    short, exact, long = (shortest_m(some, start, end) for some in (more, water, less))
    assert short <= exact + 1e-6
    assert exact <= long + 1e-6


@pytest.mark.parametrize("seed", range(2))
def test_tabulated_distances_and_their_paths_agree_with_the_visibility_graph(seed):
    water = rocks(seed)
    field = clearance_field(area(water), resolution_m=4.0)
    graph, goal = build_visibility_graph(water), np.array([440.0, 460.0])
    table = build_goal_distance(graph, field, goal)
    points = np.random.default_rng(seed).uniform(-450, 450, (60, 2))
    points = points[field.at(points) > 3 * field.cell_m]
    exact = np.array([polyline_length(graph.shortest(point, goal)) for point in points])
    np.testing.assert_allclose(table.to_goal(points), exact, atol=3 * table.field.cell_m)
    lengths = [polyline_length(table.path(point)) for point in points]
    np.testing.assert_allclose(lengths, exact, atol=3 * table.field.cell_m)
    for path, point in zip(table.paths(points), points, strict=True):
        assert polyline_length(path) == pytest.approx(polyline_length(table.path(point)))
        np.testing.assert_allclose(path[[0, -1]], [point, goal])


@pytest.mark.parametrize("seed", range(3))
def test_taut_corners_give_the_same_lengths_as_all_corners(seed):
    graph, goal = build_visibility_graph(rocks(seed)), np.array([440.0, 460.0])
    nodes, distance, next_node = shortest_path_tree(graph, goal)
    points = np.random.default_rng(seed).uniform(-520, 520, (400, 2))  # some ashore, some off the chart
    total = np.hypot(*np.moveaxis(points[:, None] - nodes, -1, 0)) + distance
    length, _ = taut_bends(graph, points, nodes, next_node, total)
    expected, _ = first_bends(graph, points, nodes, distance)
    assert np.isinf(expected).any()
    assert np.isfinite(expected).any()
    np.testing.assert_allclose(length, expected, rtol=1e-9)


def test_points_are_joined_where_the_whole_line_between_them_is_water():
    graph, rng = build_visibility_graph(rocks(1)), np.random.default_rng(1)
    a, b = rng.uniform(-480, 480, (2, 500, 2))
    joined = graph.joins(a, b)
    np.testing.assert_array_equal(joined, shapely.covers(graph.water, sight_lines(a, b)))
    assert 0 < joined.sum() < len(joined)


def test_few_lines_of_sight_are_tested_for_each_cell(monkeypatch):
    water, lines = rocks(0), []
    joins = VisibilityGraph.joins
    monkeypatch.setattr(VisibilityGraph, "joins", lambda graph, a, b: lines.append(len(a)) or joins(graph, a, b))
    field = clearance_field(area(water), resolution_m=4.0)
    table = build_goal_distance(build_visibility_graph(water), field, np.array([440.0, 460.0]))
    cells = table.field.centre(np.arange(table.field.clearance_m.size))
    wet = shapely.contains_xy(table.graph.water, cells[:, 1], cells[:, 0])
    assert wet.sum() <= sum(lines) <= 3 * wet.sum()


def test_corners_tested_in_parts_give_the_graph_of_all_at_once(monkeypatch):
    water = rocks(3)
    whole = build_visibility_graph(water)
    monkeypatch.setattr(visibility_graph, "PAIRS", len(whole.corners) ** 2 // 7)
    parts = build_visibility_graph(water)
    assert whole.lengths.nnz > len(whole.corners)
    assert (whole.lengths != parts.lengths).nnz == 0


@pytest.mark.thorough
def test_passages_between_a_thousand_islands_remain():
    """Islands have four corners each at least, so 4000 must be accepted before their passages are lost."""
    pitch_m, radius_m, side = 1000.0, 200.0, 32
    middles = pitch_m * (np.stack(np.divmod(np.arange(side**2), side), axis=1) + 0.5)
    islands = shapely.buffer(shapely.points(middles), radius_m, quad_segs=8)
    water = shapely.MultiPolygon(
        [shapely.box(0, 0, pitch_m * side, pitch_m * side).difference(shapely.union_all(islands))]
    )
    simple = simplified(water, grow=False, tolerance_m=1.0)
    assert water.covers(simple)
    lanes = pitch_m * np.stack([np.arange(1, side), np.full(side - 1, 0.5)], axis=1)
    assert shapely.covers(simple, sight_lines(lanes, lanes + np.array([0.0, pitch_m * (side - 1)]))).all()


def test_narrow_passages_among_islands_remain_with_more_corners():
    """Few corners are reached by a tolerance that is wider than the passages."""
    pitch_m, side = 100.0, 12
    middles = pitch_m * (np.stack(np.divmod(np.arange(side**2), side), axis=1) + 0.5)
    islands = shapely.union_all(shapely.buffer(shapely.points(middles), 40.0, quad_segs=4))
    water = shapely.MultiPolygon([shapely.box(0, 0, pitch_m * side, pitch_m * side).difference(islands)])
    few, many = (
        simplified(water, grow=False, tolerance_m=0.5, corners=((1.0, 50), (4.0, count))) for count in (300, 2000)
    )
    lane = sight_lines(*(pitch_m * np.array([[side / 2, share * side]]) for share in (0.05, 0.95)))
    assert water.covers(few)
    assert water.covers(many)
    assert not shapely.covers(few, lane).all()
    assert shapely.covers(many, lane).all()


def test_a_graph_that_another_process_gets_has_its_water_prepared():
    graph = build_visibility_graph(shapely.box(0, 0, 100, 100).difference(shapely.box(40, 20, 60, 80)))
    assert shapely.is_prepared(graph.water)
    copied = pickle.loads(pickle.dumps(graph))
    assert shapely.is_prepared(copied.water)
    ends = np.array([50.0, 10.0]), np.array([50.0, 90.0])
    assert np.array_equal(copied.shortest(*ends), graph.shortest(*ends))
