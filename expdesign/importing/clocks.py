"""Which columns of a table are its clock, and the times that they give."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from expdesign.importing.channels import COMPUTER, DAY_S, GNSS, NONE, OWN
from expdesign.importing.times import TIME_NAME, Stamps, over_midnight, read_numbers, read_stamps, utc_of_gps, zone_of
from expdesign.importing.units import split_unit, words
from expdesign.values import Array

DATE_NUMBERS = (19700101, 21001231)
"""Least and greatest number that is a year, month and day run together."""
UTC, LOCAL = r"\b(utc|gps|gnss|gmt|zulu)\b", r"\blocal\b"
PARTS = ("year", "month", "day", "hour", "minute", "second")
PART_WORDS = {"yyyy": "year", "yr": "year", "mon": "month", "mm": "month", "dd": "day", "hh": "hour", "hr": "hour",
              "hours": "hour", "min": "minute", "mi": "minute", "minutes": "minute", "ss": "second", "sec": "second",
              "seconds": "second"}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Clock:
    """The clock of a table."""

    taken: frozenset[str]  # columns that it is made of
    times: Array | None  # (k,), None where there is no clock
    kind: str  # one of COMPUTER, GNSS, OWN, NONE
    how: str
    name: str = "time"


def clock_of(numbers: Mapping[str, Array], stamps: Mapping[str, Stamps], units: Mapping[str, str]) -> Clock:
    """The clock of a table: a column with date and time, columns of both, or numbers; UTC before local time.

    Args:
        numbers: columns (k,) of numbers by name.
        stamps: columns of texts that are times.
        units: of columns, where a row of units says them.
    """
    for found in (
        _of_both(stamps),
        _of_parts(numbers),
        _of_weeks(numbers),
        _of_clocks(stamps),
        _of_numbers(numbers, units),
    ):
        if found is not None:
            break
    else:
        return Clock(frozenset(), None, NONE, "")
    assert found.times is not None
    late_s = zone_of(found.name)
    if late_s:
        how = f"{found.how}; {late_s / 3600:g} h later than UTC, as its name says"
        return Clock(found.taken, found.times - late_s, found.kind, how, found.name)
    if re.search(LOCAL, words(found.name)):
        return Clock(found.taken, found.times, found.kind, f"{found.how}; it is local, of an unknown zone", found.name)
    return found


def _preferred(names: list[str]) -> str:
    """Of satellites or UTC before others, local ones last."""
    return min(names, key=lambda name: (bool(re.search(LOCAL, words(name))), not re.search(UTC, words(name))))


def _kind(name: str) -> str:
    return GNSS if re.search(UTC, words(name)) and not zone_of(name) else COMPUTER


def _of_both(stamps: Mapping[str, Stamps]) -> Clock | None:
    both = [name for name, own in stamps.items() if own.kind == "both"]
    if not both:
        return None
    name = _preferred(both)
    times = stamps[name].day * DAY_S + stamps[name].second
    return Clock(frozenset({name}), times, _kind(name), f"time is {name}, date and time", name)


def _of_clocks(stamps: Mapping[str, Stamps]) -> Clock | None:
    """A time of day, with the date beside it where there is one."""
    # one that stands still, as a count-down that has not begun, is no clock
    clocks = [k for k, own in stamps.items() if own.kind == "clock" and np.isfinite(np.unique(own.second)[1:2]).any()]
    if not clocks:
        return None
    name = _preferred(clocks)
    second = over_midnight(stamps[name].second)
    dates = [key for key, own in stamps.items() if own.kind == "date"]
    if not dates:
        return Clock(frozenset({name}), second, OWN, f"time is {name}, a time of day without a date", name)
    whole = stamps[dates[0]].day * DAY_S + second % DAY_S
    return Clock(frozenset({name, dates[0]}), whole, _kind(name), f"time is {dates[0]} and {name}", name)


def _of_parts(numbers: Mapping[str, Array]) -> Clock | None:
    """Year, month, day, hour, minute and second in columns of their own."""
    found: dict[str, str] = {}
    for name in numbers:
        own = words(name).replace("utc ", "")
        found.setdefault(PART_WORDS.get(own, own), name)
    if not set(PARTS) <= set(found):
        return None
    year, month, day, hour, minute, second = (numbers[found[part]] for part in PARTS)
    year = year + 2000.0 * (year < 100)
    days = read_stamps([f"{y:.0f}-{m:.0f}-{d:.0f}" for y, m, d in zip(year, month, day, strict=True)]).day
    times = days * DAY_S + hour * 3600.0 + minute * 60.0 + second
    extra = next((name for name in numbers if re.search(r"\b(ms|msec|millis\w*)$", words(name))), "")
    if extra:
        times = times + numbers[extra] * 1e-3
    names = [found[part] for part in PARTS]
    return Clock(frozenset({*names, extra} - {""}), times, COMPUTER, f"time is {', '.join(names)}", names[-1])


def _of_weeks(numbers: Mapping[str, Array]) -> Clock | None:
    """Weeks and seconds, or milliseconds, of the week of GPS."""
    week = next((name for name in numbers if re.search(r"\bgps week\b|\bweek( number)?$", words(name))), "")
    second = next((name for name in numbers if re.search(r"\b(i?tow|gps (sec\w*|time)|sow)\b", words(name))), "")
    if not week or not second or not (numbers[week] > 700).any():
        return None
    own = numbers[second]
    scale = 1e-3 if float(np.nanmax(own)) > 604800.0 else 1.0
    how = f"time is {week} and {second}, of GPS; leap seconds are taken off"
    return Clock(frozenset({week, second}), utc_of_gps(numbers[week], own * scale), GNSS, how, second)


def _of_numbers(numbers: Mapping[str, Array], units: Mapping[str, str]) -> Clock | None:
    able = [name for name in numbers if TIME_NAME.search(words(name)) or words(name).startswith("time")]
    dates = [name for name in able if _is_date(numbers[name])]
    able = [name for name in able if name not in dates and _runs(numbers[name])]
    if not able:
        return None
    name = _preferred(able)
    unit = units.get(name, "") or split_unit(name)[1]
    times, kind, how = read_numbers(numbers[name], words(name), unit=unit)
    if how != "hhmmss" or not dates:
        return Clock(frozenset({name}), times, kind, f"time is {name}, {how}", name)
    texts = [f"{d // 10000:04.0f}-{d // 100 % 100:02.0f}-{d % 100:02.0f}" for d in numbers[dates[0]]]
    whole = read_stamps(texts).day * DAY_S + times % DAY_S
    return Clock(frozenset({name, dates[0]}), whole, COMPUTER, f"time is {dates[0]} and {name}, {how}", name)


def _runs(values: Array) -> bool:
    """Whether numbers change as a clock does."""
    known = values[np.isfinite(values)]
    return len(known) > 1 and float((np.diff(known) != 0).mean()) >= 0.05 and float(np.ptp(known)) > 0


def _is_date(values: Array) -> bool:
    """Whether numbers are years, months and days run together."""
    low, high = DATE_NUMBERS
    month, day = values // 100 % 100, values % 100
    return bool(((values > low) & (values < high) & (month <= 12) & (day <= 31) & (values % 1 == 0)).all())
