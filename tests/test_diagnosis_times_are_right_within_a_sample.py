"""What acts in a part of a sample's time is simulated so, and roll that is quick beside it."""

import numpy as np
import pytest

import hidden_effects as sea
from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.causes.candidate import Candidate
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.motion.simulation import initial_states, simulate_windows
from expdesign.diagnosis.select.fitted_candidate import fit_candidate, profile_estimate, with_profile_estimate
from expdesign.diagnosis.select.score_tests import ScoreTest
from expdesign.diagnosis.select.starting_point import starting_point
from expdesign.diagnosis.vessel_file.reading import extended_model

CALM = sea.Weather(current_std=0.0, wind_std=0.0)
PERFECT = sea.Sensors(position=0.0, heading=0.0, velocity=0.0, yaw_rate=0.0, wind=0.0)
ROLL = {"roll:period": 6.0, "roll:damping": 0.08, "roll:sway": 0.4, "roll:yaw": 0.01}
CASES = (
    ("barge", {"lag_s": 3.5, "acts_on": 0b111}, {"lag:all": 3.5}, "lag:all", 0.01),
    ("tug", {"lag_s": 2.3, "acts_on": 0b1111}, {"lag:all": 2.3}, "lag:all", 0.01),
    ("barge", {"delay_s": 3.4, "acts_on": 0b111}, {"delay:all": 3.4}, "delay:all", 0.01),
    ("barge", {"change_s": 60.4, "change_gain": 0.3}, {"change:time": 60.4, "change:gain": 0.3}, "change:time", 0.2),
    (
        "barge", {"roll_period_s": 6.0, "roll_damping": 0.08, "roll_sway": 0.4, "roll_yaw": 0.01}, ROLL, "roll:period",
        0.006,
    ),
)  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]}-{case[3]}")
def test_a_second_s_step_is_no_coarser_than_a_small_part_of_the_time(case):
    """Against a generator of a fifth of the step, nothing random, errors are below those of a time a little off."""
    ship, hidden, effects, key, little = case
    record = hidden_record(
        ship, seed=5, batches=2, samples=150, weather=CALM, sensors=PERFECT, effects=hidden, manoeuvre="zigzag"
    )
    extended = extended_model(vessel_of(ship), record).with_effects(effects)
    windows = cut_windows(extended.model, record)
    starts = initial_states(windows, extended.states)

    def error(extended) -> float:
        found = simulate_windows(extended, windows, starts).error[..., :3]
        return float(np.sqrt(np.mean((found / np.std(windows.measured[..., :3], axis=(0, 1))) ** 2)))

    right = error(extended)
    for way in (-little, little):
        assert right < error(extended.with_effects({key: effects[key] + way}))


@pytest.mark.parametrize(
    ("ship", "hidden", "candidate", "key", "truth"),
    [
        (
            "coaster", {"deadband": 0.18, "dead_on": 0b10},
            Candidate(cause="actuator_deadband", free={"deadband:rudder": 0.1}, finite=True,
                      grid=("deadband:rudder", tuple(np.linspace(0.02, 0.5, 25).tolist()))),
            "deadband:rudder", 0.18,
        ),
        (
            "barge", {"change_s": 412.3, "change_gain": 0.2},
            Candidate(cause="change_point", free={"change:gain": 0.0}, fixed={"change:time": 430.0},
                      grid=("change:time", tuple(np.linspace(380.0, 480.0, 11).tolist()))),
            "change:time", 412.3,
        ),
    ],
    ids=("width", "time"),
)  # fmt: skip
def test_a_number_found_by_trying_lies_within_three_standard_errors(ship, hidden, candidate, key, truth):
    record = hidden_record(ship, seed=6, batches=5, samples=160, effects=hidden)
    extended = extended_model(vessel_of(ship), record)
    windows = cut_windows(extended.model, record)
    base = fit(extended, windows, (), starts=initial_states(windows))
    first = starting_point(base, ScoreTest(candidate=candidate, statistic=0.0, p_value=0.0, step=np.zeros(1)))
    rough = fit_candidate(base, windows, first)
    assert rough is not None
    found = with_profile_estimate(rough, base)
    assert found.profiled is not None
    std = found.profiled[1]
    assert abs(found.fit.value(key) - truth) < 3 * std
    assert std < 0.1 * truth
    assert found.likelihood_gain >= rough.likelihood_gain - 1.0


@pytest.mark.thorough
def test_a_width_is_as_unsure_as_the_commands_leave_it():
    """Steering in square waves has a few sizes only; any dead band between two of them is as good as another."""
    hidden = {"deadband": 34.0, "dead_on": 0b100}
    record = hidden_record("barge", seed=7, batches=6, samples=160, effects=hidden, manoeuvre="zigzag")
    sizes = np.unique(np.concatenate([np.abs(batch.inputs[:, 2]).round(6) for batch in record.batches]))
    low, high = sizes[sizes < 34.0].max(), sizes[sizes > 34.0].min()
    extended = extended_model(vessel_of("barge"), record)
    windows = cut_windows(extended.model, record)
    base = fit(extended.with_effects({"deadband:tau_psi": low + 0.1}), windows, (), starts=initial_states(windows))
    found, std = profile_estimate(base, "deadband:tau_psi", 0.01)
    assert found.value("deadband:tau_psi") == pytest.approx((low + high) / 2, abs=0.2 * (high - low))
    assert std == pytest.approx((high - low) / 2, rel=0.5)
