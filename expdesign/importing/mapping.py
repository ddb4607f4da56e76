"""What becomes of the channels of logs: columns, units as people write them, senses, clocks.

A column has our unit in its name (`expdesign explain data`). Beside ours there are a few that others are made from:
speed and course over ground, velocity north and east, magnetic heading and variation.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

import numpy as np

from expdesign.importing.channels import Channel
from expdesign.records.file import ANGLE, REVOLUTIONS, SPEED, YAW_RATE, is_input

DEGREE, KNOT = math.pi / 180.0, 1852.0 / 3600.0
FACTORS: dict[str, dict[str, float]] = {
    "angle": {**ANGLE, "°": DEGREE, "degree": DEGREE, "grad": DEGREE, "cdeg": 0.01 * DEGREE, "ddeg": 0.1 * DEGREE},
    "speed": {**SPEED, "m/sec": 1.0, "mm/s": 1e-3, "km/hr": 1.0 / 3.6, "mph": 0.44704,
              **dict.fromkeys(("nds", "noeuds", "knop", "knob", "knoop", "knopen", "knoten", "nudos", "nodi"), KNOT)},
    "rate": {**YAW_RATE, "°/s": DEGREE, "°/min": DEGREE / 60.0, "deg/sec": DEGREE, "degrees/s": DEGREE,
             "deg/m": DEGREE / 60.0, "rad/sec": 1.0, "mrad/s": 1e-3, "r/s": 1.0},
    "place": {"deg": 1.0, "°": 1.0, "degrees": 1.0, "degree": 1.0, "rad": 1.0 / DEGREE, "1e-7 deg": 1e-7, "ddmm": 1.0},
    "length": {"m": 1.0, "km": 1e3, "cm": 0.01, "mm": 1e-3, "ft": 0.3048, "meters": 1.0, "metres": 1.0, "nm": 1852.0},
    "revolutions": {**REVOLUTIONS, "1/s": 1.0, "r/min": 1.0 / 60.0,
                    **dict.fromkeys(("u/min", "tr/min", "rev/min", "min-1"), 1.0 / 60.0)},
    "acceleration": {"mps2": 1.0, "m/s2": 1.0, "m/s^2": 1.0, "m/s/s": 1.0, "g": 9.80665, "mg": 9.80665e-3},
    "force": {"": 1.0},
}  # fmt: skip
"""Dimension -> unit -> factor to the unit of our columns (rad, m/s, rad/s, deg, m, rps, m/s2)."""
SHARES = {**dict.fromkeys(("percent", "%", "pct", "perc", "prozent"), 0.01), "pwm": 1.0 / 500.0, "share": 1.0}
"""Units of an order that is a share of the largest, and their factor; of pulse widths the middle, 1500 us, is zero."""
KNOWN = {unit for table in FACTORS.values() for unit in table if unit} | set(SHARES)
ALIASES = {"kt": "kn", "kts": "kn", "knots": "kn", "knot": "kn", "degrees": "deg", "degree": "deg", "°": "deg",
           "m/s": "mps", "m/sec": "mps", "deg/s": "degps", "°/s": "degps", "deg/sec": "degps", "deg/min": "degpmin",
           "°/min": "degpmin", "rad/s": "radps",
           **dict.fromkeys(("%", "pct", "perc", "prozent"), "percent"),
           "1/min": "rpm", "km/h": "kmph"}  # fmt: skip
"""Units as people write them -> one word for each."""
RATES = re.compile(r"_(deg|rad|km|m|cm|rev|r)_(s|min|h)(?:_1)?$")
"""Units of two parts at the end of a name, as rate_deg_min."""


def split_unit(name: str) -> tuple[str, str]:
    """A name without its unit, and the unit: `Speed (kn)`, `SOG [kts]`, `rudder_deg`; "" where there is none."""
    if (ending := RATES.search(name)) and f"{ending[1]}/{ending[2]}" in KNOWN:
        return name[: ending.start()], unit_word(f"{ending[1]}/{ending[2]}")
    bracket = re.search(r"[\[({]\s*([^\])}]*?)\s*[\])}]\s*$", name)
    if bracket and bracket[1].lower() in KNOWN:
        return name[: bracket.start()].strip(), unit_word(bracket[1])
    ending = re.search(r"[_\s,/]+([A-Za-z%°/0-9]+)$", name)
    if ending and len(ending[1]) > 1 and ending[1].lower() in KNOWN and ending[1].lower() != "nm":
        return name[: ending.start()].strip(), unit_word(ending[1])
    return name, ""


def counted(count: int, what: str) -> str:
    """`1 line`, `2 lines`."""
    return f"{count} {what}{'s' if count != 1 else ''}"


def unit_word(text: str) -> str:
    """The one word for a unit."""
    unit = text.strip().lower()
    return ALIASES.get(unit, unit)


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
