"""Numbers that no ship can mean: the sign of a wrong unit, a wrong sign or a broken sensor."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from expdesign.records.file.table import Table

ROUNDING = 1e-3
TURN = 2.0 * np.pi
FULL_CIRCLE_DEG = 360.0


@dataclass(frozen=True, kw_only=True)
class Range:
    """Allowed values of a column.

    Attributes:
        pattern: of the contract names it is about.
        low, high: bounds in the contract's unit.
        expected: in words.
        degrees: whether values outside may be degrees.
    """

    pattern: str
    low: float
    high: float
    expected: str
    degrees: bool = False


RANGES = (
    Range(pattern="[uv]_mps", low=-60, high=60, expected="-60 to 60 m/s"),
    Range(pattern="r_radps", low=-TURN, high=TURN, expected="-6.28 to 6.28 rad/s", degrees=True),
    Range(pattern="wind_[uv]_mps", low=-120, high=120, expected="-120 to 120 m/s"),
    Range(pattern="wind_speed_mps", low=0, high=120, expected="0 to 120 m/s"),
    Range(pattern="wind_angle_rad", low=-TURN, high=TURN, expected="-6.28 to 6.28 rad", degrees=True),
    Range(pattern="steered", low=0, high=1, expected="0 or 1"),
    Range(
        pattern=r"(?:planned_|reached_)?a\d+_rad",
        low=-4 * TURN,
        high=4 * TURN,
        expected="-25.1 to 25.1 rad",
        degrees=True,
    ),
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


def check_ranges(table: Table) -> None:
    """Raise for numbers outside `RANGES`, positions without a fix, and headings in degrees under a radian name.

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
    """Radians start within a turn and never step by half a circle of degrees; yaw rates may prove them right."""
    heading = table.columns.get("heading_rad")
    if heading is None or table.sources["heading_rad"].factor != 1.0:
        return
    steps = np.abs(np.diff(heading, prepend=heading[0]))
    suspicious = (np.abs(heading) > FULL_CIRCLE_DEG / 2) | (steps > FULL_CIRCLE_DEG / 2)
    suspicious |= np.abs(heading[0]) > TURN + ROUNDING
    if suspicious.any() and np.abs(heading).max() <= FULL_CIRCLE_DEG and not _turns_as_measured(table):
        row = int(np.argmax(suspicious))
        found = f"is {table.value('heading_rad', row)} in row {row + table.first_row}"
        raise table.error(
            "heading_rad", f"{found}, expected radians from within one turn; degrees belong under heading_deg"
        )


def _turns_as_measured(table: Table) -> bool:
    """Whether the heading changes as the yaw rate says, in radians."""
    rate = table.columns.get("r_radps")
    if rate is None or len(table) < 3:
        return False
    turned = np.diff(np.unwrap(table.columns["heading_rad"]))
    expected = rate[:-1] * np.diff(table.columns["time_s"])
    return bool(np.linalg.norm(turned - expected) < 0.5 * np.linalg.norm(expected))
