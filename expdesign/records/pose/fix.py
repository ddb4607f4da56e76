"""The last fix of a file: where the ship was when the data end."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from expdesign.errors import FileError
from expdesign.records.file import check_ranges, read_table
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class Fix:
    """A measured position and heading.

    Attributes:
        path: the file.
        row: of the file (header is row 1).
        degrees: whether the position is in degrees of latitude and longitude, or in metres north and east.
        position: (2,) latitude, longitude [deg] or north, east [m].
        heading_rad: clockwise from north.
    """

    path: Path
    row: int
    degrees: bool
    position: Array
    heading_rad: float

    def __post_init__(self) -> None:
        seal(self, position="2")


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
