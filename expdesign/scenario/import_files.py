"""Files of `expdesign import`: the mapping that it reads, and `instruments.toml`, which it leaves beside its runs.

The latter states what the logs tell of sensors and actuators. It speaks for a vessel file that says nothing of
them. What the vessel file states counts, and a difference is told.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field

from expdesign.importing.mapping import EXTRA_COLUMNS, FACTORS, SHARES, FileClock, Mapping, Use, dimension
from expdesign.records.file import Source, is_input, meaning
from expdesign.scenario.tables import Entry, NonNegative, Number, Positive, Table, Text, check_table, read_toml
from expdesign.scenario.vessels import load_vessel, vessel_of
from expdesign.scenario.vessels.vessel_tables import SensorsTable
from expdesign.vessel import Vessel, response_keys, stem
from expdesign.vessel.actuators import SIGNALS
from expdesign.vessel.quantities import NOISE

INSTRUMENTS = "instruments.toml"
NOISE_FACTOR, FACTOR = 1.5, 1.1
"""Ratio of two values from which they differ: of a noise, and of an interval, a rate, a lag or a dead time."""
TOLD = ("rate", "lag_s", "delay_s")  # fields of a response


class InstrumentsFile(Table):
    """What an import leaves beside its runs; all commands that read measured data take it."""

    topic: ClassVar[str] = "instruments"

    sensors: SensorsTable = Field(
        default_factory=SensorsTable,
        description="keys of [sensors] in vessel files that the logs tell: noise, interval",
    )
    actuators: dict[str, dict[str, Positive]] = Field(
        default_factory=dict,
        description="signal, as rudder1, -> slew rate, lag and dead time by their keys in [[actuators]]",
    )


def load_instruments(path: Path) -> InstrumentsFile:
    """Read the file.

    Raises:
        FileError: unreadable, or something in it is wrong or unknown.
    """
    entry = Entry(path)
    file = check_table(InstrumentsFile, read_toml(path), entry)
    for signal, given in file.actuators.items():
        if stem(signal) not in SIGNALS:
            raise entry.at("actuators").unknown(signal, [f"{name}1" for name in SIGNALS])
        known = [key for field, key in response_keys(stem(signal)).items() if field in TOLD]
        for key in given:
            if key not in known:
                raise entry.at("actuators").at(signal).unknown(key, known)
    return file


def equipped_vessel(path: Path, data: Sequence[Path]) -> tuple[Vessel, tuple[str, ...]]:
    """The vessel of a file, with what imports tell of sensors and actuators where the file is silent, and notes.

    Args:
        data: files, or folders of them; those without the file of an import beside them tell nothing.

    Raises:
        FileError: a file is wrong.
    """
    ship = load_vessel(path)
    folders = dict.fromkeys(own if own.is_dir() else own.parent for own in data)
    files = [folder / INSTRUMENTS for folder in folders if (folder / INSTRUMENTS).is_file()]
    if not files:
        return ship, ()
    raw = read_toml(path)
    sources: dict[tuple[str, str], Path] = {}
    notes: list[str] = []
    for file in files:
        taken: list[str] = []
        for where, table, told in _tables(raw, ship, load_instruments(file)):
            for key, value in told.items():
                words = f"{where} {key} = {value:.3g}".strip()
                if key not in table:
                    table[key], sources[where, key] = value, file
                    taken.append(words)
                elif _differ(key, float(table[key]), value):
                    source = sources.get((where, key), path)
                    notes.append(
                        f"{_named(file)} shows {words}, where {_named(source)} says {table[key]:.3g}, which counts"
                    )
        if taken:
            notes.insert(0, f"by {_named(file)}, as {path.name} does not say: {', '.join(taken)}")
    return vessel_of(raw, Entry(path)), tuple(notes)


def _named(path: Path) -> str:
    """A file with its folder, as all of these have one name."""
    return f"{path.parent.name}/{path.name}" if path.name == INSTRUMENTS else path.name


def _tables(
    raw: dict[str, Any], ship: Vessel, told: InstrumentsFile
) -> Iterator[tuple[str, dict[str, Any], dict[str, float]]]:
    """Words, the table of the vessel file, and what is told of its keys."""
    yield "", raw.setdefault("sensors", {}), told.sensors.model_dump(exclude_unset=True)
    rows = dict(zip((one.signals for one in ship.actuators), raw.get("actuators", []), strict=True))
    for signal, values in told.actuators.items():
        row = next((own for signals, own in rows.items() if signal in signals), None)
        if row is not None:
            yield signal, row, values


def _differ(key: str, one: float, other: float) -> bool:
    factor = NOISE_FACTOR if key in NOISE else FACTOR
    return not (one > 0 and other > 0) or abs(math.log(one / other)) > math.log(factor)


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
        files=tuple(FileClock(file=one.name, **one.model_dump(exclude={"name"})) for one in file.file),
        **file.model_dump(exclude={"file", "channel"}),
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
    return Use(**table.model_dump())
