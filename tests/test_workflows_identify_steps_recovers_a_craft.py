"""`expdesign identify-steps`: a simulated fast craft in noise and waves, delays unknown, and records that are none."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.scenario import load_vessel
from expdesign.step_trials import StepTrial, controls_of, identify_steps, nominal, nominal_vessel
from expdesign.step_trials.nominal.evidence import evidence
from step_case import GUESS, INPUTS, STEPS, TRUTH, craft_columns, craft_record, mirrored, write_csv

pytestmark = pytest.mark.usefixtures("undrawn")

NAMES = ("time_s", "u_mps", "r_radps", "n1_rps", "rudder1_rad")
CONTROLS = controls_of(INPUTS)
DESIGNED = GUESS.parents[1] / "fast-boat-designed.toml"


def standard_scores(seed: int, *, with_sway: bool) -> np.ndarray:
    """Errors of all parameters in their standard deviations."""
    trial = identify_steps(craft_record(seed, with_sway=with_sway), CONTROLS)
    found = nominal_vessel(load_vessel(GUESS), trial.samples, trial.delays, INPUTS).model
    return np.asarray((found.parameters - load_vessel(TRUTH).model.parameters) / found.parameter_std)


def identified(folder: Path) -> None:
    """Results of the command in `out`."""
    data = write_csv(folder / "steps.csv", craft_columns(1), NAMES)
    held_out = write_csv(folder / "other.csv", craft_columns(2, steps=STEPS[5:14]), NAMES)
    words = ["identify-steps", data, "--vessel", GUESS, "--test", held_out, "--out", folder / "out", "--quiet"]
    assert main(list(map(str, words))) == 0


@pytest.fixture
def results(made_once: Callable[[str, Callable[[Path], object]], tuple[Path, object]]) -> Path:
    folder, _ = made_once("identify-steps", identified)
    return folder / "out"


@pytest.mark.thorough
def test_the_craft_is_recovered_with_its_delays(results: Path) -> None:
    found = json.loads((results / "step-model.json").read_text())
    for command in ("throttle", "rudder"):
        delay, std = found["model"]["delay_s"][command], found["model"]["delay_std_s"][command]
        assert delay == pytest.approx(0.55, abs=max(3 * std, 0.15))
    assert found["fit_percent"]["other.csv"]["U"] > 90
    assert found["fit_percent"]["other.csv"]["r"] > 75
    assert sum(not step["problems"] for step in found["steps"]) >= 0.7 * len(found["steps"])


@pytest.mark.thorough
def test_the_vessel_file_holds_what_the_steps_tell_and_keeps_what_they_do_not(results: Path) -> None:
    before, after = load_vessel(GUESS).model, load_vessel(results / "vessel-steps.toml").model
    truth = load_vessel(TRUTH).model
    share = dict(zip(after.names, (after.parameter_std / before.parameter_std).tolist(), strict=True))
    assert max(share[name] for name in ("X_u", "X_abs_u_u", "X_nn")) < 0.2
    assert min(share[name] for name in ("Y_uv", "Y_ur")) > 0.5  # sway was not measured
    assert np.abs(after.parameter_correlation_matrix - np.eye(len(after.names))).max() > 0.5
    places = [after.names.index(name) for name in ("X_u", "X_abs_u_u", "X_nn")]
    assert after.parameters[places] == pytest.approx(truth.parameters[places], rel=0.15)
    responses = load_vessel(results / "vessel-steps.toml").responses
    assert all(0.2 < response.delay_s < 1.0 for response in responses)


@pytest.mark.thorough
def test_the_page_and_the_summary_speak_of_the_same_steps(results: Path) -> None:
    page = (results / "step-trial.html").read_text()
    found = json.loads((results / "step-model.json").read_text())
    assert all(remark.split(" \N{PLUS-MINUS SIGN}")[0] in page for remark in found["remarks"][:3])
    assert "http" not in page.replace("http://www.w3.org", "")
    told = re.findall(r"-?\d+(\.\d+)? \N{PLUS-MINUS SIGN} \d+(\.\d+)?", page)
    assert len(told) > 20
    assert all(len(value) == len(std) for value, std in told)  # as many decimals as the error


@pytest.mark.thorough
def test_a_trial_is_designed_on_top_of_what_the_steps_told(results: Path, tmp_path: Path) -> None:
    """More is known in the end than from a guess, and the same minutes add less to it."""
    known, added = {}, {}
    for name, vessel in (("guess", GUESS), ("steps", results / "vessel-steps.toml")):
        words = ["durations", str(DESIGNED), "--vessel", str(vessel), "--out", str(tmp_path / name), "-q"]
        assert main(words) == 0
        known[name] = json.loads((tmp_path / name / "durations.json").read_text())["log_det"]
        added[name] = known[name] + np.linalg.slogdet(load_vessel(vessel).model.parameter_covariance)[1]
    assert known["steps"] > known["guess"]
    assert added["steps"] < added["guess"]


def test_a_vessel_file_that_is_not_there_leaves_no_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["score", str(DESIGNED), "--vessel", str(tmp_path / "none.toml"), "--out", str(tmp_path / "out"), "-q"]
    assert main(words) == 2
    told = capsys.readouterr().err
    assert "none.toml: does not exist, expected a TOML file" in told
    assert not (tmp_path / "out").exists()


@pytest.fixture(scope="module")
def trial() -> StepTrial:
    return identify_steps(craft_record(3), CONTROLS)


@pytest.mark.thorough
def test_a_mirrored_trial_gives_the_same_model(trial: StepTrial) -> None:
    one, other = trial, identify_steps(mirrored(craft_record(3)), CONTROLS)
    assert [a.inertia for a in one.samples] == pytest.approx([b.inertia for b in other.samples], nan_ok=True, rel=1e-6)
    states = np.array([[3.0, 0.05], [6.0, 0.1]])
    for a, b in zip(
        (*one.model.inertia, one.model.damping[0]), (*other.model.inertia, other.model.damping[0]), strict=True
    ):
        assert a(states) == pytest.approx(b(states * [1.0, -1.0]), rel=1e-6)


@pytest.mark.slow
def test_steps_leave_no_parameter_more_uncertain_than_it_was() -> None:
    """Although sway, which is not measured, adds errors to what the plateaus say of surge and yaw."""
    trial = identify_steps(craft_record(9000), CONTROLS)
    guess, truth = load_vessel(GUESS), load_vessel(TRUTH).model.parameters
    drawn = truth + guess.model.parameter_std * np.random.default_rng(0).standard_normal(len(truth))
    vessel = replace(guess, model=replace(guess.model, parameters=drawn))
    found = nominal_vessel(vessel, trial.samples, trial.delays, INPUTS).model
    assert (found.parameter_std <= guess.model.parameter_std * (1 + 1e-9)).all()
    assert (found.parameter_std < 0.6 * guess.model.parameter_std).sum() >= 5


@pytest.mark.parametrize("heading_rad", [0.0, 1.0, -2.5])
def test_speeds_through_water_are_those_over_ground_without_the_current(heading_rad: float) -> None:
    """To first order in the current: the rest is of the size of its square over the speed."""
    current_to, water = np.array([0.1, -0.05]), np.array([5.0, -0.4])
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    ground = water + np.array([[c, s], [-s, c]]) @ current_to
    measured = nominal.States(
        state=np.array([[np.hypot(*ground), 0.1]]), sway=ground[1:], inputs=np.zeros((1, 2))
    ).through_water(np.array([[c, s]]), current_to[None])
    assert measured.state[0, 0] == pytest.approx(np.hypot(*water), abs=0.1 * np.hypot(*current_to))
    assert measured.sway[0] == pytest.approx(water[1])
    assert measured.state[0, 1] == 0.1


def test_plateaus_enter_with_the_errors_that_they_state(trial: StepTrial) -> None:
    """Their means know that noise is slow: it must not be counted again."""
    held = [one.plateau for one in trial.samples if one.plateau is not None and np.isfinite(one.plateau.std).all()]
    known = evidence(trial.samples, trial.delays)
    assert known.steady_std[:, [0, 2]] == pytest.approx(np.array([part.std for part in held]))


@pytest.mark.slow
@pytest.mark.parametrize("with_sway", [False, True])
def test_stated_errors_hold_over_many_trials(with_sway: bool) -> None:
    scores = np.array([standard_scores(seed, with_sway=with_sway) for seed in range(20)])
    inside = (np.abs(scores) < 1.96).mean()
    assert inside > 0.85  # parameters of one trial err together, as do trials by what a time constant leaves out
    assert np.abs(np.mean(scores, axis=0)).max() < 2.0


@pytest.mark.parametrize(
    ("rows", "status", "what"),
    [
        ("time_s,u_mps,r_radps\n0,1,0\n1,1,0\n2,1,0\n", 2, "names no n1_rps"),
        ("time_s,u_mps,r_radps,n1_rps\n0,1,0,5\n1,1,0,5\n2,1,0,5\n", 2, "rudder1_rad"),
    ],
)
def test_files_that_are_wrong_are_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], rows: str, status: int, what: str
) -> None:
    (tmp_path / "bad.csv").write_text(rows)
    words = ["identify-steps", str(tmp_path / "bad.csv"), "--vessel", str(GUESS), "--out", str(tmp_path / "out"), "-q"]
    assert main(words) == status
    told = capsys.readouterr().err
    assert what in told
    assert told.count("\n") == 1
    assert not (tmp_path / "out").exists()


def _told(
    tmp_path: Path, columns: dict[str, np.ndarray], capsys: pytest.CaptureFixture[str], *more: str
) -> tuple[int, str]:
    data = write_csv(tmp_path / "data.csv", columns, list(columns))
    status = main(["identify-steps", str(data), "--out", str(tmp_path / "out"), "-q", *more])
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert not (tmp_path / "out").exists()
    return status, told


def test_records_without_steps_have_no_answer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng, time_s = np.random.default_rng(1), np.arange(0.0, 200.0, 0.5)
    wandering = {
        "time_s": time_s, "u_mps": 3 + 0.1 * np.sin(time_s), "r_radps": 0.1 * np.cos(time_s),
        "n1_rps": 5 + rng.standard_normal(len(time_s)), "rudder1_rad": 0.2 * np.sin(time_s / 3),
    }  # fmt: skip
    status, told = _told(tmp_path, wandering, capsys)
    assert (status, "no step trial" in told) == (3, True)
    still = wandering | {"n1_rps": np.full(len(time_s), 5.0), "rudder1_rad": 0.1 * (time_s // 50 % 2)}
    status, told = _told(tmp_path, still, capsys)
    assert (status, "throttle" in told) == (3, True)


@pytest.mark.thorough
def test_a_signal_that_is_not_there_and_a_vessel_that_is_known_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    columns = {name: values for name, values in craft_columns(1).items() if name in NAMES}
    status, told = _told(tmp_path, columns, capsys, "--throttle", "n3")
    assert (status, "n3" in told) == (2, True)
    status, told = _told(tmp_path, columns, capsys, "--vessel", str(TRUTH))
    assert (status, "parameter_std" in told) == (2, True)
