"""What a log holds, whatever its format: channels of numbers, each with its own times; and clocks set right.

Times count from 1970 UTC where the clock is that of a satellite receiver or a computer, else from any origin.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from expdesign.values import Array, closed, seal

Places = NDArray[np.signedinteger[Any]]
"""Indices of rows."""

GNSS, COMPUTER, OWN, NONE = "satellite time", "a computer's clock", "a clock of its own", "no clock"
RESET_S, RESET_STEPS = 2.0, 10.0
"""A step back in time of more than both, in seconds and usual steps, is a clock that began anew."""
STRAY_ROWS = 10
"""Rows at most whose stamps are out of place where those before and after them go on: a bit was lost, a row is old."""
DATED_S = 1e8  # times beyond count from 1970, so that each is right by itself
TIME = " time"  # of rows, as no field is named
RESTART_GAP_S = 60.0  # put between readings before and after a clock began anew [s]
ALIKE = 0.8  # share of channels by which two files are of one logger
OVERLAP_S = 2.0  # by which the next file of a logger may begin before the end of the one before
DAY_S = 86400.0
LARGEST = 1e20  # no reading of any quantity in any unit is as large; times in ns since 1970 are 2e18
MOST_NUMBERS = 60_000_000
"""Readings and times that are kept of all logs of an import; see tests/benchmarks/imported_day.py for the memory."""


class TooManyNumbers(Exception):
    """A log has more readings and times than `MOST_NUMBERS`, which the message says in words."""


def check_size(numbers: int) -> None:
    """Raise TooManyNumbers where that many readings and times are too many."""
    if numbers > MOST_NUMBERS:
        raise TooManyNumbers(f"{MOST_NUMBERS / 1e6:g} million")


@dataclass(frozen=True, kw_only=True, eq=False)
class Channel:
    """Readings of one quantity."""

    name: str  # as the format has it, e.g. "GPRMC.spd"
    source: str  # name of the file
    unit: str = ""  # where the format says it, by the words of `units`
    time_s: Array  # (k,) never decreasing
    values: Array  # (k,) finite

    def __post_init__(self) -> None:
        for own in (self.time_s, self.values):  # taken over, as a day of readings is not to be copied
            if isinstance(own, np.ndarray):
                closed(own)
        seal(self, time_s="k", values="k")

    def __len__(self) -> int:
        return len(self.values)

    def without_readings(self) -> Channel:
        """Its name alone."""
        return replace(self, time_s=np.zeros(0), values=np.zeros(0))

    @property
    def interval_s(self) -> float:
        """Usual time between readings [s]; infinite for fewer than two."""
        steps = np.diff(self.time_s)
        return float(np.median(steps[steps > 0])) if (steps > 0).any() else np.inf


@dataclass(frozen=True, kw_only=True, eq=False)
class Log:
    """All that was read of one file."""

    source: str  # name of the file
    clock: str  # one of GNSS, COMPUTER, OWN, NONE
    channels: tuple[Channel, ...]
    notes: tuple[str, ...] = ()  # what was broken, converted, taken for granted
    unused: tuple[str, ...] = ()  # what stands in the file and is no channel

    @property
    def size(self) -> int:
        """Readings and times that it keeps; channels may share times."""
        arrays = {id(part): len(part) for channel in self.channels for part in (channel.time_s, channel.values)}
        return sum(arrays.values())

    def without_readings(self) -> Log:
        """The names of its channels alone."""
        return replace(self, channels=tuple(channel.without_readings() for channel in self.channels))


@dataclass(frozen=True, kw_only=True)
class Reader:
    """One format."""

    name: str  # for messages
    meaning: str  # what is read of it
    fits: Callable[[Path, bytes], bool]  # whether a file that begins with these bytes is of this format
    read: Callable[[Path, float], Log]  # file, and time between rows where it has no clock (0 for unknown) -> log
    extra: str = ""  # of this package, which has to be installed
    lines: bool = False  # whether it is text, whose lines are read one after another


def epochs(stamps: Array, places: Array) -> tuple[Array, Array]:
    """Stamps (e,) that differ, in order, and the places (e,) in a file where each is first seen; later ones only."""
    later = np.flatnonzero(np.diff(np.maximum.accumulate(stamps), prepend=-np.inf) > 0)
    return stamps[later], places[later]


def spread(places: Array | Places, stamps: Array, at: Array | Places) -> Array:
    """Times (k,) of readings at places of a file from stamps (e,) at other places.

    Readings between two stamps are taken for evenly spaced from the first of them on; those before the first stamp
    are nan.
    """
    if len(stamps) < 2:
        return np.full(len(places), np.nan)
    own = np.searchsorted(at, places, side="right") - 1
    steps = np.append(np.diff(stamps), np.median(np.diff(stamps)))
    usual = float(np.median(steps))
    count = np.bincount(own[own >= 0], minlength=len(stamps))
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    before = int((own < 0).sum())
    rank = np.arange(len(places)) - before - first[np.maximum(own, 0)]
    share = rank / np.maximum(count[np.maximum(own, 0)], 1)
    length = np.minimum(steps, 2.0 * usual)[np.maximum(own, 0)]  # a gap is not filled
    return np.where(own < 0, np.nan, stamps[np.maximum(own, 0)] + share * length)


def set_right(time_s: Array, *, what: str) -> tuple[Places, Array, list[str]]:
    """Times (k,) as a clock has them -> the order (k,) of the rows in time, their times, and notes.

    A clock that began anew goes on after a gap; stamps that repeat, as coarse ones do, are spread evenly up to the
    next; rows that were swapped are sorted, and so are parts with dates that were joined in another order. A few rows
    whose stamps neither those before nor those after them go on from are left out: they would move all that follows.
    """
    notes: list[str] = []
    order = np.flatnonzero(np.isfinite(time_s))
    if len(order) < len(time_s):
        notes.append(f"{what}: {_rows(len(time_s) - len(order))} without a readable time and left out")
    times = time_s[order]
    if len(times) < 3:
        return order, times, notes
    steps = np.diff(times)
    if (steps < 0).sum() > (steps > 0).sum():
        notes.append(f"{what}: the last row comes first; the rows are turned round")
        order, times = order[::-1], times[::-1]
        steps = np.diff(times)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    back_s = max(RESET_S, RESET_STEPS * usual)
    stray = _stray(times, back_s)
    if stray.any():
        notes.append(f"{what}: {_rows(int(stray.sum()))} out of order in time and left out")
        order, times = order[~stray], times[~stray]
    resets = np.flatnonzero(np.diff(times) < -back_s) + 1
    parts = np.split(np.arange(len(times)), resets)
    in_order = sorted(parts, key=lambda part: times[part].min())
    if (
        len(resets)
        and times.min() > DATED_S
        and all(times[one].max() <= times[next_].min() for one, next_ in pairwise(in_order))
    ):
        notes.append(f"{what}: its {len(parts)} parts are not in the order of their dates; they are sorted")
        places = np.concatenate(in_order)
        order, times, resets = order[places], times[places], resets[:0]
    for place in resets:
        times = np.concatenate([times[:place], times[place:] + times[:place].max() + RESTART_GAP_S - times[place]])
    if len(resets):
        notes.append(f"{what}: the clock goes back {_times(len(resets))} and counts as begun anew after a gap there")
    backward = np.diff(times) < 0
    if backward.any():
        notes.append(f"{what}: {_stamps(int(backward.sum()), 'go', 'goes')} back in time; the rows are sorted")
        sorting = np.argsort(times, kind="stable")
        order, times = order[sorting], times[sorting]
    repeated = np.diff(times) == 0
    if repeated.any():
        stamps, at = np.unique(times, return_index=True)
        places = np.arange(len(times))
        if len(stamps) < 2:
            return order[:1], times[:1], [*notes, f"{what}: all rows have one and the same time"]
        words = _stamps(int(repeated.sum()), "repeat", "repeats")
        notes.append(f"{what}: {words}; those rows are spread evenly up to the next stamp")
        times = spread(places, stamps, at)
    return order, times, notes


def _rows(count: int) -> str:
    return f"{count} rows are" if count != 1 else "1 row is"


def _stamps(count: int, many: str, one: str) -> str:
    return f"{count} stamps {many}" if count != 1 else f"1 stamp {one}"


def _times(count: int) -> str:
    return f"{count} times" if count != 1 else "once"


def _stray(times: Array, back_s: float) -> np.ndarray:
    """Which stamps (k,) are out of place: a few that lag behind those around them, or that run ahead of them."""
    stray = np.zeros(len(times), dtype=bool)
    for place in np.flatnonzero(np.diff(times) < -back_s) + 1:
        if stray[place - 1]:
            continue
        later = times[place : place + STRAY_ROWS + 1] >= times[place - 1] - back_s
        earlier = times[max(place - STRAY_ROWS - 1, 0) : place][::-1] <= times[place]
        lagging = int(np.argmax(later)) if later.any() else STRAY_ROWS + 1
        ahead = int(np.argmax(earlier)) if earlier.any() else STRAY_ROWS + 1
        if min(lagging, ahead) > STRAY_ROWS:
            continue
        stray[place : place + lagging] |= lagging <= ahead
        stray[place - ahead : place] |= ahead < lagging
    return stray


def channels_of(
    columns: Mapping[str, Array],
    time_s: Array,
    *,
    source: str,
    units: Mapping[str, str] | None = None,
    what: str = "",
) -> tuple[list[Channel], list[str]]:
    """Channels of a table whose rows (k,) share a clock, and notes on it; readings that are no numbers are left out."""
    order, times, notes = set_right(np.asarray(time_s, dtype=float), what=what or source)
    in_order = len(order) == len(time_s) and bool((np.diff(order) == 1).all())
    found, beyond = [], []
    for name, values in columns.items():
        own = np.asarray(values, dtype=float)
        own = own if in_order else own[order]
        known = np.abs(own) < LARGEST
        beyond += [name] * bool((np.isfinite(own) & ~known).any())
        if known.any():
            unit = (units or {}).get(name, "")
            # most channels of a table have all readings, and then share its times
            times_of, own = (times, own) if known.all() else (times[known], own[known])
            found.append(Channel(name=name, source=source, unit=unit, time_s=times_of, values=own))
    notes += [f"{', '.join(beyond)}: readings beyond {LARGEST:g} are left out"] * bool(beyond)
    return found, notes


@dataclass
class Blocks:
    """Arrays that grow block by block, by name."""

    parts: dict[str, list[Array]] = field(default_factory=dict)
    size: int = 0  # numbers in all of them

    def add(self, name: str, values: Sequence[float] | Array) -> None:
        """Append values of a name; raises TooManyNumbers."""
        self.size += len(values)
        check_size(self.size)
        self.parts.setdefault(name, []).append(np.asarray(values, dtype=float))

    def joined(self, name: str) -> Array:
        """All values of a name; empty where there are none."""
        own = self.parts.get(name)
        if own is not None and len(own) > 1:
            own[:] = [np.concatenate(own)]  # in place of its blocks, so that both are not kept
        return own[0] if own else np.zeros(0)


@dataclass
class Rows:
    """Tables that grow row by row, by name, as messages come; a number that a row lacks is nan."""

    tables: dict[str, dict[str, array[float]]] = field(default_factory=dict)
    size: int = 0  # numbers in all of them

    def add(self, name: str, time_s: float, values: Iterable[tuple[str, float]]) -> None:
        """Append a row to the table of a name; raises TooManyNumbers."""
        table = self.tables.setdefault(name, {TIME: array("d")})
        rows = len(table[TIME])
        for key, value in (*values, (TIME, time_s)):
            column = table.setdefault(key, array("d"))
            missing = rows - len(column)
            self.size += missing + 1
            check_size(self.size)
            column.extend([np.nan] * missing)
            column.append(value)

    def columns(self, name: str) -> tuple[Array, dict[str, Array]]:
        """Times (k,) and columns (k,) of a table."""
        table = self.tables[name]
        rows = len(table[TIME])
        found = {}
        for key, column in table.items():
            column.extend([np.nan] * (rows - len(column)))
            found[key] = np.frombuffer(column)
        return found.pop(TIME), found


def joined(logs: Sequence[Log], apart: Collection[str] = ()) -> list[Log]:
    """Logs, those that one logger wrote one after another as one, under the name of the first of them.

    They have the same channels and clock, and times that do not overlap. Where there is no other log, whose times they
    would have to fit, a clock of its own that began anew in the next file goes on after a gap.

    Args:
        apart: names of files that go on from no other.
    """
    groups: list[list[Log]] = []
    no_other = len({(log.clock, _names(log)) for log in logs}) == 1
    for log in sorted(logs, key=_begin_s):
        group = None if log.source in apart else next((one for one in groups if _goes_on(one[-1], log, no_other)), None)
        if group is None:
            groups.append([log])
        else:
            group.append(_after(group[-1], log))
    place = {log.source: number for number, log in enumerate(logs)}
    return sorted((_as_one(group) for group in groups), key=lambda log: place[log.source])


def _names(log: Log) -> frozenset[tuple[str, str]]:
    return frozenset((channel.name, channel.unit) for channel in log.channels)


def _begin_s(log: Log) -> float:
    return min((float(channel.time_s[0]) for channel in log.channels), default=0.0)


def _end_s(log: Log) -> float:
    return max(float(channel.time_s[-1]) for channel in log.channels)


def _goes_on(log: Log, later: Log, no_other: bool) -> bool:
    names, others = _names(log), _names(later)
    if log.clock != later.clock or log.clock == NONE or len(names & others) < ALIKE * max(len(names), len(others), 1):
        return False
    return _begin_s(later) > _end_s(log) - OVERLAP_S or (log.clock == OWN and no_other)


def _after(log: Log, later: Log) -> Log:
    """The next log, on the clock of the one before, with a note on what it is."""
    begin_s, end_s = _begin_s(later), _end_s(log)
    anew = begin_s <= end_s - OVERLAP_S
    how = "its clock began anew, so that it counts after a gap" if anew else "its times come after"
    note = f"has the same channels and is read as what comes next: {how}"
    shift_s = end_s + RESTART_GAP_S - begin_s if anew else 0.0
    channels = later.channels
    if anew:
        channels = tuple(replace(channel, time_s=channel.time_s + shift_s) for channel in channels)
    return replace(later, channels=channels, notes=(note, *later.notes))


def _as_one(group: Sequence[Log]) -> Log:
    """Logs one after another as one."""
    first, *others = group
    if not others:
        return first
    parts: dict[str, list[Channel]] = {}
    for log in group:
        for channel in log.channels:
            parts.setdefault(channel.name, []).append(channel)
    return replace(
        first,
        channels=tuple(_in_a_row(own, first.source) for own in parts.values()),
        notes=(*first.notes, *_shared_notes(others, first.notes)),
        unused=tuple(dict.fromkeys(text for log in group for text in log.unused)),
    )


def _shared_notes(logs: Sequence[Log], said: Sequence[str]) -> Iterator[str]:
    """Notes of logs that are not said yet, each once, behind the names of the logs that have it."""
    names: dict[str, list[str]] = {}
    for log in logs:
        for note in log.notes:
            if note not in said:
                names.setdefault(note, []).append(log.source)
    for note, (name, *more) in names.items():
        yield f"{name}{f' and {len(more)} more' if more else ''}: {note}"


def _in_a_row(parts: Sequence[Channel], source: str) -> Channel:
    times, values = (np.concatenate(own) for own in ([one.time_s for one in parts], [one.values for one in parts]))
    order = np.argsort(times, kind="stable")
    return replace(parts[0], source=source, time_s=times[order], values=values[order])
