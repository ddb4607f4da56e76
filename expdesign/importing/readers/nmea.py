"""NMEA 0183 sentences, by the fields that pynmeagps knows; also behind a time, in a TAG block or in OpenCPN's records.

Which field stands where is pynmeagps's knowledge. Its reader takes 70 us a line, which is five minutes for a day of
five sentences at 10 Hz; here the lines of a block are taken apart column by column.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from datetime import date, timedelta
from itertools import compress
from typing import Any

import numpy as np
from pynmeagps.nmeatypes_get import NMEA_PAYLOADS_GET

from expdesign.importing.channels import DAY_S, Blocks, Channel, epochs, spread
from expdesign.importing.times import over_midnight, read_numbers, read_stamps, tells_month_first
from expdesign.values import Array, closed

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
OWN_SHIP = {"lat": ("lat", "deg", 91.0), "lon": ("lon", "deg", 181.0), "spd": ("speed", "kn", 102.3),
            "cog": ("course", "deg", 360.0), "headt": ("heading", "deg", 511.0)}  # fmt: skip
"""Reading -> field of pyais, unit, and what stands for none (ITU-R M.1371)."""
WGS84 = ("", "W84", "P90", "999")
PLACES = {name: {field: place for place, field in enumerate(NMEA_PAYLOADS_GET[name])} for name in FIELDS}
INVALID = {"V", "0", "N", "NN", "NNN", "NNNN"}  # marks of a reading that is not valid
TIMED = ("RMC", "GGA", "GNS", "GLL", "ZDA")
WIND_UNITS = {"N": 1852.0 / 3600.0, "K": 1.0 / 3.6, "M": 1.0}
XDR_UNITS = {"D": "deg", "M": "m", "N": "", "P": "percent"}
ENDS = '"\r\n \x00'
TWO_DIGITS = {form.format(number): number for number in range(256) for form in ("{:02X}", "{:02x}")}  # of a checksum
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
        self.known: set[str] = set()  # talkers and sentences
        self.broken = self.garbled = self.unchecked = 0
        self.unread: Counter[str] = Counter()
        self.no_numbers = 0  # readings of transducers
        self.count = 0
        self.doubtful: Counter[str] = Counter()
        self.datums: Counter[str] = Counter()

    def add(self, lines: Sequence[tuple[int, str]]) -> None:
        """Take lines with a "$" or a "!", each with its place in the file."""
        kept: dict[str, list[Any]] = {}
        for place, line in lines:
            start = 0 if line[0] in "$!" else line.find("$")
            name = line[start + 1 : line.find(",", start)]
            if name not in self.known:
                found = SENTENCE.search(line)
                if found is None:
                    self.garbled += 1
                    continue
                start, name = found.start(), found[1]
                self.known.add(name)
            body = line[start + 1 :].rstrip(ENDS)
            if name.endswith("VDO"):
                self._own_ship(name, place, f"!{body}", line[:start])
                continue
            maker = MAKERS.get(name)
            read = name[0] != "P" and name[-3:] in FIELDS
            if (maker and maker[0] and not body.startswith(f"{name},{maker[0]},")) or not (maker or read):
                self.unread[name] += 1
                continue
            own = kept.setdefault(name, [])
            own += (
                place,
                line[:start],
                *body.partition("*"),
            )  # in one list: a million small ones cost more than all else
        for name, own in kept.items():
            self._take(name, *(own[part::5] for part in range(5)))

    def _own_ship(self, name: str, place: int, line: str, prefix: str) -> None:
        """Position, course, speed and heading that the ship's own AIS sends, by pyais."""
        try:
            import pyais
        except ModuleNotFoundError:
            self.unread[f"{name}, which needs pyais: pip install 'expdesign[logs]'"] += 1
            return
        text, star, end = line[1:].partition("*")
        if not star or not _checked([text], [star], [end])[0]:
            self.broken += 1
            return
        try:
            message: dict[str, Any] = pyais.decode(line).asdict()
        except pyais.exceptions.AISBaseException:  # of several sentences, which has no position, or unknown
            message = {"msg_type": "no position"}
        if "lat" not in message or not math.isfinite(float(message["lat"])) or abs(message["lat"]) > 90.0:
            self.unread[f"{name} of type {message.get('msg_type')}"] += 1
            return
        self.count += 1
        at = np.array([place], dtype=float)
        for what, (field, unit, none) in OWN_SHIP.items():
            value = float(message.get(field, none))
            self._keep(f"{name}.{what}", unit, at, np.array([value]), np.array([value < none]))
        self._received([prefix], at)

    def _take(
        self, name: str, numbers: list[int], prefixes: list[str], texts: list[str], stars: list[str], ends: list[str]
    ) -> None:
        """Lines of one talker and sentence: places, what is before it, the sentence, its star and its checksum."""
        good = _checked(texts, stars, ends)
        if 2 * (checked := sum(map(bool, stars))) > len(stars) > checked:  # others have one: these are cut
            good = [own and bool(star) for own, star in zip(good, stars, strict=True)]
        if not all(good):
            self.broken += len(good) - sum(good)
            numbers, prefixes = list(compress(numbers, good)), list(compress(prefixes, good))
            texts, stars = list(compress(texts, good)), list(compress(stars, good))
        if not texts:
            return
        self.count += len(texts)
        self.unchecked += len(texts) - sum(map(len, stars))
        commas = [text.count(",") for text in texts]
        most = max(commas)
        cells = ",".join([text + "," * (most - own) for text, own in zip(texts, commas, strict=True)]).split(",")
        columns = [cells[place :: most + 1] for place in range(1, most + 1)]
        places = closed(np.array(numbers, dtype=float))
        if name in MAKERS:
            for what, place in MAKERS[name][1].items():
                if place < len(columns):
                    values = _numbers(columns[place])
                    self._keep(f"{name}.{what}", "deg", places, values, np.isfinite(values))
            self._received(prefixes, places)
            return
        kind, at = name[-3:], PLACES[name[-3:]]

        def column(field: str) -> Sequence[str]:
            return columns[at[field]] if at[field] < len(columns) else [""] * len(places)

        if kind in DOUBTS:
            doubtful, words = DOUBTS[kind]
            marks = Counter(column(doubtful))
            self.doubtful.update({f"{words[mark]} ({name})": marks[mark] for mark in words if marks[mark]})
        if kind == "DTM":
            self.datums.update(datum for datum in column("datum") if datum not in WGS84)
        elif kind in MACHINES:
            self._by_machine(name, places, column)
        elif kind == "XDR":
            self._transducers(name, list(zip(*columns, strict=True)), places)
        else:
            self._fields(name, places, column)
        if kind in TIMED:
            self._anchor(kind, places, column)
        self._received(prefixes, places)

    def _fields(self, name: str, places: Array, column: Callable[[str], Sequence[str]]) -> None:
        """Readings that stand in fields of their own."""
        kind = name[-3:]
        marks = ["R", "T"] if kind == "MWV" else [""]
        valid_by: dict[str, np.ndarray] = {}
        for item in FIELDS[kind].split():
            field, unit, *valid = item.split(":")
            unit, _, sign = unit.partition("/")
            values = _numbers(column(field))
            if field in ("lat", "lon"):
                values = np.floor(values / 100.0) + values % 100.0 / 60.0
            if sign:
                values *= np.where(_among(column(sign), ("S", "W")), -1.0, 1.0)
            if kind == "MWV" and field == "speed":
                values *= [WIND_UNITS.get(text, np.nan) for text in column("speedu")]
            good = np.isfinite(values)
            if valid and valid[0] not in valid_by:
                valid_by[valid[0]] = ~_among(column(valid[0]), INVALID)
            good &= valid_by[valid[0]] if valid else True
            for mark in marks:
                own = good & _among(column("reference"), (mark,)) if mark else good
                self._keep(f"{name}.{ORDERS.get(field, field)}{f'.{mark}' * bool(mark)}", unit, places, values, own)

    def _keep(self, name: str, unit: str, places: Array, values: Array, good: np.ndarray) -> None:
        """Readings where they are good; places of a sentence whose readings all are, are kept once."""
        if good.any():
            whole = good.all()
            self.blocks.add(f"{name}|{unit}|place", places if whole else places[good])
            self.blocks.add(f"{name}|{unit}|value", values if whole else values[good])

    def _by_machine(self, name: str, places: Array, column: Callable[[str], Sequence[str]]) -> None:
        """Revolutions and azimuth of each engine, shaft or thruster by its number.

        Odd engines are to starboard, even ones to port; odd thrusters are at the bow, even ones at the stern.
        """
        number, parts = MACHINES[name[-3:]]
        numbers = column(number)
        kind = "T" if number == "thrusternum" else "E"
        sources = column("source") if name[-3:] == "RPM" else [kind] * len(places)
        keys = list(zip(sources, numbers, strict=True))
        for field, words, mode, unit in parts:
            values = _numbers(column(field))
            modes = column(mode or "status") if mode or name[-3:] == "RPM" else [""] * len(places)
            good, percent = np.isfinite(values) & ~_among(modes, INVALID), _among(modes, ("P",))
            for source, own in sorted(set(keys)):
                here = good & _among(keys, ((source, own),))
                for per_cent in (False, True):
                    self._keep(
                        f"{name}.{words} {_machine(source + own)}", "percent" if per_cent else unit, places, values,
                        here & (percent == per_cent),
                    )  # fmt: skip

    def _transducers(self, name: str, rows: Sequence[Sequence[str]], places: Array) -> None:
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
            at, values = np.array(pairs).T
            self._keep(f"{name}.{label}", unit, at, values, np.ones(len(at), dtype=bool))

    def _anchor(self, kind: str, places: Array, column: Callable[[str], Sequence[str]]) -> None:
        """Times of day, with the date where the sentence has it."""
        clock = _numbers(column("time"))
        second = np.floor(clock / 1e4) * 3600.0 + np.floor(clock / 100 % 100) * 60.0 + clock % 100.0
        day = np.full(len(clock), np.nan)
        if kind == "RMC":
            texts = column("date")
            days = dict(zip(set(texts), read_stamps([_iso(text) for text in set(texts)]).day.tolist(), strict=True))
            day = np.array([days[text] for text in texts])
        elif kind == "ZDA":
            parts = [column(field) for field in ("year", "month", "day")]
            day = read_stamps(["-".join(row) for row in zip(*parts, strict=True)]).day
        self.blocks.add("anchor|place", places)
        self.blocks.add("anchor|second", second)
        self.blocks.add("anchor|day", day)

    def _received(self, prefixes: Sequence[str], places: Array) -> None:
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
        found: list[Channel] = []
        times: dict[tuple[int, ...], Array] = {}  # by the blocks of places, which fields of a sentence share
        for key in [key for key in self.blocks.parts if key.endswith("|value")]:
            name, unit, _ = key.split("|")
            blocks = self.blocks.parts[f"{name}|{unit}|place"]
            same = tuple(map(id, blocks))
            if same not in times:
                times[same] = closed(spread(np.concatenate(blocks), stamps, at))
            time_s, values = times[same], self.blocks.joined(key)
            known = np.isfinite(time_s)
            if not known.all():
                time_s, values = time_s[known], values[known]
            if len(values):
                found.append(Channel(name=name, source=self.source, unit=unit, time_s=time_s, values=values))
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


def _iso(text: str) -> str:
    """A date of RMC, ddmmyy, as year, month and day; "" for none."""
    if not text.isdecimal():
        return ""
    date = int(text)
    year = date % 100 + (2000 if date % 100 < 80 else 1900)
    return f"{year}-{date // 100 % 100:02}-{date // 10000:02}"


def _among(texts: Sequence[object], words: Collection[object]) -> np.ndarray:
    """(k,) whether a cell is one of these."""
    own = set(texts).intersection(words)
    if not own:
        return np.zeros(len(texts), dtype=bool)
    return np.fromiter((text in own for text in texts), dtype=bool, count=len(texts))


def _numbers(texts: Sequence[str]) -> Array:
    """Numbers of cells, nan where there is none."""
    try:
        return np.fromiter(map(float, texts), dtype=float, count=len(texts))
    except ValueError:
        return np.array([_number(text) if text else np.nan for text in texts])


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _checked(texts: Sequence[str], stars: Sequence[str], ends: Sequence[str]) -> list[bool]:
    """Whether the checksum of each sentence is right, or it has none."""
    starts = np.cumsum([0, *map(len, texts)])[:-1]
    signs = "".join(texts).encode("latin-1", "replace")  # one for each letter
    sums = np.bitwise_xor.reduceat(np.frombuffer(signs, dtype=np.uint8), starts).tolist()
    if all(stars) and list(map(TWO_DIGITS.get, ends)) == sums:
        return [True] * len(sums)
    return [not star or _hex(end) == own for star, end, own in zip(stars, ends, sums, strict=True)]


def _hex(text: str) -> int:
    try:
        return int(text[:2], 16)
    except ValueError:
        return -1
