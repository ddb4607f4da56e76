"""Trials of which only the pose was recorded, at any rate, in one run or many, with and without wind measured."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import from_pose, hidden_record, vessel_of
from expdesign.diagnosis import diagnose
from expdesign.signals import Record

AIR = ("W_abs_u_u", "W_abs_v_v", "W_uv")


def pose_only(ship: str, *, smoothed: bool = False, wind: bool = True, **options) -> Record:
    """A trial of `hidden_effects` without its velocities."""
    batches = hidden_record(ship, **options).batches
    return Record(batches=tuple(from_pose(batch, smoothed=smoothed, wind=wind) for batch in batches))


def check(found, cause: str, name: str, truth: float) -> None:
    assert found.findings, f"{cause} was not found"
    assert found.findings[0].cause == cause
    (one,) = [item for item in found.findings[0].estimates if item.name == name]
    assert abs(one.value - truth) < 4 * one.std + 0.002 * abs(truth)


@pytest.mark.thorough
def test_a_compass_that_shows_too_little_is_named():
    """v_measured = v + u sin(bias) where the heading that turns the positions lacks the bias."""
    record = pose_only("barge", seed=21, faults={"heading_bias": 0.06}, batches=3, samples=200)
    found = diagnose(vessel_of("barge"), record)
    check(found, "heading_bias", "heading_bias_rad", -0.06)
    assert "compass shows" in found.findings[0].explanation
    assert "too little" in found.findings[0].explanation
    assert found.extended.sensors.heading_bias_rad == pytest.approx(-0.06, abs=0.02)


def test_a_propeller_s_advance_loss_is_named_for_ships_with_rudders():
    record = hidden_record("coaster", seed=21, effects={"kappa": -0.0003}, batches=3, samples=200)
    check(diagnose(vessel_of("coaster"), record), "thrust_advance_loss", "X_unn", -0.0003)


@pytest.mark.slow
@pytest.mark.parametrize("step_s", [0.5, 0.2, 0.1, 0.05])
def test_thrust_is_named_at_any_rate(step_s):
    record = pose_only("barge", seed=22, effects={"gain": -0.2}, batches=3, samples=round(300 / step_s), step_s=step_s)
    check(diagnose(vessel_of("barge", sample_time_s=step_s), record), "thrust_gain", "factor", 0.8)


@pytest.mark.slow
def test_one_run_without_wind_shows_a_current():
    record = pose_only("coaster", seed=23, current=(0.2, 0.15), batches=1, samples=1800, wind=False)
    check(diagnose(vessel_of("coaster"), record), "current", "north_mps", 0.2)


@pytest.mark.slow
def test_a_wind_that_nobody_measured_is_named_with_its_direction():
    record = hidden_record("tug", seed=1, wind=(6.0, 4.0))
    record = Record(batches=tuple(replace(batch, wind=None) for batch in record.batches))
    check(diagnose(vessel_of("tug", without=AIR), record), "wind", "toward_rad", float(np.arctan2(4.0, 6.0)))


@pytest.mark.slow
def test_the_damping_of_roll_is_found_with_its_period():
    effects = {"roll_period_s": 9.0, "roll_damping": 0.2, "roll_sway": 0.4, "roll_yaw": 0.01}
    found = diagnose(vessel_of("barge"), hidden_record("barge", seed=9, effects=effects, batches=5))
    for name, truth in (("roll_period_s", 9.0), ("roll_damping_ratio", 0.2), ("Y_phi", 0.4)):
        check(found, "roll_coupling", name, truth)


@pytest.mark.slow
@pytest.mark.parametrize("smoothed", [False, True])
def test_clean_trials_are_called_clean(smoothed):
    """At most one false alarm in twenty is expected; four or more have a probability below 2 per cent."""
    alarms = 0
    for seed in range(20):
        record = pose_only("barge", seed=200 + seed, batches=4, smoothed=smoothed)
        alarms += bool(diagnose(vessel_of("barge"), record, seed=seed).findings)
    assert alarms <= 3
