"""Roll, side accelerations and actuator forces are measured, written, read, checked and kept."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from design_case import SCENARIOS
from expdesign.errors import FileError
from expdesign.export.files import vessel_toml
from expdesign.export.files.text import record_csv
from expdesign.records import load_records
from expdesign.scenario import load_vessel
from expdesign.signals import AUXILIARY, Commands
from expdesign.simulation import CALM, measure, simulate
from expdesign.vessel import Roll, Vessel
from record_files import csv_text, motion, texts


def rolling(*, noise: float = 0.0) -> Vessel:
    """The tender with a roll mode that heels outwards."""
    own = load_vessel(SCENARIOS / "vessels/tender-20m.toml")
    roll = Roll(period_s=4.0, damping_ratio=0.1, Y_phi=0.05, N_phi=0.002, heel_rad_per_mps2=-0.15)
    model = replace(own.model, roll=roll)
    sensors = replace(own.sensors, roll_rad=noise, roll_rate_radps=noise / 2, acceleration_mps2=noise / 4)
    return replace(own, model=model, sensors=sensors)


def turning(ship: Vessel, samples: int) -> Commands:
    values = np.tile([8.0, 0.2, 8.0, -0.2], (samples, 1))
    values[: samples // 8, 1::2] = 0.0
    return Commands(sample_time_s=1.0, names=ship.model.inputs, values=values)


def test_a_ship_that_rolls_is_measured_rolling_and_accelerating() -> None:
    ship = rolling(noise=0.02)
    commands = turning(ship, 400)
    track = simulate(ship, commands, velocity=(3.0, 0.0, 0.0))
    assert track.auxiliary is not None
    roll, rate, sway, side = track.auxiliary[:, :4].T
    u, v, r = track.velocity.T
    assert r[-1] > 0  # to starboard, so it heels to port
    assert roll[-1] == pytest.approx(-0.15 * side[-1] / (1.0 + 0.05), rel=1e-3)  # what roll itself adds rolls no ship
    assert roll[-1] < 0
    np.testing.assert_allclose(side, sway + u * r, atol=1e-12)
    held = slice(100, 400)  # one order: motion is smooth there
    np.testing.assert_allclose(np.gradient(v)[held], sway[held], atol=2e-4)
    np.testing.assert_allclose(np.gradient(roll)[held][5:-5], rate[held][5:-5], atol=2e-3)
    told = measure(ship, commands, track, environment=CALM, rng=np.random.default_rng(5))
    for name, exact, std in zip(AUXILIARY, track.auxiliary[:-1].T, (0.02, 0.01, 0.005, 0.005), strict=False):
        assert np.std(told[name] - exact) == pytest.approx(std, rel=4.0 / np.sqrt(2 * 400))
    plain = replace(ship, model=replace(ship.model, roll=None))
    assert simulate(plain, commands).auxiliary is None


def test_roll_in_radians_survives_a_vessel_file(tmp_path: Path) -> None:
    path = tmp_path / "ship.toml"
    path.write_text(vessel_toml(rolling(noise=0.02)), encoding="utf-8")
    again = load_vessel(path)
    assert again.model.roll == rolling().model.roll
    assert (again.sensors.roll_rad, again.sensors.acceleration_mps2) == (0.02, 0.005)


def written(path: Path, **more: np.ndarray) -> Path:
    path.write_text(csv_text(texts({**motion(), **more})), encoding="utf-8")
    return path


def test_columns_are_read_in_their_units_and_written_again(tmp_path: Path) -> None:
    time = motion()["time_s"]
    roll = 0.1 * np.sin(0.7 * time)
    path = written(
        tmp_path / "run.csv", roll_deg=np.degrees(roll), lateral_acceleration_g=roll / 9.80665,
        actuator_psi_knm=5.0 * roll, actuator_x_n=1e4 + roll,
    )  # fmt: skip
    batch = load_records(path).batches[0]
    expected = {"roll_rad": roll, "lateral_acceleration_mps2": roll, "actuator_psi_nm": 5e3 * roll}
    assert batch.auxiliary is not None
    for name, values in expected.items():
        assert batch.measures(name)
        np.testing.assert_allclose(batch.auxiliary[:, AUXILIARY.index(name)], values, atol=1e-9)
    assert not batch.measures("roll_rate_radps")
    again = tmp_path / "again.csv"
    again.write_text(record_csv([batch]), encoding="utf-8")
    np.testing.assert_allclose(load_records(again).batches[0].auxiliary, batch.auxiliary, rtol=1e-9)
    assert batch.cut(slice(10, 20)).auxiliary == pytest.approx(batch.auxiliary[10:20], nan_ok=True)


def test_wrong_units_are_found_and_a_column_without_unit_is_left_alone(tmp_path: Path) -> None:
    time = motion()["time_s"]
    with pytest.raises(FileError, match=r"roll_rad: is .* expected -1.57 to 1.57 rad; degrees belong under roll_deg"):
        load_records(written(tmp_path / "a.csv", roll_rad=12.0 * np.sin(time)))
    with pytest.raises(FileError, match=r"sway_acceleration_mps2: is .* expected -50 to 50 m/s2"):
        load_records(written(tmp_path / "b.csv", sway_acceleration_mps2=90.0 * np.sin(time)))
    record = load_records(written(tmp_path / "c.csv", roll=np.sin(time)))
    assert record.batches[0].auxiliary is None
    assert any("ignored roll" in note for note in record.notes)
