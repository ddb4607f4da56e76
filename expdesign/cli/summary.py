"""Output of a finished command on stdout: key numbers and the place of the results, or the same as JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from expdesign.workflows import Outcome, TextTable

UNITS = {"s": "s", "m": "m", "mps": "m/s", "radps": "rad/s", "rad": "rad", "deg": "°", "kn": "kn", "rps": "1/s"}
"""Last part of a name -> printed unit."""
LONGEST = 200
"""Characters of a list beside its name; longer ones are left to the tables."""


def as_json(command: str, outcome: Outcome) -> str:
    """One JSON object: `command`, `files` written, the workflow's `summary`, and the `notes` of its page."""
    content = {
        "command": command,
        "files": [str(path) for path in outcome.files],
        "summary": outcome.summary,
        "notes": list(outcome.notes),
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)


def print_summary(outcome: Outcome) -> None:
    """Key numbers as a table, then tables, the notes, the files and the page to open."""
    console = Console(highlight=False, markup=False, soft_wrap=True)
    table = Table(show_header=False, box=None, padding=(0, 3, 0, 0))
    shown = {
        key: value
        for key, value in outcome.summary.items()
        if not _among_notes(value, outcome) and (not outcome.tables or _brief(value))
    }
    for row in _rows(shown):
        table.add_row(*row)
    if table.row_count:
        console.print(table)
        console.print()
    for text in outcome.tables:
        _print_table(console, text)
    if outcome.notes:
        console.print("Notes", style="bold")
        for note in outcome.notes:
            console.print(f"- {note}")
        console.print()
    for folder, names in _by_folder(outcome.files).items():
        console.print(f"Written to {folder}: {', '.join(names)}")
    for page in (path for path in outcome.files if path.suffix == ".html"):
        console.print(f"Open {page} in a browser.")


def _brief(value: object) -> bool:
    """Whether a value gets a line beside tables: no table of its own, and no long list."""
    if isinstance(value, (list, tuple)):
        return bool(value) and len(_text(value)) < LONGEST
    return not isinstance(value, Mapping)


def _among_notes(value: object, outcome: Outcome) -> bool:
    """Whether an entry is a list of what the notes say anyway."""
    return isinstance(value, (list, tuple)) and bool(value) and set(map(str, value)) <= set(outcome.notes)


def _print_table(console: Console, text: TextTable) -> None:
    """Title, header and rows, each line as long as it needs to be."""
    widths = [max(map(len, column)) for column in zip(text.header, *text.rows, strict=True)]
    console.print(text.title, style="bold")
    for index, row in enumerate((text.header, *text.rows)):
        line = "   ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        console.print(line, style="" if index else "underline")
    console.print()


def _rows(summary: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, str]]:
    """(label, value with unit) of every entry, nested ones after the name of their parent."""
    for key, value in summary.items():
        stem, _, suffix = key.rpartition("_")
        unit = UNITS.get(suffix, "") if stem else ""
        label = f"{prefix}{(stem if unit else key).replace('_', ' ')}"
        if isinstance(value, Mapping):
            yield from _rows(value, f"{label}, ")
        elif key.endswith("remarks") and isinstance(value, (list, tuple)):
            yield from ((label if number == 0 else "", str(line)) for number, line in enumerate(value))
        else:
            yield label, _text(value) if value is None else f"{_text(value)} {unit}".rstrip()


def _text(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.0f}" if 1e4 <= abs(value) < 1e9 else f"{value:.5g}"
    if isinstance(value, Mapping):
        return " ".join(_text(part) for part in value.values())
    if isinstance(value, (list, tuple)):
        return ", ".join(_text(part) for part in value)
    return str(value)


def _by_folder(files: tuple[Path, ...]) -> dict[str, list[str]]:
    folders: dict[str, list[str]] = {}
    for path in files:
        folders.setdefault(f"{path.parent}{os.sep}", []).append(path.name)
    return folders
