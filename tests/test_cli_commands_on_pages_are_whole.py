"""A command is stated once: its workflow takes the same values; the line that repeats it is read back as they are."""

import re
from dataclasses import MISSING, fields
from pathlib import Path
from typing import get_args, get_origin

import pytest
from typer.main import get_command

from expdesign import workflows
from expdesign.assessment import EstimateOptions
from expdesign.assessment.values import AUTO, MOTIONS, PRIORS
from expdesign.cli.commands import app
from expdesign.cli.entry import LISTS, repeat_option
from expdesign.errors import InputError
from expdesign.estimation.excitation import SAMPLES
from expdesign.estimation.instrumental import STARTS
from expdesign.estimation.regression import MEANS, UNKNOWN
from expdesign.estimation.replay import STEERED
from expdesign.estimation.replay.replay import INTEGRATORS
from expdesign.estimation.solve import BLOCKS
from expdesign.information import MEAN_SUBTRACTIONS
from expdesign.monitoring.changes import RELATIVE_SIZE
from expdesign.records import VELOCITY_METHODS
from expdesign.records.load import LABEL_SOURCES
from expdesign.requests import (
    COMMANDS,
    WITHOUT_EFFECT,
    Command,
    Diagnose,
    Estimate,
    IdentifySteps,
    Mine,
    Monitor,
    New,
    Request,
    Roll,
    Validate,
    command_text,
    repeating,
)
from expdesign.requests.options import Argument, Asked
from expdesign.roll.estimate import METHODS as ROLL_METHODS
from expdesign.workflows.commands import run
from expdesign.workflows.commands.new import KINDS
from expdesign.workflows.outcome import workflow
from expdesign.workflows.steps.watched_ship import VESSEL, YAW
from short_examples import SCENARIOS

EXAMPLES = {Path: Path("one.toml"), str: "word", int: 3, float: 1.5, bool: True}
each_command = pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)


def unusual(command: Command) -> dict[str, object]:
    """Values that differ from all defaults."""

    def value(kind: object) -> object:
        if get_origin(kind) is tuple:
            return (EXAMPLES[get_args(kind)[0]],) * 2
        return EXAMPLES[kind if isinstance(kind, type) else get_args(kind)[0]]

    return {one.name: _other(one) or value(one.kind) for one in command.request.asked()}


def _other(one: Asked) -> str:
    """A choice that is not the usual one; "" where there are none."""
    return next((word for word in one.choices if word != one.default), "")


def read_back(command: Command, words: list[str]) -> dict[str, object]:
    """What the command line makes of words."""
    for option, files in LISTS.items():
        words = repeat_option(words, option, files=files)
    with get_command(app).commands[command.name].make_context(command.name, words) as context:
        found = {name: value for name, value in context.params.items() if name not in ("quiet", "json")}
    asked = command.request(**found)
    return {one.name: getattr(asked, one.name) for one in command.request.asked()}


def test_usual_values_are_those_of_what_a_command_calls() -> None:
    """Requests are below the rooms that work on them, and state their usual values once more."""
    asked = {one.name: one.default for one in Estimate.asked()}
    both = {item.name: item.default for item in fields(EstimateOptions) if item.name in asked}
    assert len(both) == 12
    assert both == {name: asked[name] for name in both}
    assert Monitor.size == RELATIVE_SIZE


def test_choices_are_those_of_what_a_command_calls_and_their_help_names_each() -> None:
    called = {
        (New, "kind"): KINDS,
        (Estimate, "mean"): MEANS,
        (Estimate, "blocks"): BLOCKS,
        (Estimate, "start"): (AUTO, *STARTS),
        (Estimate, "motion"): MOTIONS,
        (Estimate, "steered"): STEERED,
        (Estimate, "samples"): SAMPLES,
        (Estimate, "prior"): PRIORS,
        (Estimate, "unknown"): UNKNOWN,
        (Estimate, "velocity"): VELOCITY_METHODS,
        (Mine, "mean"): MEAN_SUBTRACTIONS,
        (Mine, "labels"): LABEL_SOURCES,
        (Mine, "velocity"): VELOCITY_METHODS,
        (Diagnose, "velocity"): VELOCITY_METHODS,
        (IdentifySteps, "velocity"): VELOCITY_METHODS,
        (Monitor, "velocity"): VELOCITY_METHODS,
        (Monitor, "model"): (VESSEL, *YAW),
        (Roll, "method"): ROLL_METHODS,
        (Validate, "integrator"): INTEGRATORS,
    }
    stated = {(one.request, asked.name): asked for one in COMMANDS for asked in one.request.asked() if asked.choices}
    assert {*stated} == {*called}
    for key, asked in stated.items():
        assert {*asked.choices} == {*called[key]}, key
        assert {*asked.choices} <= {*re.findall(r"[a-z0-9_-]+", asked.typed.help)}, key
        with pytest.raises(InputError, match=f"^{asked.flag} is odd, expected one of {', '.join(asked.choices)}$"):
            asked.check("odd")


def test_every_command_is_there() -> None:
    assert len(COMMANDS) == 25
    assert {one.name for one in COMMANDS} | {"explain", "web"} == set(get_command(app).commands)


@each_command
def test_the_line_that_repeats_a_command_is_read_back_as_its_request(command: Command) -> None:
    values = unusual(command)
    _, name, *words = command_text(command.request(**values)).split()
    assert name == command.name
    assert read_back(command, words) == values
    arguments = [one for one in command.request.asked() if one.default is MISSING or isinstance(one.typed, Argument)]
    least = {one.name: values[one.name] for one in arguments}
    _, _, *words = command_text(command.request(**least)).split()
    usual = {one.name: one.default for one in command.request.asked() if one.name not in least}
    assert read_back(command, words) == vars(command.request(**least)) | usual


@each_command
def test_a_request_and_its_values_reach_the_same_work(command: Command, monkeypatch) -> None:
    told: list[Request] = []

    def work(request: Request, *, progress: object) -> None:
        told.append(request)

    work.__name__ = command.workflow
    called, values = workflow(work), unusual(command)
    assert all(name in (called.__doc__ or "") for name in values)
    asked = command.request(**values)
    by_name = dict(values)
    first = [by_name.pop(one.name) for one in command.request.asked() if isinstance(one.typed, Argument)]
    if "no_cache" in by_name:
        by_name["cache"] = not by_name.pop("no_cache")
    called(asked)
    called(*first, **by_name)
    called(*[list(value) if isinstance(value, tuple) else value for value in first], **by_name)
    assert [vars(one) for one in told] == [vars(asked)] * 3
    if "jobs" in values:
        called(*first, **{name: value for name, value in by_name.items() if name != "jobs"})
        assert told[-1].jobs == 1
    with pytest.raises(TypeError, match="unknown_option"):
        called(*first, **by_name, unknown_option=1)


@each_command
def test_a_page_repeats_all_that_results_depend_on(command: Command) -> None:
    asked = command.request(**unusual(command))
    words = read_back(command, repeating(asked).split()[2:])
    assert {name for name, value in words.items() if value != getattr(asked, name)} == {*words} & {*WITHOUT_EFFECT}
    assert "--out" in repeating(asked, keep={"out"}) or "out" not in words


def test_values_out_of_range_are_refused_in_python_too() -> None:
    for command in COMMANDS:
        for one in command.request.asked():
            over, least = getattr(one.typed, "over", None), getattr(one.typed, "min", None)
            if (wrong := over if over is not None else least - 1 if least is not None else None) is not None:
                with pytest.raises(InputError, match=f"{one.flag} is {wrong:g}, expected "):
                    command.request(**{**unusual(command), one.name: wrong})
    with pytest.raises(InputError, match="DATA"):
        workflows.estimate([], None, vessel=Path("ship.toml"))


def test_one_value_where_several_may_be_given_is_one_of_them() -> None:
    asked = Estimate(data=Path("run.csv"), vessel=Path("ship.toml"), methods="ls", tests=None)
    assert (asked.data, asked.methods, asked.tests) == ((Path("run.csv"),), ("ls",), ())


def test_a_report_is_reproduced_with_the_vessel_file_that_it_was_made_with(monkeypatch, tmp_path) -> None:
    told: list[str] = []
    monkeypatch.setattr(run, "_run", lambda request, *_: told.append(repeating(request)))
    scenario, vessel = SCENARIOS / "story.toml", SCENARIOS / "vessels" / "tender-20m-true.toml"
    workflows.run(scenario, tmp_path, vessel=vessel, seed=3)
    assert told == [f"expdesign run {scenario} --vessel {vessel} --seed 3"]


def test_a_request_says_which_values_it_does_not_know_and_which_it_needs() -> None:
    with pytest.raises(TypeError, match=r"^Estimate knows no colour and needs data, vessel$"):
        Estimate(colour="red")
