"""Results of commands, and the command line that repeats a call."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from expdesign.vessel import NOT_ACTING_BACK, Vessel

# Results of commands.


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Results of a command."""

    files: tuple[Path, ...]  # written, in the order of their contents
    summary: Mapping[str, object]  # key numbers, ready for JSON; units in the names
    tables: tuple[TextTable, ...] = ()  # the same for people where key numbers are many
    notes: tuple[str, ...] = ()  # all that the page notes and warns of, so that nobody has to open it to be warned


@dataclass(frozen=True, kw_only=True)
class TextTable:
    """A table for a terminal."""

    title: str  # what it shows
    header: tuple[str, ...]  # names of the columns
    rows: tuple[tuple[str, ...], ...]  # as many cells each


def note_on_roll(vessel: Vessel) -> dict[str, object]:
    """An entry of a summary, where the vessel file has roll that the command leaves out."""
    return {} if vessel.pendulum is None else {"note_on_roll": NOT_ACTING_BACK}


# The command line that repeats a call, for reports and files.

NOTHING: Mapping[str, object] = MappingProxyType({})


def command_text(
    command: str, words: Iterable[object], options: Mapping[str, object], *, usual: Mapping[str, object] = NOTHING
) -> str:
    """`expdesign COMMAND WORDS OPTIONS`, ready to be typed.

    Args:
        command: name of the command.
        words: its arguments.
        options: option -> value; a list gives several words, True none. What is None, False or empty is left out.
        usual: defaults by option; values that equal them are left out, too.
    """
    spelled = ["expdesign", command, *map(str, words)]
    for option, value in options.items():
        if value is None or value is False or value == () or (option in usual and value == usual[option]):
            continue
        values = value if isinstance(value, tuple) else () if value is True else (value,)
        spelled += [option, *(f"{item:g}" if isinstance(item, float) else str(item) for item in values)]
    return shlex.join(spelled)
