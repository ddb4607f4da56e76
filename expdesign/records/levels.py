"""Commands to go through, one row after the other: a list of levels, or a plan's commands at every sample."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from expdesign.errors import FileError
from expdesign.records.file import FIRST_ROW, Source, meaning, mistyped, read_cells
from expdesign.values import Array
from expdesign.vessel import column_name

NUMBER = "step"


Levels = tuple[Array, Array | None, tuple[int | None, ...] | None]


def read_levels(path: Path, *, inputs: Sequence[str]) -> Levels:
    """Read commands from a CSV file with a column for every input, and `time_s` or `step` where there is one.

    Returns:
        Commands (k, m) in the order of the inputs, in SI units; times (k,) of the rows [s], None for a list without;
        and the step that each row is, None where its cell is empty, or None for a list without such a column.

    Raises:
        FileError: unreadable, without a column for every input, or with cells that are no numbers.
    """
    cells = read_cells(path)
    rows = [row for _, columns in cells.blocks() for row in zip(*columns, strict=True)]
    known = [meaning(name, column) for column, name in enumerate(cells.header)]
    sources = {one.name: one for one in known if isinstance(one, Source)}
    wanted = [column_name(name) for name in inputs]
    if missing := [name for name in wanted if name not in sources]:
        problem = f"names no {' '.join(missing)}, expected a column for every input of the vessel, with its unit"
        raise FileError(path, "row 1", problem + mistyped(missing[0], cells.header))
    values = np.stack([_numbers(path, rows, sources[name]) for name in wanted], axis=1)
    time_s = _numbers(path, rows, sources["time_s"]) if "time_s" in sources else None
    if time_s is not None and np.any(np.diff(time_s) <= 0):
        raise FileError(path, sources["time_s"].header, "does not increase, expected increasing times")
    steps = next((place for place, name in enumerate(cells.header) if name == NUMBER), None)
    numbers = (
        None
        if steps is None or time_s is not None
        else tuple(_count(path, row[steps], k) for k, row in enumerate(rows))
    )
    return values, time_s, numbers


def _numbers(path: Path, rows: Sequence[Sequence[str]], source: Source) -> Array:
    found = [_number(row[source.column]) for row in rows]
    wrong = next((k for k, value in enumerate(found) if not math.isfinite(value)), None)
    if wrong is not None:
        raise FileError(
            path, source.header, f"is {rows[wrong][source.column]!r} in row {wrong + FIRST_ROW}, expected a number"
        )
    return source.factor * np.array(found)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _count(path: Path, text: str, row: int) -> int | None:
    if not text.strip():
        return None
    if not text.strip().isdecimal():
        raise FileError(path, NUMBER, f"is {text!r} in row {row + FIRST_ROW}, expected a whole number, or nothing")
    return int(text)
