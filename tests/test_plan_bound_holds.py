"""The bound on repositioning time: closed forms where there are some, and below everything that can be done."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
import shapely
from plan_case import area, at_rest, leg_water, ship
from test_plan_verification_catches_what_is_wrong import primitive

from expdesign.plan.legs import LegTask, find_leg
from expdesign.plan.lower_bound import Carry, carry, credit, joint_losses, reposition_bound_s, way_to_sail_m
from expdesign.simulation import CALM, Environment

OPEN = shapely.box(-1000, -1000, 1000, 1000)
WALL = shapely.box(-10, -1000, 10, 300)
ENDS = (np.array([0.0, -200.0, 0.0]), np.array([0.0, 200.0, 0.0]))


def to_sail(water, carries, repeats, ends=ENDS, margin_m=5.0) -> float:
    return way_to_sail_m(area(water), margin_m, carries, repeats, ends, 0.5)


def test_open_water_leaves_the_straight_line_less_the_chords():
    run = Carry(chord_m=30.0, path_m=80.0, stray_m=20.0)
    assert to_sail(OPEN, {"run": run}, {"run": 3}) == pytest.approx(400 - 90, abs=1e-6)
    assert to_sail(OPEN, {}, {}) == pytest.approx(400, abs=1e-6)


def test_round_a_wall_the_way_is_the_taut_string():
    detour = 2 * np.hypot(305, 195) + 2 * 5 + 10  # at most: corners rounded at 5 m are cut off
    found = to_sail(OPEN.difference(WALL), {}, {})
    assert 0.99 * detour < found <= detour


def test_a_run_whose_chord_crosses_the_wall_may_not_be_counted_by_its_chord():
    # a run round the wall: 20 m from side to side, but 700 m of path, 300 m from the chord
    around = Carry(chord_m=20.0, path_m=700.0, stray_m=300.0)
    string = to_sail(OPEN.difference(WALL), {}, {})
    found = to_sail(OPEN.difference(WALL), {"run": around}, {"run": 1})
    assert found == pytest.approx(max(string - 700, 400 - 20), abs=30)
    assert found <= string - 20


def test_a_straight_run_carries_its_length_and_does_not_stray():
    run = primitive(ship())
    found = carry(ship(), run, CALM)
    assert found.chord_m == pytest.approx(found.path_m)
    assert found.stray_m < 0.01 * found.path_m
    drifting = carry(ship(), run, Environment(current_to=np.array([0.3, 0.4])))
    assert drifting.chord_m == pytest.approx(found.chord_m + 0.5 * run.duration_s)


def test_what_a_run_is_credited_with_in_a_current_is_the_most_over_all_headings():
    run, current, speed = primitive(ship()), np.array([0.3, 0.4]), 1.3
    heading = np.linspace(-np.pi, np.pi, 3601)
    found = credit(run, carry(ship(), run, Environment(current_to=current)), 0.5, speed)
    track = run.trajectory.pose[:, :2]

    def most(water):
        moved = np.stack([np.cos(heading), np.sin(heading)]) * water
        ground = moved + current[:, None] * run.duration_s
        return (np.hypot(*ground) - current @ ground / speed).max()

    assert found.chord_m == pytest.approx(most(np.hypot(*(track[-1] - track[0]))), rel=1e-5)
    assert found.path_m == pytest.approx(found.chord_m, rel=0.02)  # a straight run, its speed changing


def test_no_point_of_a_drifting_runs_chord_is_farther_from_its_path_than_told():
    run = primitive(ship())
    turn = np.radians(120.0) * np.linspace(0, 1, len(run.trajectory))
    arc = np.column_stack([40 * np.sin(turn), 40 * (1 - np.cos(turn)), turn])
    bent = replace(run, trajectory=replace(run.trajectory, pose=arc))
    for current in (np.zeros(2), np.array([0.2, 0.0])):
        told = carry(ship(), bent, Environment(current_to=current)).stray_m
        for heading in np.linspace(-np.pi, np.pi, 37):
            c, s = np.cos(heading), np.sin(heading)
            track = arc[:, :2] @ np.array([[c, s], [-s, c]]) + current * run.trajectory.time_s[:, None]
            chord = track[0] + np.linspace(0, 1, 400)[:, None] * (track[-1] - track[0])
            assert shapely.distance(shapely.points(chord), shapely.linestrings(track)).max() <= told


@pytest.mark.parametrize("along", [1.0, -1.0])
def test_with_and_against_a_current_the_bound_is_the_way_by_the_speed_over_ground(along):
    current = np.array([0.0, 0.2 * along])
    bound_s = reposition_bound_s(
        ship(),
        area(OPEN),
        Environment(current_to=current),
        clearance_m=20.0,
        primitives=(),
        repeats={},
        ends=ENDS,
        speed_mps=1.3,
        yaw_rate_radps=0.1,
    )
    truth = 400 / (1.3 + 0.2 * along)
    assert 400 / 1.5 - 1e-9 <= bound_s <= truth + 1e-6
    assert bound_s == pytest.approx(truth, rel=0.03)  # 1 / (1 + x) against 1 - x


def test_the_cheapest_assignment_of_speeds_is_the_least_over_all_orders():
    rng = np.random.default_rng(0)
    for _ in range(20):
        exits, entries = rng.uniform(0, 1.2, (2, 5))
        lost, least = joint_losses(exits, entries, speed_mps=1.3, acceleration_mps2=0.2)
        costs = [
            sum((1.3 - (a + b) / 2) * abs(a - b) / 0.2 for a, b in zip(exits, order, strict=True))
            for order in permutations(entries)
        ]
        times = [sum(np.abs(exits - order) / 0.2) for order in permutations(entries)]
        assert lost == pytest.approx(min(costs))
        assert least == pytest.approx(min(times))


def test_changing_speed_loses_what_constant_acceleration_loses():
    lost, least = joint_losses(np.array([0.0]), np.array([0.0]), speed_mps=1.0, acceleration_mps2=0.5)
    assert (lost, least) == (0.0, 0.0)  # no leg is needed between equal speeds
    lost, least = joint_losses(np.array([0.0]), np.array([1.0]), speed_mps=1.0, acceleration_mps2=0.5)
    assert (lost, least) == pytest.approx((2.0 - 1.0, 2.0))  # 2 s for 1 m


@pytest.mark.parametrize("seed", range(2))
def test_legs_found_in_random_water_take_longer_than_the_bound(seed):
    rng = np.random.default_rng(seed)
    rocks = shapely.union_all(shapely.buffer(shapely.points(rng.uniform(-300, 300, (12, 2))), rng.uniform(5, 60, 12)))
    ends = (np.array([-500.0, -500.0, 0.7]), np.array([500.0, 500.0, 0.7]))
    water = leg_water(OPEN.difference(rocks))
    bound_s = reposition_bound_s(
        water.vessel,
        water.area,
        CALM,
        clearance_m=20.0,
        primitives=(),
        repeats={},
        ends=ends,
        speed_mps=1.001 * water.ship.transit_speed_mps,
        yaw_rate_radps=water.ship.spot_rate_radps,
    )
    task = LegTask(
        start=at_rest(*ends[0]), end=at_rest(*ends[1]), start_inputs=np.zeros(4), end_inputs=np.zeros(4), seed=1
    )
    values = find_leg(task, water)
    assert values is not None
    seconds = len(values) * water.vessel.sample_time_s
    assert bound_s < seconds < 1.1 * bound_s + 20
