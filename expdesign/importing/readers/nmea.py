"""NMEA 0183 sentences, by the fields that pynmeagps knows; also behind a time, in a TAG block or in OpenCPN's records.

Which field stands where is pynmeagps's knowledge. Its reader takes 70 us a line, which is five minutes for a day of
five sentences at 10 Hz; here the lines of a block are taken apart column by column.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from datetime import date, timedelta

import numpy as np
from pynmeagps.nmeatypes_get import NMEA_PAYLOADS_GET

from expdesign.importing.channels import DAY_S, Blocks, Channel, epochs, spread
from expdesign.importing.times import over_midnight, read_numbers, read_stamps, tells_month_first
from expdesign.values import Array

FIELDS = {
    "RSA": "stbdangle:deg:stbdstatus portangle:deg:portstatus",
    "RPM": "rpm:rpm:status",
    "ROT": "rot:degpmin:valid",
    "HDT": "headingT:deg",
    "THS": "headt:deg:mi",
    "HDG": "headingM:deg variation:deg/variationEW deviation:deg/deviationEW",
    "HDM": "headingM:deg",
    "VTG": "cogt:deg sogn:kn",
    "VBW": "longwaterspd:kn:waterspdstatus transwaterspd:kn:waterspdstatus longgroundspd:kn:groundspdstatus "
    "transgroundspd:kn:groundspdstatus",
    "VHW": "hdgT:deg hdgM:deg spdN:kn",
    "GGA": "lat:deg/NS:quality lon:deg/EW:quality",
    "GNS": "lat:deg/NS:posMode lon:deg/EW:posMode",
    "GLL": "lat:deg/NS:status lon:deg/EW:status",
    "RMC": "lat:deg/NS:status lon:deg/EW:status spd:kn:status cog:deg:status mv:deg/mvEW:status",
    "MWV": "angle:deg:status speed:mps:status",
    "DPT": "depth:m offset:m",
    "DBT": "depthm:m",
    "HSC": "cmdheadingT:deg",
    "ROR": "stbdrudderorder:deg:stbdrudderstatus portrudderorder:deg:portrudderstatus",
    "PRC": "",
    "TRC": "",
    "TRD": "",
    "DTM": "",
    "XDR": "",
    "ZDA": "",
}
"""Sentence -> fields that are read, each with its unit, the field that gives its sign, and that which must be valid."""
ORDERS = {"stbdrudderorder": "rudder order starboard", "portrudderorder": "rudder order port"}
"""Fields of orders and their words."""
MACHINES = {
    "RPM": ("engineshaftnum", (("rpm", "rpm", "", "rpm"),)),
    "PRC": ("engineshaftnum", (("rpmdemand", "rpm order", "rpmdemandstatus", "rpm"),)),
    "TRC": ("thrusternum", (("dmdrpm", "rpm order", "rpmmode", "rpm"), ("dmdazimuth", "azimuth order", "", "deg"))),
    "TRD": ("thrusternum", (("rpmresponse", "rpm actual", "rpmmode", "rpm"),
                            ("azimuthresponse", "azimuth actual", "", "deg"))),
}  # fmt: skip
"""Sentences on one machine of several -> field of its number, and fields with words, field of the mode, and unit."""
MAKERS = {"PSXN": ("23", {"roll": 1, "heading": 3}), "PASHR": ("", {"heading": 1, "roll": 3})}
"""Sentences of makers -> first field, and places of what is read: Seapath's motion, and attitude as many send it."""
DOUBTS = {"GGA": ("quality", {"6": "estimated", "7": "put in by hand", "8": "simulated"}),
          "RMC": ("posMode", {"E": "estimated", "M": "put in by hand", "S": "simulated"}),
          "GNS": ("posMode", {"E": "estimated", "M": "put in by hand", "S": "simulated"})}  # fmt: skip
"""Sentence -> field, and its marks of positions that no satellite gave."""
WGS84 = ("", "W84", "P90", "999")
PLACES = {name: {field: place for place, field in enumerate(NMEA_PAYLOADS_GET[name])} for name in FIELDS}
INVALID = {"V", "0", "N", "NN", "NNN", "NNNN"}
"""Marks of a reading that is not valid."""
TIMED = ("RMC", "GGA", "GNS", "GLL", "ZDA")
WIND_UNITS = {"N": 1852.0 / 3600.0, "K": 1.0 / 3.6, "M": 1.0}
XDR_UNITS = {"D": "deg", "M": "m", "N": "", "P": "percent"}
ENDS = '"\r\n \x00'
SENTENCE = re.compile(r"[$!]([A-Z]{2,4}[A-Z]{3}|P[A-Z0-9]+),")
DATE_AND_TIME = re.compile(
    r"(\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}|\d{1,2}[- ][A-Za-z]{3}[- ]\d{4})[T ,;:_\t]+"
    r"(\d{1,2}:\d{2}:\d{2}(?:\.\d*)?\s*(?:Z|[+-]\d{2}:?\d{2})?)"
)
TIME_OF_DAY = re.compile(r"(?<![\d:-])\d{1,2}:\d{2}:\d{2}(?:\.\d*)?")
DAY_OF_YEAR = re.compile(r"\b(\d{4}):(\d{3}):(\d{2}:\d{2}:\d{2}(?:\.\d+)?)")
TAG_TIME = re.compile(r"\\[^\\]*\bc:(\d{9,16})[^\\]*\\")


class Sentences:
    """The sentences of one file, taken block by block."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.blocks = Blocks()
        self.broken = self.garbled = self.unchecked = 0
        self.unread: Counter[str] = Counter()
        self.no_numbers = 0  # readings of transducers
        self.count = 0
        self.doubtful: Counter[str] = Counter()
        self.datums: Counter[str] = Counter()

    def add(self, lines: Sequence[tuple[int, str]]) -> None:
        """Take lines with a "$" or a "!", each with its place in the file."""
        kept: dict[str, list[tuple[int, str, str]]] = {}
        for place, line in lines:
            found = SENTENCE.search(line)
            if found is None:
                self.garbled += 1
                continue
            name = found[1]
            maker = MAKERS.get(name)
            if maker and not (maker[0] and not line[found.end() :].startswith(f"{maker[0]},")):
                kept.setdefault(name, []).append((place, line[: found.start()], line[found.start() + 1 :].rstrip(ENDS)))
                continue
            if name[-3:] not in FIELDS or name[0] == "P":
                self.unread[name] += 1
                continue
            body = line[found.start() + 1 :].rstrip(ENDS)
            kept.setdefault(name, []).append((place, line[: found.start()], body))
        for name, group in kept.items():
            self._take(name, group)

    def _take(self, name: str, group: list[tuple[int, str, str]]) -> None:
        """Lines of one talker and sentence."""
        whole = _checked([body for _, _, body in group])
        self.broken += int((whole < 0).sum())
        self.unchecked += int((whole == 0).sum())
        group = [line for line, good in zip(group, whole, strict=True) if good >= 0]
        if not group:
            return
        self.count += len(group)
        rows = [body.partition("*")[0].split(",")[1:] for _, _, body in group]
        places = np.array([place for place, _, _ in group], dtype=float)
        if name in MAKERS:
            for what, place in MAKERS[name][1].items():
                values = _numbers([row[place] if place < len(row) else "" for row in rows])
                good = np.isfinite(values)
                self._keep(f"{name}.{what}", "deg", places[good], values[good])
            self._received([prefix for _, prefix, _ in group], places)
            return
        kind, at = name[-3:], PLACES[name[-3:]]

        def column(field: str) -> list[str]:
            return [row[at[field]] if at[field] < len(row) else "" for row in rows]

        if kind in DOUBTS:
            doubtful, words = DOUBTS[kind]
            self.doubtful.update(f"{words[mark]} ({name})" for mark in column(doubtful) if mark in words)
        if kind == "DTM":
            self.datums.update(datum for datum in column("datum") if datum not in WGS84)
        elif kind in MACHINES:
            self._by_machine(name, rows, places, column)
        elif kind == "XDR":
            self._transducers(name, rows, places)
        else:
            marks = ["", *(f".{mark}" for mark in "RT")] if kind == "MWV" else [""]
            for item in FIELDS[kind].split():
                field, unit, *valid = item.split(":")
                unit, _, sign = unit.partition("/")
                values = _numbers(column(field))
                if field in ("lat", "lon"):
                    values = np.floor(values / 100.0) + values % 100.0 / 60.0
                if sign:
                    values *= np.where(np.isin(column(sign), ("S", "W")), -1.0, 1.0)
                if kind == "MWV" and field == "speed":
                    values *= [WIND_UNITS.get(text, np.nan) for text in column("speedu")]
                good = np.isfinite(values)
                if valid:
                    good &= ~np.isin(column(valid[0]), list(INVALID))
                for mark in marks[1:] or marks:
                    own = good & (np.array(column("reference")) == mark[1:]) if mark else good
                    self._keep(f"{name}.{ORDERS.get(field, field)}{mark}", unit, places[own], values[own])
        if kind in TIMED:
            self._anchor(kind, places, column)
        self._received([prefix for _, prefix, _ in group], places)

    def _keep(self, name: str, unit: str, places: Array, values: Array) -> None:
        if len(values):
            self.blocks.add(f"{name}|{unit}|place", places)
            self.blocks.add(f"{name}|{unit}|value", values)

    def _by_machine(self, name: str, rows: list[list[str]], places: Array, column: Callable[[str], list[str]]) -> None:
        """Revolutions and azimuth of each engine, shaft or thruster by its number.

        Odd engines are to starboard, even ones to port; odd thrusters are at the bow, even ones at the stern.
        """
        number, parts = MACHINES[name[-3:]]
        sources = column("source") if name[-3:] == "RPM" else ["T" if number == "thrusternum" else "E"] * len(rows)
        keys = np.array([f"{source}{own}" for source, own in zip(sources, column(number), strict=True)])
        for field, words, mode, unit in parts:
            values = _numbers(column(field))
            modes = np.array(column(mode or "status") if mode or name[-3:] == "RPM" else [""] * len(rows))
            good = np.isfinite(values) & ~np.isin(modes, list(INVALID))
            for key in np.unique(keys):
                for per_cent in (False, True):
                    own = good & (keys == key) & ((modes == "P") == per_cent)
                    self._keep(
                        f"{name}.{words} {_machine(key)}", "percent" if per_cent else unit, places[own], values[own]
                    )

    def _transducers(self, name: str, rows: list[list[str]], places: Array) -> None:
        """Each transducer by its name."""
        found: dict[tuple[str, str], list[tuple[float, float]]] = {}
        for place, row in zip(places.tolist(), rows, strict=True):
            for start in range(0, len(row) - 3, 4):
                _, value, unit, label = row[start : start + 4]
                number = _number(value)
                if number == number:
                    found.setdefault((label, XDR_UNITS.get(unit, "")), []).append((place, number))
                else:
                    self.no_numbers += bool(value)
        for (label, unit), pairs in found.items():
            self._keep(f"{name}.{label}", unit, *np.array(pairs).T)

    def _anchor(self, kind: str, places: Array, column: Callable[[str], list[str]]) -> None:
        """Times of day, with the date where the sentence has it."""
        clock = _numbers(column("time"))
        second = np.floor(clock / 1e4) * 3600.0 + np.floor(clock / 100 % 100) * 60.0 + clock % 100.0
        day = np.full(len(clock), np.nan)
        if kind == "RMC":
            dates = _numbers(column("date"))
            texts = [f"{2000 + d % 100 if d % 100 < 80 else 1900 + d % 100}-{d // 100 % 100:02}-{d // 10000:02}"
                     if d == d else "" for d in (int(x) if x == x else np.nan for x in dates)]  # fmt: skip
            day = read_stamps(texts).day
        elif kind == "ZDA":
            parts = [column(field) for field in ("year", "month", "day")]
            day = read_stamps(["-".join(row) for row in zip(*parts, strict=True)]).day
        self.blocks.add("anchor|place", places)
        self.blocks.add("anchor|second", second)
        self.blocks.add("anchor|day", day)

    def _received(self, prefixes: list[str], places: Array) -> None:
        """Times of reception, which stand before the sentence."""
        if not any(prefixes):
            return
        tags = [TAG_TIME.search(text) for text in prefixes]
        if any(tags):
            values = np.array([float(tag[1]) if tag else np.nan for tag in tags])
        else:
            texts = [_stamp_in(text) for text in prefixes]
            stamps = read_stamps(texts, day_first=not tells_month_first(texts))
            day = np.where(np.isfinite(stamps.day), stamps.day, 0.0)
            values = day * DAY_S + stamps.second
            if not np.isfinite(values).any():
                values = _numbers(texts)
        if np.isfinite(values).any():
            self.blocks.add("received|place", places)
            self.blocks.add("received|time", values)

    def anchors(self) -> tuple[Array, Array, bool]:
        """Satellite times (e,), places (e,) where they are first seen, and whether they have a date."""
        place, second, day = (self.blocks.joined(f"anchor|{part}") for part in ("place", "second", "day"))
        order = np.flatnonzero(np.isfinite(second))[np.argsort(place[np.isfinite(second)], kind="stable")]
        place, second, day = place[order], over_midnight(second[order]), day[order]
        dated = np.isfinite(day)
        if dated.any():
            # days between the clock that counts on and the date, the same throughout but for faults of one of them
            second += DAY_S * float(np.median(day[dated] - np.floor(second[dated] / DAY_S)))
        stamps, at = epochs(second, place)
        return stamps, at, bool(dated.any())

    def received(self) -> tuple[Array, Array]:
        """Times of reception (e,) and their places."""
        place, time_s = self.blocks.joined("received|place"), self.blocks.joined("received|time")
        order = np.argsort(place, kind="stable")
        if len(time_s):
            time_s = read_numbers(time_s, "received at")[0]
        return epochs(time_s[order], place[order])

    def channels(self, stamps: Array, at: Array) -> list[Channel]:
        """All channels, their readings spread over the time from one stamp (e,) to the next."""
        found = []
        for key in [key for key in self.blocks.parts if key.endswith("|value")]:
            name, unit, _ = key.split("|")
            time_s = spread(self.blocks.joined(f"{name}|{unit}|place"), stamps, at)
            known = np.isfinite(time_s)
            if known.any():
                values = self.blocks.joined(key)[known]
                found.append(Channel(name=name, source=self.source, unit=unit, time_s=time_s[known], values=values))
        return found


def _machine(key: str) -> str:
    """Words on an engine, shaft or thruster of a kind and number, as `S1`."""
    number = int(key[1:]) if key[1:].isdecimal() else 0
    if key[0] == "T":
        return f"thruster {number}{' bow' if number % 2 else ' stern'}"
    side = "" if not number else " starboard" if number % 2 else " port"
    return f"{'shaft' if key[0] == 'S' else 'engine'} {number}{side}"


def _stamp_in(prefix: str) -> str:
    """Date and time, the time of day or the number before a sentence, whatever is around it; "" for none."""
    if found := DAY_OF_YEAR.search(prefix):
        day = date(int(found[1]), 1, 1) + timedelta(days=int(found[2]) - 1)
        return f"{day.isoformat()} {found[3]}"
    if found := DATE_AND_TIME.search(prefix):
        return f"{found[1]} {found[2]}"
    found = TIME_OF_DAY.search(prefix) or re.search(r"\d+(?:\.\d+)?", prefix)
    return found[0] if found else ""


def _numbers(texts: Sequence[str]) -> Array:
    """Numbers of cells, nan where there is none."""
    try:
        return np.array([text or "nan" for text in texts], dtype=float)
    except ValueError:
        return np.array([_number(text) for text in texts])


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _checked(bodies: Sequence[str]) -> Array:
    """(k,) 1 where the checksum of a sentence is right, 0 where it has none, -1 where it is wrong."""
    parts = [body.partition("*") for body in bodies]
    texts = [text.encode("latin-1", "replace") or b"\0" for text, _, _ in parts]
    starts = np.cumsum([0, *map(len, texts)])[:-1]
    sums = np.bitwise_xor.reduceat(np.frombuffer(b"".join(texts), dtype=np.uint8), starts)
    said = [_hex(end) if star else None for _, star, end in parts]
    return np.array(
        [0 if value is None else 1 if value == own else -1 for value, own in zip(said, sums.tolist(), strict=True)]
    )


def _hex(text: str) -> int:
    try:
        return int(text[:2], 16)
    except ValueError:
        return -1
