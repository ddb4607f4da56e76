"""Legs of a vessel whose actuators lag and come late: delivered values run on from leg to run and from run to leg."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign.plan.legs import LegTask
from expdesign.plan.resimulation import FINE_SUBSTEPS
from expdesign.signals import Commands
from expdesign.simulation import CALM, delivered_at_samples, simulate
from expdesign.vessel import Response
from plan_case import at_rest, find_leg, leg_water

OPEN = shapely.box(-1500, -1500, 1500, 1500)
CASES = {
    "lag": Response(lag_s=2.0),
    "lag and delay": Response(lag_s=1.5, delay_s=2.4),
    "delay": Response(delay_s=1.0),
    "delay of no whole sample": Response(delay_s=1.3),
}


def slow_water(response: Response):
    water = leg_water(OPEN)
    slow = [replace(item, responses=(response,) * len(item.limits)) for item in water.vessel.actuators]
    model = replace(water.vessel.model, actuators=tuple(slow))
    return replace(water, vessel=replace(water.vessel, model=model))


def slow_leg(water, start, end, before):
    task = LegTask(start=start, end=end, start_inputs=before[-1], end_inputs=np.zeros(4), seed=1, before=before)
    return find_leg(task, water)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name == "delay" else name for name in CASES]
)
def test_a_leg_arrives_although_actuators_are_slow(name):
    water, start, end = slow_water(CASES[name]), at_rest(0, 0, 0.0), at_rest(60, 40, 1.0)
    before = np.array([[0.0] * 4, [1.5, 0.1, -1.5, 0.1], [3.0, 0.2, -2.0, 0.2]])
    values = slow_leg(water, start, end, before)
    assert values is not None
    track = water.sail(start, values, before)
    np.testing.assert_allclose(track.pose[-1], end[:3], atol=0.03)
    np.testing.assert_allclose(track.velocity[-1], end[3:], atol=2e-3)
    told = np.concatenate([before, values])
    given = delivered_at_samples(water.vessel.responses, told, sample_time_s=1.0, standing=before[0])
    np.testing.assert_allclose(given[-1], 0.0, atol=2e-3)  # of 15 rps: ready for what comes next


@pytest.mark.parametrize("name", CASES)
def test_sailing_in_two_parts_is_sailing_at_once(name):
    water = slow_water(CASES[name])
    rng = np.random.default_rng(0)
    values = np.cumsum(rng.normal(0, [0.5, 0.05, 0.5, 0.05], (60, 4)), axis=0)
    values[0] = 0.0
    commands = Commands(sample_time_s=1.0, names=water.vessel.model.inputs, values=values)
    whole = simulate(water.vessel, commands, environment=CALM)
    half = np.r_[whole.pose[30], whole.velocity[30]]
    second = water.sail(half, values[30:], values[:30])
    np.testing.assert_allclose(second.pose, whole.pose[30:], atol=1e-9)
    np.testing.assert_allclose(second.velocity, whole.velocity[30:], atol=1e-9)


@pytest.mark.parametrize("delay_s", [0.43, 1.3])
def test_a_dead_time_of_no_whole_sample_leaves_the_track_as_its_verification_finds_it(delay_s):
    """Ten minutes of commands that jump: the errors of steps with the mean of two commands add up to a decimetre."""
    water = slow_water(Response(delay_s=delay_s))
    rng = np.random.default_rng(3)
    jumps = np.repeat(rng.uniform(-1, 1, (150, 4)) * [6.0, 0.5, 6.0, 0.5], 4, axis=0)
    values = np.vstack([np.zeros((1, 4)), jumps])
    track = water.sail(np.zeros(6), values, values[:1])
    commands = Commands(sample_time_s=1.0, names=water.vessel.model.inputs, values=values)
    again = simulate(water.vessel, commands, environment=CALM, substeps=FINE_SUBSTEPS)
    off_m = np.hypot(*(again.pose - track.pose)[:, :2].T).max()
    assert off_m < 1e-3
