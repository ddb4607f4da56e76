"""Mapping files of `expdesign import`: which channel of a log is which column, in which unit, and the clocks."""

from __future__ import annotations

import re
from pathlib import Path
from typing import ClassVar

from pydantic import Field

from expdesign.importing.mapping import EXTRA_COLUMNS, FileClock, Mapping, Use, dimension
from expdesign.importing.units import FACTORS, SHARES
from expdesign.records.file import Source, is_input, meaning
from expdesign.scenario.tables import Entry, NonNegative, Number, Table, Text, check_table, read_toml

COLUMNS_BESIDE = EXTRA_COLUMNS
UNITS = ", ".join(dict.fromkeys(unit for table in FACTORS.values() for unit in table if unit.isascii() and unit))


class ChannelTable(Table):
    """`[[channel]]`."""

    file: Text = Field(description="name of the log, without its folder")
    channel: Text = Field(description="name of the channel in it, as the table of the import shows it")
    column: str = Field(
        description='column that it becomes (expdesign explain data), or one of those below; "" leaves it out'
    )
    unit: str = Field(default="", description=f"unit of its readings: {UNITS}, percent, share or pwm")
    scale: Number = Field(default=1.0, description="further factor, -1 where the channel counts the other way")
    offset: Number = Field(default=0.0, description="added afterwards, in the unit of the column")
    why: str = Field(default="", description="why it was guessed so; not read")


class FileTable(Table):
    """`[[file]]`."""

    name: Text = Field(description="name of the log, without its folder")
    offset_s: Number = Field(default=0.0, description="added to its times [s]")
    offset_std_s: NonNegative = Field(default=0.0, description="standard error of that, where it was estimated [s]")
    sample_time_s: NonNegative = Field(
        default=0.0, description="time between rows of a table without a clock [s]; 0 where it has one"
    )


class MappingFile(Table):
    """A mapping file."""

    topic: ClassVar[str] = "mapping"

    sample_time_s: NonNegative = Field(
        default=0.0, description="time between rows that are written [s]; 0 for the slowest main sensor's, at most 1"
    )
    length_m: NonNegative = Field(default=0.0, description="length of the ship [m]; 0 where it is not known")
    variation_deg: Number | None = Field(
        default=None, description="variation that is added to a magnetic heading [deg], positive to the east"
    )
    antenna_forward_m: Number = Field(
        default=0.0, description="place of the satellite antenna forward of amidships [m]"
    )
    antenna_starboard_m: Number = Field(default=0.0, description="place of the antenna to starboard [m]")
    file: list[FileTable] = Field(default_factory=list, description="tables [[file]], one for each log")
    channel: list[ChannelTable] = Field(
        min_length=1, description="tables [[channel]], one for each channel that is used"
    )


def load_mapping(path: Path | str) -> Mapping:
    """Read a mapping file.

    Raises:
        FileError: unreadable, or something in it is wrong, missing or unknown.
    """
    entry = Entry(Path(path))
    file = check_table(MappingFile, read_toml(entry.path), entry)
    uses = [_use(table, entry.at("channel").item(number)) for number, table in enumerate(file.channel, start=1)]
    given: dict[str, int] = {}
    for number, use in enumerate(uses, start=1):
        if use.column and use.column in given:
            raise (
                entry.at("channel")
                .item(number)
                .at("column")
                .error(f"is {use.column!r} as in channel[{given[use.column]}], expected every column once")
            )
        given[use.column] = number
    return Mapping(
        uses=tuple(uses),
        files=tuple(
            FileClock(
                file=one.name, offset_s=one.offset_s, offset_std_s=one.offset_std_s, sample_time_s=one.sample_time_s
            )
            for one in file.file
        ),
        sample_time_s=file.sample_time_s,
        variation_deg=file.variation_deg,
        antenna_forward_m=file.antenna_forward_m,
        antenna_starboard_m=file.antenna_starboard_m,
        length_m=file.length_m,
    )


def _use(table: ChannelTable, entry: Entry) -> Use:
    column = table.column
    if not table.scale:
        raise entry.at("scale").error('is 0, expected another number; column = "" leaves a channel out')
    if column and column not in EXTRA_COLUMNS:
        known = meaning(column, 0)
        if not isinstance(known, Source):
            names = [*EXTRA_COLUMNS, "lat_deg", "lon_deg", "heading_rad", "u_mps", "v_mps", "r_radps", "n1_rps",
                     "a1_rad", "rudder1_rad", "reached_rudder1_rad", "tau_x", "tau_psi", "wind_speed_mps",
                     "wind_angle_rad", "depth_m", "roll_rad"]  # fmt: skip
            raise entry.at("column").unknown(column, names)
        if known.factor != 1.0 or known.name != column:
            raise entry.at("column").error(f"is {column!r}, expected {known.name!r} with the unit under unit")
    dims = FACTORS[dimension(column)]
    shares = SHARES if is_input(re.sub("^(reached|planned)_", "", column)) or column.startswith("tau") else {}
    if column and table.unit and table.unit not in dims and table.unit not in shares:
        raise entry.at("unit").unknown(table.unit, [unit for unit in (*dims, *shares) if unit])
    return Use(
        file=table.file, channel=table.channel, column=column, unit=table.unit, scale=table.scale, offset=table.offset,
        why=table.why,
    )  # fmt: skip
