"""Paths by OMPL of legs that bend: clear, nearly as short as the shortest, the same whenever they are asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.plan.chart import polyline_length
from expdesign.plan.legs import LegTask, LegWater
from expdesign.plan.legs import water as water_module
from plan_case import leg_water, local_planner, random_path

BASIN = shapely.box(-500, -500, 500, 500)
STRAIGHT = np.array([-450.0, -450.0]), np.array([-450.0, 450.0])
SEEDS = range(6)


def task(start: np.ndarray, end: np.ndarray, seed: int = 1) -> LegTask:
    """A leg between places (2,), at rest."""
    rest = np.zeros(4)
    states = (np.array([*place, 0.0, 0.0, 0.0, 0.0]) for place in (start, end))
    return LegTask(**dict(zip(("start", "end"), states, strict=True)), start_inputs=rest, end_inputs=rest, seed=seed)


def islands(seed: int) -> LegWater:
    """Water with islands that close the straight way from west to east."""
    rng = np.random.default_rng(seed)
    lands = [shapely.LineString(random_path(rng, rng.uniform(-250, 250, 2), 5)).buffer(25) for _ in range(4)]
    wall = shapely.box(-30, -300 + 150 * rng.uniform(), 30, 300 - 150 * rng.uniform())
    return leg_water(BASIN.difference(shapely.union_all([*lands, wall])).buffer(0))


ENDS = np.array([0.0, -450.0]), np.array([0.0, 450.0])


@pytest.mark.parametrize("seed", SEEDS)
def test_paths_are_clear_and_hardly_longer_than_the_shortest(seed: int) -> None:
    water = islands(seed)
    found = list(water.candidate_paths(*ENDS, task(*ENDS)))
    assert sum(path.source == "ompl BITstar in R2" for path in found) >= len(found) - 1
    margins = water.ship.path_spares_m(water.vessel)
    exact = [water.area.safe_water(water.clearance_m + spare) for spare in margins]
    shortest_m = polyline_length(water.narrowest_graph.shortest(*ENDS))
    for path in found:
        assert np.array_equal(path.points[[0, -1]], ENDS)
        assert any(shapely.covers(safe, shapely.LineString(path.points[:, ::-1])) for safe in exact)
    assert min(path.length_m for path in found) <= 1.01 * shortest_m


def test_a_path_does_not_depend_on_what_was_searched_before() -> None:
    water, other = islands(0), islands(1)
    first = [path.points for path in water.candidate_paths(*ENDS, task(*ENDS))]
    list(other.candidate_paths(*ENDS, task(*ENDS, seed=5)))
    again = [path.points for path in water.candidate_paths(*ENDS, task(*ENDS))]
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))


def test_a_path_turns_with_the_chart() -> None:
    water, turn = islands(2), np.array([[0.0, 1.0], [-1.0, 0.0]])
    turned = leg_water(shapely.transform(water.area.water, lambda places: places @ turn))
    # (east, north) are turned, so (north, east) are turned the other way
    ends = tuple((end[::-1] @ turn)[::-1] for end in ENDS)
    lengths = [
        next(sea.candidate_paths(*places, task(*places))).length_m for sea, places in ((water, ENDS), (turned, ends))
    ]
    assert lengths[0] == pytest.approx(lengths[1], rel=2e-3)


def test_nothing_is_searched_for_a_straight_leg(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(water_module, "search_plane", lambda *ends, **rest: pytest.fail("searched"))
    (path,) = islands(0).candidate_paths(*STRAIGHT, task(*STRAIGHT))
    assert path.source == "straight"


def test_the_graph_is_asked_where_it_is_wished_and_where_nothing_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    water = islands(0)
    (wished, *_) = replace(water, paths="visibility").candidate_paths(*ENDS, task(*ENDS))
    assert wished.source == "visibility graph"
    monkeypatch.setattr(water_module, "search_plane", lambda *ends, **rest: None)
    (found, *_) = water.candidate_paths(*ENDS, task(*ENDS))
    assert found.source == "visibility graph, as OMPL found no path as short"
    assert np.array_equal(found.points, wished.points)


def test_searches_are_counted_and_named_with_the_leg() -> None:
    water = islands(0)
    asked = task(*ENDS)
    leg = local_planner(water).leg(asked, water)
    assert leg is not None
    assert (leg.source, asked.budget.searches) == ("ompl BITstar in R2", 1)
    assert asked.budget.spent_s > 0
