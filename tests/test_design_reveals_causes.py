"""Designs that a diagnosis must profit from: causes revealed and told apart, refusals with the best probability."""

import re
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from expdesign import workflows
from expdesign.cli import main
from expdesign.durations import InformationFloor
from expdesign.errors import NoAnswer
from expdesign.foresight import design_runs, foresee, told_apart_from, told_apart_with
from expdesign.scenario import load_scenario
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")


def story(folder: Path, *lines: str) -> Path:
    """The story's scenario with more lines in [design]."""
    text = (SCENARIOS / "story.toml").read_text()
    text = re.sub(r'"(vessels|dictionaries|areas)/', rf'"{SCENARIOS}/\1/', text)
    path = folder / "scenario.toml"
    path.write_text(text.replace('criterion = "D"', "\n".join(['criterion = "D"', *lines])))
    return path


def test_told_apart_is_the_lead_of_a_gaussian():
    """One of two nearly collinear causes leads by noncentrality + 2 root(noncentrality) z; five are asked for."""
    for probability in (0.5, 0.9, 0.99):
        assert told_apart_with(told_apart_from(probability)) == pytest.approx(probability)
    assert told_apart_from(0.5) == pytest.approx(5.0)
    rng, angle = np.random.default_rng(0), 0.05
    left = told_apart_from(0.9)
    size = np.sqrt(left) / np.sin(angle)
    drawn = np.array([size, 0.0]) + rng.standard_normal((20000, 2))
    lead = drawn[:, 0] ** 2 - (drawn @ [np.cos(angle), np.sin(angle)]) ** 2
    assert (lead >= 5.0).mean() == pytest.approx(0.9, abs=0.01)


@pytest.mark.thorough
def test_a_design_reveals_what_it_is_asked_to(tmp_path):
    """Where the design alone gives too little, and by the foresight of its whole runs, which have other headings."""
    case = load_scenario(story(tmp_path, 'reveal = ["lever_arm"]', "reveal_sizes = {lever_arm = 0.13}"))
    information = workflows.scored(case)
    design = workflows.designed(case, information)
    assert design.gap < 1e-5
    assert design.certificate.multipliers["power to reveal lever_arm as forward_m"] > 0
    free = workflows.designed(load_scenario(SCENARIOS / "story.toml"), information)
    shares = {
        name: np.array(item.repeats) * item.problem.run_s / 720.0 for name, item in (("free", free), ("own", design))
    }
    told = {name: min(told_of(item, share) for item in design.problem.floors) for name, share in shares.items()}
    assert told["free"] < 0.9
    assert told["own"] >= 1.0 - 1e-5
    with patch("expdesign.foresight.foresee.standard_trials", return_value=None):  # which size the others would have
        found = foresee(
            case.vessel, design_runs([item.primitive for item in information], design.repeats), case.environment
        )
    assert max(item.least_change for item in found.effects if item.cause == "lever_arm") < 1.1 * 0.13


def told_of(floor: InformationFloor, shares: np.ndarray) -> float:
    """Information of shares of the time over what is asked for."""
    M = floor.prior + np.tensordot(shares, floor.matrices, axes=1)
    return float(1.0 / np.trace(floor.L.T @ np.linalg.inv(M) @ floor.L) / floor.least)


@pytest.mark.thorough
def test_a_cause_that_cannot_be_revealed_is_refused_with_the_best_probability(tmp_path):
    case = load_scenario(story(tmp_path, 'reveal = ["gyro_scale"]', "reveal_sizes = {gyro_scale = 0.001}"))
    with pytest.raises(NoAnswer, match=r"cannot reveal gyro_scale \(factor\) at 0.1 % .*the best is [\d.]+ %"):
        workflows.designed(case, workflows.scored(case))


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('reveal = ["gyro_scal"]', "design.reveal[1]: is 'gyro_scal', did you mean 'gyro_scale'?"),
        ('reveal = ["change_point"]', "design.reveal[1]: is 'change_point'"),
        ('tell_apart = [["current"]]', "design.tell_apart[1]: has 1 names, expected two causes"),
        ('tell_apart = [["current", "current"]]', "is 'current' again"),
        ("reveal_sizes = {current = 0.1}", "design.reveal_sizes"),
    ],
)
def test_wrong_names_are_one_line_with_what_is_allowed(tmp_path, capsys, line, said):
    assert main(["durations", str(story(tmp_path, line)), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
