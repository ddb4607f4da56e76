"""What every command takes and leaves behind."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

Progress = Callable[[str, float], None]
"""(what is being done, share of the command done from 0 to 1)."""


def silent(what: str, share: float) -> None:
    """Progress that nobody looks at."""


def within(progress: Progress, low: float, high: float) -> Progress:
    """Progress of a step that takes a command's share from `low` to `high`."""
    return lambda what, share: progress(what, low + (high - low) * share)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a command leaves behind.

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
