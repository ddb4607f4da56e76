"""NMEA 2000 as text, by nmea2000, and the JSON of canboat's analyzer.

Read are plain and fast lines of canboat and Actisense, frames of Yacht Devices' gateways, and candump. Which bits mean
what is the library's knowledge; which of the quantities are read stands in `MESSAGES`. Where several devices send one
quantity, that with the most readings is taken, and the others are told.
"""

from __future__ import annotations

import json
import logging
import re
from array import array
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from expdesign.errors import FileError
from expdesign.importing.channels import COMPUTER, DAY_S, OWN, Channel, Log, check_size, set_right
from expdesign.importing.times import over_midnight, read_stamps
from expdesign.importing.units import counted

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
DEGREES = {"rad": "deg", "radps": "degps"}
"""Units in JSON of canboat that is not of strict SI."""
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
LOOKED_AT = 4096  # bytes in which a form is told
SHORT = 8  # bytes of a frame; longer lines are whole messages
INSTANCES = {1: " starboard"}


def is_n2k(path: Path, head: bytes) -> bool:
    """Whether a file is NMEA 2000 as text."""
    return b"\0" not in head and _form(path) != ""


def _form(path: Path) -> str:
    if path.is_dir():
        return ""
    with path.open(encoding="latin-1") as file:
        lines = [line for line in file.read(LOOKED_AT).splitlines() if line.strip() and line[0] != "#"][:3]
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
        time_s = _seconds(begin[1], begin[2]) if own.groups > 1 else float(begin[1])
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
            yield _seconds(date, clock.rstrip("Z")), (int(own["pgn"]), int(own["src"]), fields, units)
        except (ValueError, KeyError, TypeError, AttributeError):
            yield None, None


@cache
def _day_s(date: str) -> float:
    return float(read_stamps([date]).day[0]) * DAY_S


def _seconds(date: str, clock: str) -> float:
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
        channels = [_renamed(channel, "Engine.rpm", "Engine port.rpm") for channel in channels]
    unused = tuple(f"{name} ({count})" for name, count in unread.most_common())
    return Log(source=path.name, clock=clock, channels=tuple(channels), notes=tuple(notes), unused=unused)


def _renamed(channel: Channel, old: str, new: str) -> Channel:
    return replace(channel, name=new) if channel.name == old else channel
