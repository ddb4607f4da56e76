"""The rule for the time of legs of ships with a helm: identities, and agreement with optimised legs."""

from __future__ import annotations

import numpy as np
import pytest

from expdesign.plan.chart.visibility_graph import polyline_length
from expdesign.plan.legs import LegTask
from expdesign.plan.legs._ompl import dubins_curve
from expdesign.plan.local_planner.dubins import dubins_m
from expdesign.plan.local_planner.helm import _lengths_and_times, helm_times
from expdesign.simulation import steady_ahead
from helm_case import coaster, open_water
from plan_case import find_leg


def rule():
    return helm_times(open_water(coaster()).ship)


def test_lengths_are_those_of_the_curves_that_are_sailed():
    rng = np.random.default_rng(0)
    start, end = (np.column_stack([rng.uniform(-5, 5, (200, 2)), rng.uniform(-4, 4, 200)]) for _ in range(2))
    start[:3], end[:3] = [0.0, 0.0, 1.0], [[0.0, 0.0, 1.0], [np.cos(1.0), np.sin(1.0), 1.0], [4.0, 0.0, 1.0]]
    found = dubins_m(start, end, radius_m=2.0)
    for length, a, b in zip(found, start, end, strict=True):
        curve = dubins_curve(a, b, radius_m=2.0, spacing_m=0.02)
        assert polyline_length(curve[:, :2]) == pytest.approx(length, rel=1e-4, abs=1e-4)


def test_lengths_do_not_change_when_poses_are_moved_turned_mirrored_or_sailed_backwards():
    rng = np.random.default_rng(1)
    start, end = rng.uniform(-3, 3, (2, 300, 3))
    found = dubins_m(start, end, radius_m=1.3)
    turn, c, s = 0.7, np.cos(0.7), np.sin(0.7)
    moved = [
        np.column_stack([p[:, :2] @ np.array([[c, s], [-s, c]]) + [2.0, -1.0], p[:, 2] + turn]) for p in (start, end)
    ]
    back = [p + np.array([0.0, 0.0, np.pi]) for p in (end, start)]
    for other in (moved, [p * [1, -1, -1] for p in (start, end)], back):
        np.testing.assert_allclose(dubins_m(*other, radius_m=1.3), found, rtol=1e-6, atol=1e-6)


def test_a_longer_leg_takes_longer_and_never_less_than_its_length_at_transit_speed():
    times = rule()
    for exit_mps, entry_mps in ((0.0, 5.0), (4.8, 5.0), (1.4, 0.0), (2.4, 5.0)):
        shortest_m = max(_lengths_and_times(times, exit_mps, entry_mps)[0][0], 0.0 if entry_mps else times.at_rest_m)
        length_m = shortest_m + np.linspace(0.0, 4000.0, 200)
        seconds = times.seconds(length_m, exit_mps, entry_mps)
        assert (np.diff(seconds) > 0).all()
        assert (seconds >= length_m / times.speed_mps).all()
        far = np.diff(seconds)[-20:] * times.speed_mps / np.diff(length_m)[-20:]
        np.testing.assert_allclose(far, 1.0)
        # a leg that is too short is no way to save time
        assert times.seconds(0.9 * shortest_m, exit_mps, entry_mps) > seconds[0]


def test_keeping_the_speed_loses_hardly_anything_and_a_start_what_accelerating_loses():
    times = rule()
    assert times.lost_s(6.0, 6.0, made_good=True) < 5.0
    ways = times.speeding_up
    rest = float(np.interp(5.0, ways[:, 0], ways[:, 2]) - np.interp(5.0, ways[:, 0], ways[:, 1]) / times.speed_mps)
    assert rest < times.lost_s(0.0, 5.0, made_good=True) < rest + 10.0


def moving(vessel, speed):
    """Velocity (3,) and commands (m,) of a ship that goes straight on, or lies still."""
    if speed == 0.0:
        return np.zeros(3), np.zeros(len(vessel.limits))
    ahead = steady_ahead(vessel, speed)
    return ahead.velocity, ahead.inputs


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("exit_mps", "entry_mps", "hulls"),
    [(0.0, 5.0, 7.0), pytest.param(4.8, 5.0, 8.0, marks=pytest.mark.slow), (2.4, 0.0, 6.0)],
)
def test_optimised_legs_take_as_long_as_the_rule_says(exit_mps, entry_mps, hulls):
    water = open_water(coaster())
    vessel, times = water.vessel, rule()
    (begin, before), (end, after) = (moving(vessel, speed) for speed in (exit_mps, entry_mps))
    way_m = hulls * vessel.length_m
    task = LegTask(
        start=np.r_[0.0, 0.0, 0.0, begin],
        end=np.r_[way_m, 0.0, 0.0, end],
        start_inputs=before,
        end_inputs=after,
        seed=1,
    )
    values = find_leg(task, water)
    assert values is not None
    seconds = len(values) * vessel.sample_time_s
    assert times.seconds(np.array(way_m), exit_mps, entry_mps) == pytest.approx(seconds, rel=0.1)
