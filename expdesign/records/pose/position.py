"""Pose from a file's columns: metres north and east, heading continuous, no jumps that no ship makes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.conventions import whole_turns
from expdesign.errors import FileError
from expdesign.records.file import Table, check_ranges, input_name, is_turning_input, read_table
from expdesign.sea_area import LocalFrame
from expdesign.values import Array, sealed
from expdesign.vessel import Limit

JUMP_RATIO = 10.0  # a step above this multiple of the 95th percentile of all changes gets a note
TURN = 2.0 * np.pi
TIE = 1e-9
"""Share of a turn within which a step counts as half a turn, so that it goes the same way however it is written."""

CHANGES = {
    "heading_rad": (0.5, 1.0, "rad"),
    "u_mps": (10.0, 0.0, "m/s"),
    "v_mps": (10.0, 0.0, "m/s"),
    "r_radps": (1.0, 0.0, "rad/s"),
    "north_m": (2.0, 10.0, "m"),
}
"""Column -> change that is still possible: at any sample time, and per second of it; north_m stands for position."""
NOTED = ("heading_rad", "north_m")
"""Columns whose small jumps get a note; filtered velocities may change unevenly without harm."""


def with_metres(table: Table, origin: LocalFrame | None) -> tuple[Table, LocalFrame | None]:
    """Add north_m and east_m to a table that has latitudes and longitudes.

    Args:
        origin: of an earlier file's metres, or None to take this file's first position.

    Returns:
        The table, and the origin used so far.
    """
    if "lat_deg" not in table.columns:
        return table, origin
    lat, lon = table.columns["lat_deg"], table.columns["lon_deg"]
    origin = origin or LocalFrame(float(lat[0]), float(lon[0]))
    north, east = origin.to_metres(np.stack([lat, lon], axis=-1)).T
    sources = {**table.sources, "north_m": table.sources["lat_deg"], "east_m": table.sources["lon_deg"]}
    note = f"north_m and east_m are metres from lat_deg {origin.lat_deg:.7g}, lon_deg {origin.lon_deg:.7g}"
    columns = {**table.columns, "north_m": north, "east_m": east}
    return replace(table, columns=columns, sources=sources).noted(note), origin


def with_continuous_angles(table: Table, limits: Mapping[str, Limit]) -> Table:
    """Take the jumps by a whole turn out of the heading, and out of angles of thrusters, planned ones too.

    A thruster that turns freely goes the shorter way from sample to sample, and begins within half a turn of dead
    ahead. One with limits of less than a turn has one angle between them for every direction.

    Args:
        limits: of columns, where they are known.
    """
    columns, notes = dict(table.columns), []
    if "heading_rad" in columns:
        columns["heading_rad"] = continuous(columns["heading_rad"])
    for name in (name for name in columns if is_turning_input(name)):
        limit, angle = limits.get(input_name(name), Limit()), continuous(columns[name])
        columns[name] = angle - whole_turns(angle[0])
        if limit.high - limit.low <= TURN:
            columns[name] -= whole_turns(columns[name] - (limit.low + limit.high) / 2.0)
    for name, angle in columns.items():
        change = np.diff(whole_turns(angle - table.columns[name]))
        if turns := int(np.count_nonzero(change)):
            times = f"{turns} time{'s' if turns > 1 else ''}"
            notes.append(f"{table.sources[name].header} is wrapped {times} and made continuous")
    return replace(table, columns=columns).noted(*notes)


def continuous(angle_rad: Array) -> Array:
    """Angles (k,) with whole turns added, none more than half a turn from the one before, and half a turn positive.

    Values that repeat are the same numbers afterwards.
    """
    turns = np.ceil((np.diff(angle_rad, prepend=angle_rad[0]) - np.pi) / TURN - TIE)
    return np.asarray(angle_rad - TURN * np.cumsum(turns))


def check_jumps(table: Table, batches: tuple[slice, ...], sample_time_s: float, *, needed: set[str]) -> Table:
    """Raise where a column that is used jumps as no ship can; note other unusual steps of the pose.

    Args:
        table: a file in metres and radians.
        batches: stretches without a gap.
        sample_time_s: time between samples [s].
        needed: columns that velocities are taken or derived from.

    Raises:
        FileError: naming the column, the size of the jump and the row it lands in.
    """
    notes: list[str] = []
    for name, (least, fastest, unit) in CHANGES.items():
        if name not in table.columns:
            continue
        step = np.abs(_steps(table.columns[name], batches))
        if name == "north_m":
            step = np.hypot(step, _steps(table.columns["east_m"], batches))
        ordinary = JUMP_RATIO * float(np.percentile(step[step > 0], 95)) if step.any() else 0.0
        jump = step > max(least, fastest * sample_time_s, ordinary)
        if jump.any() and name in needed:
            what = "position jumps" if name == "north_m" else "jumps"
            found = f"{what} by {step[int(np.argmax(jump))]:.4g} {unit} in {table.rows(jump)}"
            raise table.error(name, f"{found}, expected what a ship can do in {sample_time_s:g} s")
        odd = step > ordinary
        if odd.any() and name in NOTED:
            what = "the position" if name == "north_m" else table.sources[name].header
            notes.append(f"{what} changes by up to {step[odd].max():.3g} {unit} at once in {table.rows(odd)}")
    return table.noted(*notes)


def _steps(values: Array, batches: tuple[slice, ...]) -> Array:
    """(k,) change into each sample from the one before it in the same batch, else 0."""
    steps = np.zeros(len(values))
    for part in batches:
        steps[part.start + 1 : part.stop] = np.diff(values[part])
    return steps


@sealed(position="2")
class Fix:
    """A measured position and heading."""

    path: Path  # the file
    row: int  # of the file (header is row 1)
    degrees: bool  # whether the position is in degrees of latitude and longitude, or in metres north and east
    position: Array  # (2,) latitude, longitude [deg] or north, east [m]
    heading_rad: float  # clockwise from north


def last_fix(path: Path) -> Fix:
    """Position and heading in the last row of a file that has every number; latitude and longitude come first.

    Raises:
        FileError: unreadable, or without positions or headings.
    """
    table = read_table(path, inputs=None)
    check_ranges(table)
    degrees = "lat_deg" in table.columns
    names = ("lat_deg", "lon_deg") if degrees else ("north_m", "east_m")
    missing = [name for name in (*names, "heading_rad") if name not in table.columns]
    if missing:
        wanted = "heading_rad or heading_deg" if missing == ["heading_rad"] else "lat_deg lon_deg, or north_m east_m"
        raise FileError(path, "row 1", f"gives no final position and heading of the ship, expected {wanted}")
    return Fix(
        path=path,
        row=table.first_row + len(table) - 1,
        degrees=degrees,
        position=table.stack(*names)[-1],
        heading_rad=float(table.columns["heading_rad"][-1]),
    )
