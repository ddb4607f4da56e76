"""Every page of the manual is listed and shown, and the commands of its tutorials do what the pages say."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from expdesign.cli import main
from expdesign.scenario import load_card
from expdesign.workflows import explain
from expdesign.workflows.commands.explain import MANUAL, page

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "expdesign" / "manual"
LONG = ("run", "replan", "diagnose", "simulate", "estimate")  # wait for a whole plan


def tutorial(name: str) -> list[list[str]]:
    """Commands of a tutorial, in order; but for `web`, which goes on until it is interrupted."""
    text = (PAGES / f"{name}.md").read_text(encoding="utf-8").replace("\\\n", " ")
    commands = (shlex.split(line) for line in re.findall(r"^ {7}expdesign (.*)$", text, re.MULTILINE))
    return [command for command in commands if command[0] != "web"]


def test_the_list_of_pages_is_that_of_the_files() -> None:
    assert sorted(MANUAL) == sorted(path.stem for path in PAGES.glob("*.md"))
    listed = [entry.name for section in explain().sections for entry in section.entries]
    assert set(MANUAL) <= set(listed)


@pytest.mark.parametrize("name", MANUAL)
def test_a_page_is_shown_whole(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", name]) == 0
    shown = capsys.readouterr().out
    assert f"# {page(name).title}\n\n{shown.partition(chr(10))[2].strip()}\n" == (PAGES / f"{name}.md").read_text()


def lines(name: str) -> str:
    """Lines of TOML that a page has the reader write."""
    text = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    return "\n".join(re.findall(r"^ {7}((?:\[|\w+ = ).*)$", text, re.MULTILINE))


def carried_out(commands: list[list[str]], folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder without the project's examples, as an installed package has none."""
    monkeypatch.chdir(folder)
    for command in commands:
        if "truth.toml" in command:
            (folder / "truth.toml").write_text((folder / "mytrial/vessel.toml").read_text() + lines("first-estimate"))
        assert main(command) == 0, command
        named = [folder / word for word in command if word.startswith("runs/")]
        assert all(path.exists() for path in named)


@pytest.mark.thorough
def test_what_the_tutorials_ask_before_a_plan_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    commands = [command for command in tutorial("first-plan") if command[0] not in LONG]
    assert {command[0] for command in commands} == {"new", "explain", "score", "durations"}
    carried_out(commands, tmp_path, monkeypatch)


@pytest.mark.thorough
def test_a_card_becomes_a_vessel_as_its_page_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    commands = tutorial("pilot-card")
    commands = [command for command in commands if command[0] not in LONG]
    assert [command[0] for command in commands] == ["explain", "nominal", "nominal", "indices", "new", "durations"]
    (tmp_path / "card.toml").write_text(lines("pilot-card"))
    assert len(load_card(tmp_path / "card.toml").stated) == 2
    carried_out(commands, tmp_path, monkeypatch)


@pytest.mark.thorough
def test_a_log_is_imported_and_estimated_as_the_tutorial_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "bridge.csv").symlink_to(ROOT / "scenarios/logs/bridge.csv")
    (tmp_path / "ship.toml").symlink_to(ROOT / "scenarios/vessels/logged-50m.toml")
    carried_out(tutorial("your-log"), tmp_path, monkeypatch)


@pytest.mark.parametrize("name", MANUAL)
def test_commands_need_no_files_of_the_project(name: str) -> None:
    words = [word for command in tutorial(name) for word in command]
    assert not [word for word in words if word.startswith("scenarios/")]


def test_examples_of_commands_need_no_files_of_the_project() -> None:
    named = [path for path in (ROOT / "expdesign/requests").glob("*.py") if "scenarios/" in path.read_text("utf-8")]
    assert not named


@pytest.mark.slow
@pytest.mark.parametrize("name", ["first-plan", "first-estimate"])
def test_a_tutorial_runs_from_its_first_command_to_its_last(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    carried_out(tutorial(name), tmp_path, monkeypatch)
