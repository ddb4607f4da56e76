"""Inputs that answer a lasting disturbance make biased instruments; planned inputs, or open loop alone, do not."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from expdesign.errors import InputError, NotInformative
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate
from expdesign.estimation.regression import Regression
from expdesign.estimation.values import Estimate, feedback_in
from expdesign.signals import Record
from expdesign.vessel import Term
from steered_ship import TRUTH, legs_and_runs, sailed, surge_model

SEEDS, SAMPLES = 20, 2400
MODEL, TRUE = surge_model(), np.array(list(TRUTH.values()))


def errors(found: Sequence[Estimate]) -> np.ndarray:
    """(seeds, p) of the estimates."""
    return np.array([item.values for item in found]) - TRUE


def in_standard_errors(found: Sequence[Estimate]) -> np.ndarray:
    """(p,) mean error over the standard error of the mean."""
    off = errors(found)
    return np.abs(off.mean(axis=0)) / (off.std(axis=0, ddof=1) / np.sqrt(len(off)))


def chances(found: Sequence[Estimate]) -> np.ndarray:
    """(seeds,) of the test for feedback."""
    return np.array([item.feedback.chance for item in found if item.feedback is not None])


@cache
def treated(treatment: str) -> tuple[Estimate, ...]:
    """By instruments, of ships steered in two stretches of three in a current that wanders."""
    settings, steered = Settings(steered=treatment), legs_and_runs(SAMPLES)
    return tuple(estimate(sailed(seed, SAMPLES, steered=steered), MODEL, settings=settings) for seed in range(SEEDS))


@pytest.mark.thorough
def test_instruments_from_steered_inputs_are_biased() -> None:
    assert in_standard_errors(treated("use")).max() > 3.0


@pytest.mark.thorough
@pytest.mark.parametrize("treatment", ["planned", "leave-out"])
def test_instruments_from_planned_inputs_or_open_loop_are_not(treatment: str) -> None:
    assert in_standard_errors(treated(treatment)).max() < 3.0


@pytest.mark.thorough
def test_output_error_holds_under_feedback_of_white_sensor_noise_where_least_squares_does_not() -> None:
    calm = [sailed(seed, 600, steered=np.ones(600), current_std_mps=0.0) for seed in range(12)]
    assert in_standard_errors([estimate(trial, MODEL, method="oe") for trial in calm]).max() < 3.0
    assert in_standard_errors([estimate(trial, MODEL, method="ls") for trial in calm]).max() > 3.0


def test_inputs_that_follow_disturbances_are_found() -> None:
    found = treated("use")
    assert (chances(found) < 0.01).all()
    assert any("Inputs follow earlier disturbances" in warning for warning in found[0].warnings)


@pytest.mark.thorough
@pytest.mark.parametrize("correlation_s", [0.0, 100.0], ids=["white", "wandering"])
def test_external_inputs_are_suspected_as_often_as_chance_says(correlation_s: float) -> None:
    count = 40
    calm = [sailed(1000 + seed, 400, steered=np.zeros(400), correlation_s=correlation_s) for seed in range(count)]
    found = chances([estimate(trial, MODEL) for trial in calm])
    assert len(found) == count
    for share in (0.05, 0.5):
        assert abs((found < share).mean() - share) < 3.0 * np.sqrt(share * (1 - share) / count)


@pytest.mark.thorough
def test_a_wrong_model_alone_is_not_taken_for_feedback() -> None:
    """The drag is linear, the model's quadratic: past inputs take up what is wrong."""
    quadratic = replace(MODEL, terms=(Term("u", "X_u", "u*abs(u)"), MODEL.terms[1]), parameters=np.array([-0.05, 0.02]))
    calm = [sailed(3000 + seed, 400, steered=np.zeros(400)) for seed in range(40)]
    found = chances([estimate(trial, quadratic) for trial in calm])
    assert (found < 0.05).mean() < 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / 40)


def test_marked_samples_are_not_suspected() -> None:
    for treatment in ("planned", "leave-out"):
        assert (chances(treated(treatment)) < 0.05).mean() < 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / SEEDS)


def test_samples_are_counted() -> None:
    trial = sailed(0, 1200, steered=legs_and_runs(1200))
    planned = estimate(trial, MODEL)
    assert (planned.steered.treatment, planned.steered.samples, planned.residuals.rows) == ("planned", 800, 1198)
    unplanned = sailed(0, 1200, steered=legs_and_runs(1200), planned_known=False)
    left = estimate(unplanned, MODEL)
    assert left.steered.treatment == "leave-out"
    assert left.residuals.rows == 2 * (200 - 2), (
        "two open stretches, without the first pair and the last sample of each"
    )
    assert any("800 of 1200 samples are marked as steered; they are left out" in warning for warning in left.warnings)
    assert estimate(unplanned, MODEL, method="ls").steered.treatment == "use"


def test_leaving_out_equals_data_that_never_had_the_samples() -> None:
    trial = sailed(0, 1200, steered=legs_and_runs(1200))
    (batch,) = trial.batches
    apart = Record(batches=tuple(batch.cut(slice(begin, begin + 200)) for begin in (400, 1000)))
    one, other = estimate(trial, MODEL, settings=Settings(steered="leave-out")), estimate(apart, MODEL)
    np.testing.assert_array_equal(one.values, other.values)
    np.testing.assert_array_equal(one.covariance, other.covariance)


def test_plans_that_were_kept_change_nothing() -> None:
    open_loop = sailed(0, 600, steered=np.zeros(600))
    marked = Record(batches=(replace(open_loop.batches[0], steered=np.ones(600)),))
    np.testing.assert_array_equal(estimate(marked, MODEL).values, estimate(open_loop, MODEL).values)


def test_what_cannot_be_done_is_refused() -> None:
    unplanned = sailed(0, 600, steered=np.ones(600), planned_known=False)
    with pytest.raises(NotInformative, match="all samples are marked as steered"):
        estimate(unplanned, MODEL)
    with pytest.raises(InputError, match="no planned inputs, expected planned_tau_x"):
        estimate(unplanned, MODEL, settings=Settings(steered="planned"))


def test_smoothed_velocities_are_not_tested_as_they_know_what_follows() -> None:
    (batch,) = sailed(0, 600, steered=np.zeros(600)).batches
    assert estimate(Record(batches=(batch,)), MODEL).feedback is not None
    assert estimate(Record(batches=(replace(batch, smoothed=True),)), MODEL).feedback is None


def test_long_data_are_compared_in_part() -> None:
    (batch,) = sailed(0, 120_000, steered=np.zeros(120_000)).batches
    rows = len(batch) - 1
    regression = Regression(parameters=("a",), Phi=np.ones((rows, 1, 1)), y=np.zeros((rows, 1)))
    noise = np.random.default_rng(0).standard_normal((rows, 1))
    apart = feedback_in(Record(batches=(batch,)), regression, noise)
    following = np.roll(batch.inputs[1:, :1], -1, axis=0) + noise  # row k holds the input of k + 2
    assert apart is not None
    assert apart.samples <= 50_000
    assert not apart.found
    followed = feedback_in(Record(batches=(batch,)), regression, following)
    assert followed is not None
    assert followed.found
