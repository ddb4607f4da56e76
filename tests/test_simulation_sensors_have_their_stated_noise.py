"""Measured signals: the truth plus white noise of the stated size, under the names of measured-data files."""

from dataclasses import replace

import numpy as np
import pytest

from design_case import vessel
from expdesign.conventions import rotation, wrap_angle
from expdesign.errors import InputError
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import CALM, Environment, draw_environment, measure, simulate
from expdesign.vessel import Sensors

COUNT = 4000
STDS = {
    "north_m": 1.5, "east_m": 1.5, "heading_rad": 0.02, "u_mps": 0.1, "v_mps": 0.1, "r_radps": 0.03,
    "wind_u_mps": 0.7, "wind_v_mps": 0.7,
}  # fmt: skip
SENSORS = Sensors(position_m=1.5, heading_rad=0.02, velocity_mps=0.1, yaw_rate_radps=0.03, wind_mps=0.7)
SHIP = replace(vessel("azimuth-30m-true"), sensors=SENSORS)
WIND = Environment(wind_to=np.array([4.0, -3.0]))
COMMANDS = Commands(sample_time_s=1.0, names=SHIP.model.inputs, values=np.tile([10.0, -0.1, 10.0, 0.1], (COUNT, 1)))


@pytest.fixture(scope="module")
def trajectory() -> Trajectory:
    return simulate(SHIP, COMMANDS, environment=WIND, substeps=1)


@pytest.fixture(scope="module")
def noise(trajectory: Trajectory) -> dict[str, np.ndarray]:
    measured = measure(SHIP, COMMANDS, trajectory, environment=WIND, rng=np.random.default_rng(1))
    exact = measure(
        replace(SHIP, sensors=Sensors()), COMMANDS, trajectory, environment=WIND, rng=np.random.default_rng(1)
    )
    errors = {name: measured[name] - exact[name] for name in STDS}
    return errors | {"heading_rad": wrap_angle(errors["heading_rad"])}


@pytest.mark.parametrize("name", STDS)
def test_noise_has_the_stated_mean_and_deviation(noise: dict[str, np.ndarray], name: str):
    # Of n normal numbers the mean has standard error std / sqrt n, the deviation std / sqrt 2n; five of them pass
    # by chance once in two million.
    assert abs(noise[name].mean()) < 5 * STDS[name] / np.sqrt(COUNT)
    assert abs(noise[name].std() - STDS[name]) < 5 * STDS[name] / np.sqrt(2 * COUNT)


def test_noise_is_white_and_independent_between_signals(noise: dict[str, np.ndarray]):
    table = np.array([noise[name] / STDS[name] for name in STDS])
    # A sample correlation of independent numbers has standard error 1 / sqrt n.
    assert np.abs(np.corrcoef(table) - np.eye(len(table))).max() < 5 / np.sqrt(COUNT)
    assert np.abs((table[:, 1:] * table[:, :-1]).mean(axis=1)).max() < 5 / np.sqrt(COUNT - 1)


def test_without_noise_the_measurement_is_the_truth(trajectory: Trajectory):
    exact = measure(
        replace(SHIP, sensors=Sensors()), COMMANDS, trajectory, environment=WIND, rng=np.random.default_rng(0)
    )
    pose, velocity = trajectory.pose[:-1], trajectory.velocity[:-1]
    np.testing.assert_array_equal(exact["time_s"], np.arange(COUNT))
    np.testing.assert_array_equal(np.stack([exact["north_m"], exact["east_m"]]), pose[:, :2].T)
    np.testing.assert_allclose(np.exp(1j * exact["heading_rad"]), np.exp(1j * pose[:, 2]), atol=1e-12)
    assert np.abs(exact["heading_rad"]).max() <= np.pi
    np.testing.assert_array_equal(np.stack([exact["u_mps"], exact["v_mps"], exact["r_radps"]]), velocity.T)
    air = np.array([rotation(heading).T @ WIND.wind_to for heading in pose[:, 2]])
    relative = np.stack([exact["wind_u_mps"], exact["wind_v_mps"]], axis=1)
    np.testing.assert_allclose(relative, velocity[:, :2] - air, atol=1e-12)


def test_columns_are_those_of_measured_data_files(trajectory: Trajectory):
    columns = measure(SHIP, COMMANDS, trajectory, environment=CALM, rng=np.random.default_rng(0))
    assert list(columns) == ["time_s", "north_m", "east_m", "heading_rad", "u_mps", "v_mps", "r_radps", "wind_u_mps",
                             "wind_v_mps", "n1_rps", "a1_rad", "n2_rps", "a2_rad"]  # fmt: skip
    assert {len(column) for column in columns.values()} == {COUNT}
    for name, column in zip(COMMANDS.names, ("n1_rps", "a1_rad", "n2_rps", "a2_rad"), strict=True):
        np.testing.assert_array_equal(columns[column], COMMANDS.column(name))


def test_the_same_seed_measures_the_same(trajectory: Trajectory):
    first, second, other = (
        measure(SHIP, COMMANDS, trajectory, environment=WIND, rng=np.random.default_rng(seed)) for seed in (7, 7, 8)
    )
    assert all(np.array_equal(first[name], second[name]) for name in first)
    assert not any(np.array_equal(first[name], other[name]) for name in STDS)


def test_seas_are_drawn_around_the_forecast():
    forecast = Environment(
        current_to=np.array([0.3, -0.1]), wind_to=np.array([5.0, 1.0]), current_std_mps=0.05, wind_std_mps=2.0
    )
    rng, count = np.random.default_rng(2), 2000
    seas = [draw_environment(forecast, rng) for _ in range(count)]
    for name, std in (("current_to", 0.05), ("wind_to", 2.0)):
        drawn = np.array([getattr(sea, name) for sea in seas])
        assert np.abs(drawn.mean(axis=0) - getattr(forecast, name)).max() < 5 * std / np.sqrt(count)
        assert np.abs(drawn.std(axis=0) - std).max() < 5 * std / np.sqrt(2 * count)


def test_a_certain_forecast_is_what_comes():
    sea = draw_environment(WIND, np.random.default_rng(0))
    np.testing.assert_array_equal(sea.wind_to, WIND.wind_to)
    assert not sea.current_to.any()


@pytest.mark.parametrize("std", [-0.1, np.nan, np.inf])
def test_standard_deviations_are_not_negative_and_finite(std: float):
    with pytest.raises(InputError, match=r"sensors\.heading_rad is .*, expected a standard deviation of 0 or more"):
        Sensors(heading_rad=std)
