"""`expdesign indices` prints and writes indices of model and records; `expdesign check-route` judges route files."""

import json
import math
import re
import shlex
from pathlib import Path

import pytest

import export_case
from expdesign.cli import main
from expdesign.export.formats import FORMATS
from expdesign.indices import standard_results
from expdesign.simulation import Conduct, turning_circle, zigzag
from measured_trials import TUG, TUG_TRUE, quiet, write_run

README = Path(__file__).parents[1] / "README.md"
TWENTY = math.radians(20)


def test_the_models_indices_are_those_of_the_library(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["indices", "--vessel", str(TUG), "--speed-mps", "1.2", "--out", str(tmp_path), "--quiet"]) == 0
    written = json.loads((tmp_path / "indices.json").read_text())
    from expdesign.scenario import load_vessel

    expected = standard_results(load_vessel(TUG), speed_mps=1.2)
    assert [trial["name"] for trial in written["simulated"]["trials"]] == [trial.name for trial in expected.trials]
    assert written["simulated"]["trials"][0]["advance_m"] == expected.circles[0].advance_m
    assert {row["source"] for row in written["verdicts"]} == {"simulated"}
    assert all(row["met"] == (row["value"] <= row["limit"]) for row in written["verdicts"])
    assert capsys.readouterr().out == ""


def test_a_recorded_zigzag_stands_beside_the_models(tmp_path: Path) -> None:
    ship = quiet(TUG_TRUE)
    commands, motion = zigzag(
        ship, heading_rad=TWENTY, helm_rad=TWENTY, side="port", conduct=Conduct(speed_mps=2.0, approach_s=40.0)
    )
    path = write_run(tmp_path / "swing.csv", ship, commands, velocity=tuple(motion.velocity[0]))
    told = ["--depth-m", "30", "--wind-mps", "4.5", "--sea-state", "2"]
    assert main(["indices", str(path), "--vessel", str(TUG), *told, "--out", str(tmp_path / "out")]) == 0
    written = json.loads((tmp_path / "out" / "indices.json").read_text())
    expected = standard_results(ship, speed_mps=2.0, sides=("port",)).zigzags[1]
    (found,) = written["measured"]
    assert (found["kind"], found["side"]) == ("zig-zag", "port")
    assert found["overshoots_rad"] == pytest.approx(expected.overshoots_rad, abs=math.radians(2.5))
    page = (tmp_path / "out" / "indices.html").read_text()
    assert "swing.csv" in page
    assert " ".join(told) in page
    assert written["held"] == {"depth_m": 30.0, "wind_mps": 4.5, "sea_state": 2}
    assert "http" not in page


@pytest.mark.thorough
def test_the_readmes_commands_for_indices_and_routes_run_as_they_stand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With files of the names that it uses."""
    readme = README.read_text()
    ship, conduct = quiet(TUG_TRUE), Conduct(speed_mps=2.0, approach_s=40.0)
    for name, (commands, motion) in {
        "zigzag.csv": zigzag(ship, heading_rad=TWENTY, helm_rad=TWENTY, conduct=conduct),
        "circle.csv": turning_circle(ship, conduct=conduct),
    }.items():
        write_run(tmp_path / name, ship, commands, velocity=tuple(motion.velocity[0]))
    (tmp_path / "ship.toml").write_bytes(TUG.read_bytes())
    for name, content in export_case.plan_files().items():
        (tmp_path / name).write_text(content)
    monkeypatch.chdir(tmp_path)
    (line,) = re.findall(r"^\.venv/bin/expdesign (indices .*)$", readme, re.MULTILINE)
    assert main(shlex.split(line)) == 0
    kinds = [run["kind"] for run in json.loads((tmp_path / "runs/ship-indices/indices.json").read_text())["measured"]]
    assert kinds == ["zig-zag", "turning circle"]
    assert main(["export", "plan.json", "--format", "rtz", "rtz-1.0", "rtz-1.1", "--quiet"]) == 0
    assert main(["check-route", *map(str, tmp_path.glob("*.rtz"))]) == 0


def test_what_is_wrong_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["indices", "--vessel", str(TUG), "--speed-mps", "30", "--out", str(tmp_path)]) == 2
    assert "cannot hold 30 m/s" in capsys.readouterr().err
    assert main(["indices", "--vessel", str(TUG), "--scale", "0.5"]) == 2
    assert "--scale is 0.5, expected at least 1" in capsys.readouterr().err
    assert main(["indices", "--vessel", str(TUG), "--sea-state", "10"]) == 2
    assert "--sea-state is 10, expected at least 0 and at most 9" in capsys.readouterr().err
    (tmp_path / "bad.gpx").write_text("<gpx/>")
    assert main(["check-route", str(tmp_path / "bad.gpx")]) == 2
    assert "expected gpx 1.1" in capsys.readouterr().err


def test_all_problems_of_a_route_are_told_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, content in export_case.plan_files().items():
        (tmp_path / name).write_text(content)
    assert main(["export", str(tmp_path / "plan.json"), "--format", "rtz", "--quiet"]) == 0
    text = (tmp_path / "route.rtz").read_text()
    wrong = re.sub(r'lat="-?[\d.]+"', 'lat="91"', text, count=3)
    (tmp_path / "route.rtz").write_text(wrong.replace('routeName="route"', 'routeName="other"'))
    assert main(["check-route", str(tmp_path / "route.rtz"), "--quiet"]) == 2
    *notes, line = capsys.readouterr().err.splitlines()
    assert line.endswith("lat = '91', expected -90 to 90 (and 3 more)")
    assert [note.split("route.rtz: ")[1].split(",")[0] for note in notes] == [
        "position has lat = '91'", "position has lat = '91'", "routeName is 'other'"
    ]  # fmt: skip


def test_export_writes_every_format_from_the_plan_files_with_times_where_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, content in export_case.plan_files().items():
        (tmp_path / name).write_text(content)
    plan = str(tmp_path / "plan.json")
    formats = [known.name for known in FORMATS]
    assert main(["export", plan, "--format", *formats[:3], "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["summary"]["legs_in_allowed_water"] is True
    spelled = [part for name in formats for part in ("--format", name)]
    assert main(["export", plan, *spelled, "--departure", "2027-05-01T08:00:00Z", "--quiet"]) == 0
    assert all((tmp_path / known.file_name).exists() for known in FORMATS)
    assert 'eta="2027-05-01T08:15:00Z"' in (tmp_path / "route.rtz").read_text()
    assert main(["check-route", *(str(tmp_path / f"route{end}") for end in (".rtz", "-rtz10.rtz", ".gpx"))]) == 0
    assert main(["export", plan, "--format", "rtz", "--departure", "tomorrow"]) == 2
    assert "expected a time such as" in capsys.readouterr().err
    assert main(["export", plan, "--format", "rtz", "--departure", "2027-05-01T08:00"]) == 2
    assert "has no time zone" in capsys.readouterr().err
