"""Text of a CSV file: header and cells, before any of them means anything."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

from expdesign.errors import FileError
from expdesign.input_files import check_ends

SEPARATORS = {";": "';'", "\t": "tabs", "|": "'|'"}
SPREADSHEET = b"PK\x03\x04"
LONGEST_SHOWN = 30


@dataclass(frozen=True, kw_only=True)
class Cells:
    """The cells of one file, all rows as wide as the header.

    Attributes:
        path: the file.
        header: names in row 1, on one line, without surrounding blanks.
        columns: for each name the texts of rows 2, 3, ...
    """

    path: Path
    header: tuple[str, ...]
    columns: tuple[tuple[str, ...], ...]


def read_cells(path: Path) -> Cells:
    """Read a comma-separated file.

    Raises:
        FileError: unreadable, not UTF-8, empty, no header, another separator, or rows of another width.
    """
    rows = _rows(path, _text(path))
    header = tuple(_one_line(name) for name in rows[0])
    _check_header(path, header)
    if len(rows) == 1:
        raise FileError(path, "", "has a header but no data, expected one row per sample")
    _check_widths(path, header, rows)
    return Cells(path=path, header=header, columns=tuple(zip(*rows[1:], strict=True)))


def shown(text: str) -> str:
    """A cell as it appears in messages: quoted, on one line, not too long."""
    return repr(text if len(text) <= LONGEST_SHOWN else text[:LONGEST_SHOWN] + "...")


def _one_line(name: str) -> str:
    """A column name with single blanks, cut where it gets longer than any name."""
    return "".join(letter if letter.isprintable() else "?" for letter in " ".join(name.split()))[: 2 * LONGEST_SHOWN]


def _text(path: Path) -> str:
    check_ends(path, "a CSV file")
    try:
        content = path.read_bytes()
        if content.startswith(SPREADSHEET):
            raise FileError(path, "", "is a spreadsheet or archive, expected CSV text")
        return content.decode("utf-8-sig")
    except FileNotFoundError:
        problem = "does not exist, expected a CSV file"
    except IsADirectoryError:
        problem = "is a directory, expected a CSV file"
    except UnicodeDecodeError as error:
        problem = f"is not UTF-8 text (byte 0x{error.object[error.start]:02x} at offset {error.start})"
    except (OSError, ValueError) as error:
        problem = f"cannot be read: {getattr(error, 'strerror', None) or error}"
    raise FileError(path, "", problem)


def _rows(path: Path, text: str) -> list[list[str]]:
    if not text.strip():
        raise FileError(path, "", "is empty, expected a header row and one row per sample")
    if text.lstrip().startswith(("#", "%")):
        raise FileError(path, "row 1", "is a comment, expected the header with names such as time_s")
    _check_separator(path, text.lstrip("\r\n").partition("\n")[0])
    rows: list[list[str]] = []
    try:
        rows.extend(csv.reader(io.StringIO(text, newline=None), strict=True))
    except csv.Error as error:
        problem = f"is not readable CSV ({error}), expected numbers between commas, without quotes"
        raise FileError(path, f"row {len(rows) + 1}", problem) from None
    while not rows[-1]:
        rows.pop()
    if not rows[0]:
        raise FileError(path, "row 1", "is empty, expected the header")
    return rows


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


def _check_widths(path: Path, header: tuple[str, ...], rows: list[list[str]]) -> None:
    width = len(header)
    wrong = [number for number, row in enumerate(rows, start=1) if len(row) != width]
    if not wrong:
        return
    found = len(rows[wrong[0] - 1])
    more = f"; {len(wrong) - 1} more rows differ too" if len(wrong) > 1 else ""
    hint = ": decimal commas?" if len(wrong) == len(rows) - 1 and found > width else ""
    cells = {0: "is empty", 1: "has 1 cell"}.get(found, f"has {found} cells")
    raise FileError(path, f"row {wrong[0]}", f"{cells}, expected {width} cells as in the header{more}{hint}")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
