"""Ships that sail arcs get away from where there is room for their turns, and are told where there is none."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from expdesign.errors import NoPlan
from expdesign.plan import PlanSettings
from expdesign.plan.chart.goal_distance import clearance_field
from expdesign.plan.control.ships import capability
from expdesign.plan.legs import LegWater
from expdesign.plan.legs.water import check_ends, escapes
from expdesign.plan.local_planner import local_planner
from expdesign.plan.local_planner.arcs import ways_on
from expdesign.simulation import CALM
from helm_case import catamaran
from plan_case import area, ship

VESSEL, CLEARANCE = catamaran(), 0.5
SHIP = capability(VESSEL, PlanSettings(clearance_m=CLEARANCE))
RADIUS = SHIP.turning_radius_m


def water(basin: shapely.Geometry) -> LegWater:
    sea = area(basin)
    return LegWater(
        vessel=VESSEL,
        environment=CALM,
        ship=SHIP,
        area=sea,
        clearance_m=CLEARANCE,
        field=clearance_field(sea, resolution_m=0.5),
    )


def slip(half_m: float) -> LegWater:
    """A slip of a width, closed to the south, that opens to a bay to the north; in turning radii."""
    bay = shapely.box(-8 * RADIUS, 0, 8 * RADIUS, 8 * RADIUS)
    return water(bay.union(shapely.box(-half_m, -4 * RADIUS, half_m, 0.1)))


@pytest.mark.parametrize("backwards", [False, True])
def test_a_slip_can_only_be_left_through_its_mouth(backwards):
    narrow, inside = slip(0.6 * RADIUS), np.array([-2 * RADIUS, 0.0, 0.0])
    out = np.add(inside, (0, 0, np.pi * backwards))  # a way towards a place comes from where its stern points
    assert escapes(out, narrow, backwards=backwards)
    assert not escapes(np.add(out, (0, 0, np.pi)), narrow, backwards=backwards)


def test_a_slip_wider_than_a_turn_of_half_a_circle_lets_ships_turn():
    least = RADIUS + np.hypot(RADIUS + VESSEL.beam_m / 2, VESSEL.length_m / 2) - RADIUS + CLEARANCE
    into = np.array([-2.5 * RADIUS, 0.0, np.pi])
    assert not escapes(into, slip(0.9 * RADIUS))
    assert escapes(np.add(into, (0, -RADIUS, 0)), slip(least + 0.3 * RADIUS))


def test_answers_do_not_depend_on_where_north_is():
    bay = slip(0.6 * RADIUS)
    for turn in np.linspace(0.3, 6.0, 5):
        turned = water(shapely.affinity.rotate(bay.area.water, -np.degrees(turn), origin=(0, 0)))
        place = -2 * RADIUS * np.array([np.cos(turn), np.sin(turn)])
        assert escapes(np.r_[place, turn], turned)
        assert not escapes(np.r_[place, turn + np.pi], turned)


def test_the_message_names_the_end_and_its_place_and_agile_ships_are_not_asked():
    narrow, out, into = slip(0.6 * RADIUS), np.array([-2 * RADIUS, 0, 0]), np.array([-2 * RADIUS, 0, np.pi])
    check_ends(out, into, narrow)
    lat, lon = narrow.area.frame.to_degrees(into[:2])
    for ends, name in (((into, into), "from the start"), ((out, out), "to the goal")):
        with pytest.raises(NoPlan, match=name) as caught:
            check_ends(*ends, narrow)
        assert f"near {lat:.5f}, {lon:.5f}" in str(caught.value)
        assert f"{RADIUS:.3g} m radius" in str(caught.value)
    agile = capability(ship(), PlanSettings(clearance_m=CLEARANCE))
    local_planner(replace(narrow, ship=agile)).check_ends(into, out, narrow)
    with pytest.raises(NoPlan):
        local_planner(narrow).check_ends(into, out, narrow)


def on_the_grid(sea: LegWater, pose: np.ndarray, *, backwards: bool = False) -> np.ndarray:
    """(n,) whether a search for places sees a way on from poses (n, 3)."""
    margin_m = CLEARANCE + VESSEL.beam_m / 2 + sea.field.cell_m
    return ways_on(SimpleNamespace(ship=SHIP, field=sea.field, leg_margin_m=margin_m), pose, backwards=backwards)


@pytest.mark.parametrize("backwards", [False, True])
def test_the_search_for_places_sees_a_way_on_nearly_wherever_there_is_one_and_nowhere_else(backwards):
    rng = np.random.default_rng(5)
    islands = [shapely.Point(*place).buffer(1.5 * RADIUS) for place in 8 * RADIUS * rng.uniform(-1, 1, (9, 2))]
    sea = water(shapely.box(*(8 * RADIUS * np.array([-1, -1, 1, 1]))).difference(shapely.union_all(islands)))
    pose = rng.uniform(-1, 1, (400, 3)) * (8 * RADIUS, 8 * RADIUS, np.pi)
    pose = pose[[sea.holds(each[None]) for each in pose]]
    exact = np.array([escapes(each, sea, backwards=backwards) for each in pose])
    seen = on_the_grid(sea, pose, backwards=backwards)
    assert 0.05 < np.mean(~exact) < 0.5
    assert np.mean(exact[seen]) > 0.99
    assert np.mean(seen[exact]) > 0.95


def test_the_search_for_places_knows_where_a_slip_opens():
    inside = np.array([[-2 * RADIUS, 0.0, heading] for heading in (0.0, np.pi)])
    assert on_the_grid(slip(0.6 * RADIUS), inside).tolist() == [True, False]
    assert on_the_grid(slip(0.6 * RADIUS), inside, backwards=True).tolist() == [False, True]
