"""A refused plan leaves a draft that nobody can take for a plan; results of an earlier attempt stay apart from it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from expdesign import requests
from expdesign.cli import main
from expdesign.errors import NoPlan, NotInformative
from expdesign.export.document import Document
from expdesign.progress import silent
from expdesign.scenario import load_scenario
from expdesign.workflows.outcome import Outcome
from expdesign.workflows.steps.case import DRAFT, drafted, written
from scenario_files import SCENARIOS

STORY = load_scenario(SCENARIOS / "story.toml")
RESULTS = {"plan.json", "track.csv", "commands.csv", "report.html", "cards.html", "route.rtz", "durations.json"}


def asked(folder: Path) -> requests.Run:
    return requests.Run(scenario=SCENARIOS / "story.toml", out=folder)


def refused(folder: Path, **known) -> NoPlan:
    """A refusal with a place and a piece of track, and what it leaves in a folder."""
    error = NoPlan("no room for 'zigzag'", place=(20.0, -30.0), remedy="with plan.clearance_m = 5 there is", **known)
    error.poses = np.linspace((-100.0, -450.0, 0.0), (0.0, 0.0, 1.0), 5000)
    error.tried = ("plan 1: 9 % leave allowed water",)
    with pytest.raises(NoPlan) as caught, drafted(asked(folder), STORY):
        raise error
    return caught.value


def test_the_draft_says_what_where_and_what_helps_and_is_no_route(tmp_path):
    error = refused(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(DRAFT)
    assert not set(DRAFT) & RESULTS
    found = json.loads((tmp_path / "refused.json").read_text("utf-8"))
    assert found["refused"] is True
    assert found["verified"] is False
    assert (found["place"]["north_m"], found["place"]["east_m"]) == (20.0, -30.0)
    assert found["remedies"] == ["with plan.clearance_m = 5 there is"]
    assert 0 < len(found["draft_track"]) <= 2500
    assert found["draft_track"][0] == {"north_m": -100.0, "east_m": -450.0, "heading_rad": 0.0}
    page = (tmp_path / "refused.html").read_text("utf-8")
    for text in ("nothing here may be sailed", "No room for", "plan.clearance_m = 5", "9 % leave", "north 20 m"):
        assert text in page
    assert str(tmp_path / "refused.html") in str(error)


def test_earlier_results_stay_and_are_named_as_such(tmp_path):
    (tmp_path / "plan.json").write_text("{}", "utf-8")
    refused(tmp_path)
    assert (tmp_path / "plan.json").read_text("utf-8") == "{}"
    assert json.loads((tmp_path / "refused.json").read_text("utf-8"))["earlier_results_in_this_folder"] == ["plan.json"]
    assert "of an earlier attempt, not of this one: plan.json" in (tmp_path / "refused.html").read_text("utf-8")


def finished(folder: Path, name: str) -> Outcome:
    """A command that writes one file into a folder."""
    return written(asked(folder), STORY, {name: "{}"}, Document(), silent)


def test_a_plan_that_is_found_takes_an_earlier_draft_away_and_other_results_do_not(tmp_path):
    refused(tmp_path)
    finished(tmp_path, "durations.json")
    assert {path.name for path in tmp_path.iterdir()} == {*DRAFT, "durations.json"}
    assert not any("earlier draft" in note for note in finished(tmp_path, "plan.json").document.notes)
    assert {path.name for path in tmp_path.iterdir()} == {"plan.json", "durations.json"}


def test_a_draft_that_cannot_be_deleted_is_named_in_one_line(tmp_path, monkeypatch):
    refused(tmp_path)
    unlink = Path.unlink

    def locked(path: Path, missing_ok: bool = False) -> None:
        if path.name == "refused.html":
            raise PermissionError(13, "Permission denied")
        unlink(path, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", locked)
    *_, note = finished(tmp_path, "plan.json").document.notes
    left = tmp_path / "refused.html"
    assert note == f"The earlier draft cannot be deleted and is of no use: {left} (Permission denied)."


def test_other_refusals_leave_nothing(tmp_path):
    with pytest.raises(NotInformative), drafted(asked(tmp_path / "out"), STORY):
        raise NotInformative("nothing is known")
    assert not (tmp_path / "out").exists()


def test_a_refused_command_ends_with_status_3_one_line_and_the_draft(tmp_path, capsys):
    text = (SCENARIOS / "story.toml").read_text("utf-8")
    for folder in ("vessels", "dictionaries", "areas"):
        text = text.replace(f'"{folder}/', f'"{SCENARIOS.as_posix()}/{folder}/')
    path = tmp_path / "fast.toml"
    path.write_text(text + "transit_speed_mps = 60.0\n", "utf-8")
    assert main(["run", str(path), "--out", str(tmp_path / "out"), "--quiet"]) == 3
    line = capsys.readouterr().err.strip()
    assert "\n" not in line
    assert "without plan.transit_speed_mps the vessel is capable" in line
    assert {item.name for item in (tmp_path / "out").iterdir()} == set(DRAFT)
