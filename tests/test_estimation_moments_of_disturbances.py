"""Means and second moments of current and wind from nuisance parameters: closed forms, and errors as stated."""

from dataclasses import replace

import numpy as np
import pytest

from estimation_case import CURRENT, NOMINAL, QUIET, TRUE, commands, measured, record
from expdesign.estimation.disturbance import combined_moments, current_moments, measured_wind
from expdesign.estimation.methods import estimate
from expdesign.simulation import Environment, Variation
from expdesign.vessel import Sensors, Vessel, VesselModel

SKEW = np.array([0.3, -0.1])  # a current whose two components differ in size, so that its second moments differ, too


def waterborne(model: VesselModel) -> VesselModel:
    kept = [index for index, name in enumerate(model.names) if not name.startswith("W_")]
    return replace(
        model,
        terms=tuple(model.terms[index] for index in kept),
        parameters=model.parameters[kept],
        parameter_std=model.parameter_std[kept],
    )


SUNK: Vessel = replace(TRUE, model=waterborne(TRUE.model))
"""The ship without terms of the air."""


def second(velocity: np.ndarray) -> np.ndarray:
    north, east = velocity
    return np.array([north**2 - east**2, north * east])


def test_a_steady_current_has_the_second_moments_of_its_mean() -> None:
    weather, still = Environment(current_to=SKEW), replace(SUNK, sensors=Sensors())
    batches = [measured(still, commands(900, np.random.default_rng(seed)), weather=weather) for seed in (4, 5)]
    found = estimate(record(*batches), waterborne(NOMINAL), method="iv-no-wind")
    moments = current_moments(found)
    np.testing.assert_allclose(moments.mean, SKEW, rtol=1e-6)
    np.testing.assert_allclose(moments.second, second(SKEW), rtol=1e-6)
    np.testing.assert_allclose(moments.central, 0.0, atol=1e-8)
    assert combined_moments(found) == ()


def test_drag_feels_current_and_wind_by_the_shares_of_their_parameters() -> None:
    wind = np.array([0.3, 0.1])  # slower than the ship
    weather = Environment(current_to=CURRENT, wind_to=wind)
    batches = [measured(QUIET, commands(900, np.random.default_rng(seed)), weather=weather) for seed in (4, 5)]
    found = estimate(record(*batches), NOMINAL, method="iv-augmented")
    value = dict(zip(TRUE.model.names, TRUE.model.parameters.tolist(), strict=True))
    told = combined_moments(found)
    assert [(item.of, item.shares) for item in told] == [
        ("u", (("W_abs_u_u", "X_abs_u_u"),)),
        ("v", (("W_abs_v_v", "Y_abs_v_v"),)),
    ]
    for item in told:
        ((air, water),) = item.shares
        share = value[air] / (value[air] + value[water])
        np.testing.assert_allclose(item.mean, share * wind + (1 - share) * CURRENT, rtol=1e-5)
        np.testing.assert_allclose(item.second, share * second(wind) + (1 - share) * second(CURRENT), rtol=1e-5)
        np.testing.assert_allclose(item.central, item.second - second(item.mean), rtol=1e-9)


def test_a_current_estimated_as_steady_has_no_second_moments() -> None:
    batch = measured(QUIET, commands(400, np.random.default_rng(4)), weather=Environment(current_to=CURRENT))
    moments = current_moments(estimate(record(batch), NOMINAL, method="iv-current"))
    np.testing.assert_allclose(moments.mean, CURRENT, rtol=0.05)
    assert np.isnan(moments.second).all()
    assert np.isnan(moments.central).all()


@pytest.mark.thorough
@pytest.mark.parametrize("trials", [8, pytest.param(40, marks=pytest.mark.slow)])
def test_moments_of_a_varying_current_are_right_within_their_errors(trials: int) -> None:
    """Its components vary alike and independently, so that the moments about the mean are zero."""
    weather = Environment(current_to=SKEW, current_variation=Variation(std_mps=0.03))
    errors = []
    for trial in range(trials):
        inputs = commands(2000, np.random.default_rng(100 + trial))
        batch = measured(SUNK, inputs, weather=weather, seed=trial)
        found = estimate(record(batch), waterborne(NOMINAL), method="iv-no-wind")
        moments = current_moments(found, heading_std_rad=SUNK.sensors.heading_rad)
        error = np.concatenate([moments.mean - SKEW, moments.second - second(SKEW), moments.central])
        errors.append(error / np.sqrt(np.diag(moments.covariance)))
    assert (np.abs(np.mean(errors, axis=0)) < 4 * 1.5 / np.sqrt(trials)).all()  # errors are up to 1.5 of those stated
    assert (np.sqrt(np.mean(np.square(errors), axis=0)) < 1.5 * (1 + 4 / np.sqrt(2 * trials))).all()


def test_the_measured_wind_has_the_moments_that_it_was_drawn_with() -> None:
    wind, std = np.array([3.0, -2.0]), 0.5
    weather = Environment(wind_to=wind, wind_variation=Variation(std_mps=std))
    batch = measured(QUIET, commands(3000, np.random.default_rng(6)), weather=weather)
    found = measured_wind(record(batch))
    assert found is not None
    assert found.samples == 3000
    assert (np.abs(found.mean - wind) < 4 * std / np.sqrt(3000)).all()
    np.testing.assert_allclose(found.covariance, std**2 * np.eye(2), atol=4 * std**2 * np.sqrt(2 / 3000))
    assert measured_wind(record(replace(batch, wind=None))) is None
