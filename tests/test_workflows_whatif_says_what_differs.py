import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign import workflows
from expdesign.cli import main
from expdesign.errors import FileError, InputError
from expdesign.export.pages import document_html
from expdesign.export.whatif_content import Case, WhatIfContent
from expdesign.export.whatif_page import whatif_document
from expdesign.scenario import load_scenario, load_variant
from scenario_files import SCENARIOS, write_scenario

MODEL_SHIP, HOUR = SCENARIOS / "model-ship.toml", SCENARIOS / "helsinki-hour.toml"
VARIANTS = sorted((SCENARIOS / "variants").glob("*.toml"))


def variant(folder: Path, name: str, text: str) -> Path:
    path = folder / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return path


def cases(outcome) -> dict[str, dict]:
    content = json.loads(outcome.files[0].read_text("utf-8"))
    return {case["name"]: case for case in content["cases"]}


@pytest.mark.parametrize("path", VARIANTS, ids=lambda path: path.stem)
def test_the_example_variants_change_what_they_say(path):
    scenario, changes = load_variant(HOUR, path)
    assert scenario.name == path.stem
    assert changes
    assert scenario.area.name == load_scenario(HOUR).area.name


@pytest.mark.thorough
def test_twice_the_time_is_twice_the_information_and_the_same_files_give_no_difference(tmp_path):
    base = load_scenario(MODEL_SHIP).design.total_s
    twice = variant(tmp_path, "twice", f"[design]\ntotal_s = {2 * base}\n")
    same = variant(tmp_path, "same", "[design]\n")
    found = cases(workflows.whatif(MODEL_SHIP, [twice, same], tmp_path / "out", jobs=1))
    assert found["same"]["accuracy"] == pytest.approx(1.0, abs=1e-12)
    assert all(ratio == pytest.approx(1.0) for ratio in found["same"]["std_ratio"].values())
    # whole runs do not double exactly; their time does, to a run
    longer = found["twice"]["informative_s"] / found["model-ship"]["informative_s"]
    assert longer == pytest.approx(2.0, rel=0.1)
    assert found["twice"]["accuracy"] == pytest.approx(longer, rel=0.1)
    assert found["twice"]["same_accuracy_s"] == pytest.approx(found["model-ship"]["informative_s"], rel=0.1)
    # cases that differ in time alone lie on one curve, which falls with the root of time
    curves = {
        name: {row["informative_s"]: row["std_ratio"] for row in case["accuracy_by_time"]}
        for name, case in found.items()
    }
    for own_s in (case["informative_s"] for case in found.values()):
        assert curves["twice"][own_s] == pytest.approx(curves["model-ship"][own_s], rel=1e-9)
    assert curves["twice"][found["twice"]["informative_s"]] == pytest.approx(found["twice"]["accuracy"] ** -0.5)
    times, ratios = (np.array(side) for side in zip(*sorted(curves["twice"].items()), strict=True))
    assert ratios * np.sqrt(times) == pytest.approx(np.sqrt(found["model-ship"]["informative_s"]), rel=0.1)
    assert found["twice"]["changes"] == [f"design.total_s = {2 * base:g} instead of {base:g}"]


def test_a_complete_scenario_is_a_variant_too_and_relative_files_are_found(tmp_path):
    write_scenario(tmp_path)
    own = tmp_path / "scenario.toml"
    scenario, _ = load_variant(MODEL_SHIP, own)
    alone = load_scenario(own)
    assert scenario.name == alone.name
    assert np.array_equal(scenario.start, alone.start)
    assert scenario.vessel.name == alone.vessel.name


def test_a_complete_scenario_takes_nothing_from_its_base_and_what_it_leaves_out_is_said():
    shortest = SCENARIOS / "helsinki.toml"
    assert load_scenario(shortest).design.accuracy is not None
    scenario, changes = load_variant(shortest, HOUR)
    assert scenario.design.accuracy is None
    assert any(line.startswith("design.accuracy") and "not given instead of" in line for line in changes)
    assert load_variant(HOUR, HOUR)[1] == ()


def test_a_position_in_other_keys_replaces_the_first(tmp_path):
    moved = variant(tmp_path, "moved", "[start]\nheading_deg = 10.0\n")
    assert load_variant(MODEL_SHIP, moved)[0].start[2] == pytest.approx(np.radians(10.0))
    base = load_scenario(MODEL_SHIP)
    lat, lon = base.area.frame.to_degrees(base.start[:2])
    other = variant(tmp_path, "other", f"[start]\nlat_deg = {lat:.9f}\nlon_deg = {lon:.9f}\n")
    assert np.allclose(load_variant(MODEL_SHIP, other)[0].start, base.start, atol=1e-3)


def test_a_variant_without_answer_is_listed_beside_the_others(tmp_path):
    alone = variant(tmp_path, "circles-only", f"[design]\nexcluded = {json.dumps(_all_but_first())}\n")
    found = cases(workflows.whatif(MODEL_SHIP, [alone], tmp_path / "out", jobs=1))
    assert "cannot separate these parameters" in found["circles-only"]["problem"]
    assert found["model-ship"]["problem"] is None
    assert "No result" in (tmp_path / "out" / "whatif.html").read_text("utf-8")


def _all_but_first() -> list[str]:
    return [spec.name for spec in load_scenario(MODEL_SHIP).dictionary[1:]]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[design]\ntotal_x = 3\n", "design.total_x: is not a known key, did you mean 'total_s'?"),
        ("[design]\ntotal_s = 0\n", "design.total_s"),
        ('[scenario]\nvessel = "nowhere.toml"\n', "nowhere.toml"),
        ('scenario = "x"\n', "scenario"),
    ],
)
def test_wrong_variants_are_one_line_of_their_own_file(tmp_path, capsys, text, words):
    path = variant(tmp_path, "wrong", text)
    assert main(["whatif", str(MODEL_SHIP), str(path), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert str(path) in error
    assert words in error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("text", ['robust = "worst"', "balance = 0.5", 'predictor = "velocity"'])
def test_what_is_wrong_with_a_variant_is_said_before_anything_is_planned(tmp_path, monkeypatch, capsys, text):
    path = variant(tmp_path, "wrong", f'[design]\n{text}\n[design.accuracy]\nas = "durations"\n')

    def planned(*_, **__):
        raise AssertionError("a trial is planned")

    monkeypatch.setattr("expdesign.workflows.commands.whatif.planned_day", planned)
    monkeypatch.setattr("expdesign.workflows.commands.whatif.search_additions", planned)
    command = ["whatif", str(MODEL_SHIP), str(path), "--plan", "--jobs", "1", "--no-cache"]
    assert main([*command, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert str(path) in error
    assert f"design.{text.split()[0]}" in error
    assert not (tmp_path / "out").exists()


def test_two_of_one_name_and_none_at_all_are_refused(tmp_path):
    path = variant(tmp_path, "model-ship", "[design]\n")
    with pytest.raises(FileError, match=r"scenario.name: is 'model-ship' as in model-ship.toml, expected another"):
        workflows.whatif(MODEL_SHIP, [path], tmp_path, jobs=1)
    with pytest.raises(InputError, match="no VARIANT"):
        workflows.whatif(MODEL_SHIP, [], tmp_path, jobs=1)
    with pytest.raises(FileError, match="does not exist"):
        workflows.whatif(MODEL_SHIP, [tmp_path / "none.toml"], tmp_path, jobs=1)


def case_of(name, *, track, day_s, legs_count=False):
    plan = {"day_s": day_s, "day_median_s": day_s + 60.0, "day_95_s": day_s + 120.0}
    return Case(
        name=name,
        criterion="D",
        runs={"circle": 1},
        informative_s=100.0,
        efficiencies={},
        parameters=("X_u", "Y_v"),
        covariance=np.eye(2),
        plan=plan,
        track=track,
        legs_count=legs_count,
    )


@pytest.mark.thorough
def test_days_are_compared_by_what_their_whole_tracks_tell():
    first, half, unknown = (
        case_of(name, track=track, day_s=day_s)
        for name, track, day_s in (("first", np.eye(2), 900.0), ("half", 2 * np.eye(2), 600.0), ("none", None, 300.0))
    )
    content = WhatIfContent(cases=(first, half, unknown), planned=True)
    assert content.against(half).track == pytest.approx(0.5)
    assert content.against(half).accuracy == pytest.approx(1.0)
    assert content.against(unknown).track is None
    page = document_html(whatif_document(content))
    assert 'id="days-' in page
    assert page.count("Legs included, the day has 0.50 times the information of the scenario") == 1
    asked = replace(case_of("asked", track=None, day_s=0.0, legs_count=True), plan={})
    unplanned = WhatIfContent(cases=(first, asked), planned=False)
    assert document_html(whatif_document(unplanned)).count("These durations only state its accuracy;") == 1
    for minutes in ("15.0", "16.0", "17.0", "10.0"):  # planned, median, 95 %
        assert f">{minutes}<" in page


def test_where_legs_count_whole_days_are_compared_and_not_runs():
    first = case_of("first", track=np.eye(2), day_s=900.0)
    shortest = case_of("shortest", track=np.diag([2.0, 0.5]), day_s=600.0, legs_count=True)
    content = WhatIfContent(cases=(first, shortest), planned=True)
    against = content.against(shortest)
    np.testing.assert_allclose(against.ratios, np.sqrt([2.0, 0.5]))
    assert against.accuracy == against.track == pytest.approx(1.0)
    assert against.same_accuracy_s is None
    assert "Legs count in its accuracy, so whole days are compared." in document_html(whatif_document(content))


@pytest.mark.thorough
def test_what_a_case_does_not_use_is_said_of_it_and_of_all_only_once(tmp_path, capsys):
    calm = variant(tmp_path, "windy", "[environment]\nwind_to = {north_mps = 5.0, east_mps = 0.0}\n")
    assert main(["whatif", str(MODEL_SHIP), str(calm), "--jobs", "1", "--out", str(tmp_path / "out")]) == 0
    (wind,) = (line for line in load_variant(MODEL_SHIP, calm)[0].remarks if "wind" in line)
    told, page = capsys.readouterr().out, (tmp_path / "out" / "whatif.html").read_text(encoding="utf-8")
    assert load_scenario(MODEL_SHIP).remarks == ()
    for text in (told, page.replace("&#39;", "'")):
        assert text.count(f"Note: {wind}.") == 1
