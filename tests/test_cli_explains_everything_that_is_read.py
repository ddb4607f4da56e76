"""`expdesign explain` has every key that is read and every name that can be chosen; --help shows what is written."""

from __future__ import annotations

import ast
import inspect
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from expdesign import cli, requests
from expdesign.cli import main
from expdesign.cli.commands import app
from expdesign.diagnosis.causes import CAUSES
from expdesign.dictionary import FAMILIES
from expdesign.durations import CRITERIA
from expdesign.errors import FileError, InputError
from expdesign.estimation.methods import METHODS
from expdesign.export.formats import FORMATS
from expdesign.indices import OUTCOMES
from expdesign.plan.values import PlanSettings
from expdesign.records import COLUMNS
from expdesign.scenario import load_scenario, load_vessel
from expdesign.scenario.tables import Table
from expdesign.vessel import STRUCTURES
from expdesign.workflows import explain
from expdesign.workflows.commands.explain import TOPICS, Explained
from scenario_files import spoil, write_scenario


def tables(base: type[Table] = Table) -> Iterator[type[Table]]:
    """Every model of a file's table in the package."""
    for model in base.__subclasses__():
        if model.__module__.startswith("expdesign."):
            yield model
        yield from tables(model)


def everything() -> list[Explained]:
    return [entry for name in TOPICS for section in explain(name).sections for entry in section.entries]


def test_every_key_that_a_model_reads_is_explained() -> None:
    explained = {(entry.name.split(".")[-1].removesuffix("[]"), entry.meaning) for entry in everything()}
    models = list(tables())
    assert {"ScenarioFile", "VesselTable", "RudderTable", "AreaTable", "DictionaryTable", "GrowTable"} <= {
        model.__name__ for model in models
    }
    for model in models:
        for name, field in model.fields().items():
            assert field.description, f"{model.__name__}.{name}"
            assert (name, field.description) in explained, f"{model.__name__}.{name}"


INTERNAL = re.compile(r"Pydantic|<[a-z]+[ .>]| at 0x|\bNone\b|\bnan\b|\binf\b|functools|lambda")
"""What only the program calls so."""


@pytest.mark.parametrize("topic", ["", *TOPICS])
def test_nothing_is_explained_in_words_of_the_program(topic: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", *([topic] if topic else [])]) == 0
    assert not INTERNAL.findall(capsys.readouterr().out)


def test_every_key_of_a_file_is_required_optional_or_has_a_default() -> None:
    for name in ("scenario", "vessel", "dictionary", "area", "loads", "mapping"):
        for section in explain(name).sections:
            assert all(entry.default for entry in section.entries)


def written_helps() -> Iterator[str]:
    """Every text that is written as help in the source of the command line and of requests, constants in parts."""
    folders = (Path(inspect.getfile(module)).parent for module in (cli, requests))
    for path in (path for folder in folders for path in folder.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.keyword) and node.arg == "help":
                parts = node.value.values if isinstance(node.value, ast.JoinedStr) else [node.value]
                yield from (part.value for part in parts if isinstance(part, ast.Constant))


def shown_help(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    """The help of a command on a wide terminal, as words with one space between."""
    assert main([*([command] if command else []), "--help"]) == 0
    return " ".join(re.sub("[│╭╮╰╯─]", " ", capsys.readouterr().out).split())


@pytest.mark.thorough
def test_help_shows_every_text_as_it_is_written(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "1000")
    names = [registered.name or "" for registered in app.registered_commands]
    shown = {name: shown_help(name, capsys) for name in ("", *names)}
    for registered in app.registered_commands:
        assert registered.callback is not None
        assert " ".join((registered.callback.__doc__ or "").split()) in shown[registered.name or ""]
    texts = {" ".join(text.split()) for text in written_helps()}
    assert sum("[" in text for text in texts) > 5
    for text in texts:
        assert any(text in page for page in shown.values()), text


def test_no_explanation_is_empty_or_ends_in_a_full_stop() -> None:
    for entry in everything():
        assert len(entry.meaning) > 2, entry.name
        assert not entry.meaning.endswith("."), entry.name


@pytest.mark.parametrize(
    ("topic", "names"),
    [
        ("families", {f"{family.name}.{setting.name}" for family in FAMILIES for setting in family.settings}),
        ("causes", {cause.name for cause in CAUSES}),
        ("methods", {method.name for method in METHODS}),
        ("criteria", {criterion.name for criterion in CRITERIA}),
        ("formats", {known.name for known in FORMATS}),
        ("outcomes", set(OUTCOMES)),
        ("structures", {term.name for terms in STRUCTURES.values() for term in terms}),
        ("data", {column.names for column in COLUMNS}),
    ],
)
def test_a_topic_has_what_can_be_chosen_and_nothing_else(topic: str, names: set[str]) -> None:
    assert {entry.name for section in explain(topic).sections for entry in section.entries} == names


def test_a_default_is_the_one_that_counts() -> None:
    for key in ("clearance_m", "confidence", "time_budget_s"):
        ((entry,),) = (section.entries for section in explain(f"plan.{key}").sections)
        assert float(entry.default) == getattr(PlanSettings(), key)


@pytest.mark.parametrize(
    ("subject", "first"),
    [
        ("design.total_s", "design.total_s"),
        ("total_s", "design.total_s"),
        ("design", "design"),
        ("actuators[2].angle_lag_s", "actuators[].angle_lag_s"),
        ("no_go.polygon", "no_go[].polygon"),
        ("zigzag", "zigzag.duration_s"),
        ("gyro_scale", "gyro_scale"),
        ("iv-wind", "iv-wind"),
        ("v_mps", "design.grow.limits.v_mps"),
    ],
)
def test_one_thing_can_be_asked_for(subject: str, first: str) -> None:
    assert explain(subject).sections[0].entries[0].name == first


def test_what_is_not_explained_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(InputError, match="did you mean 'total_s'"):
        explain("totl_s")


def test_the_command_lists_its_topics_and_gives_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert {line.split(":")[0] for line in lines if ": " in line} >= set(TOPICS)
    assert main(["explain", "area", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["sections"][0]["entries"][0]["name"] == "area"
    assert main(["explain", "nonsense"]) == 2


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [("total_s = 600", "total_s = -3", "design.total_s"), ("confidence = 0.9", "confidence = 1", "plan.confidence")],
)
def test_an_error_says_what_the_key_means_and_where_to_read_on(tmp_path: Path, old: str, new: str, key: str) -> None:
    scenario = write_scenario(tmp_path)
    spoil(scenario, old, new)
    with pytest.raises(FileError) as caught:
        load_scenario(scenario)
    ((entry,),) = (section.entries for section in explain(key).sections)
    assert entry.meaning in str(caught.value)
    assert "(see expdesign explain scenario)" in str(caught.value)


def test_an_unknown_key_names_a_topic_that_there_is(tmp_path: Path) -> None:
    write_scenario(tmp_path)
    spoil(tmp_path / "vessel.toml", "length_m = 30", "lenght_m = 30")
    with pytest.raises(FileError) as caught:
        load_vessel(tmp_path / "vessel.toml")
    (topic,) = re.findall(r"see expdesign explain ([a-z]+)", str(caught.value))
    assert topic in TOPICS
