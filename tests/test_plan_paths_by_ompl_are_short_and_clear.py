"""Paths by OMPL of legs that bend: clear, hardly longer than the shortest, the same whenever they are asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.plan.assembly import leg_water as planned_water
from expdesign.plan.assembly import ship_on_legs
from expdesign.plan.chart import Roadmap, polyline_length
from expdesign.plan.legs import LegPath, LegTask, LegWater
from expdesign.plan.legs import water as water_module
from expdesign.plan.legs._ompl import roadmap_of, shortened
from expdesign.scenario import load_scenario
from expdesign.workflows import designed, plan_problem, scored
from plan_case import leg_water, local_planner, random_path
from scenario_files import SCENARIOS

BASIN = shapely.box(-500, -500, 500, 500)
ENDS = np.array([0.0, -450.0]), np.array([0.0, 450.0])
STRAIGHT = np.array([-450.0, -450.0]), np.array([-450.0, 450.0])
SEEDS = range(6)
AGILE = ["harbour", "helsinki-hour", "model-ship", "narrows", "story"]


def islands(seed: int) -> LegWater:
    """Water with islands that close the straight way from west to east."""
    rng = np.random.default_rng(seed)
    lands = [shapely.LineString(random_path(rng, rng.uniform(-250, 250, 2), 5)).buffer(25) for _ in range(4)]
    wall = shapely.box(-30, -300 + 150 * rng.uniform(), 30, 300 - 150 * rng.uniform())
    return leg_water(BASIN.difference(shapely.union_all([*lands, wall])).buffer(0))


def paths(water: LegWater, ends: tuple[np.ndarray, np.ndarray]) -> list[LegPath]:
    return list(water.candidate_paths(*ends))


@pytest.mark.parametrize("seed", SEEDS)
def test_paths_are_clear_and_hardly_longer_than_the_shortest(seed: int) -> None:
    water = islands(seed)
    found = paths(water, ENDS)
    assert {path.source for path in found} == {"ompl PRMstar in R2"}
    exact = [water.area.safe_water(water.clearance_m + spare) for spare in water.ship.path_spares_m(water.vessel)]
    for path in found:
        assert np.array_equal(path.points[[0, -1]], ENDS)
        assert any(shapely.covers(safe, shapely.LineString(path.points[:, ::-1])) for safe in exact)
    ranks = [np.ceil(path.length_m / (2 * water.vessel.length_m)) for path in found]
    assert ranks == sorted(ranks)
    shortest = [path.length_m for path in paths(replace(water, paths="visibility"), ENDS)]
    assert np.allclose([path.length_m for path in found], shortest, rtol=0.01)


@pytest.mark.thorough
@pytest.mark.parametrize("name", AGILE)
def test_on_every_example_chart_no_path_is_a_hundredth_longer_than_the_shortest(name: str) -> None:
    case = load_scenario(SCENARIOS / f"{name}.toml")
    information = scored(case)
    problem = plan_problem(case, information, designed(case, information))
    water = planned_water(problem, ship_on_legs(problem))
    graph = water.narrowest_graph
    roadmap = roadmap_of(water.centre_waters[-1], water.tolerance_m, water.corners)
    rng = np.random.default_rng(1)
    longer = []
    for start, end in islanded(graph, rng, 25):
        path, shortest = roadmap.shortest(start, end), graph.shortest(start, end)
        assert (path is None) == (shortest is None)
        if path is not None and shortest is not None:
            taut = shortened(path, roadmap.water)
            assert shapely.covers(graph.water, shapely.LineString(taut[:, ::-1]))
            longer.append(polyline_length(taut) / polyline_length(shortest) - 1.0)
    assert min(longer) > -1e-9
    assert max(longer) < 0.01


def islanded(graph: Roadmap, rng: np.random.Generator, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Pairs of places of the water that are not in sight of each other."""
    west, south, east, north = graph.water.bounds
    pairs: list[tuple[np.ndarray, np.ndarray]] = []
    while len(pairs) < count:
        ends = rng.uniform((south, west), (north, east), (2, 2))
        wet = shapely.contains_xy(graph.water, ends[:, 1], ends[:, 0]).all()
        if wet and not graph.joins(ends[:1], ends[1:])[0]:
            pairs.append((ends[0], ends[1]))
    return pairs


@pytest.mark.thorough
def test_a_path_does_not_depend_on_what_was_asked_before() -> None:
    first = [path.points for path in paths(islands(0), ENDS)]
    paths(islands(1), ENDS)
    paths(islands(0), (ENDS[1], np.array([300.0, -400.0])))
    roadmap_of.cache_clear()
    again = [path.points for path in paths(islands(0), ENDS)]
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))


def test_nothing_is_searched_for_a_straight_leg(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(water_module, "roadmap_of", lambda *water: pytest.fail("searched"))
    (path,) = paths(islands(0), STRAIGHT)
    assert path.source == "straight"


def test_the_graph_is_asked_where_it_is_wished_and_where_the_roadmap_has_no_path(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    water = islands(0)
    wished, *_ = paths(replace(water, paths="visibility"), ENDS)
    assert wished.source == "visibility graph"
    roadmap = roadmap_of(water.centre_waters[0], water.tolerance_m, water.corners)
    empty = replace(roadmap, corners=roadmap.corners[:0], lengths=roadmap.lengths[:0, :0])
    monkeypatch.setattr(water_module, "roadmap_of", lambda *water: empty)
    found, *_ = paths(water, ENDS)
    assert (found.source, found.points.tolist()) == (wished.source, wished.points.tolist())


@pytest.mark.thorough
def test_a_leg_says_what_found_its_path() -> None:
    water, rest = islands(0), np.zeros(4)
    start, end = (np.r_[place, np.zeros(4)] for place in ENDS)
    task = LegTask(start=start, end=end, start_inputs=rest, end_inputs=rest, seed=1)
    leg = local_planner(water).leg(task, water)
    assert leg is not None
    assert leg.source == "ompl PRMstar in R2"
