"""Numbers that no ship can mean: the sign of a wrong unit, a wrong sign or a broken sensor."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from expdesign.errors import FileError
from expdesign.records.file.table import Mask, Table

ROUNDING = 1e-3
TURN = 2.0 * np.pi
FULL_CIRCLE_DEG = 360.0
DECIMALS = 2
"""Most decimals of angles that may be degrees."""
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
