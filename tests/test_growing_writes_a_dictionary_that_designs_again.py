"""The grown dictionary is written as a file that gives the same design again; wrong settings name file and key."""

import json
from pathlib import Path

import pytest

from design_case import SCENARIOS, one_line
from expdesign import workflows
from expdesign.errors import FileError
from expdesign.scenario import load_dictionary, load_scenario

pytestmark = pytest.mark.usefixtures("undrawn")

GROW = """
[design.grow]
rounds = 2
pool = 32
run_s = 12.5
free_form = true
families = ["multisine", "turning_circle"]
limits = {v_mps = [-0.15, 0.2]}
"""


def scenario(folder: Path, *, dictionary: Path, grow: str = "") -> Path:
    """The model ship's scenario with another dictionary and key design.grow."""
    text = (SCENARIOS / "model-ship.toml").read_text(encoding="utf-8")
    for kind in ("vessels", "areas"):
        text = text.replace(f'"{kind}/', f'"{SCENARIOS}/{kind}/')
    text = text.replace('"dictionaries/model-ship.toml"', f'"{dictionary}"').replace("\n[start]", f"{grow}\n[start]")
    path = folder / "scenario.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def grown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, workflows.Outcome]:
    """Folder and outcome of a small growth."""
    folder = tmp_path_factory.mktemp("grown")
    path = scenario(folder, dictionary=SCENARIOS / "dictionaries" / "model-ship.toml", grow=GROW)
    return folder / "out", workflows.durations(path, folder / "out", seed=3)


@pytest.mark.thorough
def test_the_written_dictionary_gives_the_same_design_without_searching(grown, tmp_path: Path):
    folder, outcome = grown
    again = workflows.durations(scenario(tmp_path, dictionary=folder / "dictionary-grown.toml"), tmp_path / "out")
    first, second = (json.loads((place / "durations.json").read_text()) for place in (folder, tmp_path / "out"))
    assert second["log_det"] == pytest.approx(first["log_det"], abs=1e-7)
    assert [item["name"] for item in second["primitives"]] == [item["name"] for item in first["primitives"]]
    assert "manoeuvres_added" in outcome.summary
    assert "manoeuvres_added" not in again.summary


def test_every_addition_is_reported_with_its_gain(grown):
    folder, outcome = grown
    growth = json.loads((folder / "growth.json").read_text())
    (table,) = (item for item in outcome.document.tables if item.title.startswith("Manoeuvres added"))
    assert len(table.rows) == len(growth["rounds"]) == outcome.summary["manoeuvres_added"] > 0
    names = [spec.name for spec in load_dictionary(folder / "dictionary-grown.toml")]
    assert [row["name"] for row in growth["rounds"]] == names[-len(table.rows) :]
    assert growth["limits"]["v_mps"] == [-0.15, 0.2]
    assert all(row["sensitivity_before"] > growth["dimension"] for row in growth["rounds"])


def test_recorded_additions_lie_beside_the_dictionary(grown):
    folder, outcome = grown
    recorded = [spec for spec in load_dictionary(folder / "dictionary-grown.toml") if spec.family == "recorded"]
    assert recorded
    files = {path.name for path in outcome.files}
    assert {f"dictionary-grown-{spec.name}.csv" for spec in recorded} <= files


@pytest.mark.thorough
def test_trials_are_rehearsed_with_the_design_that_a_run_makes(grown):
    """Additions and seed included: as many runs of every manoeuvre as in durations.json."""
    folder, _ = grown
    tried = workflows.validate_design(
        folder.parent / "scenario.toml", folder.parent / "tried", trials=2, integrator="euler", jobs=1, seed=3
    )
    runs = json.loads(tried.files[0].read_text("utf-8"))["designs"]["optimised"]["runs"]
    rows = json.loads((folder / "durations.json").read_text())["primitives"]
    assert runs == {row["name"]: row["repeats"] for row in rows if row["repeats"]}


@pytest.mark.parametrize(
    ("grow", "says"),
    [
        ('families = ["zigzagg"]', "design.grow.families[1]: is 'zigzagg', did you mean 'zigzag'"),
        ("limits = {u_mps = [1.0, 0.0]}", "design.grow.limits.u_mps: is [1, 0], expected low below high"),
        ("limits = {u_mps = [1.0]}", "design.grow.limits.u_mps: "),
        ("limits = {u = [0.0, 1.0]}", "design.grow.limits.u: is not a known key, expected one of u_mps"),
        ("rounds = 0", "design.grow.rounds: is 0, expected at least 1"),
        ("tolerance = 0.0", "design.grow.tolerance: is 0, expected more than 0"),
        ("round = 3", "design.grow.round: is not a known key, did you mean 'rounds'"),
    ],
)
def test_wrong_settings_are_refused_with_file_and_key(grow: str, says: str, tmp_path: Path):
    dictionary = SCENARIOS / "dictionaries" / "model-ship.toml"
    path = scenario(tmp_path, dictionary=dictionary, grow=f"\n[design.grow]\n{grow}\n")
    with pytest.raises(FileError) as caught:
        load_scenario(path)
    assert says in str(caught.value)
    assert one_line(caught.value)
