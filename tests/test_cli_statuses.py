"""Every way a command can end has its exit status and its one line on stderr."""

import os
import re
import signal
import subprocess
import sys
from dataclasses import MISSING
from pathlib import Path
from types import SimpleNamespace

import pytest

import expdesign.workflows
from expdesign.cli import main
from expdesign.errors import FileError, InputError, NoAnswer, NoPlan
from expdesign.requests import COMMANDS, Command

SCENARIOS = Path(expdesign.__file__).parents[1] / "scenarios"
ASLEEP = """
import sys
import time
import types
import expdesign.workflows
from expdesign.cli import main
def run(request, *, progress):
    progress("asleep", 0.5)
    time.sleep(600)
expdesign.workflows = types.SimpleNamespace(run=run)
sys.exit(main(["run", "any.toml"]))
"""


def ends_with(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    """Let the `run` workflow raise."""

    def run(*arguments: object, **options: object) -> None:
        raise error

    monkeypatch.setattr(expdesign, "workflows", SimpleNamespace(run=run), raising=False)


def only_line(capsys: pytest.CaptureFixture[str]) -> str:
    """The one line on stderr; nothing may be on stdout."""
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert line.startswith("expdesign: error: ")
    return line.removeprefix("expdesign: error: ")


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (InputError("vessel.length_m is -30, expected more than 0"), 2, "vessel.length_m is -30, expected more than 0"),
        (FileError("a.toml", "design.total", "unknown key"), 2, "a.toml: design.total: unknown key"),
        (NoPlan("the goal is on another lake"), 3, "the goal is on another lake"),
        (NoAnswer("two\n  lines"), 3, "two lines"),
        (PermissionError(13, "Permission denied", "runs/a/plan.json"), 2, "runs/a/plan.json: Permission denied"),
        (OSError("no space"), 2, "no space"),
        (KeyboardInterrupt(), 130, "interrupted, nothing half-written"),
    ],
)
def test_what_a_workflow_raises_decides_the_status(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: BaseException,
    status: int,
    line: str,
) -> None:
    ends_with(monkeypatch, error)
    assert main(["run", "any.toml"]) == status
    assert only_line(capsys) == line


@pytest.mark.parametrize("error", [ZeroDivisionError("division by zero"), KeyError("mass"), AssertionError()])
def test_a_defect_is_one_line_that_says_how_to_see_more(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: Exception
) -> None:
    ends_with(monkeypatch, error)
    monkeypatch.delenv("EXPDESIGN_DEBUG", raising=False)
    assert main(["run", "any.toml"]) == 1
    line = only_line(capsys)
    assert type(error).__name__ in line
    assert "EXPDESIGN_DEBUG=1" in line


def test_debugging_shows_where_a_defect_is(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    ends_with(monkeypatch, ZeroDivisionError("division by zero"))
    monkeypatch.setenv("EXPDESIGN_DEBUG", "1")
    assert main(["run", "any.toml"]) == 1
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ([], "Missing command"),
        (["rum"], "'run'"),
        (["run"], "SCENARIO.toml"),
        (["run", "a.toml", "b.toml"], "b.toml"),
        (["run", "a.toml", "--sed", "1"], "--seed"),
        (["run", "a.toml", "--seed", "-1"], "--seed is -1, expected a whole number of 0 or more"),
        (["run", "a.toml", "--seed", "1.5"], "--seed is 1.5, expected a whole number of 0 or more"),
        (["run", "a.toml", "--seed"], "--seed"),
        (["export", "plan.json"], "--format"),
        (["simulate", "plan.json"], "--truth"),
    ],
)
def test_a_typing_mistake_is_wrong_input(capsys: pytest.CaptureFixture[str], arguments: list[str], named: str) -> None:
    assert main(arguments) == 2
    assert named in only_line(capsys)


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_what_is_missing_is_named_with_its_meaning(command: Command, capsys: pytest.CaptureFixture[str]) -> None:
    needed = [one for one in command.request.asked() if one.default is MISSING]
    given: list[str] = []
    for one in needed:
        assert main([command.name, *given]) == 2
        line = only_line(capsys)
        assert line.startswith("Missing "), line
        meaning = one.typed.help.split(".")[0]
        assert meaning[1:30] in line.replace("\\", ""), line
        given += [*([one.flag] if one.flag else []), "1"]


GIVEN = {
    "SCENARIO.toml": "mytrial/scenario.toml",
    "VESSEL.toml": "rolls.toml",
    "PLAN.json": "runs/plan.json",
    "F ...": "gpx",
    "K": "1",
    "M ...": "1",
    "Y ...": "1",
}
"""Values by what they are called in the help; of the others, a file without a single row."""


@pytest.mark.parametrize("out", [(), ("--out", "runs/deeper/still")], ids=["usual", "asked for"])
@pytest.mark.parametrize(
    "command", [one for one in COMMANDS if hasattr(one.request, "out")], ids=lambda command: command.name
)
def test_every_command_tries_its_folder_before_it_works(
    command: Command,
    out: tuple[str, ...],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "mytrial", "-q"]) == 0
    (tmp_path / "rolls.toml").write_text((SCENARIOS / "vessels" / "roll-model.toml").read_text("utf-8"), "utf-8")
    (tmp_path / "empty").write_text("")
    (tmp_path / "runs").write_text("mine")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    needed = [one for one in command.request.asked() if one.default is MISSING]
    given = [part for one in needed for part in (one.flag, GIVEN.get(one.typed.metavar, "empty")) if part]
    assert main([command.name, *given, *out]) == 2
    *progress, line = capsys.readouterr().err.splitlines()
    assert "runs is a file, expected a folder; --out names the folder of results" in line
    assert all(re.match(r"\[ +[0-2]%\] reading ", told) for told in progress)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_new_makes_no_folder_below_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "taken").write_text("mine")
    assert main(["new", str(tmp_path / "taken" / "mytrial"), "--card", "nowhere.toml"]) == 2
    assert "taken is a file, expected a folder" in only_line(capsys)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_interrupts_the_work(number: signal.Signals) -> None:
    with subprocess.Popen([sys.executable, "-c", ASLEEP], stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert "asleep" in process.stderr.readline()
        process.send_signal(number)
        assert process.stderr.read() == "expdesign: error: interrupted, nothing half-written\n"
    assert process.returncode == 130


@pytest.mark.parametrize("module", ["typer", "casadi"])
def test_ctrl_c_while_the_program_loads_is_one_line(module: str) -> None:
    """Solvers are not broken off while they load: some take that badly."""
    early = f"""
import builtins
import signal
import sys
from expdesign.cli import main
real = builtins.__import__
def pressed(name, *rest, **named):
    if name == {module!r}:
        signal.raise_signal(signal.SIGINT)
        real(name, *rest, **named)
        builtins.__import__ = real
    return real(name, *rest, **named)
builtins.__import__ = pressed
status = main(["plan", "none.toml"])
assert builtins.__import__ is real
sys.exit(status)
"""
    done = subprocess.run([sys.executable, "-c", early], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "expdesign: error: interrupted, nothing half-written\n")


def test_ctrl_c_pressed_twice_is_one_line() -> None:
    impatient = ASLEEP.replace(
        "sys.exit(main(", "import atexit, signal\natexit.register(signal.raise_signal, signal.SIGINT)\nsys.exit(main("
    ).replace('main(["run", "any.toml"])', "main()")
    with subprocess.Popen(
        [sys.executable, "-c", impatient, "run", "any.toml"], stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        assert "asleep" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        assert process.stderr.read() == "expdesign: error: interrupted, nothing half-written\n"
    assert process.returncode == 130


def test_the_termination_handler_is_given_back(capsys: pytest.CaptureFixture[str]) -> None:
    before = signal.getsignal(signal.SIGTERM)
    main(["--version"])
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_closed_output_ends_the_program_silently() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "expdesign", "--help"], stdout=writing, stderr=subprocess.PIPE, check=False
        )
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (1, b"")
