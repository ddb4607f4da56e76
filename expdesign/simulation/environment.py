"""Current and wind of a trial: drawn around the forecast, steady or varying from sample to sample."""

from __future__ import annotations

import numpy as np

from expdesign.errors import InputError
from expdesign.values import Array, sealed
from expdesign.vessel.vessel import CALM, STEADY, Environment, Variation

__all__ = [
    "CALM",
    "STEADY",
    "Environment",
    "Variation",
    "WeatherSeries",
    "draw_environment",
    "draw_weather",
    "vary",
    "weather_rows",
]


@sealed(current_to="k 2", wind_to="k 2")
class WeatherSeries:
    """Current and wind at every sample, held until the next."""

    # current_to, wind_to: (k, 2) velocity to north/east [m/s]
    current_to: Array
    wind_to: Array


def draw_environment(forecast: Environment, rng: np.random.Generator) -> Environment:
    """One trial's mean current and wind, drawn around the forecast; with its variation."""
    return Environment(
        current_to=forecast.current_to + forecast.current_std_mps * rng.standard_normal(2),
        wind_to=forecast.wind_to + forecast.wind_std_mps * rng.standard_normal(2),
        current_variation=forecast.current_variation,
        wind_variation=forecast.wind_variation,
    )


def draw_weather(
    environment: Environment, samples: int, *, sample_time_s: float, rng: np.random.Generator
) -> WeatherSeries:
    """Current and wind at every sample around an environment's means."""
    current, wind = (
        mean + vary(variation, rng.standard_normal((samples, 2)), sample_time_s=sample_time_s)
        for mean, variation in (
            (environment.current_to, environment.current_variation),
            (environment.wind_to, environment.wind_variation),
        )
    )
    return WeatherSeries(current_to=current, wind_to=wind)


def vary(variation: Variation, normal: Array, *, sample_time_s: float, before: Array | None = None) -> Array:
    """A Gauss-Markov process sampled exactly, stationary from the first sample.

    x(0) = s w(0),  x(k+1) = a x(k) + s sqrt(1 - a**2) w(k+1),  a = exp(-sample time / correlation time)

    Args:
        variation: s and correlation time.
        normal: (k, ...) independent standard normal numbers w.
        sample_time_s: time between samples [s].
        before: (...) the process one sample earlier, where it goes on.

    Returns:
        (k, ...) [m/s].
    """
    keep = variation.memory(sample_time_s)
    values = np.asarray(variation.std_mps * normal)
    if keep == 0.0:
        return values
    if before is not None:
        values[0] = keep * before + np.sqrt(1.0 - keep**2) * values[0]
    values[1:] *= np.sqrt(1.0 - keep**2)
    for k in range(1, len(values)):
        values[k] += keep * values[k - 1]
    return values


def weather_rows(environment: Environment | WeatherSeries, samples: int) -> tuple[Array, Array]:
    """(k, 2) current and wind of every sample; the means of an environment.

    Raises:
        InputError: weather of another number of samples.
    """
    if isinstance(environment, Environment):
        shape = (samples, 2)
        return np.broadcast_to(environment.current_to, shape), np.broadcast_to(environment.wind_to, shape)
    if len(environment.current_to) != samples:
        raise InputError(f"weather has {len(environment.current_to)} samples, expected {samples} as of the commands")
    return environment.current_to, environment.wind_to
