"""A finished command's document on stdout: for people, or as JSON."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table as Columns

if TYPE_CHECKING:
    from expdesign.export.document import Table
    from expdesign.workflows import Outcome


def as_json(command: str, outcome: Outcome) -> str:
    """One JSON object: `command`, `files` written, and the document's `summary`, `verdict`, `findings` and `notes`."""
    document = outcome.document
    content = {
        "command": command,
        "files": [str(path) for path in outcome.files],
        "summary": document.summary,
        **({} if document.mark is None else {"verdict": document.mark.text}),
        "findings": list(document.findings),
        "notes": list(document.all_notes),
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
    """Facts, tables, findings and notes of the document, then the files and the page to open."""
    from expdesign.export.document import fact_rows, listings

    document = outcome.document
    console = Console(highlight=False, markup=False, soft_wrap=True)
    if document.title:
        console.print(f"{document.kind}: {document.title}", style="bold")
    if document.mark is not None:
        console.print(document.mark.text, style="bold")
    table = Columns(show_header=False, box=None, padding=(0, 3, 0, 0))
    for row in fact_rows(document.facts):
        table.add_row(*row)
    if table.row_count:
        console.print(table)
        console.print()
    for one in document.tables:
        _print_table(console, one)
    for title, lines in listings(document):
        console.print(title, style="bold")
        console.print(*lines, sep="\n")
        console.print()
    for line in (*document.findings, *[""] * bool(document.findings)):
        console.print(line)
    if document.all_notes:
        console.print("Notes", style="bold")
        for note in document.all_notes:
            console.print(f"- {note}")
        console.print()
    for folder, names in _by_folder(outcome.files).items():
        console.print(f"Written to {folder}: {', '.join(names)}")
    for page in (path for path in outcome.files if path.suffix == ".html"):
        console.print(f"Open {page} in a browser.")


def _print_table(console: Console, table: Table) -> None:
    """Title, header and rows, each line as long as it needs to be."""
    rows = [[cell.replace("\n", ", ") for cell in row] for row in (table.header, *table.rows)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    console.print(table.title, style="bold")
    for index, row in enumerate(rows):
        line = "   ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        console.print(line, style="" if index else "underline")
    console.print()


def _by_folder(files: tuple[Path, ...]) -> dict[str, list[str]]:
    folders: dict[str, list[str]] = {}
    for path in files:
        folders.setdefault(f"{path.parent}{os.sep}", []).append(path.name)
    return folders
