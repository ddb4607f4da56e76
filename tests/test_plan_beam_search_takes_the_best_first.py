"""The beam search: successors in order of their time, equals as they come, and each path looked up once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.plan.chart import GoalDistance
from expdesign.plan.local_planner import Departure, PartialPlans, SearchSpace, Successors
from expdesign.plan.local_planner.agile import AgilePlanner
from expdesign.plan.search import place_runs
from expdesign.plan.search.beam import SORTED_AT_ONCE, _in_order
from expdesign.plan.search.local_search import clear_successors, runs_clear
from expdesign.plan.values import WorkBudget
from plan_case import leg_water, primitive, space_of

START = np.array([0.0, -400.0, 0.0])


@pytest.fixture(scope="module")
def space() -> SearchSpace:
    sea = leg_water(shapely.box(-600, -600, 600, 600).difference(shapely.box(-60, -200, 60, 40)))
    return space_of(sea, primitive(sea.vessel), np.array([0.0, 400.0, 0.0]))


def begun(space: SearchSpace) -> PartialPlans:
    """No run done, two to go."""
    return PartialPlans(
        pose=START[None],
        exit_mps=np.zeros(1),
        last=np.array([-1]),
        left=np.array([[2]]),
        cost_s=np.zeros(1),
        history=((),),
    )


def test_order_is_that_of_a_stable_sort_whatever_is_checked_at_once():
    values = np.random.default_rng(0).integers(0, 500, 3 * SORTED_AT_ONCE).astype(float)
    values[::7] = np.inf
    expected = np.argsort(values, kind="stable")[: np.isfinite(values).sum()]
    for at_once in (1000, len(values)):
        np.testing.assert_array_equal(np.concatenate(list(_in_order(values, at_once))), expected)


def test_paths_are_looked_up_once_for_each_run(space, monkeypatch):
    asked, paths = [], GoalDistance.paths
    monkeypatch.setattr(GoalDistance, "paths", lambda self, points: asked.append(len(points)) or paths(self, points))
    assert len(place_runs(space, [3], Departure(pose=START), width=20)) == 3
    assert len(asked) == 3
    assert max(asked) <= 20


def test_each_run_and_each_order_is_told(space):
    told = []
    runs = place_runs(
        space, [5], Departure(pose=START), width=20, progress=lambda what, share: told.append((what, share))
    )
    assert [what for what, _ in told] == [
        *(f"placing run {number} of {len(runs)}" for number in range(1, 6)), "moving runs closer to each other"
    ]  # fmt: skip
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("orders", [0, 6])
def test_runs_are_placed_and_moved_only_where_there_is_a_way_on(space, monkeypatch, orders):
    usual = place_runs(space, [3], Departure(pose=START), width=20, orders=orders)
    north_m = max(run.pose[0] for run in usual)
    monkeypatch.setattr(AgilePlanner, "ways_on", lambda self, space, primitive, start, end: start[:, 0] > north_m)
    placed = place_runs(space, [3], Departure(pose=START), width=20, orders=orders)
    assert all(run.pose[0] > north_m for run in placed)


def test_where_the_grid_knows_no_way_on_runs_are_placed_all_the_same(space, monkeypatch):
    usual = place_runs(space, [3], Departure(pose=START), width=20, orders=0)
    monkeypatch.setattr(AgilePlanner, "ways_on", lambda self, space, primitive, start, end: start[:, 0] > np.inf)
    placed = place_runs(space, [3], Departure(pose=START), width=20, orders=0)
    np.testing.assert_array_equal([run.pose for run in placed], [run.pose for run in usual])


def test_the_work_is_counted_the_same_each_time_and_polishing_is_work_too(space):
    spent_s = []
    for orders in (0, 6, 6):
        budget = WorkBudget()
        place_runs(space, [3], Departure(pose=START), width=20, orders=orders, budget=budget)
        spent_s.append(budget.spent_s)
    assert 0.0 < spent_s[0] < spent_s[1] == spent_s[2]


def test_rows_chosen_from_several_sets_are_those_of_the_joined_set(space):
    parts = space.planner.successors(space, begun(space))
    joined = Successors.joined(parts)
    rows = np.random.default_rng(0).permutation(len(joined))[:300]
    chosen, expected = Successors.chosen(parts, rows), joined[rows]
    for name in ("parent", "primitive", "start", "end", "leg_s"):
        np.testing.assert_array_equal(getattr(chosen, name), getattr(expected, name))


@pytest.mark.parametrize("current", [np.zeros(2), np.array([0.4, -0.2])])
def test_runs_that_are_clear_by_one_look_are_clear_disc_by_disc(space, current):
    drifting = replace(space, current_to=current)
    found = Successors.joined(space.planner.successors(drifting, begun(space)))
    clear = clear_successors(drifting, found)
    assert 0 < clear.sum() < len(found)
    assert runs_clear(drifting, found.primitive[clear], found.start[clear]).all()
