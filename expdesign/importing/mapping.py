"""What becomes of the channels of logs: columns, units, senses, clocks.

A column has our unit in its name (`expdesign explain data`). Beside ours there are a few that others are made from:
speed and course over ground, velocity north and east, magnetic heading and variation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from expdesign.importing.channels import Channel
from expdesign.importing.units import FACTORS, SHARES
from expdesign.records.file import is_input

SOG, COG, NORTHWARD, EASTWARD = "sog_mps", "cog_rad", "vn_mps", "ve_mps"
MAGNETIC, VARIATION = "magnetic_heading_rad", "variation_rad"
EXTRA_COLUMNS = {
    SOG: "speed over ground; with the course and the heading it gives u_mps and v_mps",
    COG: "course over ground",
    NORTHWARD: "velocity over ground towards north",
    EASTWARD: "velocity over ground towards east",
    MAGNETIC: "heading from magnetic north; the variation is added",
    VARIATION: "variation, positive where magnetic north is east of true north",
}
"""Columns that others are made from, and their meaning."""


@dataclass(frozen=True, kw_only=True)
class Use:
    """What becomes of one channel: column = readings in the unit, times scale, plus offset."""

    file: str
    channel: str
    column: str = ""  # "" where it is not used
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0  # in the unit of the column
    why: str = ""

    @property
    def factor(self) -> float:
        """From the unit to that of the column."""
        if self.unit in SHARES and (is_input(self.column.removeprefix("reached_")) or self.column.startswith("tau")):
            return SHARES[self.unit]
        return FACTORS[dimension(self.column)].get(self.unit, 1.0)

    def applied(self, channel: Channel) -> Channel:
        """The channel in the column's unit."""
        values = channel.values - 1500.0 if self.unit == "pwm" else channel.values
        if self.unit == "ddmm":  # degrees and minutes run together
            size = np.abs(values)
            values = np.sign(values) * (np.floor(size / 100.0) + size % 100.0 / 60.0)
        factor = self.factor * self.scale
        values = values * factor + self.offset if factor != 1.0 or self.offset else values
        return replace(channel, name=self.column, unit="", values=values)


@dataclass(frozen=True, kw_only=True)
class FileClock:
    """What is added to the times of a file."""

    file: str
    offset_s: float = 0.0
    offset_std_s: float = 0.0
    sample_time_s: float = 0.0  # between rows of a table without a clock; 0 where it has one


@dataclass(frozen=True, kw_only=True)
class Mapping:
    """All decisions."""

    uses: tuple[Use, ...]
    files: tuple[FileClock, ...] = ()
    sample_time_s: float = 0.0  # of what is written; 0 for the slowest of the main sensors
    variation_deg: float | None = None  # of a magnetic heading
    # antenna_forward_m, antenna_starboard_m: place of the satellite antenna
    antenna_forward_m: float = 0.0
    antenna_starboard_m: float = 0.0
    length_m: float = 0.0  # of the ship; 0 where it is not known


def dimension(column: str) -> str:
    """Key of `FACTORS` of a column."""
    if column in ("lat_deg", "lon_deg"):
        return "place"
    ends = (("_radps", "rate"), ("_rad", "angle"), ("_mps2", "acceleration"), ("_mps", "speed"),
            ("_rps", "revolutions"),
            ("_m", "length"))  # fmt: skip
    return next((name for end, name in ends if column.endswith(end)), "force")
