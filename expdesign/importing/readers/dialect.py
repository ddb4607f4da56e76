"""How a table is written: encoding, separator, decimal sign, the rows above the data, and cells as people write them.

Cells are numbers with a unit or a side, latitudes and longitudes.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from expdesign.errors import FileError
from expdesign.importing.languages import is_foreign, words
from expdesign.importing.mapping import KNOWN, split_unit, unit_word
from expdesign.importing.times import read_stamps
from expdesign.records.file import MISSING
from expdesign.values import Array

NUMBER = re.compile(r"\s*[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?\s*")
WITH_UNIT = re.compile(r"\s*([+-]?(?:\d+[.,]?\d*|[.,]\d+))\s*([A-Za-z%°º/]+(?:/[A-Za-z0-9]+)?)\s*")
SIDED = re.compile(r"\s*(?P<a>[A-Za-z]*)\.?\s*(?P<number>\d+(?:[.,]\d*)?)\s*°?\s*(?P<b>[A-Za-z]*)\s*")
PLACE = re.compile(
    r"\s*(?P<sign>[+-])?\s*(?P<a>[NSEWO])?\s*(?P<deg>\d{1,3}(?:[.,]\d+)?)"
    r"(?:\s*[°ºd:\s-]\s*(?P<min>\d{1,2}(?:[.,]\d+)?))?\s*(?:['\u2032\u2019m:\s]\s*(?P<sec>\d{1,2}(?:[.,]\d+)?))?"
    r"\s*[°º'\u2032\u2019\"\u2033\u201dsm]*\s*(?P<b>[NSEWO])?\s*"
)
"""A latitude or longitude, as `54°30.12'N`, `S 33 51 31.2` or `-33°51'31.2"`."""
PACKED = re.compile(r"\s*(?P<a>[NSEWO])?\s*(?P<deg>\d{2,3})(?P<min>\d{2}(?:[.,]\d+)?)\s*(?P<b>[NSEWO])?\s*")
"""The same with degrees and minutes run together, as `5430.12N`."""
PORT_WORDS = {"p", "port", "prt", "ps", "bb", "l", "left"}
STARBOARD_WORDS = {"s", "stbd", "stb", "sb", "starboard", "r", "right"}
SHARE = 0.5  # of cells of a row of data that are numbers or times


def filled(cells: Sequence[str]) -> list[str]:
    """Those that hold something."""
    return [cell for cell in cells if cell.strip().lower() not in MISSING]


def kind_of(name: str, cells: Sequence[str]) -> str:
    """What a column holds.

    Returns:
        "number", "unit ..." for numbers with that unit, "place", "sided", "side", "text", or a kind of `Stamps`.
    """
    own = filled(cells)

    def mostly(count: int) -> bool:
        return count > SHARE * len(own)

    if not own or mostly(sum(bool(NUMBER.fullmatch(cell)) for cell in own)):
        return "number"
    if kind := read_stamps(own).kind:
        return kind
    place = bool(re.search(r"\b(lat\w*|lon\w*|lng|position)\b", words(name)))
    sides = [side_of(cell) for cell in own]
    if mostly(sum(side is not None for side in sides)) and not place:
        return "sided"
    if mostly(sum(is_place(cell) for cell in own)) and (place or not mostly(sum(side is not None for side in sides))):
        return "place"
    if set(map(str.upper, map(str.strip, own))) <= {*"NSEWO"} or {cell.strip().lower() for cell in own} <= (
        PORT_WORDS | STARBOARD_WORDS
    ):
        return "side"
    suffixes = Counter(found[2] for cell in own if (found := WITH_UNIT.fullmatch(cell)))
    unit, count = suffixes.most_common(1)[0] if suffixes else ("", 0)
    return f"unit {unit}" if mostly(count) and unit_word(unit) in KNOWN else "text"


def is_place(text: str) -> bool:
    """Whether a text is a latitude or longitude with its side, or with degrees and minutes."""
    found = PACKED.fullmatch(text) or PLACE.fullmatch(text)
    if found is None:
        return False
    return bool(found["a"] or found["b"]) or bool(found["min"] and re.search("[°º]", text))


def degrees(text: str) -> float:
    """Of a latitude or longitude, nan where it is none."""
    found = PACKED.fullmatch(text)
    found = found if found and (found["a"] or found["b"]) else PLACE.fullmatch(text)
    if found is None:
        return float("nan")
    parts = {**found.groupdict()}
    numbers = [float((parts.get(key) or "0").replace(",", ".")) for key in ("deg", "min", "sec")]
    if numbers[1] >= 60.0 or numbers[2] >= 60.0:
        return float("nan")
    south = (found["a"] or found["b"] or "") in ("S", "W") or parts.get("sign") == "-"
    return (numbers[0] + numbers[1] / 60.0 + numbers[2] / 3600.0) * (-1.0 if south else 1.0)


def side_of(text: str) -> float | None:
    """-1 for port, 1 for starboard, 0 for a plain zero, of a number with its side; None for any other text."""
    found = SIDED.fullmatch(text)
    if found is None or (found["a"] and found["b"]):
        return None
    side = (found["a"] or found["b"]).lower()
    if side in PORT_WORDS:
        return -1.0
    return 1.0 if side in STARBOARD_WORDS else None


def sided(text: str) -> float:
    """A number that is negative to port, nan where it has no side and is not zero."""
    found, side = SIDED.fullmatch(text), side_of(text)
    if found is None or side is None:
        return 0.0 if NUMBER.fullmatch(text) and not float(text.replace(",", ".")) else float("nan")
    return side * float(found["number"].replace(",", "."))


def signs(cells: Sequence[str]) -> Array:
    """(k,) -1 for S, W and port, 1 for other sides, nan for none."""
    table = {"s": -1.0, "w": -1.0, "n": 1.0, "e": 1.0, "o": 1.0}
    return np.array([table.get(cell.strip().lower(), np.nan) for cell in cells])


def port_signs(cells: Sequence[str]) -> Array:
    """(k,) -1 for port, 1 for starboard, nan for neither."""
    own = [cell.strip().lower() for cell in cells]
    return np.array([-1.0 if c in PORT_WORDS else 1.0 if c in STARBOARD_WORDS else np.nan for c in own])


SEPARATORS = (";", "\t", "|", ",", " ")
COMMENT = "#%/"
EASTERN = ("cp932", "cp949", "gb18030")
"""Encodings of Japanese, Korean and Chinese, one of which is taken where a word that is known stands in it."""


@dataclass(frozen=True)
class Dialect:
    """How rows are written."""

    separator: str
    comma: bool  # whether numbers have decimal commas
    names: tuple[str, ...]
    units: tuple[str, ...]
    header: int  # lines up to the first row of data that are no rows

    def rows(self, lines: Sequence[str]) -> Iterator[list[str]]:
        """Cells of each line."""
        if self.separator == " ":
            return (line.split() for line in lines)
        return csv.reader(lines, delimiter=self.separator, skipinitialspace=True)

    def is_cut(self, line: str, before: str) -> bool:
        """Whether a line may be cut: it has no end, and decimals of its last cell that tell nothing, or are fewer."""
        if line.endswith("\n") or (line.endswith('"') and line.count('"') % 2 == 0):
            return False
        own, usual = (next(iter(self.rows([text.rstrip("\n")])), []) for text in (line, before))
        if not own or len(own) != len(usual):
            return False  # left out, as a line without the cells of a row
        decimals = [len(row[-1].strip().partition("," if self.comma else ".")[2]) for row in (own, usual)]
        return decimals[0] == 0 or decimals[0] < decimals[1]


def encoding_of(path: Path) -> str:
    """Of a text.

    Raises:
        FileError: it is none.
    """
    with path.open("rb") as file:
        head = file.read(1 << 16)
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    for first, name in ((1, "utf-16-le"), (0, "utf-16-be")):
        if len(head) > 20 and head[first::2].count(0) > 0.9 * len(head[first::2]) and 0 not in head[1 - first :: 2]:
            return name
    strange = sum(byte < 9 or 13 < byte < 32 for byte in head) / max(len(head), 1)
    if strange > 0.02:
        raise FileError(path, "", "is not text, and begins like no format that is read (see expdesign explain import)")
    try:
        head[:-4].decode("utf-8-sig")
    except UnicodeDecodeError:
        return next((name for name in EASTERN if is_foreign(head.decode(name, "ignore"))), "cp1252")
    return "utf-8-sig"


def sniffed(lines: Sequence[str]) -> Dialect | None:
    """The dialect of a table among lines of text; None where there is none."""
    best: tuple[float, Dialect] | None = None
    for separator in SEPARATORS:
        comma = separator != "," and _decimal_commas(lines, separator)
        draft = Dialect(separator, comma, (), (), 0)
        try:
            rows = [(line, row) for line in lines if (row := next(iter(draft.rows([line])), []))]
        except csv.Error:
            continue
        widths = Counter(len(row) for _, row in rows if _is_data(row))
        if not widths:
            continue
        width, count = widths.most_common(1)[0]
        if width < 2 or count < 2:
            continue
        score = count / len(rows) + 0.01 * (separator in ";\t") + 0.02 * comma - 0.05 * (separator == " ")
        if best is None or score > best[0]:
            first = next(k for k, (_, row) in enumerate(rows) if len(row) == width and _is_data(row))
            above = [row if separator != " " else _of_columns(line, width) for line, row in rows[:first]]
            best = score, Dialect(separator, comma, *_header(above, width), first)
    return None if best is None else best[1]


def _of_columns(line: str, width: int) -> list[str]:
    """Names above columns that blanks part: of single words, or of several with two blanks or more between."""
    single = line.split()
    return single if len(single) == width else re.split(r"\s{2,}", line.strip())


def _decimal_commas(lines: Sequence[str], separator: str) -> bool:
    cells = [cell for line in lines for cell in (line.split() if separator == " " else line.split(separator))]
    commas = sum(bool(re.fullmatch(r"\s*[+-]?\d+,\d+\s*", cell)) for cell in cells)
    points = sum(bool(re.fullmatch(r"\s*[+-]?\d+\.\d+\s*", cell)) for cell in cells)
    return commas > points


def _is_data(row: Sequence[str]) -> bool:
    filled = [cell for cell in row if cell.strip()]
    known = sum(bool(NUMBER.fullmatch(cell)) or is_place(cell) or side_of(cell) is not None for cell in filled)
    known += sum(bool((found := WITH_UNIT.fullmatch(cell)) and unit_word(found[2]) in KNOWN) for cell in filled)
    times = read_stamps(filled)
    known += int(np.sum(np.isfinite(times.day) | np.isfinite(times.second)))
    return len(filled) > 0 and known >= max(1.0, SHARE * len(filled)) and known > 0


def _header(before: Sequence[Sequence[str]], width: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units from the rows before the first row of data."""
    rows = [[cell.strip(' "') for cell in row] for row in before if len(row) == width]
    rows = [[row[0].lstrip(COMMENT).strip(), *row[1:]] for row in rows]
    if not rows:
        return tuple(f"column {k}" for k in range(1, width + 1)), ("",) * width
    names, units, rest = rows[-1], [""] * width, rows[:-1]
    if rest and sum(bool(split_unit(f"x [{cell.strip('[]()')}]")[1]) for cell in names if cell) > width / 3:
        names, units, rest = rest[-1], [cell.strip("[]()") for cell in names], rest[:-1]
    if rest and 1 < sum(map(bool, rest[-1])) < width:  # a row of groups, as of cells that were merged
        group = ""
        for k, above in enumerate(rest[-1]):
            group = above or group
            names[k] = f"{group} {names[k]}".strip()
    return _once([name or f"column {k}" for k, name in enumerate(names, start=1)]), tuple(units)


def _once(names: Sequence[str]) -> tuple[str, ...]:
    """The same, those that come again with their count: hdg, hdg (2)."""
    seen: Counter[str] = Counter()
    found = []
    for name in names:
        seen[name] += 1
        found.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return tuple(found)
