"""Texts and numbers of unknown kind as times: dates, hh:mm:ss, NMEA hhmmss, epochs; and the clock of a table."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from expdesign.importing.channels import COMPUTER, DAY_S, GNSS, NONE, OWN
from expdesign.importing.languages import words
from expdesign.importing.mapping import split_unit
from expdesign.values import Array

ZONES_H = {"Z": 0, "UTC": 0, "GMT": 0, "WET": 0, "WEST": 1, "CET": 1, "MEZ": 1, "CEST": 2, "MESZ": 2, "EET": 2,
           "EEST": 3, "MSK": 3, "JST": 9, "KST": 9}  # fmt: skip
"""Names of zones that mean one thing everywhere -> hours later than UTC."""
STAMP = re.compile(
    r"\s*(?:(?P<date>\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}|\d{1,2}[/.]\d{1,2}[/.]\d{2}|\d{8}(?=T)"
    r"|\d{4}:\d{3}(?=:))(?:[T ,_:]+|$))?"
    r"(?:(?P<h>\d{1,2})[:.]?(?P<m>\d{2})(?:[:.]?(?P<s>\d{2}(?:[.,]\d*|:\d{3})?))?\s*(?P<half>[AaPp][Mm])?)?"
    r"\s*(?P<zone>[+-]\d{2}(?::?\d{2})?|" + "|".join(ZONES_H) + r")?\s*"
)
MONTHS = {
    word: number
    for number, words in enumerate(
        ("jan", "feb fev", "mar mrz mae", "apr avr abr", "may mai maj mag", "jun", "jul lug", "aug ago", "sep set",
         "oct okt ott", "nov", "dec dez des dic"), start=1,
    )
    for word in words.split()
}  # fmt: skip
"""First letters of a month's name -> its number."""
WEEKDAY, MONTH, DATED = r"(?:[A-Za-z]{2,9}[.,]? +)?", r"(?P<mon>[A-Za-z]{3})[a-z]*", r"\b[T,: ]*(?P<rest>.*)"
NAMED = (
    re.compile(rf"{WEEKDAY}(?P<d>\d{{1,2}})[-./ ]+{MONTH}[-./, ]+(?P<y>\d{{4}}|\d\d){DATED}"),
    re.compile(rf"{WEEKDAY}{MONTH}\.? +(?P<d>\d{{1,2}}),? +(?P<y>\d{{4}}){DATED}"),
    re.compile(rf"{WEEKDAY}{MONTH}\.? +(?P<d>\d{{1,2}}) +(?P<rest>\d{{1,2}}:\d\d:\d\d\S*) +(?P<y>\d{{4}})"),
)
"""Dates with the name of a month."""
TIME_NAME = re.compile(
    r"\b(time|utc|timestamp|stamp|datetime|date|epoch|clock|t|secs?|seconds?|received at|doy|julian|mjd|tow|"
    r"decimal (hours?|day)|datenum)\b"
)
ZONE_NAME = re.compile(r"\b(?:UTC|GMT)\s*([+-])\s*(\d{1,2})(?::?(\d{2}))?")
"""A zone in the name of a column, as `Time (UTC+2)`."""
EARLIEST_S, LATEST_S = 7.9e8, 2.21e9  # of times since 1970: the years 1995 to 2040 [s]
EPOCHS = (
    (1e-9, 0.0, "ns since 1970"), (1e-6, 0.0, "us since 1970"), (1e-3, 0.0, "ms since 1970"),
    (1.0, 0.0, "s since 1970"),
    (1e-7, 62_135_596_800.0, "ticks of 100 ns since the year 1"),
    (1e-7, 11_644_473_600.0, "ticks of 100 ns since 1601"), (1.0, 2_082_844_800.0, "s since 1904"),
    (DAY_S, 25569.0 * DAY_S, "days of a spreadsheet"), (DAY_S, 719_529.0 * DAY_S, "days of datenum"),
    (DAY_S, 2_440_587.5 * DAY_S, "Julian days"), (DAY_S, 40587.0 * DAY_S, "modified Julian days"),
)  # fmt: skip
"""Factor to seconds, seconds from the epoch to 1970, words; the first that gives a year from 1995 to 2040 counts."""
UNITS = {
    **dict.fromkeys(("s", "sec", "secs", "seconds", "second"), 1.0), **dict.fromkeys(("ms", "msec", "millis"), 1e-3),
    **dict.fromkeys(("us", "micros"), 1e-6), **dict.fromkeys(("ns", "nanos"), 1e-9),
    **dict.fromkeys(("min", "mins", "minutes", "minute"), 60.0), **dict.fromkeys(("h", "hr", "hour", "hours"), 3600.0),
    **dict.fromkeys(("d", "days"), DAY_S),
}  # fmt: skip
UNIT_WORDS = {
    1.0: "in s",
    1e-3: "in ms",
    1e-6: "in us",
    1e-9: "in ns",
    60.0: "in min",
    3600.0: "in h",
    DAY_S: "in days",
}
LONGEST_STEP_S = 20.0  # usual step of numbers without unit beyond which these are milliseconds, or a thousandth of that
SHORTEST_STEP_S = 5e-4  # usual step of numbers without unit below which these are days: no log has 2,000 rows a second
WEEK_S = 7 * DAY_S
GPS_EPOCH_S = 315_964_800.0
LEAP_S = ((1_483_228_800.0, 18.0), (1_435_708_800.0, 17.0), (1_341_100_800.0, 16.0), (1_230_768_000.0, 15.0),
          (1_136_073_600.0, 14.0), (0.0, 13.0))  # fmt: skip
"""Seconds since 1970 from which the time of GPS was so many seconds before UTC (IERS Bulletin C)."""


@dataclass(frozen=True)
class Stamps:
    """A column of texts as times."""

    day: Array  # (k,) days since 1970, nan without a date
    second: Array  # (k,) of the day, nan without a time of day

    @property
    def kind(self) -> str:
        """One of "both", "date", "clock"; "" where most cells are neither."""
        dated, timed = (float(np.isfinite(part).mean()) > 0.5 for part in (self.day, self.second))
        return "both" if dated and timed else "date" if dated else "clock" if timed else ""


def read_stamps(texts: Sequence[str], *, day_first: bool = True) -> Stamps:
    """Dates and times of day; nan where a text is neither.

    Args:
        day_first: whether 3/4/2024 is in April, where the texts themselves do not tell.
    """
    days: dict[str, float] = {}
    day, second = np.full(len(texts), np.nan), np.full(len(texts), np.nan)
    for row, text in enumerate(texts):
        found = STAMP.fullmatch(text) or STAMP.fullmatch(_with_number_of_month(text))
        if found is None or not (found["date"] or found["h"]):
            continue
        if found["date"] is None and ":" not in text:
            continue
        if found["date"]:
            known = days.get(found["date"])
            if known is None:
                known = days[found["date"]] = _day(found["date"], day_first)
            day[row] = known
        if found["h"]:
            hour = int(found["h"]) % 12 + 12 * (found["half"].lower() == "pm") if found["half"] else int(found["h"])
            parts = float(re.sub("[,:]", ".", found["s"] or "0"))
            second[row] = 3600.0 * hour + 60.0 * int(found["m"]) + parts
            if found["zone"] and found["zone"][0] in "+-":
                second[row] -= _zone_s(found["zone"][0], found["zone"][1:3], found["zone"][3:].lstrip(":"))
            elif found["zone"]:
                second[row] -= 3600.0 * ZONES_H[found["zone"]]
    return Stamps(day, second)


def _zone_s(sign: str, hours: str, minutes: str | None) -> float:
    return (-1.0 if sign == "-" else 1.0) * (3600.0 * int(hours) + 60.0 * int(minutes or 0))


def zone_of(name: str) -> float:
    """How much later than UTC the zone in a column's name is [s]; 0 where it says none."""
    if found := ZONE_NAME.search(name):
        return _zone_s(found[1], found[2], found[3])
    return next((3600.0 * later for zone, later in ZONES_H.items() if re.search(rf"\b{zone}\b", name)), 0.0)


def _with_number_of_month(text: str) -> str:
    """A date with a month's name, as a date of numbers; other texts as they are."""
    if not re.search("[A-Za-z]{3}", text):
        return text
    for form in NAMED:
        found = form.fullmatch(text.strip())
        if found and (month := MONTHS.get(found["mon"].lower())):
            year = int(found["y"])
            return f"{year + 2000 * (year < 100)}-{month}-{found['d']} {found['rest']}".rstrip()
    return text


def tells_month_first(texts: Sequence[str]) -> bool:
    """Whether dates such as 12/31/2024 show that the month comes first."""
    parts = (re.match(r"\s*\d{1,2}(?:[-/](\d{1,2})[-/]\d{2,4}|\.(\d{1,2})\.\d{4})", text) for text in texts)
    return any(12 < int(found[1] or found[2]) < 32 for found in parts if found)


def halves_of_days(texts: Sequence[str]) -> bool:
    """Whether dates such as 3/4/2024 stand beside AM and PM, as where the month comes first."""
    days = [int(found[1]) for text in texts if (found := re.match(r"\s*(\d{1,2})/\d{1,2}/\d{4}", text))]
    return max(days, default=13) < 13 and any(re.search(r"(^|\d)\s*[AaPp][Mm]\s*$", text) for text in texts)


def _day(text: str, day_first: bool) -> float:
    numbers = [int(part) for part in re.split("[-/.:]", text)]
    try:
        if len(numbers) == 2:  # a year and its day
            return float(date(numbers[0], 1, 1).toordinal() + numbers[1] - 1 - date(1970, 1, 1).toordinal())
        if len(numbers) == 1:
            numbers = [numbers[0] // 10000, numbers[0] // 100 % 100, numbers[0] % 100]
        elif numbers[0] < 100:  # the year is last
            year = numbers[2] + 2000 * (numbers[2] < 100)
            numbers = [year, *(numbers[1::-1] if day_first else numbers[:2])]
        return float(date(*numbers).toordinal() - date(1970, 1, 1).toordinal())
    except ValueError:
        return float("nan")


def over_midnight(second: Array, period_s: float = DAY_S) -> Array:
    """Seconds of the day, or of another period, that go on counting past its end."""
    known = np.flatnonzero(np.isfinite(second))
    days = np.zeros(len(second))
    days[known[1:]] = np.cumsum(np.diff(second[known]) < -period_s / 2.0)
    return np.asarray(second + period_s * days)


def utc_of_gps(week: Array, second: Array) -> Array:
    """Times since 1970 UTC [s] of weeks since 1980, as counted on, and seconds of the week of GPS time."""
    gps = GPS_EPOCH_S + WEEK_S * week + second
    late = next(leap for since, leap in LEAP_S if float(np.nanmedian(gps)) > since)
    return np.asarray(gps - late)


def read_numbers(values: Array, name: str, *, unit: str = "") -> tuple[Array, str, str]:
    """Numbers (k,) as times [s], the kind of clock, and how they were read in words.

    Args:
        name: of the column, in lower case words, whose last may be the unit.
        unit: where the file says it.
    """
    known = values[np.isfinite(values)]
    size, steps = float(np.median(np.abs(known))), np.diff(known)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    said = UNITS.get(unit.lower(), UNITS.get(name.split(" ")[-1], 0.0))
    if 1.97e13 < size < 2.11e13 and not said and (whole := _of_digits(values)) is not None:
        return whole, COMPUTER, "date and time run together"
    for factor, since_s, word in EPOCHS:
        since_1970 = factor * size - since_s
        if EARLIEST_S < since_1970 < LATEST_S and (not said or said == factor) and factor * step < DAY_S / 2:
            return factor * values - since_s, COMPUTER, word
    if said:
        return _wrapped(said * values), OWN, UNIT_WORDS.get(said, f"units of {said:g} s")
    if _is_hhmmss(known) and step >= 0.01:
        clock = np.floor(values / 1e4) * 3600 + np.floor(values / 100 % 100) * 60 + values % 100
        return over_midnight(clock), GNSS if "utc" in name else OWN, "hhmmss"
    if step < SHORTEST_STEP_S:
        return over_midnight(values * DAY_S), OWN, "days, by their steps"
    factor = 1.0 if step <= LONGEST_STEP_S else 1e-3 if step <= LONGEST_STEP_S * 1e3 else 1e-6
    how = {1.0: "seconds", 1e-3: "ms, by their steps", 1e-6: "us, by their steps"}[factor]
    return _wrapped(factor * values), OWN, how


def _wrapped(second: Array) -> Array:
    """The same, past the end of a day or a week where they begin anew there."""
    known = second[np.isfinite(second)]
    for period_s in (DAY_S, WEEK_S):
        inside = len(known) and known.min() >= 0.0 and known.max() <= period_s
        if inside and np.diff(known).min(initial=0.0) < -0.9 * period_s:
            return over_midnight(second, period_s)
    return second


def _of_digits(values: Array) -> Array | None:
    """Times since 1970 [s] of numbers as 20251009085320; None where they are none."""
    day, clock = np.divmod(values, 1e6)
    days = {value: _day(f"{value:.0f}", True) for value in np.unique(day[np.isfinite(day)]).tolist()}
    parts = np.floor(clock / 1e4), np.floor(clock / 100 % 100), clock % 100
    if not all(np.isfinite(list(days.values()))) or np.nanmax(parts[1]) >= 60 or np.nanmax(parts[2]) > 61:
        return None
    whole = np.array([days.get(value, np.nan) for value in day.tolist()])
    return np.asarray(whole * DAY_S + parts[0] * 3600 + parts[1] * 60 + parts[2])


def _is_hhmmss(known: Array) -> bool:
    """Whether numbers are hours, minutes and seconds run together: never 60 in either, and jumps by 40 between."""
    parts = (known % 100 < 60).all() and (known / 100 % 100 < 60).all() and (known >= 0).all() and (known < 2.4e5).all()
    steps = np.diff(known)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    jumps = np.abs(steps - step - 40.0) < 0.5
    return bool(parts and known.max(initial=0) >= 1e4 and (jumps.any() or (known.min() > 1e4 and step < 20)))


DATE_NUMBERS = (19700101, 21001231)  # least and greatest number that is a year, month and day run together
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
