"""Checks of a file: its sample time, stretches without a gap, and numbers that no ship can mean.

The last are the sign of a wrong unit, a wrong sign or a broken sensor.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from expdesign.errors import FileError
from expdesign.records.file.table import Mask, Table
from expdesign.values import Array

GAP_SAMPLE_TIMES = 1.5  # interval, in sample times, above which a new batch starts

GAP_SHARE = 0.2  # share of intervals that may be gaps before the sampling counts as irregular
JITTER_SHARE = 0.25  # largest deviation of an interval from the sample time, as a share of it
SAMPLE_TIME_MISMATCH = 0.01  # largest relative difference of two sample times that count as equal
LONGEST_SAMPLE_TIME_S = 20.0  # limit of IMO MSC/Circ.1053 for manoeuvring trials [s]
SHORTEST_SAMPLE_TIME_S = 1e-4  # limit below which the unit of time is questioned [s]
UNITS = ((1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds"), (1 / 60, "minutes"), (1 / 3600, "hours"))


@dataclass(frozen=True, kw_only=True)
class Clock:
    """How a file is sampled."""

    sample_time_s: float  # mean interval inside the batches [s]
    batches: tuple[slice, ...]  # stretches of samples, each with two or more
    notes: tuple[str, ...] = ()  # on gaps and dropped samples


def read_clock(table: Table, *, sample_time_s: float | None, whose: str = "the vessel") -> Clock:
    """Check the times of a file and cut it into batches.

    Args:
        table: with `time_s`, and `batch` where there is one.
        sample_time_s: what the intervals should be [s], or None for whatever they are.
        whose: owner of that sample time, for messages.

    Raises:
        FileError: times repeat, go backwards or are irregular; the sample time is another; batch numbers are no whole
            numbers or come back; no batch is left.
    """
    if len(table) < 2:
        raise FileError(table.path, "", f"has one sample (row {table.first_row}), expected two or more")
    announced = _announced(table)
    step = np.diff(table.columns["time_s"])
    _check_increasing(table, step, announced)
    inside = step[~announced]
    if not len(inside):
        raise table.error("batch", "changes at every row, expected batches of two or more samples")
    gap = ~announced & (step > GAP_SAMPLE_TIMES * np.median(inside))
    regular = ~announced & ~gap
    found_s = float(f"{step[regular].mean():.6g}")
    _check_sample_time(table, found_s, sample_time_s, whose)
    _check_regular(table, step, gap, regular, found_s)
    stretches = _stretches(announced | gap, len(table))
    kept = tuple(part for part in stretches if part.stop - part.start > 1)
    notes = (*_gap_notes(table, gap, step), *_short_notes(table, stretches))
    return Clock(sample_time_s=sample_time_s or found_s, batches=kept, notes=notes)


def same_sample_time(a_s: float, b_s: float) -> bool:
    """Whether two sample times differ by no more than rounding in files explains."""
    return abs(a_s - b_s) <= SAMPLE_TIME_MISMATCH * max(a_s, b_s)


def _announced(table: Table) -> Mask:
    """(k - 1,) where the batch column starts a new batch."""
    numbers = table.columns.get("batch")
    if numbers is None:
        return np.zeros(len(table) - 1, dtype=bool)
    broken = numbers != np.round(numbers)
    if broken.any():
        raise table.error("batch", f"{table.found('batch', broken, 'broken')}, expected whole numbers")
    change: Mask = np.diff(numbers) != 0
    starts = np.flatnonzero(np.concatenate([[True], change]))
    seen: set[float] = set()
    for start in starts.tolist():
        if numbers[start] in seen:
            found = f"is {numbers[start]:g} again in row {start + table.first_row}"
            raise table.error("batch", f"{found}, expected the rows of a batch to follow each other")
        seen.add(float(numbers[start]))
    return change


def _check_increasing(table: Table, step: Array, announced: Mask) -> None:
    repeated, backward = (np.concatenate([[False], wrong & ~announced]) for wrong in (step == 0, step < 0))
    if repeated.any():
        stuck = f"stays at {table.value('time_s', int(np.argmax(repeated)))} in {table.rows(repeated)}"
        raise table.error("time_s", f"{stuck}, expected increasing times")
    if backward.any():
        index = int(np.argmax(backward))
        now, before = table.value("time_s", index), table.value("time_s", index - 1)
        reset = table.columns["time_s"][index] <= table.columns["time_s"][0] + abs(step[0])
        why = ": a clock that was reset needs a batch column that changes there" if reset else ""
        problem = f"goes back from {before} to {now} in {table.rows(backward)}, expected increasing times{why}"
        raise table.error("time_s", problem)


def _check_sample_time(table: Table, found_s: float, wanted_s: float | None, whose: str) -> None:
    if found_s < SHORTEST_SAMPLE_TIME_S:
        raise table.error("time_s", f"has a sample every {found_s:g} s, expected {SHORTEST_SAMPLE_TIME_S:g} s or more")
    if wanted_s is None:
        if found_s > LONGEST_SAMPLE_TIME_S:
            most = f"expected at most {LONGEST_SAMPLE_TIME_S:g} s{_unit(found_s, None)}"
            raise table.error("time_s", f"has a sample every {found_s:g} s, {most}")
    elif not same_sample_time(found_s, wanted_s):
        problem = f"has a sample every {found_s:g} s, expected every {wanted_s:g} s, as {whose} has it"
        resampled = f"; expdesign import --sample-time {wanted_s:g} resamples it"
        raise table.error("time_s", problem + (_unit(found_s, wanted_s) or resampled))


def _unit(found_s: float, wanted_s: float | None) -> str:
    if wanted_s is None:
        return " (is it in milliseconds?)"
    for factor, unit in UNITS:
        if same_sample_time(found_s, factor * wanted_s):
            return f" (is it in {unit}?)"
    return ""


def _check_regular(table: Table, step: Array, gap: Mask, regular: Mask, sample_time_s: float) -> None:
    odd = regular & (np.abs(step - sample_time_s) > JITTER_SHARE * sample_time_s)
    if gap.sum() > max(GAP_SHARE * len(step), 2):
        odd |= gap
    if odd.any():
        later = np.concatenate([[False], odd])
        found = f"advances by {step[int(np.argmax(odd))]:.6g} s in {table.rows(later)}"
        raise table.error("time_s", f"{found}, expected even steps of {sample_time_s:g} s within {JITTER_SHARE:.0%}")


def _stretches(cut: Mask, count: int) -> list[slice]:
    edges = [0, *(np.flatnonzero(cut) + 1).tolist(), count]
    return [slice(start, stop) for start, stop in pairwise(edges)]


def _gap_notes(table: Table, gap: Mask, step: Array) -> list[str]:
    if not gap.any():
        return []
    rows = table.rows(np.concatenate([[False], gap]))
    return [f"gaps in time_s of up to {step[gap].max():.6g} s start a new batch in {rows}"]


def _short_notes(table: Table, stretches: list[slice]) -> list[str]:
    lonely = np.zeros(len(table), dtype=bool)
    lonely[[part.start for part in stretches if part.stop - part.start == 1]] = True
    return [f"left out {table.rows(lonely)}, batches of a single sample"] if lonely.any() else []


ROUNDING = 1e-3
TURN = 2.0 * np.pi
FULL_CIRCLE_DEG = 360.0
DECIMALS = 2  # most decimals of angles that may be degrees
LARGE_STEP, LARGE_SHARE = 1.0, 0.2
"""A change from row to row [rad], and the share of rows with more from which angles are taken for degrees."""
COURSES, AHEAD_SHARE = 200, 0.5
"""Courses over ground that headings are compared with, and the least share of the way that goes ahead."""


@dataclass(frozen=True, kw_only=True)
class Range:
    """Allowed values of a column."""

    pattern: str  # of the contract names it is about
    # low, high: bounds in the contract's unit
    low: float
    high: float
    expected: str  # in words
    degrees: bool = False  # whether values outside may be degrees


RANGES = (
    Range(pattern="[uv]_mps", low=-60, high=60, expected="-60 to 60 m/s"),
    Range(pattern="r_radps", low=-TURN, high=TURN, expected="-6.28 to 6.28 rad/s", degrees=True),
    Range(pattern="wind_[uv]_mps", low=-120, high=120, expected="-120 to 120 m/s"),
    Range(pattern="wind_speed_mps", low=0, high=120, expected="0 to 120 m/s"),
    Range(pattern="steered", low=0, high=1, expected="0 or 1"),
    Range(
        pattern=r"(?:planned_|reached_)?rudder\d+_rad",
        low=-TURN / 4,
        high=TURN / 4,
        expected="-1.57 to 1.57 rad",
        degrees=True,
    ),
    Range(pattern="roll_rad", low=-TURN / 4, high=TURN / 4, expected="-1.57 to 1.57 rad", degrees=True),
    Range(pattern="roll_rate_radps", low=-TURN, high=TURN, expected="-6.28 to 6.28 rad/s", degrees=True),
    Range(pattern="(?:sway|lateral)_acceleration_mps2", low=-50, high=50, expected="-50 to 50 m/s2"),
    Range(pattern="depth_m", low=1e-9, high=12000, expected="more than 0, counted downwards, at most 12000 m"),
    Range(pattern="lat_deg", low=-90, high=90, expected="-90 to 90 degrees"),
    Range(pattern="lon_deg", low=-180, high=180, expected="-180 to 180 degrees"),
)

ROUND = re.compile(r"(?:planned_|reached_)?a\d+_rad|wind_angle_rad")
"""Angles that go round and round: any number of turns stands for the same direction, as it does for the heading."""


def check_ranges(table: Table) -> None:
    """Raise for numbers outside `RANGES`, positions without a fix, and degrees under a radian name.

    Raises:
        FileError: naming the column, the first value and the rows.
    """
    for name, values in table.columns.items():
        for allowed in RANGES:
            if not re.fullmatch(allowed.pattern, name):
                continue
            slack = ROUNDING if allowed.degrees else 0.0
            wrong = (values < allowed.low - slack) | (values > allowed.high + slack)
            if wrong.any():
                found = table.found(name, wrong, "out of range")
                raise table.error(name, f"{found}, expected {allowed.expected}{_hint(table, name, allowed)}")
    _check_fix(table)
    _check_heading(table)
    for name in filter(ROUND.fullmatch, table.columns):
        if _like_degrees(table, name):
            raise _degrees(table, name, np.abs(table.columns[name]) > TURN + ROUNDING)
    _check_marks(table)


def _hint(table: Table, name: str, allowed: Range) -> str:
    values = table.columns[name]
    if allowed.degrees and table.sources[name].factor == 1.0 and np.abs(values).max() <= FULL_CIRCLE_DEG:
        return f"; degrees belong under {name.replace('rad', 'deg')}"
    if name not in ("lat_deg", "lon_deg"):
        return ""
    lat, lon = np.abs(table.columns["lat_deg"]), np.abs(table.columns["lon_deg"])
    if lat.max() <= 180 and lon.max() <= 90:
        return "; are lat_deg and lon_deg exchanged?"
    if lat.min() > 90 and lon.max() <= 18000:
        return "; degrees and minutes run together (ddmm.mm) must be split"
    return ""


def _check_fix(table: Table) -> None:
    if "lat_deg" not in table.columns:
        return
    nowhere = (table.columns["lat_deg"] == 0) & (table.columns["lon_deg"] == 0)
    if nowhere.any():
        raise table.error("lat_deg", f"is 0 with lon_deg 0 in {table.rows(nowhere)}, expected a position fix")


def _check_marks(table: Table) -> None:
    marks = table.columns.get("steered")
    if marks is None:
        return
    between = (marks != 0) & (marks != 1)
    if between.any():
        raise table.error("steered", f"{table.found('steered', between, 'neither')}, expected 0 or 1")


def _check_heading(table: Table) -> None:
    """Radians start within a turn and never step by half a circle of degrees; other columns may prove them right."""
    heading = table.columns.get("heading_rad")
    if heading is None or table.sources["heading_rad"].factor != 1.0:
        return
    steps = np.abs(np.diff(heading, prepend=heading[0]))
    suspicious = (np.abs(heading) > FULL_CIRCLE_DEG / 2) | (steps > FULL_CIRCLE_DEG / 2)
    suspicious |= np.abs(heading[0]) > TURN + ROUNDING
    proven = _turns_as_measured(table) or _points_as_it_moves(table)
    if suspicious.any() and np.abs(heading).max() <= FULL_CIRCLE_DEG and not proven:
        raise _degrees(table, "heading_rad", suspicious)


def _degrees(table: Table, name: str, suspicious: Mask) -> FileError:
    row = int(np.argmax(suspicious))
    found = f"is {table.value(name, row)} in row {row + table.first_row}"
    belong = f"degrees belong under {name.replace('rad', 'deg')}"
    return table.error(name, f"{found}, expected radians; {belong}")


def _like_degrees(table: Table, name: str) -> bool:
    """Whether an angle of more than a turn is written as degrees are, or moves as far as only degrees do.

    Radians that count turns on move by less than a turn at once, mostly by little, and have many decimals.
    """
    angle = table.columns[name]
    size, steps = np.abs(angle).max(), np.abs(np.diff(angle))
    if table.sources[name].factor != 1.0 or size <= TURN + ROUNDING:
        return False
    few_decimals = bool(np.all(angle == np.round(angle, DECIMALS)))
    far = bool((steps > 0).any()) and float(np.median(steps[steps > 0])) > TURN
    return few_decimals or far or float(np.mean(steps > LARGE_STEP)) > LARGE_SHARE


def _turns_as_measured(table: Table) -> bool:
    """Whether the heading changes as the yaw rate says, in radians."""
    rate = table.columns.get("r_radps")
    if rate is None or len(table) < 3:
        return False
    turned = np.diff(np.unwrap(table.columns["heading_rad"]))
    expected = rate[:-1] * np.diff(table.columns["time_s"])
    return bool(np.linalg.norm(turned - expected) < 0.5 * np.linalg.norm(expected))


def _points_as_it_moves(table: Table) -> bool:
    """Whether the heading agrees with the course over ground as radians, and better than as degrees."""
    names = ("lat_deg", "lon_deg") if "lat_deg" in table.columns else ("north_m", "east_m")
    if not set(names) <= set(table.columns) or len(table) < 3:
        return False
    every = slice(None, None, max(1, len(table) // COURSES))
    north, east = (np.diff(table.columns[name][every]) for name in names)
    east = east * np.cos(np.radians(table.columns["lat_deg"][0])) if "lat_deg" in table.columns else east
    heading, size = table.columns["heading_rad"][every][1:], float(np.hypot(north, east).sum())
    ahead, otherwise = (
        float(np.sum(north * np.cos(angle) + east * np.sin(angle))) for angle in (heading, np.radians(heading))
    )
    return ahead > AHEAD_SHARE * size and ahead > otherwise
