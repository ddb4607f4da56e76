"""Signal K: deltas, one JSON object a line, also behind the time and the provider that a server writes before them.

Paths are those of the specification of Signal K 1.7, whose quantities are in SI units.
"""

from __future__ import annotations

import json
import math
import re
from array import array
from collections import Counter, defaultdict
from collections.abc import Iterator
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from expdesign.errors import FileError
from expdesign.importing.channels import COMPUTER, Channel, Log, check_size, set_right
from expdesign.importing.units import counted
from expdesign.values import Array

PREFIX = re.compile(r"(\d{12,14});[^;]*;")
"""Milliseconds since 1970 and the provider, in the log of a server."""
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
