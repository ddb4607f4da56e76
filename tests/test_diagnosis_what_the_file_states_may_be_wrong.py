"""What a vessel file states of water, actuators and sensors is where a diagnosis begins, not where it ends."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from diagnosis_case import Told, drawn_parameters, from_pose, hidden_record, vessel_of
from expdesign.diagnosis import diagnose
from expdesign.diagnosis.accuracy import accuracy
from expdesign.diagnosis.causes import CAUSES
from expdesign.diagnosis.causes.candidate import Candidate, Situation
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit.fit import FitOptions
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.model.extended_model import ExtendedModel
from expdesign.diagnosis.motion.simulation import initial_states
from expdesign.diagnosis.select.score_tests import score_tests
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.diagnosis.vessel_file.writing import extend
from expdesign.signals import Record
from expdesign.vessel import Response, Vessel

EVERYTHING = {"current:north", "current:east", "lag:n", "delay:a", "deadband:a", "offset:a", "heading_bias", "gyro",
              "gyro_bias", "lever:forward", "late:r"}  # fmt: skip


def in_current(ship: str, north: float, east: float) -> Vessel:
    vessel = vessel_of(ship)
    return replace(vessel, environment=replace(vessel.environment, current_to=np.array([north, east])))


def stating_everything() -> Vessel:
    """The tug with a current, slow propellers, late and misaligned angles with a dead band, and wrong sensors."""
    vessel = in_current("tug", 0.1, -0.05)
    responses = Response(lag_s=2.0), Response(delay_s=1.0, deadband=0.05, offset=0.03)
    actuators = tuple(replace(one, responses=responses) for one in vessel.model.actuators)
    sensors = replace(
        vessel.sensors, velocity_forward_m=2.0, velocity_angle_rad=-0.02, yaw_rate_scale=1.04,
        yaw_rate_bias_radps=0.003, yaw_rate_delay_s=1.0,
    )  # fmt: skip
    return replace(vessel, model=replace(vessel.model, actuators=actuators), sensors=sensors)


def candidates(ship: ExtendedModel, record: Record) -> list[Candidate]:
    situation = Situation(ship=ship, windows=cut_windows(ship.model, record))
    return [candidate for cause in CAUSES for candidate in cause.candidates(situation)]


def test_whatever_is_stated_may_be_corrected():
    """Every stated value is free in some candidate, and what is stated of propellers leaves angles to be tested."""
    record = hidden_record("tug", seed=1, batches=2, samples=120)
    ship = extended_model(stating_everything(), record)
    assert set(ship.stated) == EVERYTHING
    free = {key for candidate in candidates(ship, record) for key in candidate.free}
    assert free >= EVERYTHING
    assert {"lag:a", "lag:a1", "delay:n", "deadband:n"} <= free
    assert not {"lag:all", "lag:n1", "offset:a1"} & free  # would act besides what is stated, and say so of no one value


def test_a_lag_stated_of_every_actuator_may_be_wrong_of_some():
    vessel = vessel_of("tug")
    slow = tuple(replace(one, responses=(Response(lag_s=2.0),) * 2) for one in vessel.model.actuators)
    record = hidden_record("tug", seed=1, batches=2, samples=120)
    ship = extended_model(replace(vessel, model=replace(vessel.model, actuators=slow)), record)
    assert ship.stated == {"lag:n": 2.0, "lag:a": 2.0}
    free = {key for candidate in candidates(ship, record) for key in candidate.free}
    assert {key for key in free if key.startswith("lag:")} == {"lag:n", "lag:a"}


def test_a_ship_whose_sensors_are_known_can_be_fitted_with_nothing_free():
    record = hidden_record("tug", seed=1, batches=2, samples=120)
    ship = extended_model(stating_everything(), record)
    windows = replace(cut_windows(ship.model, record), has_heading=False)
    assert fit(ship, windows, (), starts=initial_states(windows), options=FitOptions(ar_order=0)).keys == ()


def test_what_was_found_is_not_sought_again_in_another_way():
    record = hidden_record("tug", seed=1, batches=2, samples=120)
    ship = extended_model(stating_everything(), record).with_effects(
        {"lag:n": 3.0, "late:r": 2.0, "lever:forward": 4.0}
    )
    assert not [c for c in candidates(ship, record) if c.cause in ("actuator_lag", "sensor_delay", "lever_arm")]


def test_a_diagnosis_without_findings_leaves_the_vessel_unchanged():
    record = hidden_record("tug", seed=1, batches=2, samples=120)
    vessel = stating_everything()
    again, missing = extend(vessel, extended_model(vessel, record), {})
    assert missing == ()
    assert again.model.actuators == vessel.model.actuators
    assert again.sensors == vessel.sensors
    np.testing.assert_array_equal(again.environment.current_to, vessel.environment.current_to)


@pytest.mark.thorough
def test_the_current_of_another_day_is_found_and_written():
    record = hidden_record("barge", seed=3, batches=2, samples=120, current=(-0.15, 0.1))
    found = diagnose(in_current("barge", 0.15, 0.0), record)
    assert found.findings[0].cause == "current"
    for one, truth in zip(found.findings[0].estimates, (-0.15, 0.1), strict=True):
        assert abs(one.value - truth) < 4 * one.std
    assert "The vessel file states north_mps 0.15" in found.findings[0].explanation
    values = [one.value for one in found.findings[0].estimates]
    np.testing.assert_allclose(found.extended.environment.current_to, values)


def test_a_current_that_is_as_stated_is_tested_against_what_is_stated():
    """Its score statistic is chi-squared, at least no larger, over six trials; the threshold is its 99.9 % point."""
    statistics = []
    for seed in range(6):
        record = hidden_record("barge", seed=600 + seed, batches=3, samples=120, current=(0.2, -0.1))
        ship = extended_model(in_current("barge", 0.2, -0.1), record)
        windows = cut_windows(ship.model, record)
        base = fit(ship, windows, (), starts=initial_states(windows))
        sought = [c for c in candidates(ship, record) if c.cause == "current"]
        statistics += [item.statistic for item in score_tests(base, sought)]
    assert len(statistics) == 6
    assert sum(statistics) < chi2.isf(1e-3, 12)


def test_a_stated_current_is_left_out_where_no_heading_is_measured():
    record = hidden_record("barge", seed=2, batches=2, samples=150)
    blind = Record(batches=tuple(replace(batch, pose=None) for batch in record.batches))
    vessel = in_current("barge", 0.3, 0.2)
    one, other = (accuracy(extended_model(ship, blind), blind) for ship in (vessel, vessel_of("barge")))
    np.testing.assert_array_equal(one.fit, other.fit)
    again, _ = extend(vessel, extended_model(vessel, blind), {})
    np.testing.assert_array_equal(again.environment.current_to, [0.3, 0.2])


@pytest.mark.thorough
def test_a_cause_with_little_gain_alone_is_judged_again_beside_later_ones():
    """A compass and an antenna that are both not as stated: turned alone, the simulation hardly gains.

    The compass takes 4 % off the error in sway. Six runs show that for certain; three leave its interval open.
    """
    faults = {"heading_bias": 0.05, "lever_m": 3.0}
    batches = hidden_record("barge", seed=6, batches=6, samples=150, faults=faults).batches
    record = Record(batches=tuple(from_pose(batch) for batch in batches))
    barge = vessel_of("barge")
    stated = replace(barge.sensors, heading_bias_rad=0.03, position_forward_m=-1.0)
    found = diagnose(replace(barge, sensors=stated), record)
    estimates = {item.cause: item.estimates[0] for item in found.findings}
    for cause, truth in (("lever_arm", 3.0), ("heading_bias", -0.05)):
        assert abs(estimates[cause].value - truth) < 4 * estimates[cause].std


@pytest.mark.slow
def test_a_lag_of_propellers_that_is_longer_than_stated_is_found():
    record = hidden_record("coaster", seed=4, effects={"lag_s": 9.0, "acts_on": 0b01}, batches=6)
    vessel = vessel_of("coaster")
    first, *others = vessel.model.actuators
    slow = replace(first, responses=(Response(lag_s=3.0),))
    found = diagnose(replace(vessel, model=replace(vessel.model, actuators=(slow, *others))), record)
    assert found.findings[0].cause == "actuator_lag"
    (lag,) = found.findings[0].estimates
    assert abs(lag.value - 9.0) < 4 * lag.std


LATE_S = 0.6
OFF = [("barge", 1, 3), pytest.param("coaster", 3, 4, marks=pytest.mark.thorough)]  # ship, seed, runs


def late(ship: str, seed: int, runs: int, *, off: float) -> Record:
    """Orders that act late, on a ship whose parameters differ from the file's by so many shares of themselves."""
    acting = {"delay_s": LATE_S, "acts_on": {"barge": 0b111, "coaster": 0b11}[ship]}
    return hidden_record(ship, seed=seed, effects=acting, relative_std=off, batches=runs, samples=200)


@pytest.mark.parametrize(("ship", "seed", "runs"), OFF)
def test_parameters_of_the_file_that_are_off_are_told_beside_a_cause_with_their_own_gain(
    ship: str, seed: int, runs: int
) -> None:
    """They are three times as far off as the file says; all of their gain was told to be that of the dead time."""
    found = diagnose(vessel_of(ship, relative_std=0.05), late(ship, seed, runs, off=0.15))
    delay, parameters = found.findings
    assert {delay.cause, *delay.not_distinguishable_from} >= {"actuator_delay"}
    assert parameters.cause == "parameters"
    assert "parameters" not in delay.not_distinguishable_from
    assert parameters.gain > 15 * delay.gain > 0
    assert "actuators" in found.verdict
    assert found.verdict.count("correct value") >= 2
    assert not any("beyond their standard deviations" in note or "unlike the file's" in note for note in found.notes)
    true = drawn_parameters(ship, Told(relative_std=0.15), np.random.default_rng(seed))
    for one in parameters.estimates:
        assert one.stated is not None
        assert abs(one.value - one.stated) > 3 * 0.05 * abs(one.stated)
        assert abs(one.value - true[one.name]) < 0.1 * abs(one.stated)
    assert len(found.errors) == len(found.step_residuals) == 2


@pytest.mark.parametrize(("ship", "seed", "runs"), OFF)
def test_parameters_that_are_within_what_the_file_says_are_no_finding_beside_a_cause(
    ship: str, seed: int, runs: int
) -> None:
    (delay,) = diagnose(vessel_of(ship, relative_std=0.05), late(ship, seed, runs, off=0.03)).findings
    assert {delay.cause, *delay.not_distinguishable_from} >= {"actuator_delay"}
