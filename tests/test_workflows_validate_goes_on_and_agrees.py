import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign import workflows
from expdesign.cli import main
from expdesign.errors import InputError
from expdesign.estimation.methods import method_named
from expdesign.export import words
from expdesign.memory import digest
from expdesign.rehearsal.validation import Rehearsal
from expdesign.scenario import load_scenario
from expdesign.workflows.commands.validate import _method
from scenario_files import SCENARIOS

MODEL_SHIP, TRUE = SCENARIOS / "model-ship.toml", SCENARIOS / "vessels" / "model-ship-true.toml"
OPTIONS = {"truth": TRUE, "trials": 4, "integrator": "euler", "jobs": 1}


@pytest.fixture
def whole(made_once) -> dict[str, Path]:
    """Files of an uninterrupted call, by name."""

    def made(folder: Path) -> list[str]:
        return [path.name for path in workflows.validate_design(MODEL_SHIP, folder, **OPTIONS).files]

    folder, names = made_once("validated", made)
    return {name: folder / name for name in names}


@pytest.mark.thorough
@pytest.mark.usefixtures("undrawn_here")
def test_an_interrupted_call_goes_on_and_gives_the_same(tmp_path, whole):

    def stop(what: str, share: float) -> None:
        if what == "simulating trials" and share > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        workflows.validate_design(MODEL_SHIP, tmp_path / "parts", progress=stop, **OPTIONS)
    (kept,) = (tmp_path / "parts").iterdir()
    assert 0 < len(list(kept.glob("*.npy"))) < 3
    resumed = workflows.validate_design(MODEL_SHIP, tmp_path / "parts", **OPTIONS)
    assert [path.name for path in resumed.files] == ["validation.json", "validation.html"]
    assert sorted(path.name for path in (tmp_path / "parts").iterdir()) == ["validation.html", "validation.json"]
    assert resumed.files[0].read_text("utf-8") == whole["validation.json"].read_text("utf-8")


def test_the_page_shows_what_the_file_holds(whole):
    content = json.loads(whole["validation.json"].read_text("utf-8"))
    page = whole["validation.html"].read_text("utf-8")
    assert set(content["designs"]) == {"optimised", "equal shares", "random"}
    for design in content["designs"].values():
        for entry in design["parameters"].values():
            assert words.significant(entry["std_found"]) in page
            assert 0 <= entry["coverage_95"] <= 1
    random = content["designs"]["random"]
    assert random["runs"] is None
    assert all(entry["std_predicted_at_truth"] is None for entry in random["parameters"].values())
    runs = content["designs"]["optimised"]["runs"]
    assert all(count > 0 for count in runs.values())
    assert "http" not in page.replace("http://www.w3.org", "")
    assert np.isfinite(content["designs"]["optimised"]["normalised_error"]["median"])


@pytest.mark.parametrize(
    ("name", "method"), [("story", "iv-current"), ("helsinki", "iv-air-current"), ("model-ship", "iv")]
)
def test_designs_are_tested_by_the_method_whose_accuracy_they_count(name, method):
    case = load_scenario(SCENARIOS / f"{name}.toml")
    assert _method(case, None) == method
    assert _method(case, "ls") == "ls"
    assert method_named(method).weather.steady == (case.environment.current_std_mps > 0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--trials", "1"), "trials is 1, expected 2 or more"),
        (("--integrator", "heun"), "--integrator is heun, expected one of rk4, euler"),
        (("--method", "magic"), "magic"),
        (("--truth", str(SCENARIOS / "vessels" / "azimuth-30m.toml")), "expected the same actuators"),
    ],
)
def test_wrong_options_give_one_line_and_no_files(tmp_path, capsys, options, words):
    assert main(["validate", str(MODEL_SHIP), "--out", str(tmp_path / "out"), "--jobs", "1", *options]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert words in error
    assert not (tmp_path / "out").exists()


def test_another_method_is_named_at_once():
    with pytest.raises(InputError):
        workflows.validate_design(MODEL_SHIP, None, method="magic", trials=2, jobs=1)


def test_chunks_of_another_ship_are_not_taken_over():
    """Whatever of a ship differs, be it one expression, the kept chunks are others."""
    case = load_scenario(MODEL_SHIP)
    vessel, model = case.vessel, case.vessel.model
    turned = replace(model.terms[0], expression=f"2*({model.terms[0].expression})")
    first, *others = model.actuators
    ships = (
        vessel,
        replace(vessel, model=replace(model, terms=(turned, *model.terms[1:]))),
        replace(vessel, model=replace(model, actuators=(replace(first, forward_m=first.forward_m + 0.1), *others))),
    )
    rehearsals = (
        Rehearsal(
            truth=ship, nominal=vessel, primitives=(), designs={}, total_s=60.0, environment=case.environment,
            parameters=model.names, method="iv", mean_subtraction="none", integrator="euler", trials=2, seed=0,
        )
        for ship in ships
    )  # fmt: skip
    assert len({digest(one) for one in rehearsals}) == len(ships)
