"""The command that a page gives to reproduce it has every option that results depend on."""

import inspect

import pytest
from typer.main import get_command

from expdesign import workflows
from expdesign.cli.app import WORKFLOWS
from expdesign.cli.commands import app
from expdesign.workflows.commands import run
from short_examples import SCENARIOS

WITHOUT_EFFECT = {"--out", "--quiet", "--json", "--jobs", "--scheduler", "--no-cache", "--help"}
"""On results."""
COMMANDS = get_command(app).commands


@pytest.mark.parametrize("name", [name for name in COMMANDS if name in WORKFLOWS])
def test_a_workflow_that_gives_its_command_names_all_options(name: str) -> None:
    text = inspect.getsource(inspect.getmodule(getattr(workflows, WORKFLOWS[name][0])))
    options = {option for given in COMMANDS[name].params for option in given.opts if option.startswith("--")}
    if "command_text(" in text:
        assert {option for option in options - WITHOUT_EFFECT if f'"{option}"' not in text} == set()


def test_a_report_is_reproduced_with_the_vessel_file_that_it_was_made_with(monkeypatch, tmp_path) -> None:
    told: list[str] = []
    monkeypatch.setattr(run, "_run", lambda case, out, words, *_: told.append(words))
    scenario, vessel = SCENARIOS / "story.toml", SCENARIOS / "vessels" / "tender-20m-true.toml"
    workflows.run(scenario, tmp_path, vessel=vessel, seed=3)
    assert told == [f"expdesign run {scenario} --vessel {vessel} --seed 3"]
