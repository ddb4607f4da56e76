"""Texts and numbers of unknown kind as times: ISO and other dates, hh:mm:ss, NMEA hhmmss, epochs in any unit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from expdesign.importing.channels import COMPUTER, DAY_S, GNSS, OWN
from expdesign.values import Array

STAMP = re.compile(
    r"\s*(?:(?P<date>\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}|\d{1,2}/\d{1,2}/\d{2}|\d{8}(?=T))"
    r"(?:[T ,_]+|$))?"
    r"(?:(?P<h>\d{1,2}):?(?P<m>\d{2})(?::?(?P<s>\d{2}(?:[.,]\d*)?))?\s*(?P<half>[AaPp][Mm])?)?"
    r"\s*(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2})?\s*"
)
TIME_NAME = re.compile(
    r"\b(time|utc|timestamp|stamp|datetime|date|epoch|zeit|uhrzeit|datum|clock|t|secs?|seconds?|received at)\b"
)
SCALES = ((1e17, 1e-9, "ns"), (1e14, 1e-6, "us"), (1e11, 1e-3, "ms"), (5e8, 1.0, "s"))
"""Least size of a number that is a time since 1970 in a unit, factor to seconds, unit."""
UNITS = {"s": 1.0, "sec": 1.0, "secs": 1.0, "seconds": 1.0, "ms": 1e-3, "millis": 1e-3, "us": 1e-6, "micros": 1e-6,
         "ns": 1e-9, "nanos": 1e-9, "min": 60.0, "h": 3600.0}  # fmt: skip
UNIT_WORDS = {1.0: "in s", 1e-3: "in ms", 1e-6: "in us", 1e-9: "in ns", 60.0: "in min", 3600.0: "in h"}
LATEST = 4.2e9
"""Seconds since 1970 beyond which a number is no time."""
EXCEL_DAY, MATLAB_DAY = 25569.0, 719529.0
"""The first of January 1970 in days of spreadsheets and of datenum."""
LONGEST_STEP_S = 20.0
"""Usual step of numbers without unit beyond which these are milliseconds, or a thousandth of that."""


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
        texts: cells.
        day_first: whether 3/4/2024 is in April, where the texts themselves do not tell.
    """
    days: dict[str, float] = {}
    day, second = np.full(len(texts), np.nan), np.full(len(texts), np.nan)
    for row, text in enumerate(texts):
        found = STAMP.fullmatch(text)
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
            second[row] = 3600.0 * hour + 60.0 * int(found["m"]) + float((found["s"] or "0").replace(",", "."))
            if found["zone"] and found["zone"][0] in "+-":
                sign = -1.0 if found["zone"][0] == "+" else 1.0
                second[row] += sign * (3600.0 * int(found["zone"][1:3]) + 60.0 * int(found["zone"][-2:]))
    return Stamps(day, second)


def tells_month_first(texts: Sequence[str]) -> bool:
    """Whether dates such as 12/31/2024 show that the month comes first."""
    parts = (re.match(r"\s*(\d{1,2})[-/.](\d{1,2})[-/.]\d{2,4}", text) for text in texts)
    return any(int(found[2]) > 12 for found in parts if found)


def _day(text: str, day_first: bool) -> float:
    numbers = [int(part) for part in re.split("[-/.]", text)]
    if len(numbers) == 1:
        numbers = [numbers[0] // 10000, numbers[0] // 100 % 100, numbers[0] % 100]
    elif len(text) - max(text.rfind(c) for c in "-/.") == 5:
        numbers = [numbers[2], *(numbers[1::-1] if day_first else numbers[:2])]
    elif len(text) - text.rfind("/") == 3 and numbers[0] < 100:  # a year of two digits
        numbers = [2000 + numbers[2], *(numbers[1::-1] if day_first else numbers[:2])]
    try:
        return float(date(*numbers).toordinal() - date(1970, 1, 1).toordinal())
    except ValueError:
        return float("nan")


def over_midnight(second: Array) -> Array:
    """Seconds of the day that go on counting past midnight."""
    known = np.flatnonzero(np.isfinite(second))
    days = np.zeros(len(second))
    days[known[1:]] = np.cumsum(np.diff(second[known]) < -DAY_S / 2.0)
    return np.asarray(second + DAY_S * days)


def read_numbers(values: Array, name: str, *, unit: str = "") -> tuple[Array, str, str]:
    """Numbers (k,) as times [s], the kind of clock, and how they were read in words.

    Args:
        values: as they stand.
        name: of the column, in lower case words, whose last may be the unit.
        unit: where the file says it.
    """
    known = values[np.isfinite(values)]
    size, steps = float(np.median(np.abs(known))), np.diff(known)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    said = UNITS.get(unit.lower(), UNITS.get(name.split(" ")[-1], 0.0))
    for least, factor, word in SCALES:
        if size > least and factor * size < LATEST and (not said or said == factor):
            return factor * values, COMPUTER, f"{word} since 1970"
    if said:
        return said * values, OWN, UNIT_WORDS.get(said, f"units of {said:g} s")
    if _is_hhmmss(known) and step >= 0.01:
        clock = np.floor(values / 1e4) * 3600 + np.floor(values / 100 % 100) * 60 + values % 100
        return over_midnight(clock), GNSS if "utc" in name else OWN, "hhmmss"
    for origin, word in ((EXCEL_DAY, "days of a spreadsheet"), (MATLAB_DAY, "days of datenum")):
        if 0.6 * origin < size < 2.2 * origin and step < 1e-2 and (known % 1 > 0).any():
            return (values - origin) * DAY_S, COMPUTER, word
    factor = 1.0 if step <= LONGEST_STEP_S else 1e-3 if step <= LONGEST_STEP_S * 1e3 else 1e-6
    return factor * values, OWN, {1.0: "seconds", 1e-3: "ms, by their steps", 1e-6: "us, by their steps"}[factor]


def _is_hhmmss(known: Array) -> bool:
    """Whether numbers are hours, minutes and seconds run together: never 60 in either, and jumps by 40 between."""
    parts = (known % 100 < 60).all() and (known / 100 % 100 < 60).all() and (known >= 0).all() and (known < 2.4e5).all()
    steps = np.diff(known)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    jumps = np.abs(steps - step - 40.0) < 0.5
    return bool(parts and known.max(initial=0) >= 1e4 and (jumps.any() or (known.min() > 1e4 and step < 20)))
