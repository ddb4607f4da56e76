"""Text: tables of any dialect, NMEA 0183, and both in one file.

A table's separator, decimal sign, header, units and clock are told from its first lines. Rows without a clock of their
own stand between sentences with satellite time, and are spread evenly from one to the next.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from expdesign.errors import FileError
from expdesign.importing.channels import COMPUTER, DAY_S, GNSS, NONE, OWN, Blocks, Log, channels_of, spread
from expdesign.importing.readers.nmea import Sentences
from expdesign.importing.times import TIME_NAME, over_midnight, read_numbers, read_stamps, tells_month_first
from expdesign.importing.units import counted, split_unit, words
from expdesign.records.file import MISSING
from expdesign.values import Array

BLOCK_BYTES = 1 << 22  # read at once
SNIFFED = 400  # lines that a dialect is told from
SEPARATORS = (";", "\t", "|", ",", " ")
NUMBER = re.compile(r"\s*[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?\s*")
PLACE = re.compile(
    r"\s*([+-]?\d{1,3}(?:[.,]\d+)?)\s*(?:[°ºd:\s]\s*(\d{1,2}(?:[.,]\d+)?)\s*['m:\s]?)?"
    r"\s*(?:(?<=['m:\s])(\d{1,2}(?:[.,]\d+)?)\s*[\"″s]?)?\s*([NSEWO])\s*"
)
"""A latitude or longitude with its side, as `54°30.12'N`."""
PACKED = re.compile(r"\s*(\d{2,3})(\d{2}(?:[.,]\d+)?)\s*()([NSEWO])\s*")
"""The same with degrees and minutes run together, as `5430.12N`."""
DATE_NUMBERS = (19700101, 21001231)
"""Least and greatest number that is a year, month and day run together."""
COMMENT = "#%/"
SHARE = 0.5  # of cells of a row of data that are numbers or times
TEXTS_SHOWN = 3
MOST_COLUMNS = 2000


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


def read_text(path: Path, sample_time_s: float) -> Log:
    """The log.

    Args:
        path: the file.
        sample_time_s: between rows of a table without a clock [s]; 0 where it is not known.

    Raises:
        FileError: empty, no text, or without rows or sentences.
    """
    encoding = _encoding(path)
    with path.open(encoding=encoding, errors="replace", newline=None) as file:
        sample = file.readlines(BLOCK_BYTES)[:SNIFFED]
    if not any(line.strip() for line in sample):
        raise FileError(path, "", "is empty, expected a log")
    if (wide := max(line.count(separator) for line in sample[:2] for separator in SEPARATORS[:-1])) > MOST_COLUMNS:
        raise FileError(path, "row 1", f"has {wide + 1} columns, expected at most {MOST_COLUMNS}")
    plain = [line for line in sample if "$" not in line and not line.startswith("!") and line.strip()]
    dialect = sniffed(plain)
    table = None if dialect is None else _Table(path, dialect, plain)
    sentences, place, other = Sentences(path.name), 0, 0
    with path.open(encoding=encoding, errors="replace", newline=None) as file:
        while lines := file.readlines(BLOCK_BYTES):
            marked = [
                (place + k, line) for k, line in enumerate(lines) if "$" in line or line.startswith("!")
            ]  # fmt: skip
            if marked:
                sentences.add(marked)
                left = [(place + k, x) for k, x in enumerate(lines) if "$" not in x and not x.startswith("!")]
            else:
                left = list(enumerate(lines, start=place))
            left = [pair for pair in left if not pair[1].isspace()]
            if table is not None:
                table.add(left)
            else:
                other += len(left)
            place += len(lines)
    if not sentences.count and table is None:
        expected = "a table of numbers with a header, NMEA 0183, or a format of expdesign explain import"
        raise FileError(path, "", f"holds no rows of numbers and no NMEA sentences that are read, expected {expected}")
    return _joined(path, sentences, table, other, sample_time_s)


def _joined(path: Path, sentences: Sentences, table: _Table | None, other: int, sample_time_s: float) -> Log:
    stamps, at, dated = sentences.anchors()
    received, received_at = sentences.received()
    notes = list(_line_notes(sentences, other))
    clock = GNSS if len(stamps) > 1 and dated else OWN
    if len(stamps) > 1 and len(received) > 1:
        apart = spread(at, received, received_at) - stamps
        late = float(np.nanmedian(apart))
        notes.append(f"times of reception are {late:.3f} s after satellite time in the median, and are moved by that")
        stamps, at = received - late, received_at
    elif len(received) > 1:
        stamps, at, clock = received, received_at, COMPUTER if received[0] > DAY_S * 3650 else OWN
    elif sentences.count and len(stamps) > 1:
        notes.append(
            "sentences without a time of their own take that of the fix before them, and are late or early by up to "
            f"{np.median(np.diff(stamps)):.3g} s"
        )
    channels = sentences.channels(stamps, at)
    if sentences.count and len(stamps) < 2:
        clock = NONE
        notes.append("no sentence has a time, so that none can be used: log RMC, GGA or ZDA too, or times of reception")
    unused = [f"{name} ({count})" for name, count in sentences.unread.most_common()]
    if table is not None:
        columns, times, own_clock, table_notes = table.columns(stamps, at, sample_time_s)
        clock = clock if clock == GNSS and own_clock in (GNSS, NONE) else own_clock
        notes += table_notes
        outside = int((~np.isfinite(times)).sum()) if own_clock == GNSS and table.time_name == "time" else 0
        if outside:
            notes.append(f"{counted(outside, 'row')} before the first satellite time are left out")
            known = np.isfinite(times)
            columns, times = {name: values[known] for name, values in columns.items()}, times[known]
        found, clock_notes = channels_of(columns, times, source=path.name, units=table.units, what=table.time_name)
        channels, notes, unused = [*channels, *found], [*notes, *clock_notes], [*unused, *table.texts()]
    return Log(source=path.name, clock=clock, channels=tuple(channels), notes=tuple(notes), unused=tuple(unused))


def _line_notes(sentences: Sentences, other: int) -> Iterator[str]:
    if sentences.broken:
        yield f"left out {counted(sentences.broken, 'sentence')} with a wrong checksum"
    if sentences.garbled:
        yield f"left out {counted(sentences.garbled, 'line')} with a $ but no whole sentence"
    if sentences.no_numbers:
        yield f"left out {counted(sentences.no_numbers, 'reading')} of transducers (XDR) without a number"
    if sentences.unchecked:
        yield f"used {counted(sentences.unchecked, 'sentence')} without a checksum"
    if other:
        yield (
            f"left out {counted(other, 'line')} that is no sentence"
            if other == 1
            else (f"left out {other} lines that are no sentences")
        )


def _encoding(path: Path) -> str:
    """Of a text.

    Raises:
        FileError: it is none.
    """
    with path.open("rb") as file:
        head = file.read(1 << 16)
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    strange = sum(byte < 9 or 13 < byte < 32 for byte in head) / max(len(head), 1)
    if strange > 0.02:
        raise FileError(path, "", "is not text, and begins like no format that is read (see expdesign explain import)")
    try:
        head[:-4].decode("utf-8-sig")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def sniffed(lines: Sequence[str]) -> Dialect | None:
    """The dialect of a table among lines of text; None where there is none."""
    best: tuple[float, Dialect] | None = None
    for separator in SEPARATORS:
        comma = separator != "," and _decimal_commas(lines, separator)
        draft = Dialect(separator, comma, (), (), 0)
        try:
            rows = [row for line in lines if (row := next(iter(draft.rows([line])), []))]
        except csv.Error:
            continue
        widths = Counter(len(row) for row in rows if _is_data(row, comma))
        if not widths:
            continue
        width, count = widths.most_common(1)[0]
        if width < 2 or count < 2:
            continue
        score = count / len(rows) + 0.01 * (separator in ";\t") + 0.02 * comma - 0.05 * (separator == " ")
        if best is None or score > best[0]:
            first = next(k for k, row in enumerate(rows) if len(row) == width and _is_data(row, comma))
            best = score, Dialect(separator, comma, *_header(rows[:first], width), first)
    return None if best is None else best[1]


def _decimal_commas(lines: Sequence[str], separator: str) -> bool:
    cells = [cell for line in lines for cell in (line.split() if separator == " " else line.split(separator))]
    commas = sum(bool(re.fullmatch(r"\s*[+-]?\d+,\d+\s*", cell)) for cell in cells)
    points = sum(bool(re.fullmatch(r"\s*[+-]?\d+\.\d+\s*", cell)) for cell in cells)
    return commas > points


def _is_data(row: Sequence[str], comma: bool) -> bool:
    filled = [cell for cell in row if cell.strip()]
    known = sum(bool(NUMBER.fullmatch(cell)) for cell in filled)
    known += sum(_is_place(cell) for cell in filled)
    known += sum(bool(np.isfinite([*read_stamps([cell]).day, *read_stamps([cell]).second]).any()) for cell in filled)
    return len(filled) > 0 and known >= max(1.0, SHARE * len(filled)) and known > 0


def _header(before: Sequence[Sequence[str]], width: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units from the rows before the first row of data."""
    rows = [[cell.strip(' "') for cell in row] for row in before if len(row) == width]
    rows = [[row[0].lstrip(COMMENT).strip(), *row[1:]] for row in rows]
    if not rows:
        return tuple(f"column {k}" for k in range(1, width + 1)), ("",) * width
    names, units = rows[-1], [""] * width
    if len(rows) > 1 and sum(bool(split_unit(f"x [{cell.strip('[]()')}]")[1]) for cell in names if cell) > width / 3:
        names, units = rows[-2], [cell.strip("[]()") for cell in rows[-1]]
    return _once([name or f"column {k}" for k, name in enumerate(names, start=1)]), tuple(units)


def _once(names: Sequence[str]) -> tuple[str, ...]:
    """The same, those that come again with their count: hdg, hdg (2)."""
    seen: Counter[str] = Counter()
    found = []
    for name in names:
        seen[name] += 1
        found.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return tuple(found)


@dataclass
class _Table:
    """The rows of a file, taken block by block."""

    path: Path
    dialect: Dialect
    sample: Sequence[str]
    blocks: Blocks = field(default_factory=Blocks)
    broken: int = 0
    strange: Counter[int] = field(default_factory=Counter)
    skipped: int = 0
    time_name: str = "time"

    def __post_init__(self) -> None:
        cells = re.split("[,;\t ]", " ".join(self.sample))
        self.month_first = tells_month_first(cells)
        self.ambiguous = next(
            filter(re.compile(r"(0?\d|1[0-2])[-/](0?\d|1[0-2])[-/](\d{4}|\d\d)").fullmatch, cells), ""
        )
        rows = [row for line in self.sample if (row := next(iter(self.dialect.rows([line])), []))]
        rows = [row for row in rows[self.dialect.header :] if len(row) == len(self.dialect.names)]
        self.kinds = [self._kind([row[k] for row in rows]) for k in range(len(self.dialect.names))]
        self.first = self.dialect.header
        self.shown = {k: list(dict.fromkeys(row[k].strip() for row in rows)) for k in self._of("text")}
        self.letters = {k: "".join(row[k][-1:] for row in rows) for k in self._of("place")}
        self.units = {
            name: unit for name, unit in zip(self.dialect.names, self.dialect.units, strict=True) if unit
        }  # fmt: skip

    def _kind(self, cells: Sequence[str]) -> str:
        filled = [cell for cell in cells if cell.strip().lower() not in MISSING]
        if not filled or sum(bool(NUMBER.fullmatch(cell)) for cell in filled) > SHARE * len(filled):
            return "number"
        if sum(_is_place(cell) for cell in filled) > SHARE * len(filled):
            return "place"
        return read_stamps(filled).kind or "text"

    def _of(self, kind: str) -> list[int]:
        return [k for k, own in enumerate(self.kinds) if own == kind]

    def _side(self, column: int) -> str:
        """What a column of places holds, by the letters in its cells."""
        return "latitude" if any(letter in self.letters[column] for letter in "NS") else "longitude"

    def texts(self) -> list[str]:
        """Columns of texts, with some of these."""
        return [
            f"{self.dialect.names[k]} (texts: {', '.join(values[:TEXTS_SHOWN])})" for k, values in self.shown.items()
        ]

    def add(self, lines: Sequence[tuple[int, str]]) -> None:
        """Take lines with their places."""
        skip, self.first = self.first, max(0, self.first - len(lines))
        lines = lines[skip:]
        if not lines:
            return
        width = len(self.dialect.names)
        try:
            rows = list(self.dialect.rows([line.replace("\0", "") for _, line in lines]))
        except csv.Error:
            rows = [line.split(self.dialect.separator) for _, line in lines]
        if len(rows) != len(lines):  # quotes over several lines
            rows = [line.split(self.dialect.separator) for _, line in lines]
        good = [k for k, row in enumerate(rows) if len(row) == width]
        self.broken += len(rows) - len(good)
        if not good:
            return
        self.blocks.add("place", [lines[k][0] for k in good])
        columns = list(zip(*(rows[k] for k in good), strict=True))
        for k, kind in enumerate(self.kinds):
            if kind == "number":
                self.blocks.add(f"{k}", self._numbers(k, columns[k]))
            elif kind == "place":
                self.blocks.add(f"{k}", [_degrees(text) for text in columns[k]])
            elif kind != "text":
                stamps = read_stamps(columns[k], day_first=not self.month_first)
                self.blocks.add(f"{k}|day", stamps.day)
                self.blocks.add(f"{k}|second", stamps.second)

    def _numbers(self, column: int, texts: Sequence[str]) -> Array:
        if self.dialect.comma:
            texts = [text.replace(",", ".") for text in texts]
        try:
            return np.fromiter(map(float, texts), dtype=float, count=len(texts))
        except ValueError:
            return np.array([self._number(column, text) for text in texts])

    def _number(self, column: int, text: str) -> float:
        try:
            return float(text)
        except ValueError:
            self.strange[column] += text.strip().lower() not in MISSING
            return np.nan

    def columns(self, stamps: Array, at: Array, sample_time_s: float) -> tuple[dict[str, Array], Array, str, list[str]]:
        """Numbers by name, times of the rows, kind of clock, notes; rows are counted where nothing tells times."""
        names, notes = self.dialect.names, []
        if self.broken:
            notes.append(f"left out {counted(self.broken, 'line')} without the {len(names)} cells of a row")
        for column, count in (+self.strange).items():
            notes.append(f"left out {counted(count, 'cell')} of {names[column]} without a number")
        taken, times, clock, how = self._times()
        if self.ambiguous and not self.month_first:
            notes.append(f"dates such as {self.ambiguous} are read with the day first")
        place = self.blocks.joined("place")
        if times is None and len(stamps) > 1:
            times, clock = spread(place, stamps, at), GNSS
            how = "rows have no clock of their own, and are spread evenly between the satellite times around them"
        elif times is None and sample_time_s > 0:
            times, clock = np.asarray(np.arange(len(place)) * sample_time_s), OWN
            how = f"rows have no clock, and count as {sample_time_s:g} s apart, as the mapping says"
        elif times is None:
            how = (
                f"{len(place)} rows have no clock (no column with times, no satellite time between them): expected "
                "sample_time_s under [[file]] in the mapping, where rows are evenly spaced"
            )
            times = np.arange(len(place), dtype=float)
            clock = NONE
        notes.append(how)
        values = {names[k]: self.blocks.joined(f"{k}") for k in self._of("number") if k not in taken}
        values |= {f"{names[k]} ({self._side(k)})": self.blocks.joined(f"{k}") for k in self._of("place")}
        return values, np.asarray(times), clock, notes

    @staticmethod
    def _is_date(values: Array) -> bool:
        """Whether numbers are years, months and days run together."""
        low, high = DATE_NUMBERS
        month, day = values // 100 % 100, values % 100
        return bool(((values > low) & (values < high) & (month <= 12) & (day <= 31) & (values % 1 == 0)).all())

    def _times(self) -> tuple[set[int], Array | None, str, str]:
        """Columns that are times, the times, kind of clock, and how they were read."""
        names = [words(name) for name in self.dialect.names]
        for k in self._of("both"):
            day, second = self.blocks.joined(f"{k}|day"), self.blocks.joined(f"{k}|second")
            self.time_name = self.dialect.names[k]
            clock = GNSS if re.search(r"\b(gps|gnss|utc)\b", names[k]) else COMPUTER
            return (
                {k, *self._of("both"), *self._of("date"), *self._of("clock")},
                day * DAY_S + second,
                clock,
                (f"time is {self.time_name}, date and time"),
            )
        # one that stands still, as a count-down that has not begun, is no clock
        clocks = [k for k in self._of("clock") if np.isfinite(np.unique(self.blocks.joined(f"{k}|second"))[1:2]).any()]
        if clocks:
            second = over_midnight(self.blocks.joined(f"{clocks[0]}|second"))
            self.time_name = self.dialect.names[clocks[0]]
            if dates := self._of("date"):
                day = self.blocks.joined(f"{dates[0]}|day")
                whole = np.where(np.isfinite(day), day, np.nan) * DAY_S + second % DAY_S
                return (
                    {*clocks, *dates},
                    whole,
                    COMPUTER,
                    f"time is {self.dialect.names[dates[0]]} and {self.time_name}",
                )
            return {*clocks}, second, OWN, f"time is {self.time_name}, a time of day without a date"
        numbers = [k for k in self._of("number") if TIME_NAME.search(names[k]) or names[k].startswith("time")]
        for k in numbers:
            values = self.blocks.joined(f"{k}")
            known = values[np.isfinite(values)]
            if self._is_date(values) or len(known) < 2 or (np.diff(known) != 0).mean() < 0.05 or np.ptp(known) == 0:
                continue
            unit = self.dialect.units[k] or split_unit(self.dialect.names[k])[1]
            times, clock, how = read_numbers(values, names[k], unit=unit)
            self.time_name = self.dialect.names[k]
            date = next((d for d in numbers if how == "hhmmss" and self._is_date(self.blocks.joined(f"{d}"))), None)
            if date is None:
                return {k}, times, clock, f"time is {self.time_name}, {how}"
            texts = [
                f"{d // 10000:04.0f}-{d // 100 % 100:02.0f}-{d % 100:02.0f}" for d in self.blocks.joined(f"{date}")
            ]
            whole = read_stamps(texts).day * DAY_S + times % DAY_S
            return {k, date}, whole, COMPUTER, f"time is {self.dialect.names[date]} and {self.time_name}, {how}"
        return set(), None, NONE, ""


def _is_place(text: str) -> bool:
    return bool(PLACE.fullmatch(text) or PACKED.fullmatch(text))


def _degrees(text: str) -> float:
    """Of a latitude or longitude with its side, nan where it is none."""
    found = PACKED.fullmatch(text) or PLACE.fullmatch(text)
    if found is None:
        return float("nan")
    parts = [float((part or "0").replace(",", ".")) for part in found.groups()[:3]]
    return (parts[0] + parts[1] / 60.0 + parts[2] / 3600.0) * (-1.0 if found[4] in "SW" else 1.0)


def is_text(path: Path, head: bytes) -> bool:
    """Whether a file may be text: the last reader that is asked."""
    return True
