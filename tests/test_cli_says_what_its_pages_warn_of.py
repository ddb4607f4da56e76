"""What a page finds first and notes about the data is on the terminal and in the JSON summary of its command, too."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from design_case import SCENARIOS
from expdesign.cli import main
from expdesign.cli.commands import as_json, print_summary
from expdesign.export.document import Document, Table, tabled
from expdesign.scenario import load_scenario
from expdesign.sea_area import UNKNOWN_DEPTH
from expdesign.workflows import Outcome
from expdesign.workflows.steps.planned import plan_document
from export_case import plan, tug
from roll_files import KNOWN, UNKNOWN, stated, three
from short_examples import SHORTER, copied
from step_case import GUESS, STEPS, craft_columns, write_csv


def steps_files(folder: Path) -> list[object]:
    """Data with a column that nothing reads, of which a note tells."""
    columns = craft_columns(1, steps=STEPS[:12])
    names = ("time_s", "u_mps", "r_radps", "n1_rps", "rudder1_rad")
    data = write_csv(folder / "steps.csv", {**columns, "odd_mps": np.ones(len(columns["time_s"]))}, (*names, "odd_mps"))
    return ["identify-steps", data, "--vessel", GUESS]


def roll_files(folder: Path) -> list[object]:
    loads = stated(folder, "\n[[load]]\n" + KNOWN + UNKNOWN)
    return ["roll", *three(folder), "--loads", loads]


def load_plan(folder: Path) -> list[object]:
    return ["roll-plan", SCENARIOS / "roll-trial.toml", "--loads", SCENARIOS / "loads" / "roll-trial.toml"]


def foreseen(folder: Path) -> list[object]:
    return ["foresee", copied(folder, "model-ship", SHORTER["model-ship"])]


def validated(folder: Path) -> list[object]:
    return ["validate", SCENARIOS / "model-ship.toml", "--trials", 3]


def said_on_page(page: str) -> list[str]:
    """Sentences of the section at the top and of the notes on the data."""
    parts = re.findall(r'<section class="summary">(.*?)</section>', page, flags=re.DOTALL)
    parts += re.findall(r"<h2>Notes on the data</h2>(.*?)</section>", page, flags=re.DOTALL)
    texts = [text for part in parts for text in re.findall(r"<(?:p|li)>(.*?)</(?:p|li)>", part, flags=re.DOTALL)]
    return [" ".join(html.unescape(re.sub("<[^>]+>", "", text)).split()) for text in texts]


def assert_agree(summary: Mapping[str, object], table: Mapping[str, object]) -> None:
    """Numbers that a summary and a file name alike are alike."""
    for key in summary.keys() & table.keys():
        if isinstance(summary[key], float):
            assert table[key] == pytest.approx(summary[key], rel=1e-9), key


LONG = [pytest.param(one, marks=pytest.mark.thorough) for one in (steps_files, foreseen, validated)]


@pytest.mark.usefixtures("undrawn_here")
@pytest.mark.parametrize("asked", [roll_files, load_plan, *LONG])
def test_what_a_page_says_first_is_on_the_terminal(
    asked: Callable[[Path], list[object]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    printed = list[Outcome]()

    def both(outcome: Outcome) -> None:
        printed.append(outcome)
        print_summary(outcome)

    monkeypatch.setattr("expdesign.cli.commands.print_summary", both)
    words = [*map(str, asked(tmp_path)), "--out", str(tmp_path / "out")]
    assert main(words) == 0
    told = " ".join(capsys.readouterr().out.split())
    (page,) = (tmp_path / "out").glob("*.html")
    sentences = said_on_page(page.read_text())
    assert sentences
    assert [text for text in sentences if text not in told] == []
    for path in (path for path in printed[0].files if path.suffix == ".json"):
        assert_agree(printed[0].summary, json.loads(path.read_text()))


def test_water_without_depths_is_said_with_the_plan() -> None:
    assert UNKNOWN_DEPTH in plan_document(replace(load_scenario(SCENARIOS / "story.toml"), vessel=tug()), plan()).notes


def test_a_note_is_printed_once_however_long_and_whatever_tables_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    long = "A sentence that goes on. " * 20
    table = Table(title="Findings", header=("finding",), rows=(("A cell.",),))
    part = Document(facts={"number": float("nan")}, findings=("Another.",), sections=tabled(table), notes=(long,))
    outcome = Outcome(files=(), document=part + Document(notes=(long,)))
    print_summary(outcome)
    told = capsys.readouterr().out
    assert [told.count(text) for text in ("A cell.", "Another.", long)] == [1, 1, 1]
    assert "nan" not in told
    printed = json.loads(as_json("run", outcome))
    assert printed["summary"]["number"] is None
    assert printed["notes"] == [long]
