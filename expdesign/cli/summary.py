"""Output of a finished command on stdout: key numbers and the place of the results, or the same as JSON."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from expdesign.workflows import Outcome, TextTable

UNITS = {
    "s": "s",
    "m": "m",
    "mps": "m/s",
    "radps": "rad/s",
    "rad": "rad",
    "deg": "°",
    "kn": "kn",
    "rps": "1/s",
    "kg": "kg",
    "h": "h",
}
"""Last part of a name -> printed unit."""
SENTENCES = ("remarks", "judgements", "notes")
"""Entries of a summary with sentences, one line each, that need no words before them; others end so or are notes."""
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
    return json.dumps(_known(content), indent=2, ensure_ascii=False, allow_nan=False)


def _known(value: object) -> object:
    """A value with null for numbers that are not finite, as in files of results."""
    if isinstance(value, Mapping):
        return {key: _known(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_known(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def unverified(summary: Mapping[str, object]) -> str:
    """Why a plan that was asked for whole is written but not verified; "" for all other results."""
    whole = summary.get("verified") is False and not summary.get("draft")
    return f"the plan is written but not verified: {summary.get('verdict')}" if whole else ""


def print_summary(outcome: Outcome) -> None:
    """Key numbers and tables, what the page finds and warns of beside them, then the files and the page to open."""
    console = Console(highlight=False, markup=False, soft_wrap=True)
    table = Table(show_header=False, box=None, padding=(0, 3, 0, 0))
    shown = {
        key: value
        for key, value in outcome.summary.items()
        if not _is_told(key) and not _among_notes(value, outcome) and (not outcome.tables or _brief(value))
    }
    for row in _rows(shown):
        table.add_row(*row)
    if table.row_count:
        console.print(table)
        console.print()
    for text in outcome.tables:
        _print_table(console, text)
    lines = list(_unsaid(outcome))
    for line in (*lines, *[""] * bool(lines)):
        console.print(line)
    if outcome.notes:
        console.print("Notes", style="bold")
        for note in outcome.notes:
            console.print(f"- {note}")
        console.print()
    for folder, names in _by_folder(outcome.files).items():
        console.print(f"Written to {folder}: {', '.join(names)}")
    for page in (path for path in outcome.files if path.suffix == ".html"):
        console.print(f"Open {page} in a browser.")


def _unsaid(outcome: Outcome) -> Iterator[str]:
    """Notes and remarks of the summary that no table has, after what they are on."""
    said = {cell for text in outcome.tables for row in text.rows for cell in row}
    for key, value in outcome.summary.items():
        if _is_told(key):
            lines = (value,) if isinstance(value, str) else value
            start = "" if key in SENTENCES else f"{key.replace('_', ' ')}: "
            yield from (f"{start}{line}" for line in lines if line not in said and line not in outcome.notes)  # type: ignore[attr-defined]


def _is_told(key: str) -> bool:
    """Whether an entry has sentences, one line each."""
    return key.startswith("note") or key.endswith(SENTENCES)


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
        else:
            text = _text(value)
            yield label, text if text == "-" else f"{text} {unit}".rstrip()


def _text(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) and not math.isfinite(value):
        return "-"
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
