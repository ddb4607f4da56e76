"""Whatever a page notes or warns of is on the terminal, in the JSON summary, and beside a refusal."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import expdesign.export
from expdesign.cli import main
from expdesign.cli.commands import as_json, print_summary
from expdesign.workflows import Outcome
from instrumented_ship import POSE, voyages, write_log, write_vessel

pytestmark = pytest.mark.usefixtures("undrawn")

EXPORT = Path(expdesign.export.__file__).parent
LISTS = r"\b(?:notes|warnings|remarks)\b"


class Notes(HTMLParser):
    """The texts of all elements of the class `note`."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if ("class", "note") in attrs:
            self.inside = tag
            self.found.append("")

    def handle_endtag(self, tag: str) -> None:
        self.inside = "" if tag == self.inside else self.inside

    def handle_data(self, data: str) -> None:
        if self.inside:
            self.found[-1] += data


def noted_on(page: Path) -> list[str]:
    reader = Notes()
    reader.feed(page.read_text(encoding="utf-8"))
    return [" ".join(text.split()) for text in reader.found]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ship, and logs with a column that nobody reads: of a held heading, of course for heading, and of hours."""
    folder = tmp_path_factory.mktemp("noted")
    write_vessel(folder / "ship.toml", off=1.1, more="heading_bias_rad = 0.01\n")
    for number, log in enumerate(voyages(2, "zigzag", last_s=240.0, gust=0.3)):
        held = log["heading_rad"][np.arange(240) // 4 * 4]
        write_log(folder / f"held{number}.csv", {**log, "heading_rad": held, "mood": log["time_s"]}, (*POSE, "mood"))
    (log,) = voyages(1, "random", last_s=6000.0, seed=3)
    log["r_radps"] = 0.9 * log["r_radps"]
    write_log(folder / "hours.csv", {**log, "mood": log["time_s"]}, (*log, "mood"))
    (folder / "instruments.toml").write_text("[sensors]\nwind_mps = 0.4\nvelocity_mps = 0.9\n")
    return folder


COMMANDS = {
    "estimate": "estimate {0}/held0.csv --test {0}/held1.csv --vessel {0}/ship.toml --fixed X_nn",
    "diagnose": "diagnose {0}/held0.csv {0}/held1.csv --vessel {0}/ship.toml --jobs 1",
    "indices": "indices {0}/held0.csv {0}/held1.csv --vessel {0}/ship.toml",
    "monitor": "monitor {0}/hours.csv --vessel {0}/ship.toml --learn-h 1.2 --size 0.5 --jobs 1",
    "mine": "mine {0}/held0.csv {0}/held1.csv --vessel {0}/ship.toml --piece 80 --keep 3 --fixed X_nn",
}
DOUBT = {"monitor": "hours.csv: r_radps is 0.9"}


LONG = [pytest.param(name, marks=pytest.mark.thorough) for name in ("estimate", "diagnose")]


@pytest.mark.parametrize("command", ["monitor", "indices", "mine", *LONG])
def test_the_terminal_says_all_that_the_page_notes(
    folder: Path, tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    printed = list[Outcome]()

    def both(outcome: Outcome) -> None:
        printed.append(outcome)
        print_summary(outcome)

    monkeypatch.setattr("expdesign.cli.commands.print_summary", both)
    assert main([*COMMANDS[command].format(folder).split(), "--out", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert DOUBT.get(command, "the headings are read every 4 s") in told
    assert "ignored mood" in told
    assert f"by {folder.name}/instruments.toml, as ship.toml does not say: wind_mps = 0.4" in told
    assert f"{folder.name}/instruments.toml shows velocity_mps = 0.9, where ship.toml says" in told
    lines = [" ".join(line.removeprefix("- ").split()) for line in told.splitlines()]
    for page in tmp_path.glob("*.html"):
        noted = noted_on(page)
        assert any("ignored mood" in note for note in noted)
        for note in noted:
            assert any(line.endswith(note) for line in lines), note
    notes = json.loads(as_json(command, printed[0]))["notes"]
    assert [f"- {note}" in told for note in notes] == [True] * len(notes)


def test_a_refusal_says_the_doubts_about_the_data(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = f"estimate {folder}/held0.csv --vessel {folder}/ship.toml --method iv --out {tmp_path / 'out'}"
    assert main(words.split()) == 3
    *_, note, error = capsys.readouterr().err.splitlines()
    assert note.startswith("expdesign: note: held0.csv: the headings are read every 4 s")
    assert error.startswith("expdesign: error: method iv: the data contain no information about")


def test_every_list_of_notes_on_a_page_is_marked_as_notes() -> None:
    """Which is how the test above finds them; `bullets` and loops of their own are for other things."""
    for template in EXPORT.glob("*/templates/*.html"):
        if template.name == "parts.html":
            continue
        for line in template.read_text(encoding="utf-8").splitlines():
            shown = re.search(rf"(?:bullets|sentences)\([\w.]*{LISTS}|for \w+ in [\w.]*{LISTS}", line)
            assert not shown, f"{template.name}: {line}"
