"""Current and wind around their means: variance, memory, and the white limit, judged by their own standard errors."""

from dataclasses import replace

import numpy as np
import pytest

from design_case import vessel
from expdesign.errors import InputError
from expdesign.signals import Commands
from expdesign.simulation import (
    Environment,
    Variation,
    WeatherSeries,
    draw_environment,
    draw_weather,
    measure,
    simulate,
    simulate_ensemble,
)
from expdesign.simulation.environment import vary
from expdesign.vessel import Sensors

SHIP = replace(vessel("azimuth-30m-true"), sensors=Sensors())
STEP_S, STD = 0.5, 0.3


def memory(correlation_s: float) -> float:
    return np.exp(-STEP_S / correlation_s) if correlation_s else 0.0


@pytest.mark.parametrize("correlation_s", [0.0, 0.7, 5.0])
def test_variance_is_the_same_at_every_sample_from_the_first(correlation_s: float):
    runs = 4000
    normal = np.random.default_rng(1).standard_normal((40, runs))
    values = vary(Variation(std_mps=STD, correlation_s=correlation_s), normal, sample_time_s=STEP_S)
    # A variance from n normal numbers has relative standard error sqrt(2 / n); five of them at 40 samples.
    np.testing.assert_allclose(values.var(axis=1), STD**2, rtol=5 * np.sqrt(2 / runs))


@pytest.mark.parametrize("correlation_s", [0.0, 0.7, 5.0])
@pytest.mark.parametrize("lag", [1, 3, 10])
def test_autocorrelation_is_exponential(correlation_s: float, lag: int):
    runs = 20_000
    normal = np.random.default_rng(2).standard_normal((12, runs))
    values = vary(Variation(std_mps=STD, correlation_s=correlation_s), normal, sample_time_s=STEP_S)
    expected = memory(correlation_s) ** lag
    found = np.corrcoef(values[1], values[1 + lag])[0, 1]
    # A correlation rho from n independent pairs has standard error (1 - rho**2) / sqrt n.
    assert abs(found - expected) < 5 * (1 - expected**2) / np.sqrt(runs)


def test_a_short_memory_tends_to_white_noise():
    normal = np.random.default_rng(3).standard_normal((50, 2))
    white, nearly = (
        vary(Variation(std_mps=STD, correlation_s=tau), normal, sample_time_s=STEP_S) for tau in (0.0, STEP_S / 40)
    )
    np.testing.assert_array_equal(white, STD * normal)
    np.testing.assert_allclose(nearly, white, atol=1e-12)


def test_a_process_goes_on_where_it_stopped():
    normal, how = np.random.default_rng(4).standard_normal((30, 3)), Variation(std_mps=STD, correlation_s=2.0)
    whole = vary(how, normal, sample_time_s=STEP_S)
    first = vary(how, normal[:11], sample_time_s=STEP_S)
    second = vary(how, normal[11:], sample_time_s=STEP_S, before=first[-1])
    np.testing.assert_allclose(np.concatenate([first, second]), whole, atol=1e-15)


def test_every_run_of_an_ensemble_has_its_own_mean_and_its_own_memory():
    """At rest in wind that pushes nothing, a perfect anemometer shows the wind: relative wind is minus the wind."""
    model = SHIP.model.with_parameters(0.0 * SHIP.model.parameters)
    still, runs, samples = replace(SHIP, model=model), 3000, 100
    sea = Environment(
        wind_to=np.array([4.0, -2.0]), wind_std_mps=1.0, wind_variation=Variation(std_mps=0.5, correlation_s=8.0)
    )
    many = simulate_ensemble(still, np.zeros((samples, 4)), runs=runs, environment=sea, rng=np.random.default_rng(5))
    wind = -many.measured_wind  # (samples, runs, 2)
    assert np.abs(wind.mean(axis=1) - sea.wind_to).max() < 5 * np.hypot(1.0, 0.5) / np.sqrt(runs)
    np.testing.assert_allclose(wind.var(axis=1), 1.0**2 + 0.5**2, rtol=5 * np.sqrt(2 / runs))
    for lag in (1, 40, 80):  # 40 and 80 reach across stretches drawn apart
        expected = (1.0**2 + 0.5**2 * np.exp(-lag / 8.0)) / (1.0**2 + 0.5**2)
        found = np.corrcoef(wind[5, :, 0], wind[5 + lag, :, 0])[0, 1]
        assert abs(found - expected) < 5 * (1 - expected**2) / np.sqrt(runs)


def test_steady_weather_sample_by_sample_is_the_steady_environment():
    rng, count = np.random.default_rng(6), 60
    commands = Commands(sample_time_s=1.0, names=SHIP.model.inputs, values=rng.uniform(-1, 6, (count, 4)))
    sea = Environment(current_to=np.array([0.3, 0.1]), wind_to=np.array([6.0, -2.0]))
    series = draw_weather(sea, count, sample_time_s=1.0, rng=rng)
    steady, again = (simulate(SHIP, commands, environment=weather) for weather in (sea, series))
    np.testing.assert_array_equal(steady.pose, again.pose)
    seen = [
        measure(SHIP, commands, steady, environment=weather, rng=np.random.default_rng(0)) for weather in (sea, series)
    ]
    assert all(np.array_equal(seen[0][name], seen[1][name]) for name in seen[0])


def test_one_run_in_varying_weather_is_a_run_of_the_ensemble():
    """The ensemble's wind, read off its perfect sensors, acts on the single run as it did on the many."""
    commands = Commands(sample_time_s=1.0, names=SHIP.model.inputs, values=np.tile([8.0, 0.2, 8.0, -0.1], (50, 1)))
    sea = Environment(wind_to=np.array([9.0, 3.0]), wind_variation=Variation(std_mps=2.0, correlation_s=5.0))
    many = simulate_ensemble(SHIP, commands.values, runs=4, environment=sea, rng=np.random.default_rng(7))
    heading = many.pose[:, 2, 2]
    ahead, side = (many.velocity[:, 2, :2] - many.measured_wind[:, 2]).T
    wind = np.stack([
        ahead * np.cos(heading) - side * np.sin(heading), ahead * np.sin(heading) + side * np.cos(heading)
    ], axis=1)  # fmt: skip
    series = WeatherSeries(current_to=np.zeros((50, 2)), wind_to=wind)
    alone = simulate(SHIP, commands, environment=series, integrator="euler", substeps=1)
    np.testing.assert_allclose(alone.velocity[:-1], many.velocity[:, 2], rtol=1e-9, atol=1e-11)


def test_a_drawn_trial_keeps_the_forecast_of_its_variation():
    gust = Variation(std_mps=1.0, correlation_s=20.0)
    drawn = draw_environment(Environment(wind_std_mps=2.0, wind_variation=gust), np.random.default_rng(0))
    assert drawn.wind_variation == gust
    assert not drawn.steady


def test_what_cannot_be_is_refused():
    with pytest.raises(InputError, match=r"variation\.std_mps is -1"):
        Variation(std_mps=-1.0)
    short = WeatherSeries(current_to=np.zeros((3, 2)), wind_to=np.zeros((3, 2)))
    commands = Commands(sample_time_s=1.0, names=SHIP.model.inputs, values=np.zeros((4, 4)))
    with pytest.raises(InputError, match="3 samples, expected 4"):
        simulate(SHIP, commands, environment=short)
