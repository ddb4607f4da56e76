"""Results of commands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Results of a command.

    Attributes:
        files: written, in the order of their contents.
        summary: key numbers, ready for JSON; units in the names.
        tables: the same for people where key numbers are many.
    """

    files: tuple[Path, ...]
    summary: Mapping[str, object]
    tables: tuple[TextTable, ...] = ()


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
