"""Text of a CSV file: header and cells, before any of them means anything.

The file is read in blocks of rows, so that memory is needed for the numbers only and not for their texts.
"""

from __future__ import annotations

import codecs
import csv
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count, islice
from pathlib import Path

import numpy as np

from expdesign.errors import FileError
from expdesign.input_files import readable
from expdesign.values import Array

BLOCK_ROWS = 4096  # rows held as text at once
CSV = "a CSV file"
READ_BYTES = 1 << 20  # bytes read at once while a file is checked to be text

SEPARATORS = {";": "';'", "\t": "tabs", "|": "'|'"}
SPREADSHEET = b"PK\x03\x04"
LONGEST_SHOWN = 30
FIRST_ROW = 2


@dataclass(frozen=True, kw_only=True)
class Cells:
    """A comma-separated file whose header was read."""

    path: Path  # the file
    header: tuple[str, ...]  # names in row 1, on one line, without surrounding blanks

    def blocks(self) -> Iterator[tuple[int, list[tuple[str, ...]]]]:
        """Row of the first cell, and the texts of each column, block by block.

        Raises:
            FileError: no data, or rows of another width than the header; after the last block.
        """
        width, row, wrong = len(self.header), FIRST_ROW, _WrongWidths(len(self.header))
        for rows in _row_blocks(self.path):
            whole = [cells for cells in rows if len(cells) == width]
            if len(whole) < len(rows):
                wrong.add(row, rows)
            if whole:
                yield row, list(zip(*whole, strict=True))
            row += len(rows)
        wrong.check(self.path, rows=row - FIRST_ROW)

    def numbers(self, columns: Sequence[int]) -> Array | None:
        """(k, n) numbers of some columns; None where cells or rows are not all plain, for `blocks` to tell them."""
        parts: list[Array] = []
        with self.path.open(encoding="utf-8-sig") as file:
            next(file)
            while lines := list(islice(file, BLOCK_ROWS)):
                if any(map(str.isspace, lines)):
                    return None
                try:
                    rows = np.loadtxt(lines, delimiter=",", comments=None, ndmin=2)
                except ValueError:
                    return None
                if rows.shape != (len(lines), len(self.header)):
                    return None
                parts.append(rows[:, columns])
        return np.concatenate(parts) if parts else None

    def text(self, row: int, column: int) -> str:
        """The text of one cell."""
        for first, columns in self.blocks():
            if row < first + len(columns[column]):
                return columns[column][row - first]
        raise IndexError(row)


def read_cells(path: Path) -> Cells:
    """Read the header of a comma-separated file, and check that all of it is text.

    Raises:
        FileError: unreadable, not UTF-8, empty, no header, or another separator.
    """
    with readable(path, CSV):
        _check_text(path)
        _check_first_line(path)
        with _rows(path) as rows:
            first = next(rows)
    if not first:
        raise FileError(path, "row 1", "is empty, expected the header")
    header = tuple(_one_line(name) for name in first)
    _check_header(path, header)
    return Cells(path=path, header=header)


def shown(text: str) -> str:
    """A cell as it appears in messages: quoted, on one line, not too long."""
    return repr(text if len(text) <= LONGEST_SHOWN else text[:LONGEST_SHOWN] + "...")


def _one_line(name: str) -> str:
    """A column name with single blanks, cut where it gets longer than any name."""
    return "".join(letter if letter.isprintable() else "?" for letter in " ".join(name.split()))[: 2 * LONGEST_SHOWN]


def _check_text(path: Path) -> None:
    """Raise for an archive, for what is not UTF-8, and for a file of blanks."""
    decoder, blank, offset = codecs.getincrementaldecoder("utf-8")(), True, 0
    with path.open("rb") as file:
        while True:
            piece = file.read(READ_BYTES)
            if not offset and piece.startswith(SPREADSHEET):
                raise FileError(path, "", "is a spreadsheet or archive, expected CSV text")
            waiting = len(decoder.getstate()[0])
            try:
                text = decoder.decode(piece, final=not piece)
            except UnicodeDecodeError as error:
                place = offset - waiting + error.start
                byte = error.object[error.start]
                raise FileError(path, "", f"is not UTF-8 text (byte 0x{byte:02x} at offset {place})") from None
            blank = blank and not text.lstrip("\N{ZERO WIDTH NO-BREAK SPACE}").strip()
            offset += len(piece)
            if not piece:
                break
    if blank:
        raise FileError(path, "", "is empty, expected a header row and one row per sample")


def _check_first_line(path: Path) -> None:
    """Raise for a comment before the header, and for other separators than commas."""
    with path.open(encoding="utf-8-sig") as file:
        lines = (line for line in file if line.strip("\r\n"))
        first = next(lines)
        words = first if first.strip() else next(line for line in lines if line.strip())
    if words.lstrip().startswith(("#", "%")):
        raise FileError(path, "row 1", "is a comment, expected the header with names such as time_s")
    _check_separator(path, first.rstrip("\n"))


@contextmanager
def _rows(path: Path) -> Iterator[Iterator[list[str]]]:
    with path.open(encoding="utf-8-sig") as file:
        yield _readable_rows(path, csv.reader(file, strict=True))


def _readable_rows(path: Path, reader: Iterator[list[str]]) -> Iterator[list[str]]:
    numbers = count(1)
    try:
        for cells in reader:
            next(numbers)
            yield cells
    except csv.Error as error:
        problem = f"is not readable CSV ({error}), expected numbers between commas, without quotes"
        raise FileError(path, f"row {next(numbers)}", problem) from None


def _row_blocks(path: Path) -> Iterator[list[list[str]]]:
    """Rows 2, 3, ... without the empty ones at the end."""
    empty = 0
    with readable(path, CSV), _rows(path) as rows:
        next(rows)
        while block := list(islice(rows, BLOCK_ROWS)):
            before, empty = empty, 0
            while block and not block[-1]:
                block.pop()
                empty += 1
            if block:
                yield [[]] * before + block
            else:
                empty += before


def _check_separator(path: Path, line: str) -> None:
    if "," in line:
        return
    for separator, name in SEPARATORS.items():
        if separator in line:
            raise FileError(path, "row 1", f"is separated by {name}, expected commas (and decimal points)")
    if len(line.split()) > 1:
        raise FileError(path, "row 1", "is separated by blanks, expected commas")


def _check_header(path: Path, header: tuple[str, ...]) -> None:
    if all(_is_number(name) for name in header):
        raise FileError(path, "row 1", "holds numbers, expected the header with names such as time_s")
    seen: dict[str, int] = {}
    for column, name in enumerate(header, start=1):
        if name and name in seen:
            raise FileError(path, "row 1", f"names {name} in columns {seen[name]} and {column}, expected it once")
        seen[name] = column


class _WrongWidths:
    """Rows that are not as wide as the header: the first of them, and how many there are."""

    def __init__(self, width: int) -> None:
        self.width, self.count, self.row, self.found = width, 0, 0, 0

    def add(self, first_row: int, rows: list[list[str]]) -> None:
        """Look at the rows of a block."""
        for row, cells in enumerate(rows, start=first_row):
            if len(cells) != self.width:
                if not self.count:
                    self.row, self.found = row, len(cells)
                self.count += 1

    def check(self, path: Path, *, rows: int) -> None:
        """Raise for a file of so many rows of data, if there are none or one was wrong."""
        if not rows:
            raise FileError(path, "", "has a header but no data, expected one row per sample")
        if not self.count:
            return
        more = f"; {self.count - 1} more rows differ too" if self.count > 1 else ""
        hint = ": decimal commas?" if self.count == rows and self.found > self.width else ""
        cells = {0: "is empty", 1: "has 1 cell"}.get(self.found, f"has {self.found} cells")
        raise FileError(path, f"row {self.row}", f"{cells}, expected {self.width} cells as in the header{more}{hint}")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
