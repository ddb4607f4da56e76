"""Signals that are held or interpolated between readings are told with their interval, and read in time."""

from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.kinematics import held
from expdesign.scenario import load_vessel
from expdesign.workflows import measured
from instrumented_ship import NAMES, POSE, TERMS, Log, voyages, write_log, write_vessel


def repeated(values: np.ndarray, samples: float, *, phase: float = 0.0) -> np.ndarray:
    """Each reading until the next arrives, every so many samples."""
    places = np.arange(len(values))
    return values[np.ceil(np.floor((places - phase) / samples) * samples + phase).clip(0).astype(int)]


def drawn(values: np.ndarray, samples: int) -> np.ndarray:
    """Straight lines between readings."""
    places = np.arange(0, len(values), samples)
    return np.interp(np.arange(len(values)), places, values[places])


@pytest.mark.parametrize("interval", [2.0, 3.0, 5.0, 2.5, 10.0 / 3.0, 7.25])
def test_the_interval_of_a_held_signal_is_found_whatever_it_is(interval: float) -> None:
    rng = np.random.default_rng(3)
    for phase in rng.uniform(0, interval, 5):
        values = repeated(np.cumsum(rng.standard_normal(400)), interval, phase=phase)
        found = held(values[:, None])
        assert found is not None
        assert found.even
        assert found.interval == pytest.approx(interval, abs=0.01)


@pytest.mark.parametrize("digits", [6, 2, 1])
@pytest.mark.parametrize("interval", [3, 5, 12])
def test_the_interval_of_an_interpolated_signal_is_found_in_spite_of_rounding(interval: int, digits: int) -> None:
    rng = np.random.default_rng(6)
    values = np.round(drawn(20 * np.cumsum(rng.standard_normal(600)), interval), digits)
    found = held(values[:, None])
    assert found is not None
    assert (found.interval, found.interpolated) == (interval, True)


def test_noise_rounding_and_steady_turns_are_not_held() -> None:
    rng = np.random.default_rng(4)
    time = np.arange(600.0)
    smooth = 0.4 * np.sin(2 * np.pi * time / 80)
    for values in (
        smooth,
        smooth + 0.01 * rng.standard_normal(600),
        np.round(np.degrees(smooth)),
        np.round(np.degrees(smooth), 1),
        np.round(0.2 * time),
        np.round(time / 7.0),
        np.round(20 * rng.standard_normal(600).cumsum() / 40),
        np.where(time < 300, 0.0, 1.0),
    ):
        assert held(values[:, None]) is None


SIGNALS = {
    "headings": ("heading_rad",),
    "positions": ("north_m", "east_m"),
    "velocities": ("u_mps", "v_mps"),
    "yaw rates": ("r_radps",),
}


@pytest.mark.parametrize("how", [repeated, drawn])
@pytest.mark.parametrize("words", SIGNALS)
def test_every_held_signal_is_told_and_nearer_to_the_truth_afterwards(tmp_path: Path, words: str, how: object) -> None:
    assert callable(how)
    ship = load_vessel(write_vessel(tmp_path / "ship.toml"))
    (log,) = voyages(1, "zigzag", sample_s=0.4, gust=0.0, noise=0.02)
    spoiled = {**log, **{name: how(log[name], 10) for name in SIGNALS[words]}}
    record = measured([write_log(tmp_path / "log.csv", spoiled)], ship)
    (doubt,) = record.doubts
    assert doubt.startswith(f"log.csv: the {words} are read every 4 s, and ")
    assert ("straight line" in doubt) == (how is drawn)
    (batch,) = record.batches
    kept = slice(batch.first_row - 2, batch.first_row - 2 + len(batch))
    assert batch.pose is not None
    assert np.isfinite(batch.pose).all()
    columns = dict(zip(NAMES[1:7], np.column_stack([batch.pose, batch.velocity]).T, strict=True))
    for name in SIGNALS[words]:
        error, before = (np.std(values - log[name][kept]) for values in (columns[name], spoiled[name][kept]))
        assert error < (1.05 if how is drawn else 0.35) * before  # straight lines are nearly as good as cubics


def test_a_heading_held_in_parts_of_a_file_is_read_there_alone(tmp_path: Path) -> None:
    ship = load_vessel(write_vessel(tmp_path / "ship.toml"))
    (log,) = voyages(1, "zigzag")
    log["batch"] = np.where(log["time_s"] < 200, 0.0, 1.0)
    half, log["heading_rad"] = log["time_s"] >= 200, log["heading_rad"].copy()
    log["heading_rad"][half] = repeated(log["heading_rad"][half], 5)
    record = measured([write_log(tmp_path / "log.csv", log, (*NAMES, "batch"))], ship)
    assert len(record.doubts) == 1
    assert record.doubts[0].startswith("log.csv, batch 2: the headings are read every 5 s")
    assert record.batches[0].pose is not None
    np.testing.assert_allclose(record.batches[0].pose[:, 2], log["heading_rad"][~half], atol=1e-6)


def estimates(folder: Path, log: Log, capsys: pytest.CaptureFixture[str]) -> dict[str, tuple[float, float]]:
    import json

    ship = write_vessel(folder / "ship.toml", off=1.2)
    path = write_log(folder / "log.csv", log, POSE)
    arguments = ["estimate", str(path), "--vessel", str(ship), "--mean", "none", "--method", "iv", "--fixed", "X_nn"]
    assert main([*arguments, "--out", str(folder / "out")]) == 0
    assert "- log.csv: the headings are read every 5 s" in capsys.readouterr().out
    found = json.loads((folder / "out" / "estimate.json").read_text())["iv"]["parameters"]
    return {name: (one["value"], one["std"]) for name, one in found.items()}


@pytest.mark.thorough
def test_estimates_from_held_headings_are_right(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Held for 5 s, N_ur was nine standard errors off, Y_ur eleven."""
    errors = []
    for log in voyages(3, "zigzag", last_s=300.0, gust=0.0, current_mps=0.0, seed=5):
        log["heading_rad"] = repeated(log["heading_rad"], 5)
        found = estimates(tmp_path, log, capsys)
        errors += [(found[name][0] - TERMS[name][2]) / found[name][1] for name in ("N_ur", "Y_ur")]
    assert np.max(np.abs(errors)) < 4.0
