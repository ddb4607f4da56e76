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
    """Results of a command.

    Attributes:
        files: written, in the order of their contents.
        summary: key numbers, ready for JSON; units in the names.
        tables: the same for people where key numbers are many.
        notes: all that the page notes and warns of, so that nobody has to open it to be warned.
    """

    files: tuple[Path, ...]
    summary: Mapping[str, object]
    tables: tuple[TextTable, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class TextTable:
    """A table for a terminal.

    Attributes:
        title: what it shows.
        header: names of the columns.
        rows: as many cells each.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


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
