"""Pieces of a file that is too long for memory, or of a stream that goes on: whole stretches of rows, as small files.

Rows that lack a number in a column that is needed are left out; the gap begins a new batch.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TextIO

import numpy as np

from expdesign.errors import FileError
from expdesign.input_files import check_ends
from expdesign.records.file import FIRST_ROW, MISSING, Inputs, Sources, choose_columns
from expdesign.signals import AUXILIARY
from expdesign.values import Array
from expdesign.vessel import column_name

STREAM = Path("-")
"""Stands for the standard input."""
CLOCKED_ROWS = 50
"""From which the time between samples is learnt."""
OPTIONAL = ("wind_u_mps", "wind_v_mps", "wind_speed_mps", "wind_angle_rad", "depth_m", "steered", "batch", *AUXILIARY)


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """Consecutive rows of a source.

    Attributes:
        path: a file that holds the header and these rows, until the next piece is asked for.
        source: where they come from.
        header: line of names.
        lines: of the rows kept.
        time_s: (k,) their times [s].
        first_row: row of the source that the piece begins in.
        left_out: rows that lack a number.
        pending: lines left over when the source ended, fewer than a stretch has.
        last: the source has ended.
    """

    path: Path
    source: Path
    header: str
    lines: tuple[str, ...]
    time_s: Array
    first_row: int
    left_out: int
    pending: tuple[str, ...]
    last: bool

    @contextmanager
    def named(self) -> Iterator[None]:
        """Errors about the small file are told as errors of the source."""
        try:
            yield
        except FileError as error:
            place = f" (rows counted in the piece from row {self.first_row} on)" if self.first_row > FIRST_ROW else ""
            raise FileError(self.source, error.key, f"{error.problem}{place}") from None


def pieces(
    source: Path,
    *,
    inputs: Sequence[str],
    stretch_s: float,
    most_rows: int,
    unread: Sequence[str] = OPTIONAL,
    before: Sequence[str] = (),
    more_follow: bool = False,
) -> Iterator[Piece]:
    """Pieces of a CSV file, or of the standard input for `STREAM`, with whole stretches but at gaps.

    Args:
        source: the file.
        inputs: signals of the vessel, e.g. ("n1", "a1").
        stretch_s: length of a stretch [s].
        most_rows: of a piece; one that is shorter than a stretch has the rows of one.
        unread: columns that rows may lack.
        before: header and `pending` lines of earlier data, which come first where the header is the same.
        more_follow: the source goes on later: rows at its end that do not fill a stretch are `pending`.

    Raises:
        FileError: unreadable, without header, or without columns that are needed.
    """
    with _opened(source) as file, TemporaryDirectory(prefix="expdesign-") as folder:
        header = file.readline()
        names = tuple(name.strip() for name in header.rstrip("\r\n").split(","))
        if not header.strip():
            raise FileError(source, "", "is empty, expected a header row and one row per sample")
        chosen, _ = choose_columns(source, names, inputs=Inputs(tuple(map(column_name, inputs)), "the vessel"))
        columns = _Columns(chosen, unread)
        left = list(before[1:]) if before and before[0] == header else []
        first = [*left, *itertools.islice(file, CLOCKED_ROWS)]
        steps = np.diff(columns.times([line for line in first if columns.complete(line)]))
        step_s = float(np.median(steps)) if len(steps) else stretch_s
        if not step_s > 0:
            raise FileError(source, chosen["time_s"].header, "does not increase, expected increasing times")
        stretch = max(1, round(stretch_s / step_s))
        lines = itertools.chain(first, iter(file.readline, ""))
        rows = stretch * max(1, most_rows // stretch)
        yield from _cut(
            lines, _Cut(source, header, columns, rows, stretch, Path(folder) / "piece.csv", more_follow), -len(left)
        )


@dataclass(frozen=True)
class _Cut:
    source: Path
    header: str
    columns: _Columns
    rows: int
    stretch: int
    path: Path
    more_follow: bool

    def piece(self, lines: list[str], first_row: int, left_out: int, *, last: bool) -> Piece:
        whole = len(lines) // self.stretch * self.stretch if self.more_follow else len(lines)
        kept = lines[:whole]
        written = self.columns.without_optional(kept) if self.columns.gaps else kept
        self.path.write_text(self.header + "".join(written), encoding="utf-8", errors="surrogateescape")
        self.columns.gaps = False
        return Piece(
            path=self.path, source=self.source, header=self.header, lines=tuple(kept), time_s=self.columns.times(kept),
            first_row=first_row, left_out=left_out, pending=tuple(lines[whole:]), last=last,
        )  # fmt: skip


def _cut(source: Iterator[str], how: _Cut, offset: int) -> Iterator[Piece]:
    """Pieces of lines, the first of which is row `FIRST_ROW` + offset."""
    lines: list[str] = []
    first = row = FIRST_ROW + offset
    left_out = 0
    for line in source:
        row += 1
        if line.strip() and how.columns.complete(line):
            lines.append(line if line.endswith("\n") else f"{line}\n")
        elif line.strip():
            left_out += 1
        if len(lines) == how.rows:
            yield how.piece(lines, max(first, FIRST_ROW), left_out, last=False)
            first, lines, left_out = row, [], 0
    yield how.piece(lines, max(first, FIRST_ROW), left_out, last=True)


class _Columns:
    """Places of the columns that are needed, and of those that may be missing."""

    def __init__(self, chosen: Sources, unread: Sequence[str]) -> None:
        self.needed = [source.column for name, source in chosen.items() if name not in unread]
        self.optional = {source.column for name, source in chosen.items() if name in unread}
        self.clock = chosen["time_s"]
        self.gaps = False

    def complete(self, line: str) -> bool:
        """Whether a row has something in every needed column; whether it is a number is for the reader to say."""
        bare = line.rstrip("\r\n")
        if ",," not in bare and not bare.endswith(",") and not bare.startswith(",") and "n" not in bare.lower():
            return True
        cells = bare.split(",")
        if any(place < len(cells) and cells[place].strip().lower() in MISSING for place in self.needed):
            return False
        self.gaps = True
        return True

    def without_optional(self, lines: Sequence[str]) -> list[str]:
        """The rows without columns that some of them lack."""
        table = [line.rstrip("\r\n").split(",") for line in lines]
        for place in self.optional:
            if any(place < len(cells) and cells[place].strip().lower() in MISSING for cells in table):
                for cells in table:
                    cells[place : place + 1] = [""] * (place < len(cells))
        return [",".join(cells) + "\n" for cells in table]

    def times(self, lines: Sequence[str]) -> Array:
        """(k,) [s]; nan where a cell is no number, of which the reader complains."""
        return self.clock.factor * np.array([_number(line, self.clock.column) for line in lines])


def _number(line: str, column: int) -> float:
    try:
        return float(line.split(",", column + 1)[column])
    except (ValueError, IndexError):
        return math.nan


@contextmanager
def _opened(source: Path) -> Iterator[TextIO]:
    if source == STREAM:
        yield sys.stdin
        return
    check_ends(source, "a CSV file, or - for the standard input")
    try:
        file = source.open(encoding="utf-8-sig", errors="surrogateescape")
    except OSError as error:
        raise FileError(source, "", f"cannot be read: {error.strerror or error}") from None
    with file:
        yield file
