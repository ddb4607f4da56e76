"""Results of commands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from expdesign.vessel import NOT_ACTING_BACK, Vessel


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
