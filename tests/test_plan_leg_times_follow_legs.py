"""The rule for the time of legs: closed forms, symmetry, and agreement with optimised legs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.stats import binom

from expdesign.dictionary.build import trim
from expdesign.plan.control.acceleration_limits import leg_end, to_work_s
from expdesign.plan.legs import LegTask
from expdesign.plan.local_planner.transitions import (
    COURSES,
    DIRECTIONS,
    GOING_ON,
    LENGTHS,
    SETTLING_SHARE,
    TURNS,
    LegTimes,
    leg_times,
    transition_losses_s,
    transitions,
)
from expdesign.simulation import CALM
from plan_case import find_leg, leg_water

RULE = LegTimes(speed_mps=2.0, push_mps2=0.5, swing_radps=0.25, settle_s=4.0, hull_m=20.0)
REST = np.zeros(1)


def test_from_rest_to_rest_a_leg_takes_what_a_pushed_point_takes():
    far, near = (RULE.step_s(np.array([[d, 0.0, 0.0]]), REST, REST)[0] - 4.0 for d in (100.0, 4.5))
    assert far == pytest.approx(100 / 2.0 + 2.0 / 0.5)
    assert near == pytest.approx(2 * np.sqrt(4.5 / 0.5))


def test_a_turn_on_the_spot_takes_its_angle_by_the_rate_either_way_round():
    turns = np.array([0.5, -0.5, 3.0, -3.0, 2 * np.pi - 0.5])
    steps = np.column_stack([0 * turns, 0 * turns, turns])
    np.testing.assert_allclose(RULE.step_s(steps, REST, REST), 4.0 + np.array([0.5, 0.5, 3.0, 3.0, 0.5]) / 0.25)


def test_going_on_as_before_loses_nothing_but_what_the_speed_falls_short():
    for speed in (0.5, 1.0, 2.0):
        way = speed * RULE.settle_s
        spent = RULE.step_s(np.array([way, 0.0, 0.0]), np.array(speed), np.array(speed))
        assert spent == pytest.approx(RULE.settle_s)


def test_transitions_on_offer_to_port_are_on_offer_to_starboard():
    found = transitions(RULE, 0.8, 1.2)
    rows = {(*np.round(step, 6), round(seconds, 6)) for step, seconds in zip(found.step, found.seconds, strict=True)}
    for forward, starboard, turn, seconds in rows:
        other = (forward, -starboard, -turn % (2 * np.pi), seconds)
        assert any(np.allclose(other, row, atol=1e-4) for row in rows)


def test_mirrored_legs_take_as_long_and_so_do_reversed_ones():
    rng = np.random.default_rng(0)
    length, first, last, turn = rng.uniform(0, 100, 50), *rng.uniform(-3, 3, (3, 50))
    begin, end = rng.uniform(0, 2, (2, 50))
    seconds = RULE.seconds(length, first, last, turn, begin, end)
    np.testing.assert_allclose(RULE.seconds(length, -first, -last, -turn, begin, end), seconds)
    np.testing.assert_allclose(RULE.seconds(length, last, first, turn, end, begin), seconds)
    assert (seconds >= (length - 4.0 * (begin + end) / 2) / 2.0).all()


def test_no_transition_on_offer_is_beaten_by_another_with_its_turn_in_its_direction():
    found = transitions(RULE, 1.0, 0.5)
    np.testing.assert_allclose(found.seconds, RULE.step_s(found.step, np.array(1.0), np.array(0.5)))
    lengths = np.r_[RULE.hull_m * LENGTHS, RULE.settle_s * 0.75 * GOING_ON]
    length, course = (grid.ravel() for grid in np.meshgrid(lengths, COURSES))
    for turn in TURNS:
        every = np.column_stack([length * np.cos(course), length * np.sin(course), 0 * length + turn])
        seconds = RULE.step_s(every, np.array(1.0), np.array(0.5))
        offered = np.isclose(found.step[:, 2], turn)
        assert seconds.min() == pytest.approx(found.seconds[offered].min())  # no wish at all: the shortest
        for wish in DIRECTIONS:
            ahead = np.array([np.cos(wish), np.sin(wish)])
            lost = found.seconds[offered] - found.step[offered, :2] @ ahead / RULE.speed_mps
            least = (seconds - every[:, :2] @ ahead / RULE.speed_mps).min()
            assert lost.min() == pytest.approx(least)
            assert transition_losses_s(RULE, 1.0, 0.5)[turn == TURNS, wish == DIRECTIONS] == pytest.approx(least)


def test_actuators_that_need_longer_lose_no_less():
    slow = replace(RULE, settle_s=6.0)
    assert (transition_losses_s(RULE, 1.0, 0.5) <= transition_losses_s(slow, 1.0, 0.5) + 1e-9).all()


@pytest.mark.thorough
@pytest.mark.parametrize("legs", [8, pytest.param(60, marks=pytest.mark.slow)])
def test_half_of_optimised_legs_take_as_long_as_the_rule_says_within_three_seconds(legs):
    water = leg_water(shapely.box(-1000, -1000, 1000, 1000))
    rng, transit = np.random.default_rng(3), water.ship.transit_speed_mps
    changes = leg_end(water.vessel, CALM, 0.0, None, top_mps=transit, yaw_rate_radps=0.3).changes
    rule = leg_times(water.vessel, water.ship, changes)
    assert rule.settle_s == pytest.approx(SETTLING_SHARE * to_work_s(water.vessel))
    off_s = []
    for _ in range(legs):
        speeds = rng.choice([0.0, 0.4, 0.8], 2) * transit
        course, turn, length = rng.normal(0, 0.6), rng.uniform(-np.pi, np.pi), rng.uniform(30, 120)
        step = np.array([length * np.cos(course), length * np.sin(course), turn])
        inputs = [trim(water.vessel, np.array([speed, 0.0, 0.0])) for speed in speeds]
        task = LegTask(
            start=np.array([0, 0, 0, speeds[0], 0, 0]),
            end=np.array([*step, speeds[1], 0, 0]),
            start_inputs=inputs[0],
            end_inputs=inputs[1],
            seed=1,
        )
        found = find_leg(task, water)
        assert found is not None
        seconds = len(found) * water.vessel.sample_time_s
        off_s.append(abs(seconds - float(rule.step_s(step, speeds[:1], speeds[1:])[0])))
    assert sum(off < 3.0 for off in off_s) >= binom.ppf(0.01, legs, 0.5)
