"""From arguments to an exit status: every error becomes one line on stderr."""

from __future__ import annotations

import os
import re
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from inspect import cleandoc
from itertools import takewhile
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar, get_args, get_origin

import typer
from rich.markup import escape
from typer.main import get_command

from expdesign.cli.app import BUG, NO_ANSWER
from expdesign.cli.commands import app
from expdesign.errors import InputError, NoAnswer
from expdesign.interruptions import interruptions_wait
from expdesign.requests import COMMANDS

LISTS = {
    one.flag: get_args(one.kind)[0] is Path
    for command in COMMANDS
    for one in command.request.asked()
    if one.flag and get_origin(one.kind) is tuple
}
"""Options that take several values, and whether these are files."""
LINE_END = re.compile(r"(?<!\n)\n(?!\n|Example:)")  # within a paragraph
ESCAPED = escape("[a]").removesuffix("a]")
Program = TypeVar("Program")
DONE, WRONG_INPUT, INTERRUPTED = 0, 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: arguments without the program's name; those of the process when None.

    Returns:
        Exit status: 0 done, 2 the input is wrong, 3 the input is fine but has no answer, 130 interrupted (Ctrl-C or
        a termination signal), 1 a defect of this program or a reader of the output that went away.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    for option, files in LISTS.items():
        arguments = repeat_option(arguments, option, files=files)
    try:
        with _termination_interrupts():
            return _invoke(arguments)
    except (InputError, NoAnswer) as error:
        for note in getattr(error, "__notes__", ()):
            typer.echo(f"expdesign: note: {note}", err=True)
        return _fail(str(error), WRONG_INPUT if isinstance(error, InputError) else NO_ANSWER)
    except typer.TyperException as error:
        return _fail(_usage(error), WRONG_INPUT)
    except KeyboardInterrupt as error:
        if argv is None:  # the process ends: pressed once more, Ctrl-C must not end in a traceback
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        said = f"{error}"  # what is written, where results are while their page is not
        return _fail(f"interrupted; {said}" if said else "interrupted, nothing half-written", INTERRUPTED)
    except BrokenPipeError:
        return _reader_left()
    except OSError as error:
        return _fail(f"{error.filename}: {error.strerror}" if error.filename else str(error), WRONG_INPUT)
    except Exception as error:
        return _defect(error)


def repeat_option(arguments: Sequence[str], option: str, *, files: bool = False) -> list[str]:
    """Spell out a list of values: `--format rtz gpx` becomes `--format rtz --format gpx`.

    A list ends at the next option and, unless it lists files, at anything that looks like a file, i.e. has a slash or
    an ending that is no number: rtz-1.0 is a value.
    """
    spelled, rest = [], list(arguments)
    while rest:
        spelled.append(rest.pop(0))
        if spelled[-1] == option and rest:
            first, *more = rest
            values = [first, *takewhile(_looks_like_file_or_value if files else _looks_like_value, more)]
            spelled += [values[0], *(part for value in values[1:] for part in (option, value))]
            rest = rest[len(values) :]
    return spelled


def _looks_like_value(text: str) -> bool:
    _, dot, ending = text.rpartition(".")
    return not text.startswith("-") and "/" not in text and (not dot or ending.isdecimal())


def _looks_like_file_or_value(text: str) -> bool:
    return not text.startswith("-")


def _invoke(arguments: list[str]) -> int:
    command = _program()
    try:
        with command.make_context("expdesign", arguments) as context:
            command.invoke(context)
        sys.stdout.flush()
    except typer.Exit as exit_request:
        return exit_request.exit_code
    return DONE


@cache
def _program() -> Any:
    """The commands as they are parsed, made once: that takes as long as many a command."""
    with interruptions_wait():  # annotations are evaluated: Python ends by the signal itself when that is broken off
        return with_plain_help(get_command(app))


def with_plain_help(program: Program) -> Program:
    """The program with help texts that are shown as they are written: what stands in brackets is a unit or a table.

    Lines of a paragraph are joined, but for examples, as the terminal wraps them.
    """
    commands: tuple[Any, ...] = (program, *getattr(program, "commands", {}).values())
    for part in (part for command in commands for part in (command, *command.params)):
        if text := getattr(part, "help", None):
            part.help = escape(LINE_END.sub(" ", cleandoc(text)))
    return program


@contextmanager
def _termination_interrupts() -> Iterator[None]:
    """Let a termination signal act like Ctrl-C, so that the same cleaning up runs."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGTERM, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _usage(error: typer.TyperException) -> str:
    context, message = getattr(error, "ctx", None), error.format_message().rstrip(".")
    help_text = getattr(getattr(error, "param", None), "help", None) if message.startswith("Missing") else None
    what = f": {help_text[0].lower()}{help_text[1:].rstrip('.')}" if help_text else ""
    return f"{message}{what.replace(ESCAPED, '[')} (see {context.command_path if context else 'expdesign'} --help)"


def _defect(error: Exception) -> int:
    if os.environ.get("EXPDESIGN_DEBUG"):
        traceback.print_exception(error)
    what = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return _fail(f"this is a defect in expdesign, {what} (EXPDESIGN_DEBUG=1 shows where)", BUG)


def _reader_left() -> int:
    """Nobody reads stdout any more, as after `| head`: say nothing, not even when the interpreter flushes it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return BUG


def _fail(message: str, status: int) -> int:
    line = " ".join(part.strip() for part in message.splitlines() if part.strip())
    typer.echo(f"expdesign: error: {line}", err=True)
    return status
