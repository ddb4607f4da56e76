"""A draft is the first that the whole job would plan, takes less work, is marked everywhere, and cannot be sailed."""

from __future__ import annotations

import contextlib
import io
import json
import re
from fnmatch import fnmatch
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from counted_work import counted_work
from expdesign import workflows
from expdesign.cli import main
from expdesign.errors import FileError, InputError
from expdesign.export.routes import read_plan
from expdesign.web.answers import played
from expdesign.workflows.steps.planned import SAILED_BY
from short_examples import SHORTER, copied, example_run, example_work

NAME = "story"


@pytest.fixture(scope="module")
def draft(made_once):
    """Folder of a draft, where the command puts it, the work counted for it by kind, its scenario, and what is told."""

    def run(folder: Path) -> dict:
        scenario, told = copied(folder.with_name("draft-scenario"), NAME, SHORTER[NAME]), io.StringIO()
        with counted_work() as (counts, _), contextlib.chdir(folder), contextlib.redirect_stdout(told):
            main(["run", str(scenario), "--draft", "--seed", "1"])
        return {"work": total(counts), "scenario": str(scenario), "told": told.getvalue()}

    folder, found = made_once("draft", run)
    return folder / "runs" / f"{NAME}-draft", found


def total(counts: dict[str, dict[str, int]]) -> dict[str, int]:
    """Work by kind, whatever the phase."""
    kinds = {kind for phase in counts.values() for kind in phase}
    return {kind: sum(phase.get(kind, 0) for phase in counts.values()) for kind in kinds}


def planned(folder: Path) -> dict:
    return json.loads((folder / "plan.json").read_text("utf-8"))


def test_it_is_the_first_plan_of_the_whole_job(draft, made_once):
    whole, _ = example_run(made_once, NAME)
    durations = [json.loads((folder / "durations.json").read_text("utf-8")) for folder in (draft[0], whole)]
    assert durations[0]["primitives"] == durations[1]["primitives"]
    legs = [
        [(leg["name"], leg["start"], leg["end"]) for leg in planned(folder)["legs"]] for folder in (draft[0], whole)
    ]
    assert legs[0] == legs[1]  # whose drawn trials stayed in allowed water at once


def test_it_takes_the_work_of_legs_and_none_of_drawn_trials(draft, made_once):
    whole, work = example_work(made_once, NAME), draft[1]["work"]
    assert work["solves"] == total(whole)["solves"]
    assert work["iterations"] == total(whole)["iterations"]
    drawn = whole["checks"]["samples of few ships"]
    assert drawn > 0
    assert work.get("samples of few ships", 0) <= total(whole)["samples of few ships"] - drawn


def test_it_draws_the_manoeuvres_that_it_runs_and_says_of_the_others_that_they_are_not_drawn(draft):
    durations = json.loads((draft[0] / "durations.json").read_text("utf-8"))
    runs = [item["repeats"] for item in durations["primitives"]]
    page = (draft[0] / "report.html").read_text("utf-8")
    gallery = page[page.index("<h2>The manoeuvres") : page.index("<h2>Time series")]
    assert 0 < len(re.findall(r"<svg", gallery)) == sum(count > 0 for count in runs) < len(runs)
    assert gallery.count("Not drawn in a draft") == sum(count == 0 for count in runs)


def test_plan_page_and_every_figure_say_draft(draft):
    plan = planned(draft[0])
    assert plan["draft"] is True
    assert plan["verified"] is False
    assert "DRAFT" in plan["verdict"]
    assert plan["verification"]["problems"] == []
    assert plan["drawn_trials"] is None
    assert plan["reposition_bound_s"] is None
    page = (draft[0] / "report.html").read_text("utf-8")
    assert re.search("<title>DRAFT", page)
    assert re.search("<h1>.*DRAFT", page)
    assert "not verified" in page
    figures = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert len(figures) > 4
    assert all(re.search('class="mark-across".*?>DRAFT</text></svg>$', figure, re.DOTALL) for figure in figures)


def test_a_whole_plan_has_no_such_mark(made_once):
    whole, _ = example_run(made_once, NAME)
    assert "draft" not in planned(whole)
    assert "mark-across" not in (whole / "report.html").read_text("utf-8")


def test_it_has_no_file_to_sail_by_and_none_can_be_made_from_it(draft):
    names = [path.name for path in draft[0].iterdir()]
    assert {"plan.json", "report.html", "durations.json"} <= set(names)
    assert not [name for name in names for pattern in SAILED_BY if fnmatch(name, pattern)]
    with pytest.raises(FileError, match="nobody may sail a draft"):
        read_plan(draft[0] / "plan.json")


def test_its_legs_are_where_a_chart_draws_them(draft):
    legs = planned(draft[0])["legs"]
    sketch = played(str(draft[0] / "plan.json"))["sketch"]
    assert [leg["places"] for leg in sketch] == [leg["sketch_deg"] for leg in legs]
    assert all(len(leg["sketch_deg"]) <= 40 for leg in legs)
    assert all(one["sketch_deg"][-1] == other["sketch_deg"][0] for one, other in pairwise(legs))
    for leg in legs:
        ends = [leg[end][axis] for axis in ("north_m", "east_m") for end in ("start", "end")]
        north, east = (111_195.0 * np.ptp(np.array(leg["sketch_deg"])[[0, -1]], axis=0)).tolist()
        assert north == pytest.approx(abs(ends[1] - ends[0]), abs=3.0 + 0.01 * abs(ends[1] - ends[0]))
        assert east >= abs(ends[3] - ends[2]) - 3.0  # a degree of longitude is shorter


def test_it_never_lies_beside_files_to_sail_by(draft, made_once):
    whole, names = example_run(made_once, NAME)
    before = {name: (whole / name).read_bytes() for name in names}
    with pytest.raises(InputError, match="part of a trial that may be sailed"):
        workflows.run(Path(draft[1]["scenario"]), whole, draft=True, seed=1)
    assert {path.name: path.read_bytes() for path in whole.iterdir()} == before


def test_the_terminal_says_draft_and_the_page_how_it_was_made(draft):
    assert "DRAFT" in draft[1]["told"]
    assert f"{NAME}.toml --draft --seed 1" in (draft[0] / "report.html").read_text("utf-8")
