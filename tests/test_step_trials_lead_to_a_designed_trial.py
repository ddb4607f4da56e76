"""From a craft that nobody has a model of to its parameters, by commands alone: steps, designed trial, estimate."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import scipy

from expdesign.cli import main
from expdesign.scenario import load_vessel
from expdesign.vessel import VesselModel
from scenario_files import SCENARIOS
from step_case import GUESS, TRUTH


def done(*words: object) -> None:
    assert main([*map(str, words), "--quiet"]) == 0


def planned(folder: Path, scenario: str, vessel: Path) -> Path:
    """A verified plan of a scenario with a vessel file."""
    done("run", SCENARIOS / scenario, "--vessel", vessel, "--seed", 1, "--out", folder)
    plan = json.loads((folder / "plan.json").read_text())
    assert plan["verified"]
    assert plan["leave_water_probability"] < 0.05
    return folder / "plan.json"


def distance(model: VesselModel) -> float:
    """Squared errors of the parameters by their covariance: chi-square distributed where that is true."""
    errors = model.parameters - load_vessel(TRUTH).model.parameters
    return float(errors @ np.linalg.solve(model.parameter_covariance, errors))


@pytest.mark.slow
def test_the_trial_designed_after_the_steps_halves_what_they_left_uncertain_and_finds_the_truth(tmp_path: Path) -> None:
    steps, trial = tmp_path / "steps", tmp_path / "trial"
    plan = planned(steps, "fast-boat.toml", GUESS)
    done("simulate", plan, "--truth", TRUTH, "--seed", 2, "--out", steps)
    done("identify-steps", steps / "measured.csv", "--vessel", GUESS, "--steps", plan, "--out", steps)
    stepped = load_vessel(steps / "vessel-steps.toml")
    plan = planned(trial, "fast-boat-designed.toml", steps / "vessel-steps.toml")
    done("simulate", plan, "--truth", TRUTH, "--seed", 3, "--out", trial)
    vessel = ("--vessel", steps / "vessel-steps.toml")
    data = trial / "measured.csv"
    done(
        "estimate",
        data,
        *vessel,
        "--method",
        "oe-current",
        "--mean",
        "none",
        "--prior",
        "parameter_std",
        "--out",
        trial,
    )
    found = load_vessel(trial / "vessel-estimated.toml")
    ratio = found.model.parameter_std / stepped.model.parameter_std
    assert ratio.max() < 0.5
    likely = scipy.stats.chi2.ppf(0.999, len(ratio))
    assert distance(stepped.model) < likely
    assert distance(found.model) < likely
    for response, true in zip(found.responses, load_vessel(TRUTH).responses, strict=True):
        assert response.delay_s == pytest.approx(true.delay_s, abs=0.05)
