"""`expdesign durations --monte-carlo`: covariances of simulated trials, and shares by their fusion."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from design_case import SCENARIOS
from expdesign.cli import main
from expdesign.dictionary import build_dictionary
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.rehearsal import estimates_alone
from expdesign.rehearsal.validation import heading_rad
from expdesign.scenario import load_dictionary, load_vessel
from expdesign.vessel import Sensors
from short_examples import copied

DICTIONARY = """[dictionary]
name = "three"
[[primitives]]
family = "acceleration"
duration_s = 60.0
speed_mps = 1.5
[[primitives]]
family = "sway_zigzag"
duration_s = 120.0
period_s = 60.0
speed_mps = 0.6
sway_mps = 0.6
[[primitives]]
family = "zigzag"
duration_s = 120.0
period_s = 60.0
speed_mps = 1.4
sway_mps = 0.15
yaw_rate_radps = 0.05
"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fused")
    path = copied(folder, "story", {})
    (path.parent / "dictionaries" / "tender-20m.toml").write_text(DICTIONARY)
    return path


@pytest.mark.thorough
def test_scatter_about_the_nominal_parameters_is_the_predicted_covariance():
    noisy = load_vessel(SCENARIOS / "vessels" / "tender-20m.toml")
    ship = replace(noisy, sensors=Sensors(velocity_mps=0.002, yaw_rate_radps=0.0002))  # theory is for little noise
    switching = build_dictionary(ship, load_dictionary(SCENARIOS / "dictionaries" / "tender-20m.toml"))[-1]
    names = ship.model.names
    (found,) = estimates_alone(ship, [switching], parameters=names, total_s=480.0, trials=24, seed=3)
    assert found.runs == 4
    assert found.informative
    parts = [
        TrialPart(
            commands=switching.commands,
            velocity=switching.entry_velocity,
            heading_rad=heading_rad(number),
            standing=switching.entry_inputs,
        )
        for number in range(4)
    ]
    theory = np.diag(expected_covariance(ship, parts, names))
    # a variance from 24 trials has a relative standard error of sqrt(2 / 24) = 0.29; four of them, and bias besides
    assert 0.1 < np.median(np.diag(found.covariance) / theory) < 2.2


@pytest.mark.thorough
def test_shares_are_those_of_the_covariances_told(scenario: Path, tmp_path: Path):
    arguments = ["durations", str(scenario), "--monte-carlo", "13", "--jobs", "1", "--out", str(tmp_path), "-q"]
    assert main(arguments) == 0
    told, tried = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("durations", "covariances"))
    alone = {entry["name"]: entry for entry in tried["primitives"]}
    assert alone["acceleration"]["covariance"] is None
    assert alone["acceleration"]["without_estimate"] == 13
    assert "acceleration" not in [entry["name"] for entry in told["primitives"]]
    total = 0.0
    for entry in told["primitives"]:
        own = alone[entry["name"]]
        total = total + entry["duration_s"] / own["seconds"] * np.linalg.inv(np.array(own["covariance"]))
    size = np.sqrt(np.diag(total))
    value = np.linalg.slogdet(total / np.outer(size, size))[1] + 2 * np.log(size).sum()
    assert told["log_det"] == pytest.approx(value, abs=1e-6)
    fused = np.linalg.inv(total)
    for entry in told["primitives"]:
        own = alone[entry["name"]]
        slope = np.trace(fused @ np.linalg.inv(np.array(own["covariance"]))) * told["total_s"] / own["seconds"]
        assert slope <= told["dimension"] + told["gap"] + 1e-6


@pytest.mark.parametrize(
    ("change", "options", "status", "words"),
    [
        ({}, ["--monte-carlo", "11"], 2, "11 trials give no covariance of 10 parameters"),
        ({}, ["--monte-carlo", "12", "--grow"], 2, "expected neither --grow"),
        ({'criterion = "D"': 'criterion = "D"\nrobust = "worst"'}, ["--monte-carlo", "12"], 2, "design.robust"),
    ],
)
def test_what_covariances_cannot_serve_is_refused(tmp_path, capsys, change, options, status, words):
    path = copied(tmp_path, "story", change)
    assert main(["durations", str(path), *options, "--jobs", "1", "--out", str(tmp_path / "out")]) == status
    assert words in capsys.readouterr().err.strip().splitlines()[-1]
    assert not (tmp_path / "out").exists()


def test_without_a_manoeuvre_that_informs_alone_there_is_no_answer(scenario: Path, tmp_path: Path, capsys):
    text = DICTIONARY.partition('[[primitives]]\nfamily = "sway_zigzag"')[0]
    path = copied(tmp_path, "story", {})
    (path.parent / "dictionaries" / "tender-20m.toml").write_text(text)
    arguments = ["durations", str(path), "--monte-carlo", "12", "--jobs", "1", "--out", str(tmp_path / "out")]
    assert main(arguments) == 3
    assert "no manoeuvre gives an estimate of every parameter" in capsys.readouterr().err
