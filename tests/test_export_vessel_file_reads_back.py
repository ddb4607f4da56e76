"""A vessel written as a file and read again is the same vessel."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.errors import FileError, InputError
from expdesign.export.files import vessel_toml
from expdesign.scenario import load_vessel
from expdesign.vessel import Missed, Vessel
from scenario_files import SCENARIOS
from vessel_files import KVLCC2, write_vessel

FILES = sorted((SCENARIOS / "vessels").glob("*.toml"))


def same(a: Vessel, b: Vessel) -> bool:
    """Every field alike; numbers to the last bit."""
    models = all(
        np.array_equal(getattr(a.model, field.name), getattr(b.model, field.name))
        for field in fields(a.model)
        if field.name in ("parameters", "parameter_std")
    )
    names = ("terms", "form", "sample_time_s", "actuators", "parameter_range")
    rest = all(getattr(a.model, name) == getattr(b.model, name) for name in names)
    weather = all(
        np.array_equal(getattr(a.environment, field.name), getattr(b.environment, field.name))
        for field in fields(a.environment)
    )
    return models and rest and weather and replace(a, model=b.model, environment=b.environment) == b


def read_back(vessel: Vessel, folder: Path, **options: object) -> Vessel:
    path = folder / "again.toml"
    path.write_text(vessel_toml(vessel, **options), encoding="utf-8")
    return load_vessel(path)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_example_comes_back_the_same(path: Path, tmp_path: Path) -> None:
    vessel = load_vessel(path)
    assert same(vessel, read_back(vessel, tmp_path))


def test_a_custom_structure_comes_back_the_same(tmp_path: Path) -> None:
    vessel = load_vessel(write_vessel(tmp_path / "custom.toml", KVLCC2))
    assert same(vessel, read_back(vessel, tmp_path))
    assert "[[model.terms]]" in vessel_toml(vessel)


def test_the_covariance_of_parameters_comes_back(tmp_path: Path) -> None:
    vessel = load_vessel(write_vessel(tmp_path / "custom.toml", KVLCC2))
    names = vessel.model.names[1:]
    root = np.random.default_rng(0).standard_normal((len(names), len(names))) * 10.0 ** np.linspace(-6, 3, len(names))
    known = replace(vessel, model=vessel.model.with_covariance(names, root.T @ root))
    found = read_back(known, tmp_path).model.parameter_covariance
    scale = np.maximum(known.model.parameter_std, 1e-300)
    assert np.allclose(found[1:, 1:] / np.outer(scale[1:], scale[1:]), (root.T @ root) / np.outer(scale[1:], scale[1:]))
    assert not found[0].any()


def test_numbers_and_names_of_any_kind_come_back(tmp_path: Path) -> None:
    vessel = load_vessel(write_vessel(tmp_path / "custom.toml", KVLCC2))
    scales = 10.0 ** np.linspace(-300, 11, len(vessel.model.names))
    values = np.random.default_rng(0).uniform(-1, 1, len(scales)) * scales
    model = replace(vessel.model, parameters=values, parameter_std=np.abs(values))
    odd = replace(vessel, name='Ship "Å" \\ No. 1 = # [x]', model=model)
    assert same(odd, read_back(odd, tmp_path, comments=("first", "second\nthird")))


def test_what_the_data_told_of_the_model_comes_back(tmp_path: Path) -> None:
    vessel = load_vessel(FILES[0])
    told = replace(vessel.model, speeds_mps=(-0.5, 6.25), missed=Missed(way_share=0.0125, turn_share=0.5))
    found = read_back(replace(vessel, model=told), tmp_path).model
    assert (found.speeds_mps, found.missed) == (told.speeds_mps, told.missed)


def test_comments_go_first(tmp_path: Path) -> None:
    vessel = load_vessel(FILES[0])
    assert vessel_toml(vessel, comments=("one", "two\nthree")).startswith("# one\n# two\n# three\n[vessel]\n")


def test_a_sample_time_of_the_models_own_cannot_be_written() -> None:
    vessel = load_vessel(FILES[0])
    with pytest.raises(InputError, match="expected the same in a vessel file"):
        vessel_toml(replace(vessel, sample_time_s=0.3))


RESPONSES = """
[[actuators]]
kind = "podded"
forward_m = -10.0
speed_min_rps = -3.0
speed_max_rps = 3.0
speed_lag_s = 4.0
speed_deadband_rps = 0.2
angle_min_rad = -0.6
angle_max_rad = 0.6
angle_delay_s = 0.7
angle_offset_rad = 0.03

[[actuators]]
kind = "rudder"
angle_min_rad = -0.6
angle_max_rad = 0.6
angle_lag_s = 2.0
angle_deadband_rad = 0.01
angle_offset_rad = -0.02
"""
FORCES = """
[[actuators]]
kind = "force"
""" + "".join(
    f"{name}_min = -9.0\n{name}_max = 9.0\n{name}_lag_s = {lag}.5\n{name}_delay_s = {lag}.25\n"
    f"{name}_deadband = 0.{lag}\n"
    for lag, name in enumerate(("x", "y", "psi"), start=1)
)
REST = """
[model]
structure = "surge"
form = "continuous"
[model.parameters]
X_u = -0.1
X_abs_u_u = -0.01
W_abs_u_u = -0.001
X_mu = 0.02

[sensors]
position_m = 1.0
wind_mps = 0.2
wind_angle_rad = 0.03
heading_bias_rad = -0.02
yaw_rate_scale = 0.98
wind_sensor = "vane"
position_forward_m = -12.0
position_starboard_m = 1.5
position_delay_s = 0.4
position_interval_s = 5.0
heading_interval_s = 2.0
heading_delay_s = 0.1
velocity_forward_m = 6.0
velocity_starboard_m = -1.0
velocity_delay_s = 0.2
velocity_interval_s = 3.0
yaw_rate_delay_s = 0.3
yaw_rate_interval_s = 1.5
wind_forward_m = 9.0
wind_starboard_m = 0.5
wind_delay_s = 1.0
wind_interval_s = 4.0

[environment]
sea_state = 3
current_to = {north_mps = 0.3, east_mps = -0.1, std_mps = 0.05}
wind_to = {north_mps = -2.0, east_mps = 0.0, variation_std_mps = 0.8, correlation_s = 30.0}
"""
HEAD = '[vessel]\nname = "odd"\nlength_m = 30.0\nbeam_m = 8.0\ndraught_m = 2.0\nsample_time_s = 1.0\n'


@pytest.mark.parametrize("actuators", [RESPONSES, FORCES])
def test_responses_sensors_and_weather_come_back_the_same(actuators: str, tmp_path: Path) -> None:
    path = tmp_path / "vessel.toml"
    path.write_text(HEAD + actuators + REST, encoding="utf-8")
    vessel = load_vessel(path)
    again = read_back(vessel, tmp_path)
    assert same(vessel, again)
    assert vessel_toml(again) == vessel_toml(vessel)
    for line in (actuators.replace('"podded"', '"azimuth"') + REST).splitlines():
        assert "= " not in line or line.replace(" ", "") in vessel_toml(vessel).replace(" ", ""), line
    assert again.environment.sea_state == 3


def test_keys_say_which_signal_responds_how(tmp_path: Path) -> None:
    path = tmp_path / "vessel.toml"
    path.write_text(HEAD + RESPONSES + REST, encoding="utf-8")
    vessel = load_vessel(path)
    assert vessel.model.inputs == ("n1", "a1", "rudder1")
    speed, angle, rudder = vessel.responses
    assert (speed.lag_s, speed.delay_s, speed.deadband, speed.offset) == (4.0, 0.0, 0.2, 0.0)
    assert (angle.lag_s, angle.delay_s, angle.deadband, angle.offset) == (0.0, 0.7, 0.0, 0.03)
    assert (rudder.lag_s, rudder.deadband, rudder.offset) == (2.0, 0.01, -0.02)
    assert vessel.sensors.position_interval_s == 5.0
    assert (vessel.sensors.wind_forward_m, vessel.sensors.wind_sensor) == (9.0, "vane")
    assert vessel.environment.wind_variation.correlation_s == 30.0
    assert vessel.environment.current_std_mps == 0.05


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        ("speed_lag_s = -1.0", "actuators[1].speed_lag_s"),
        ("speed_offset_rps = 1.0", "actuators[1].speed_offset_rps"),
        ("angle_lag = 1.0", "actuators[1].angle_lag"),
    ],
)
def test_wrong_responses_are_named(wrong: str, key: str, tmp_path: Path) -> None:
    path = tmp_path / "vessel.toml"
    path.write_text(HEAD + RESPONSES.replace("speed_lag_s = 4.0", wrong) + REST, encoding="utf-8")
    with pytest.raises(FileError) as caught:
        load_vessel(path)
    assert caught.value.key == key


def test_a_pod_needs_its_angle_limits(tmp_path: Path) -> None:
    path = tmp_path / "vessel.toml"
    path.write_text(HEAD + RESPONSES.replace("angle_max_rad = 0.6\n", "", 1) + REST, encoding="utf-8")
    with pytest.raises(FileError, match="angle_max_rad"):
        load_vessel(path)
