"""Text: tables of any dialect, NMEA 0183, and both in one file.

A table's separator, decimal sign, header, units and clock are told from its first lines. Rows without a clock of their
own stand between sentences with satellite time, and are spread evenly from one to the next.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from expdesign.errors import FileError
from expdesign.importing.channels import COMPUTER, DAY_S, GNSS, NONE, OWN, Blocks, Log, channels_of, spread
from expdesign.importing.languages import words
from expdesign.importing.mapping import counted
from expdesign.importing.readers.dialect import (
    SEPARATORS,
    Dialect,
    degrees,
    encoding_of,
    kind_of,
    port_signs,
    sided,
    signs,
    sniffed,
)
from expdesign.importing.readers.nmea import Sentences
from expdesign.importing.times import Stamps, clock_of, halves_of_days, read_stamps, tells_month_first
from expdesign.records.file import MISSING
from expdesign.values import Array

TEXTS_SHOWN = 3
STAMPS = ("both", "date", "clock")
LATITUDE, LONGITUDE = r"\b(lat|latitude)\b", r"\b(lon|lng|long|longitude)\b"
TURNED = r"\b(variation|deviation|declination|mv)\b"  # names of angles with E or W that are no places
VESSEL = r"\b(mmsi|imo|call ?sign|vessel name|ship name|boat name)\b"
"""Names of columns that say which vessel a row is of."""
AMBIGUOUS = re.compile(r"(0?\d|1[0-2])[-/](0?\d|1[0-2])[-/](\d{4}|\d\d)")


@dataclass
class TextTable:
    """The rows of a file, taken block by block."""

    path: Path
    dialect: Dialect
    sample: Sequence[str]
    blocks: Blocks = field(default_factory=Blocks)
    broken: int = 0
    strange: Counter[int] = field(default_factory=Counter)
    vessels: Counter[str] = field(default_factory=Counter)
    time_name: str = "time"

    def __post_init__(self) -> None:
        cells = re.split('[,;\t" ]', " ".join(self.sample))
        self.halves = halves_of_days(cells)
        self.month_first = tells_month_first(cells) or self.halves
        self.ambiguous = next(filter(AMBIGUOUS.fullmatch, cells), "")
        rows = [row for line in self.sample if (row := next(iter(self.dialect.rows([line])), []))]
        rows = [row for row in rows[self.dialect.header :] if len(row) == len(self.dialect.names)]
        columns = [[row[k] for row in rows] for k in range(len(self.dialect.names))]
        self.kinds = [kind_of(name, own) for name, own in zip(self.dialect.names, columns, strict=True)]
        self.first = self.dialect.header
        self.shown = {k: list(dict.fromkeys(cell.strip() for cell in columns[k])) for k in self._of("text")}
        self.letters = {k: "".join(columns[k]).upper() for k in (*self._of("place"), *self._of("side"))}
        self.units = {name: unit for name, unit in zip(self.dialect.names, self.dialect.units, strict=True) if unit}
        self.suffixes = {k: kind[5:] for k, kind in enumerate(self.kinds) if kind.startswith("unit ")}
        self.units |= {self.dialect.names[k]: unit for k, unit in self.suffixes.items()}
        self.vessel = next((k for k, name in enumerate(self.dialect.names) if re.search(VESSEL, words(name))), None)

    def _of(self, kind: str) -> list[int]:
        return [k for k, own in enumerate(self.kinds) if own == kind]

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
        if self.vessel is not None:
            self.vessels.update(columns[self.vessel])
        for k, kind in enumerate(self.kinds):
            if kind == "number":
                self.blocks.add(f"{k}", self._numbers(k, columns[k]))
            elif kind.startswith("unit "):
                self.blocks.add(f"{k}", self._numbers(k, [c.strip().removesuffix(kind[5:]) for c in columns[k]]))
            elif kind == "place":
                self.blocks.add(f"{k}", [degrees(text) for text in columns[k]])
            elif kind == "sided":
                self.blocks.add(f"{k}", [sided(text) for text in columns[k]])
            elif kind == "side":
                self.blocks.add(f"{k}", signs(columns[k]))
                self.blocks.add(f"{k}|port", port_signs(columns[k]))
            elif kind in STAMPS:
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
        """Numbers by name, times of the rows, kind of clock, notes; rows are counted where nothing tells times.

        Raises:
            FileError: the rows are of several vessels.
        """
        names, notes = self.dialect.names, []
        seen = {text.strip() for text in self.vessels} - {""}
        if self.vessel is not None and len(seen) > 1:
            raise FileError(
                self.path, names[self.vessel], f"names {len(seen)} vessels ({', '.join(sorted(seen)[:3])}, ...), "
                "expected the rows of one"
            )  # fmt: skip
        if self.broken:
            notes.append(f"left out {counted(self.broken, 'line')} without the {len(names)} cells of a row")
        for column, count in (+self.strange).items():
            notes.append(f"left out {counted(count, 'cell')} of {names[column]} without a number")
        stamped = {
            names[k]: Stamps(self.blocks.joined(f"{k}|day"), self.blocks.joined(f"{k}|second"))
            for kind in STAMPS for k in self._of(kind)
        }  # fmt: skip
        values, more = self._values()
        clock = clock_of(values, stamped, self.units)
        taken, times, kind, how = clock.taken, clock.times, clock.kind, clock.how
        self.time_name = clock.name
        if others := [name for name in stamped if name not in taken]:
            notes.append(f"{', '.join(others)}: another time, not used")
        if self.ambiguous and (self.halves or not self.month_first):
            first = "month first, as times have AM and PM" if self.halves else "day first"
            notes.append(f"dates such as {self.ambiguous} are read with the {first}")
        place = self.blocks.joined("place")
        if times is None and len(stamps) > 1:
            times, kind = spread(place, stamps, at), GNSS
            how = "rows have no clock of their own, and are spread evenly between the satellite times around them"
        elif times is None and sample_time_s > 0:
            times, kind = np.asarray(np.arange(len(place)) * sample_time_s), OWN
            how = f"rows have no clock, and count as {sample_time_s:g} s apart, as the mapping says"
        elif times is None:
            how = (
                f"{len(place)} rows have no clock (no column with times, no satellite time between them): expected "
                "sample_time_s under [[file]] in the mapping, where rows are evenly spaced"
            )
            times = np.arange(len(place), dtype=float)
            kind = NONE
        left = {name: own for name, own in values.items() if name not in taken}
        return left, np.asarray(times), kind, [*notes, *more, how]

    def _values(self) -> tuple[dict[str, Array], list[str]]:
        """Numbers by name, with the signs and the minutes that stand in columns of their own, and notes."""
        names, notes = self.dialect.names, []
        values = {names[k]: self.blocks.joined(f"{k}") for k in self._of("number")}
        values |= {names[k]: self.blocks.joined(f"{k}") for k in (*self._of("sided"), *self.suffixes)}
        for k in self._of("place"):
            known = re.search(f"{LATITUDE}|{LONGITUDE}|{TURNED}", words(names[k]))
            side = "latitude" if set(self.letters[k]) & {*"NS"} else "longitude"
            values[names[k] if known else f"{names[k]} ({side})"] = self.blocks.joined(f"{k}")
            if set(self.letters[k]) & {*"NSEWO"}:
                notes += _of_o(self.letters[k], names[k])
        for k in self._of("side"):
            number = names[k - 1] if k else ""
            if number not in values:
                continue
            place = re.search(f"{LATITUDE}|{LONGITUDE}", words(number))
            sign = self.blocks.joined(f"{k}" if place or set(self.letters[k]) <= {*"EWO"} else f"{k}|port")
            values[number] = np.abs(values[number]) * sign
            notes.append(f"{number}: its sign is that of {names[k]}")
            notes += _of_o(self.letters[k], names[k]) if place else []
        return _with_minutes(values), notes


def _of_o(letters: str, name: str) -> list[str]:
    """A note where O may be east, as in German, or west, as in French."""
    return [f"{name}: O is read as east (Ost)"] if "O" in letters and "E" not in letters else []


def _with_minutes(values: dict[str, Array]) -> dict[str, Array]:
    """The same, with minutes, and seconds, of latitude and longitude added to their degrees."""
    found = dict(values)
    for name in values:
        stem, _, last = words(name).rpartition(" ")
        if last not in ("deg", "degrees", "d") or not re.search(f"{LATITUDE}|{LONGITUDE}", stem):
            continue
        for ends, share in ((("min", "minutes", "m"), 60.0), (("sec", "seconds", "s"), 3600.0)):
            part = next((other for other in values if words(other) in [f"{stem} {end}" for end in ends]), None)
            if part is not None:
                found[name] = found[name] + np.where(np.signbit(values[name]), -1.0, 1.0) * found.pop(part) / share
    return found


BLOCK_BYTES = 1 << 20  # read at once
SNIFFED = 400  # lines that a dialect is told from
MOST_COLUMNS = 2000


def read_text(path: Path, sample_time_s: float) -> Log:
    """The log.

    Args:
        sample_time_s: between rows of a table without a clock [s]; 0 where it is not known.

    Raises:
        FileError: empty, no text, or without rows or sentences.
    """
    encoding = encoding_of(path)
    with path.open(encoding=encoding, errors="replace", newline=None) as file:
        sample = file.readlines(BLOCK_BYTES)[:SNIFFED]
    if not any(line.strip() for line in sample):
        raise FileError(path, "", "is empty, expected a log")
    if (wide := max(line.count(separator) for line in sample[:2] for separator in SEPARATORS[:-1])) > MOST_COLUMNS:
        raise FileError(path, "row 1", f"has {wide + 1} columns, expected at most {MOST_COLUMNS}")
    plain = [line for line in sample if not _is_sentence(line) and line.strip()]
    dialect = sniffed(plain)
    table = None if dialect is None else TextTable(path, dialect, plain)
    sentences, place, other, before, cut = Sentences(path.name), 0, 0, "", False
    with path.open(encoding=encoding, errors="replace", newline=None) as file:
        while lines := file.readlines(BLOCK_BYTES):
            marked = [(place + k, line) for k, line in enumerate(lines) if _is_sentence(line)]
            if marked:
                sentences.add(marked)
                left = [(place + k, line) for k, line in enumerate(lines) if not _is_sentence(line)]
            else:
                left = list(enumerate(lines, start=place))
            left = [pair for pair in left if not pair[1].isspace()]
            if left:
                before, last = left[-2][1] if len(left) > 1 else before, left[-1][1]
                cut = dialect is not None and dialect.is_cut(last, before)
                left, before = left[:-1] if cut else left, last
            if table is not None:
                table.add(left)
            else:
                other += len(left)
            place += len(lines)
    if not sentences.count and table is None:
        expected = "a table of numbers with a header, NMEA 0183, or a format of expdesign explain import"
        raise FileError(path, "", f"holds no rows of numbers and no NMEA sentences that are read, expected {expected}")
    log = _joined(path, sentences, table, other, sample_time_s)
    words = "left out the last line, which has no end and may be cut"
    return replace(log, notes=(words, *log.notes)) if cut else log


def _joined(path: Path, sentences: Sentences, table: TextTable | None, other: int, sample_time_s: float) -> Log:
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


def _is_sentence(line: str) -> bool:
    """Whether a line is, or ends in, a sentence of NMEA 0183; reports of the own ship may stand behind a time."""
    return "$" in line or line.startswith("!") or "VDO," in line


def _line_notes(sentences: Sentences, other: int) -> Iterator[str]:
    if sentences.broken:
        yield f"left out {counted(sentences.broken, 'sentence')} with a wrong checksum"
    if sentences.garbled:
        yield f"left out {counted(sentences.garbled, 'line')} with a $ but no whole sentence"
    if sentences.no_numbers:
        yield f"left out {counted(sentences.no_numbers, 'reading')} of transducers (XDR) without a number"
    for what, count in sentences.doubtful.most_common():
        yield f"used {counted(count, 'position')} that no satellite gave: {what}"
    for datum, count in sentences.datums.most_common():
        told = counted(count, "sentence")
        yield f"positions are of the datum {datum} by {told} (DTM), and may be off by 100 m and more"
    if sentences.unchecked:
        yield f"used {counted(sentences.unchecked, 'sentence')} without a checksum"
    if other:
        yield (
            f"left out {counted(other, 'line')} that is no sentence"
            if other == 1
            else (f"left out {other} lines that are no sentences")
        )


def is_text(path: Path, head: bytes) -> bool:
    """Whether a file may be text: the last reader that is asked."""
    return True
