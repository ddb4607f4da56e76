"""The rows of a text table, taken block by block: cells become numbers, and some columns the clock."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from expdesign.errors import FileError
from expdesign.importing.channels import GNSS, NONE, OWN, Blocks, spread
from expdesign.importing.clocks import clock_of
from expdesign.importing.readers.dialect import Dialect, degrees, kind_of, port_signs, sided, signs
from expdesign.importing.times import Stamps, halves_of_days, read_stamps, tells_month_first
from expdesign.importing.units import counted, words
from expdesign.records.file import MISSING
from expdesign.values import Array

TEXTS_SHOWN = 3
STAMPS = ("both", "date", "clock")
LATITUDE, LONGITUDE = r"\b(lat|latitude)\b", r"\b(lon|lng|long|longitude)\b"
TURNED = r"\b(variation|deviation|declination|mv)\b"
"""Names of angles with E or W that are no places."""
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
