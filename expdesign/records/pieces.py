"""Pieces of a file that is too long for memory, or of a stream that goes on: whole stretches of rows.

Rows that lack a number in a column that is needed are left out; the gap begins a new batch. Stretches are counted from
the beginning of a batch, and a piece ends where one does, so that stretches are the same wherever data are cut.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TextIO

import numpy as np

from expdesign.errors import FileError
from expdesign.input_files import readable
from expdesign.records.file import FIRST_ROW, GAP_SAMPLE_TIMES, JITTER_SHARE, MISSING, Inputs, Sources, choose_columns
from expdesign.signals import AUXILIARY
from expdesign.values import Array
from expdesign.vessel import column_name

STREAM = Path("-")  # stands for the standard input
CLOCKED_ROWS = 50  # from which the time between samples is learnt
LINES = 4096  # looked at together
WIND_COLUMNS = ("wind_u_mps", "wind_v_mps", "wind_speed_mps", "wind_angle_rad")
OPTIONAL = (*WIND_COLUMNS, "depth_m", "steered", "batch", *AUXILIARY)
CORRECTED_SHARE = 0.005  # share of the steps, at most, that corrections of a clock are


@dataclass(frozen=True)
class Taken:
    """How far a source has been read."""

    source: str  # its name
    begins: str  # digest of its header and first row, by which it is known again
    rows: int  # rows after the header
    last_s: float  # time of the last of them, in the clock of the source [s]

    def continues(self, other: Taken) -> bool:
        """Whether this is the same source, read further.

        A stream is one however often it is opened, and the file that it was logged into begins as it did.
        """
        stream = STREAM.name in (self.source, other.source)
        return (self.source == other.source and stream) or (
            self.begins == other.begins and (self.source == other.source or stream)
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """Consecutive rows of a source."""

    text: str  # header and these rows, less columns that some of them lack
    source: Path  # where they come from
    header: str  # line of names
    lines: tuple[str, ...]  # of the rows kept
    time_s: Array  # (k,) their times [s]
    first_row: int  # row of the source that the piece begins in
    left_out: int  # rows that lack a number
    whole: bool  # all of the source
    pending: tuple[str, ...]  # lines after the last whole stretch, which the next piece begins with
    taken: Taken  # rows of the source that were read, those of `pending` included
    # lines left over from earlier data that are still to come; until there are none, this is no state to go on from
    again: int
    skipped: int  # rows at the beginning of the source that are among those taken before

    @property
    def place(self) -> str:
        """The source, and the rows of it that are meant, where these are not all."""
        last = self.first_row + len(self.lines) + self.left_out - 1
        return self.source.name if self.whole else f"{self.source.name}, rows {self.first_row} to {last}"

    def problem(self, error: FileError) -> FileError:
        """An error about the text as a file, told as an error of the source."""
        place = f" (rows counted in the piece from row {self.first_row} on)" if self.first_row > FIRST_ROW else ""
        return FileError(self.source, error.key, f"{error.problem}{place}")


@contextmanager
def as_file(text: str) -> Iterator[Path]:
    """A file of a piece's text."""
    with TemporaryDirectory(prefix="expdesign-") as folder:
        path = Path(folder) / "piece.csv"
        path.write_text(text, encoding="utf-8", errors="surrogateescape")
        yield path


def pieces(
    source: Path,
    *,
    inputs: Sequence[str],
    stretch_s: float,
    most_rows: int,
    unread: Sequence[str] = OPTIONAL,
    before: Sequence[str] = (),
    more_follow: bool = False,
    taken: Sequence[Taken] = (),
) -> Iterator[Piece]:
    """Pieces of a CSV file, or of the standard input for `STREAM`, with whole stretches but at gaps.

    Args:
        inputs: signals of the vessel, e.g. ("n1", "a1").
        stretch_s: length of a stretch [s].
        most_rows: of a piece; one that is shorter than a stretch has the rows of one.
        unread: columns that rows may lack; so may those of a wind that none of the first rows has.
        before: header and `pending` lines of earlier data, which come first where the header is the same.
        more_follow: the source goes on later: rows at its end that do not fill a stretch are `pending`, and a last
            line that does not end is not read.
        taken: of earlier data; rows of this source among them are skipped, of a stream those up to the last time.

    Raises:
        FileError: unreadable, without header, or without columns that are needed.
    """
    with _opened(source) as file:
        header = file.readline()
        names = tuple(name.strip() for name in header.rstrip("\r\n").split(","))
        if not header.strip():
            raise FileError(source, "", "is empty, expected a header row and one row per sample")
        chosen, _ = choose_columns(source, names, inputs=Inputs(tuple(map(column_name, inputs)), "the vessel"))
        lines = iter(file.readline, "")
        first = list(itertools.islice(lines, CLOCKED_ROWS))
        columns = _Columns(chosen, unread, first)
        step_s = _step_of(source, columns, first) or stretch_s
        stretch = max(1, round(stretch_s / step_s))
        how = _Cut(
            source=source, header=header, columns=columns, rows=stretch * max(1, most_rows // stretch),
            stretch=stretch, gap_s=GAP_SAMPLE_TIMES * step_s,
            more_follow=more_follow, begins=(begins := _digest(header, first)), skipped=0,
        )  # fmt: skip
        known = next((t for t in taken if t.continues(Taken(source.name, begins, 0, math.nan))), None)
        every: Iterator[str] = itertools.chain(first, lines)
        if known is None:
            rows = 0
        elif STREAM.name in (source.name, known.source):
            every, rows = _after(every, columns, known.last_s)
        else:
            every, rows = itertools.islice(every, known.rows, None), known.rows
        left = list(before[1:]) if before and before[0] == header else []
        how = replace(how, skipped=rows)
        yield from _cut(itertools.chain(left, every), how, rows - len(left), len(left))


def _step_of(source: Path, columns: _Columns, first: Sequence[str]) -> float:
    """Time between samples [s]; zero for a single row."""
    steps = np.diff(columns.times([line for line in first if columns.complete(line)]))
    step_s = float(np.median(steps)) if len(steps) else 0.0
    if len(steps) and not step_s > 0:
        raise FileError(source, columns.clock.header, "does not increase, expected increasing times")
    return step_s


def _digest(header: str, first: Sequence[str]) -> str:
    return hashlib.sha256("".join([header, *first[:1]]).encode(errors="surrogateescape")).hexdigest()[:16]


def _after(lines: Iterator[str], columns: _Columns, after_s: float) -> tuple[Iterator[str], int]:
    """Lines of a stream from the first on that is later, and the number before it."""
    rows = 0
    for line in lines:
        if not columns.times([line])[0] <= after_s:
            return itertools.chain([line], lines), rows
        rows += 1
    return iter(()), rows


@dataclass(frozen=True, kw_only=True)
class _Cut:
    source: Path
    header: str
    columns: _Columns
    rows: int
    stretch: int
    gap_s: float
    more_follow: bool
    begins: str
    skipped: int

    def piece(
        self, lines: list[str], left_out: int, *, rows: int, again: int, last: bool, all_of: bool = False
    ) -> Piece:
        """A piece of the lines up to a row of the source, as many as make whole stretches, or all of them."""
        times = self.columns.times(lines)
        whole = self._whole(times) if not all_of and (self.more_follow or not last) else len(lines)
        kept = lines[:whole]
        written = self.columns.without_optional(kept) if self.columns.gaps else kept
        self.columns.gaps = False
        first_row = max(FIRST_ROW, FIRST_ROW + rows - len(lines) - left_out)
        return Piece(
            text=self.header + "".join(written), source=self.source, header=self.header, lines=tuple(kept),
            time_s=times[:whole],
            first_row=first_row, left_out=left_out, whole=last and first_row == FIRST_ROW,
            pending=tuple(lines[whole:]), again=again, skipped=self.skipped,
            taken=Taken(self.source.name, self.begins, rows, float(times[-1]) if len(times) else math.nan),
        )  # fmt: skip

    def correction(self, lines: list[str]) -> int:
        """The first line after the clock was put right, back or by a part of a sample; zero where it was not.

        Steps that are uneven again and again are no corrections, and for the reader to refuse.
        """
        steps = np.diff(self.columns.times(lines))
        step_s = self.gap_s / GAP_SAMPLE_TIMES
        uneven = (steps <= 0) | ((np.abs(steps - step_s) > JITTER_SHARE * step_s) & (steps <= self.gap_s))
        return int(np.argmax(uneven)) + 1 if 0 < uneven.sum() <= CORRECTED_SHARE * len(steps) else 0

    def _whole(self, times: Array) -> int:
        """Lines up to the end of the last whole stretch, counted from the last gap."""
        steps = np.diff(times)
        gaps = np.flatnonzero(~((steps > 0) & (steps <= self.gap_s))) + 1
        begin = int(gaps[-1]) if len(gaps) else 0
        return begin + (len(times) - begin) // self.stretch * self.stretch


def _cut(source: Iterator[str], how: _Cut, rows: int, again: int) -> Iterator[Piece]:
    """Pieces of lines after so many rows of the source; the first lines were left over from earlier data."""
    lines: list[str] = []
    left_out, last = 0, False
    while not last:
        asked = min(LINES, how.rows - len(lines))
        block = list(itertools.islice(source, asked))
        last = len(block) < asked
        if last and how.more_follow and block and not block[-1].endswith("\n"):
            block.pop()
        rows, again = rows + len(block), max(0, again - len(block))
        kept, missing = how.columns.kept(block)
        lines, left_out = lines + kept, left_out + missing
        while cut := how.correction(lines):
            before, lines = lines[:cut], lines[cut:]
            yield how.piece(before, left_out, rows=rows - len(lines), again=len(lines), last=False, all_of=True)
            left_out = 0
        if last or len(lines) == how.rows:
            piece = how.piece(lines, left_out, rows=rows, again=again, last=last)
            yield piece
            lines, left_out = list(piece.pending), 0


class _Columns:
    """Places of the columns that are needed, and of those that may be missing."""

    def __init__(self, chosen: Sources, unread: Sequence[str], first: Sequence[str]) -> None:
        unread = (
            *unread,
            *(name for name in WIND_COLUMNS if name in chosen and not _filled(first, chosen[name].column)),
        )
        self.needed = [source.column for name, source in chosen.items() if name not in unread]
        self.optional = {source.column for name, source in chosen.items() if name in unread}
        self.clock = chosen["time_s"]
        self.gaps = False

    def kept(self, lines: list[str]) -> tuple[list[str], int]:
        """The rows that have something in every needed column, each on a whole line, and the number of others."""
        text = "".join(lines)
        if _full(f"\n{text}") and text.endswith("\n"):
            return lines, 0
        filled = [line if line.endswith("\n") else f"{line}\n" for line in lines if line.strip()]
        kept = [line for line in filled if self.complete(line)]
        return kept, len(filled) - len(kept)

    def complete(self, line: str) -> bool:
        """Whether a row has something in every needed column; whether it is a number is for the reader to say."""
        bare = line.rstrip("\r\n")
        if _full(f"\n{bare}\n"):
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


def _filled(lines: Sequence[str], column: int) -> bool:
    """Whether any of these lines has something in a column."""
    cells = [line.rstrip("\r\n").split(",")[column : column + 1] for line in lines]
    return any(cell[0].strip().lower() not in MISSING for cell in cells if cell)


def _full(text: str) -> bool:
    """Whether no cell of rows, each after a line end, can be empty or a word for nothing."""
    return not (
        ",," in text or ", " in text or ",\n" in text or "\n," in text or "\n\n" in text or "\r" in text
        or "n" in text.lower()
    )  # fmt: skip


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
    with readable(source, "a CSV file, or - for the standard input"):
        file = source.open(encoding="utf-8-sig", errors="surrogateescape")
    with file:
        yield file
