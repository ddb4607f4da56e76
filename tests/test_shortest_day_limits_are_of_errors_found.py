"""Limits on standard deviations are judged by the errors that a track leaves, and forecast by the reference."""

from dataclasses import replace

import numpy as np
import pytest

from expdesign.errors import InputError
from expdesign.indices import outcome_gradients
from expdesign.information.expected import expected_covariance
from expdesign.rehearsal import trial_parts
from expdesign.scenario import load_scenario
from expdesign.shortest_day import AccuracySettings, stated_accuracy
from expdesign.vessel import Sensors
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.scored import scored
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")

STORY = SCENARIOS / "story.toml"
NORMAL_95 = 1.959963984540054


@pytest.fixture(scope="module")
def reference():
    """Vessel, weather, runs, optimal durations, their information, and the errors that they leave."""
    case = load_scenario(STORY)
    information = scored(case)
    design = designed(case, information, seed=1)
    problem, runs = design.problem, [item.primitive for item in information]
    covariance = expected_covariance(
        case.vessel,
        trial_parts(runs, design.fractions * problem.total_s / problem.run_s, environment=case.environment),
        problem.parameters,
        environment=case.environment,
        unknown_current=True,
    )
    told = problem.total_s / case.vessel.sample_time_s * np.tensordot(design.fractions, problem.matrices, axes=1)
    return case, design, runs, told, covariance


def accuracy(reference, settings):
    case, design, runs, _, _ = reference
    return stated_accuracy(settings, design, case.vessel, runs, case.environment)


def test_what_the_reference_leaves_is_forecast_of_it(reference):
    _, design, _, told, covariance = reference
    std = dict(zip(design.problem.parameters, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    for name, value in std.items():
        asked = accuracy(reference, AccuracySettings(std={name: value}))
        assert asked.margin(told) == pytest.approx(0.0, abs=1e-9)
        assert asked.margin_of_track(told, covariance) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.thorough
def test_an_outcome_is_as_uncertain_as_errors_along_its_gradient(reference):
    case, design, _, told, covariance = reference
    gradient = outcome_gradients(case.vessel, ("advance_m",), design.problem.parameters)[1][0]
    half = NORMAL_95 * np.sqrt(gradient @ covariance @ gradient)
    asked = accuracy(reference, AccuracySettings(outcomes_95={"advance_m": float(half)}))
    assert asked.margin(told) == pytest.approx(0.0, abs=1e-9)
    assert asked.margin_of_track(told, covariance) == pytest.approx(0.0, abs=1e-9)
    assert asked.told(covariance)["advance_m"] == pytest.approx(half)


def test_the_margin_of_a_track_is_that_of_the_furthest_from_its_limit(reference):
    _, _, _, told, covariance = reference
    std = np.sqrt(np.diag(covariance))
    asked = accuracy(reference, AccuracySettings(std={"X_u": 0.5 * std[0], "X_vr": 0.8 * std[2]}))
    assert asked.margin_of_track(told, covariance) == pytest.approx(2 * np.log(0.5))
    assert asked.margin_of_track(told, 0.25 * covariance) == pytest.approx(0.0)
    assert asked.margin_of_track(told, None) == -np.inf
    assert asked.lacking(told, covariance) == (
        f"the standard deviation of X_u is {std[0]:.3g} where {0.5 * std[0]:.3g} is asked for"
    )


def test_prior_knowledge_counts_besides(reference):
    case, design, runs, told, covariance = reference
    known = replace(design, problem=replace(design.problem, prior=design.problem.prior + 1e-4 * np.diag(np.diag(told))))
    settings = AccuracySettings(std={"X_u": 1.0})
    free, joined = (
        stated_accuracy(settings, item, case.vessel, runs, case.environment).margin_of_track(told, covariance)
        for item in (design, known)
    )
    assert joined > free


def test_limits_say_nothing_of_information_alone(reference):
    settings = AccuracySettings(as_durations=True, std={"X_u": 0.01}, outcomes_95={"advance_m": 5.0})
    asked, criterion = accuracy(reference, settings), accuracy(reference, AccuracySettings(as_durations=True))
    told = reference[3]
    assert asked.of_information.margin(told) == criterion.margin(told) == criterion.of_information.margin(told)


def test_errors_of_ideal_sensors_cannot_be_limited(reference):
    case, design, runs, _, _ = reference
    vessel = replace(case.vessel, sensors=Sensors())
    with pytest.raises(InputError, match="needs the noise of the sensor for N_r"):
        stated_accuracy(AccuracySettings(std={"N_r": 0.1}), design, vessel, runs)
