"""NMEA 2000 and Signal K.

NMEA 2000 is read as text, by nmea2000, and from the JSON of canboat's analyzer: plain and fast lines of canboat and
Actisense, frames of Yacht Devices' gateways, and candump. Which bits mean what is the library's knowledge; which of the
quantities are read stands in `MESSAGES`. Where several devices send one quantity, that with the most readings is taken,
and the others are told.

Signal K is read as deltas, one JSON object a line, also behind the time and the provider that a server writes before
them. Paths are those of the specification of Signal K 1.7, whose quantities are in SI units.
"""

from __future__ import annotations

import json
import logging
import math
import re
from array import array
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from expdesign.errors import FileError
from expdesign.importing.channels import COMPUTER, DAY_S, OWN, Channel, Log, check_size, set_right
from expdesign.importing.mapping import counted
from expdesign.importing.times import over_midnight, read_stamps
from expdesign.values import Array

PREFIX = re.compile(r"(\d{12,14});[^;]*;")  # milliseconds since 1970 and the provider, in the log of a server
UNITS = (
    (r"position\.(latitude|longitude)$", "deg"), (r"(speed\w*|velocity\w*)$", "mps"), (r"rateOfTurn$", "radps"),
    (r"revolutions$", "rps"), (r"(heading|course|bearing|angle|direction|variation)\w*$|rudderAngle|attitude", "rad"),
    (r"depth|below|draft|length|beam", "m"), (r"(ratio|load|throttle|power)$", "share"),
)  # fmt: skip
"""End of a path -> unit."""
LOOKED_AT = 20  # lines


def is_signalk(path: Path, head: bytes) -> bool:
    """Whether a file is one of these."""
    if path.is_dir() or b"\0" in head:
        return False
    with path.open(encoding="utf-8", errors="replace") as file:
        lines = [PREFIX.sub("", line, count=1) for line in islice(file, LOOKED_AT)]
    return any(line.startswith("{") and '"updates"' in line for line in lines)


def read_signalk(path: Path, sample_time_s: float) -> Log:
    """The numbers of all paths of the vessel herself, each of the source that gives most.

    Raises:
        FileError: no delta of her has a time.
    """
    found: defaultdict[str, defaultdict[tuple[str, str], tuple[array[float], array[float]]]] = defaultdict(
        lambda: defaultdict(lambda: (array("d"), array("d")))
    )
    own, broken, untimed, size = "", 0, 0, 0
    others: Counter[str] = Counter()
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            stamp = PREFIX.match(line)
            text = line[stamp.end() :] if stamp else line
            if not text.startswith("{"):
                others["lines that are no delta"] += bool(text.strip())
                continue
            try:
                delta = json.loads(text)
            except ValueError:
                broken += 1
                continue
            own = _text(delta.get("self")) or own
            vessel = _text(delta.get("context")) or "vessels.self"
            for update in filter(_is_object, _list(delta.get("updates"))):
                time_s = _seconds(update.get("timestamp"), float(stamp[1]) / 1e3 if stamp else np.nan)
                source = _text(update.get("$source")) or json.dumps(update.get("source"), sort_keys=True)
                for name, value in _numbers(update):
                    untimed += time_s != time_s
                    times, values = found[vessel][name, source]
                    times.append(time_s)
                    values.append(value)
                    size += 2
                    check_size(size)
    herself = _herself(found, own)
    channels, notes = _channels(path.name, found[herself])
    if not channels:
        raise FileError(path, "", "is Signal K without a number and its time, expected deltas with timestamps")
    notes = [
        *[f"left out {counted(broken, 'line')} of broken JSON"] * bool(broken),
        *[f"left out {counted(untimed, 'number')} without a time"] * bool(untimed),
        *notes,
    ]
    others |= {f"values of {name}": sum(len(t) for t, _ in own.values()) for name, own in found.items()
               if name != herself}  # fmt: skip
    unused = tuple(f"{name} ({count})" for name, count in others.items() if count)
    return Log(source=path.name, clock=COMPUTER, channels=tuple(channels), notes=tuple(notes), unused=unused)


def _herself(found: dict[str, Any], own: str) -> str:
    """The vessel that logs: as the server says, else the one with most numbers; others came by AIS."""
    known = [name for name in ("vessels.self", own, f"vessels.{own}") if name in found]
    if len(known) > 1:  # under both names
        for name in known[1:]:
            for key, (times, values) in found.pop(name).items():
                found[known[0]][key][0].extend(times)
                found[known[0]][key][1].extend(values)
    return known[0] if known else max(found, key=lambda name: sum(len(t) for t, _ in found[name].values()), default="")


def _channels(file: str, series: dict[tuple[str, str], tuple[array[float], array[float]]]) -> tuple[
    list[Channel], list[str]
]:  # fmt: skip
    channels, notes = [], []
    by_name: defaultdict[str, dict[str, tuple[Array, Array]]] = defaultdict(dict)
    for (name, source), (times, values) in series.items():
        by_name[name][source] = np.array(times), np.array(values)
    for name, sources in by_name.items():
        best = max(sources, key=lambda source: len(sources[source][0]))
        if len(sources) > 1:
            rest = ", ".join(source for source in sources if source != best)
            notes.append(f"{name}: of several sources {best} is read, which gives most; {rest[:120]} not")
        order, time_s, more = set_right(sources[best][0], what=name)
        readings = sources[best][1][order]
        if len(readings):
            unit = next((unit for pattern, unit in UNITS if re.search(pattern, name, re.IGNORECASE)), "")
            channels.append(Channel(name=name, source=file, unit=unit, time_s=time_s, values=readings))
            notes += more
    return channels, notes


def _numbers(update: dict[str, Any]) -> Iterator[tuple[str, float]]:
    """Paths and numbers of an update; members of an object by their names."""
    for item in filter(_is_object, _list(update.get("values"))):
        name, value = _text(item.get("path")), item.get("value")
        members = value.items() if isinstance(value, dict) else [("", value)]
        for key, own in members:
            if isinstance(own, (int, float)) and not isinstance(own, bool) and math.isfinite(own):
                yield ".".join(part for part in (name, str(key)) if part), float(own)


def _seconds(text: object, otherwise: float) -> float:
    """Of a time as text, since 1970."""
    try:
        own = datetime.fromisoformat(_text(text))
    except ValueError:
        return otherwise
    return (own if own.tzinfo else own.replace(tzinfo=UTC)).timestamp()


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""


def _list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _is_object(value: object) -> bool:
    return isinstance(value, dict)


MESSAGES: dict[int, tuple[str, dict[str, tuple[str, str]]]] = {
    127237: ("Rudder", {"commandedrudderangle": ("order", "rad")}),
    127245: ("Rudder", {"position": ("feedback", "rad"), "angleorder": ("order", "rad")}),
    127250: ("Vessel Heading", {"heading": ("heading", "rad"), "variation": ("variation", "rad")}),
    127251: ("Rate of Turn", {"rate": ("rate of turn", "radps")}),
    127257: ("Attitude", {"roll": ("roll", "rad")}),
    127258: ("Magnetic Variation", {"variation": ("variation", "rad")}),
    127488: ("Engine", {"speed": ("rpm", "rpm")}),
    128259: ("Log", {"speedwaterreferenced": ("speed through water", "mps")}),
    128267: ("Sounder", {"depth": ("depth", "m")}),
    129025: ("Position", {"latitude": ("latitude", "deg"), "longitude": ("longitude", "deg")}),
    129026: ("Over ground", {"cog": ("course over ground", "rad"), "sog": ("speed over ground", "mps")}),
    129029: ("GNSS", {"latitude": ("latitude", "deg"), "longitude": ("longitude", "deg")}),
    130306: ("Apparent wind", {"windspeed": ("wind speed", "mps"), "windangle": ("wind angle", "rad")}),
}
"""Number of a message -> its name here, and field -> name and unit of a channel."""
NEEDED = {129026: ("cogreference", "True"), 130306: ("reference", "Apparent")}
"""Message -> field and text that it must have to be used."""
DEGREES = {"rad": "deg", "radps": "degps"}  # units in JSON of canboat that is not of strict SI
FORMS = {
    "plain": re.compile(r"(\d{4}-\d\d-\d\d)[T-](\d\d:\d\d:\d\d\.?\d*)Z?,\d+,\d+,\d+,\d+,(\d+),"),
    "candump": re.compile(r"\((\d+\.\d+)\)\s+\S+\s+[0-9A-Fa-f]{8}#"),
    "frames": re.compile(r"()(\d\d:\d\d:\d\d\.\d+)\s+[RT]\s+[0-9A-Fa-f]{8}\s"),
    "ascii": re.compile(r"()A(\d{6}\.\d+)\s+[0-9A-Fa-f]{5}\s+[0-9A-Fa-f]{5,6}\s"),
    "json": re.compile(r'\{"(?:timestamp|version)":'),
    "no times": re.compile(
        r"(?:<0x[0-9A-Fa-f]+>|\S*can\d+\s+[0-9A-Fa-f]{8})\s+\[\d+\]|[0-9A-Fa-f]{8}(?: [0-9A-Fa-f]{2}){2,8}$"
    ),
}  # fmt: skip
"""Form of a line -> how it begins, with date and time of day, or seconds, as groups."""
Series = tuple["array[float]", "array[float]"]
"""Times and values."""
Units = Mapping[str, str]
LOOKED_AT_BYTES = 4096  # bytes in which a form is told
SHORT = 8  # bytes of a frame; longer lines are whole messages
INSTANCES = {1: " starboard"}


def is_n2k(path: Path, head: bytes) -> bool:
    """Whether a file is NMEA 2000 as text."""
    return b"\0" not in head and _form(path) != ""


def _form(path: Path) -> str:
    if path.is_dir():
        return ""
    with path.open(encoding="latin-1") as file:
        lines = [line for line in file.read(LOOKED_AT_BYTES).splitlines() if line.strip() and line[0] != "#"][:3]
    return next((form for form, own in FORMS.items() if lines and any(map(own.match, lines))), "")


def read_n2k(path: Path, sample_time_s: float) -> Log:
    """The quantities of `MESSAGES`.

    Raises:
        FileError: the form has no times, or no message that is read is in it.
    """
    form = _form(path)
    if form == "no times":
        raise FileError(path, "", "is NMEA 2000 without times, expected a record with them, as by candump -L")
    found: defaultdict[tuple[str, str, int], Series] = defaultdict(lambda: (array("d"), array("d")))
    unread: Counter[str] = Counter()
    broken = size = 0
    for time_s, message in _messages(path, form):
        if message is None or time_s is None:
            broken += 1
            continue
        number, source, fields, units = message
        if number not in MESSAGES:
            unread[f"PGN {number}"] += 1
            continue
        key, text = NEEDED.get(number, ("", ""))
        if key and fields.get(key) != text:
            unread[f"PGN {number} {fields.get(key)}"] += 1
            continue
        name, wanted = MESSAGES[number]
        where = _where(number, fields)
        for field, (what, unit) in wanted.items():
            value = fields.get(field)
            if isinstance(value, (int, float)):
                what = f"{fields.get('reference', '')} {what}".strip().lower() if what == "heading" else what
                times, values = found[f"{name}{where}.{what}", units.get(unit, unit), source]
                times.append(time_s)
                values.append(float(value))
                size += 2
                check_size(size)
    if not found:
        raise FileError(path, "", "holds NMEA 2000 without rudder, heading, turn, engine, position or speed")
    return _log(path, found, unread, broken)


def _messages(path: Path, form: str) -> Iterator[tuple[float | None, tuple[int, int, dict[str, Any], Units] | None]]:
    """(seconds, (number, device, field -> value, its own words for units)) of each message; None where it is broken."""
    with path.open(encoding="latin-1") as file:
        lines = (line.strip() for line in file)
        lines = (line for line in lines if line and line[0] != "#")
        yield from _of_json(lines) if form == "json" else _of_lines(lines, path, FORMS[form])


def _of_lines(lines: Iterator[str], path: Path, own: re.Pattern[str]) -> Iterator[Any]:
    from nmea2000.decoder import NMEA2000Decoder

    logging.getLogger("nmea2000").setLevel(logging.CRITICAL)  # it writes to the terminal
    decoder: Any = NMEA2000Decoder(already_combined=_combined(path, own))
    for line in lines:
        begin = own.match(line)
        if begin is None:
            yield None, None
            continue
        time_s = _utc_s(begin[1], begin[2]) if own.groups > 1 else float(begin[1])
        try:
            message = decoder.decode(line)
        except Exception:  # of broken lines it raises anything
            yield None, None
            continue
        if message is not None:
            fields = {
                field.id.lower(): field.raw_value if field.id == "instance" else field.value for field in message.fields
            }
            yield time_s, (message.PGN, message.source, fields, {})


def _of_json(lines: Iterator[str]) -> Iterator[Any]:
    units: Units = DEGREES
    for line in lines:
        try:
            own = json.loads(line)
            if "version" in own and "pgn" not in own:
                units = {} if own.get("units") == "si" else DEGREES
                continue
            date, _, clock = own["timestamp"].replace("T", "-").rpartition("-")
            fields = {
                key.replace(" ", "").lower(): value.get("name", value.get("value"))
                if isinstance(value, dict)
                else value
                for key, value in own["fields"].items()
            }
            yield _utc_s(date, clock.rstrip("Z")), (int(own["pgn"]), int(own["src"]), fields, units)
        except (ValueError, KeyError, TypeError, AttributeError):
            yield None, None


@cache
def _day_s(date: str) -> float:
    return float(read_stamps([date]).day[0]) * DAY_S


def _utc_s(date: str, clock: str) -> float:
    """Of a date, "" for none, and hh:mm:ss or hhmmss."""
    digits = clock.replace(":", "")
    second = 3600.0 * int(digits[:2]) + 60.0 * int(digits[2:4]) + float(digits[4:])
    return (_day_s(date) if date else 0.0) + second


def _combined(path: Path, own: re.Pattern[str]) -> bool:
    """Whether lines are whole messages, some of them longer than a frame."""
    if own is not FORMS["plain"]:
        return False
    with path.open(encoding="latin-1") as file:
        sizes = [int(begin[3]) for line, _ in zip(file, range(2000), strict=False) if (begin := own.match(line))]
    return max(sizes, default=0) > SHORT


def _where(number: int, fields: Mapping[str, Any]) -> str:
    """Which of several rudders or engines: of two engines the first is to port."""
    own = fields.get("instance")
    if isinstance(own, str):  # of engines, in words
        own = 1 if "Starboard" in own and "Port" not in own else 0
    if not isinstance(own, (int, float)) or own <= 0 or own > 8:
        return ""
    return INSTANCES.get(int(own), f" {int(own)}") if number == 127488 else f" {int(own)}"


def _log(path: Path, found: Mapping[tuple[str, str, int], Series], unread: Counter[str], broken: int) -> Log:
    best: dict[str, tuple[str, int]] = {}
    for (name, unit, source), (_, values) in found.items():
        if name not in best or len(values) > len(found[name, *best[name]][1]):
            best[name] = unit, source
    notes = [f"left out {counted(broken, 'line')} that cannot be read"] if broken else []
    channels: list[Channel] = []
    clock = COMPUTER
    for (name, unit, source), (stamps, values) in found.items():
        if best[name] != (unit, source):
            unread[f"{name} of device {source}"] += len(values)
            continue
        times = np.array(stamps)
        if times[0] < DAY_S:  # without a date
            times, clock = over_midnight(times), OWN
        order, own, more = set_right(times, what=name)
        notes += more
        numbers = np.array(values)[order]
        channels.append(Channel(name=name, source=path.name, unit=unit, time_s=own, values=numbers))
    if "Engine starboard.rpm" in best:
        channels = [replace(one, name="Engine port.rpm") if one.name == "Engine.rpm" else one for one in channels]
    unused = tuple(f"{name} ({count})" for name, count in unread.most_common())
    return Log(source=path.name, clock=clock, channels=tuple(channels), notes=tuple(notes), unused=unused)
