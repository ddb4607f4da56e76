"""Placements are polished: legs take less time, nothing leaves the water, and mirrored plans are polished alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.plan.chart.visibility_graph import polyline_length
from expdesign.plan.local_planner import Departure, SearchSpace, TriedTransition, run_ends
from expdesign.plan.search import local_search
from expdesign.plan.search.local_search import (
    MOST_POSES,
    _Legs,
    _longest_block,
    measured_s,
    polished,
    runs_clear,
    with_another,
)
from plan_case import leg_water, primitive, space_of

ISLAND = shapely.box(-60, -200, 60, 40)
START = np.array([0.0, -400.0, 0.0])
POSES = np.array([[30.0, -330.0, 1.2], [120.0, -150.0, 1.0], [170.0, 120.0, 2.0]])
MIRROR = np.array([-1.0, 1.0, -1.0])


def placed_in(water: shapely.Geometry, goal: np.ndarray) -> SearchSpace:
    sea = leg_water(water)
    return space_of(sea, primitive(sea.vessel), goal)


@pytest.fixture(scope="module")
def space():
    return placed_in(shapely.box(-600, -600, 600, 600).difference(ISLAND), np.array([0.0, 400.0, 0.0]))


def test_legs_take_less_time_and_runs_and_paths_stay_in_the_water(space):
    ends = Departure(pose=START)
    found = polished(space, ends, [0, 0, 0], POSES)
    assert (
        found.seconds
        == measured_s(space, [0, 0, 0], found.poses, ends)
        < measured_s(space, [0, 0, 0], POSES, ends) - 5.0
    )
    assert runs_clear(space, np.zeros(3, dtype=int), found.poses).all()
    assert polished(space, ends, [0, 0, 0], found.poses).seconds == pytest.approx(found.seconds, abs=0.5)


@pytest.mark.parametrize("leg", [1, 2, 3])
def test_another_run_is_put_where_no_move_of_it_makes_the_legs_shorter(space, leg):
    """The others stay where they are."""
    ends = Departure(pose=START)
    found = with_another(space, ends, [0, 0, 0], POSES, leg=leg, run=0)
    assert found is not None
    np.testing.assert_array_equal(np.delete(found, leg, axis=0), POSES)
    assert runs_clear(space, np.zeros(4, dtype=int), found).all()
    legs = _Legs(space=space, departure=ends)
    chain = legs.measured(np.zeros(4, dtype=int), found)
    assert legs.moved(chain, leg, leg) is chain


@pytest.mark.parametrize(("width_m", "found"), [(40.0, False), (200.0, True)])
def test_a_run_needs_room_in_a_leg(width_m, found):
    """In a channel between two basins in which no run has room beside the legs to it and on from it."""
    basins = [shapely.box(-420, -60, -300, 60), shapely.box(300, -60, 420, 60)]
    water = shapely.union_all([*basins, shapely.box(-310, -width_m / 2, 310, width_m / 2)])
    ends = Departure(pose=np.array([0.0, -310.0, np.pi / 2]))
    space = placed_in(water, np.array([0.0, 310.0, 0.0]))
    another = with_another(space, ends, [], np.zeros((0, 3)), leg=0, run=0)
    assert (another is not None) == found


def test_no_plan_takes_less_than_its_path_at_full_speed(space):
    ends = Departure(pose=START)
    found = polished(space, ends, [0, 0, 0], POSES)
    froms, tos = (
        np.vstack([START, run_ends(space, np.zeros(3, dtype=int), found.poses)]),
        np.vstack([found.poses, space.goal]),
    )
    ways = [space.goal_distance.graph.shortest(a[:2], b[:2]) for a, b in zip(froms, tos, strict=True)]
    way_m = sum(polyline_length(way) for way in ways)
    assert found.seconds >= way_m / space.planner.times.speed_mps


def test_the_work_of_a_sweep_does_not_grow_with_the_cube_of_the_runs():
    for runs in range(1, 400):
        longest = _longest_block(runs)
        poses = sum(length * (runs - length + 1) for length in range(1, longest + 1))
        assert poses <= MOST_POSES
        whole = runs * (runs + 1) * (runs + 2) // 6  # of all blocks
        assert (longest == runs) == (whole <= MOST_POSES)


def test_short_blocks_alone_shorten_legs_of_many_runs(space, monkeypatch):
    ends = Departure(pose=START)
    monkeypatch.setattr(local_search, "MOST_POSES", 3)
    found = polished(space, ends, [0, 0, 0], POSES)
    assert runs_clear(space, np.zeros(3, dtype=int), found.poses).all()
    assert found.seconds < measured_s(space, [0, 0, 0], POSES, ends) - 5.0


def test_a_mirrored_plan_in_mirrored_water_takes_as_long():
    waters = [
        shapely.box(-600, -600, 600, 600).difference(shapely.affinity.scale(ISLAND, 1, sign, origin=(0, 0)))
        for sign in (1, -1)
    ]
    totals = []
    for water, sign in zip(waters, (np.ones(3), MIRROR), strict=True):
        space = placed_in(water, np.array([0.0, 400.0, 0.0]) * sign)
        ends = Departure(pose=START * sign)
        totals.append(polished(space, ends, [0, 0, 0], POSES * sign).seconds)
    assert totals[0] == pytest.approx(totals[1], rel=0.01)


def test_a_transition_that_was_tried_takes_what_it_took(space):
    pose = np.array([-300.0, -300.0, 0.0])
    end = run_ends(space, np.zeros(1, dtype=int), pose[None])[0]
    transition = TriedTransition(step=np.array([7.0, 2.0, 0.3]), seconds=3.0, more_s=0.0)
    known = replace(space, tried={("go", "go"): transition})
    after = end + transition.step  # the run is straight: its end still points north
    ends = Departure(pose=START)
    apart = [measured_s(one, [0, 0], np.stack([pose, after]), ends) for one in (known, space)]
    assert apart[0] < apart[1] - 1.0
