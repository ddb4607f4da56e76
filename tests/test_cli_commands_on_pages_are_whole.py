"""A command is stated once: its workflow takes the same values; the line that repeats it is read back as they are."""

import ast
import inspect
from dataclasses import MISSING
from pathlib import Path
from typing import get_args, get_origin

import pytest
from typer.main import get_command

from expdesign import workflows
from expdesign.cli.commands import app, given
from expdesign.cli.entry import LISTS, repeat_option
from expdesign.requests import COMMANDS, Command, command_text
from expdesign.requests.options import Argument
from expdesign.workflows.commands import run
from short_examples import SCENARIOS

WITHOUT_EFFECT = {"out", "jobs", "scheduler", "no_cache"}
"""On results."""
EXAMPLES = {Path: Path("one.toml"), str: "word", int: 3, float: 1.5, bool: True}
each_command = pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)


def unusual(command: Command) -> dict[str, object]:
    """Values that differ from all defaults."""

    def value(kind: object) -> object:
        if get_origin(kind) is tuple:
            return (EXAMPLES[get_args(kind)[0]],) * 2
        return EXAMPLES[kind if isinstance(kind, type) else get_args(kind)[0]]

    return {one.name: value(one.kind) for one in command.asked}


def read_back(command: Command, words: list[str]) -> dict[str, object]:
    """What the command line makes of words."""
    for option, files in LISTS.items():
        words = repeat_option(words, option, files=files)
    with get_command(app).commands[command.name].make_context(command.name, words) as context:
        found = {name: value for name, value in context.params.items() if name not in ("quiet", "json")}
    return given({name: () if value is None else value for name, value in found.items()})


def test_every_command_is_there() -> None:
    assert len(COMMANDS) == 25
    assert {one.name for one in COMMANDS} | {"explain", "web"} == set(get_command(app).commands)


@each_command
def test_the_line_that_repeats_a_command_is_read_back_as_its_request(command: Command) -> None:
    values = unusual(command)
    _, name, *words = command_text(command.request(**values)).split()
    assert name == command.name
    assert read_back(command, words) == given(values)
    arguments = [one for one in command.asked if one.default is MISSING or isinstance(one.typed, Argument)]
    least = {one.name: values[one.name] for one in arguments}
    _, _, *words = command_text(command.request(**least)).split()
    usual = {one.name: one.default for one in command.asked if one.name not in least}
    assert read_back(command, words) == given({name: () if v is None else v for name, v in (least | usual).items()})


@each_command
def test_a_workflow_takes_what_its_command_asks_with_the_same_defaults(command: Command) -> None:
    taken = dict(inspect.signature(getattr(workflows, command.workflow)).parameters)
    assert taken.pop("progress").default is not inspect.Parameter.empty
    assert (taken.pop("tell", None) is not None) == command.tells
    stated = {one.name: one.default for one in command.asked}
    assert set(taken) == {"cache" if name == "no_cache" else name for name in stated}
    for name in stated.keys() - WITHOUT_EFFECT:
        default = inspect.Parameter.empty if stated[name] is MISSING else stated[name]
        assert taken[name].default == default or stated[name] == (), name


@each_command
def test_a_workflow_that_gives_its_command_states_all_that_results_depend_on(command: Command) -> None:
    text = inspect.getsource(inspect.getmodule(getattr(workflows, command.workflow)))
    calls = [
        node
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == f"requests.{command.request.__name__}"
    ]
    stated = {keyword.arg for call in calls for keyword in call.keywords}
    assert not calls or {one.name for one in command.asked} - WITHOUT_EFFECT <= stated


def test_a_request_reaches_its_workflow_with_all_its_values(monkeypatch) -> None:
    for command in COMMANDS:
        told: list[dict[str, object]] = []
        monkeypatch.setattr(workflows, command.workflow, lambda told=told, **values: told.append(values))
        workflows.carry_out(command.request(**unusual(command)))
        ((reached),) = told
        assert reached.pop("progress") is not None
        assert ("tell" in reached) == command.tells
        reached.pop("tell", None)
        expected = unusual(command)
        if "no_cache" in expected:
            expected["cache"] = not expected.pop("no_cache")
        assert reached == expected


def test_a_report_is_reproduced_with_the_vessel_file_that_it_was_made_with(monkeypatch, tmp_path) -> None:
    told: list[str] = []
    monkeypatch.setattr(run, "_run", lambda case, out, words, *_: told.append(words))
    scenario, vessel = SCENARIOS / "story.toml", SCENARIOS / "vessels" / "tender-20m-true.toml"
    workflows.run(scenario, tmp_path, vessel=vessel, seed=3)
    assert told == [f"expdesign run {scenario} --vessel {vessel} --seed 3"]
