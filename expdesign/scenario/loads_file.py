"""Files of load cases: what is known of a ship's masses, and what lay on board in each run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from pydantic import Field

from expdesign.roll import MEANINGS, NOMINAL, PARAMETERS, UNITS, Body, Load
from expdesign.scenario.tables import Entry, NonNegative, Number, Positive, Table, check_table, read_toml


class ShipTable(Table):
    """`[ship]`."""

    mass_kg: Positive = Field(description="the mass of the ship without load [kg]")
    mass_height_m: Number = Field(description="the height of her centre of mass above the origin [m]")
    sensor_height_m: Number = Field(
        description="the height of the accelerometer [m] above the origin, or above the rotation axis"
    )
    sensor_above_axis: bool = Field(
        default=False, description="whether sensor_height_m is counted from the rotation axis, which has been located"
    )
    beam_m: Positive = Field(description="her beam [m], from which a search begins")
    period_s: Positive = Field(description="her roll period [s], roughly; a filter must pass it")


class LoadTable(Table):
    """`[[load]]`."""

    mass_kg: NonNegative = Field(default=0.0, description="the mass of the known load [kg]")
    height_m: Number = Field(default=0.0, description="the height of its centre above the origin [m]")
    inertia_kgm2: NonNegative = Field(default=0.0, description="its inertia about its own centre [kg m2]")
    unknown: bool = Field(default=False, description="whether this load is the one that is sought")


class LoadsFile(Table):
    """A file of load cases."""

    topic: ClassVar[str] = "loads"

    ship: ShipTable = Field(description="a table [ship]")
    load: list[LoadTable] = Field(min_length=1, description="tables [[load]], one for each data file in their order")
    known: dict[str, Number] = Field(
        default_factory=dict,
        description=f"a table [known] of parameters not to estimate: {', '.join(PARAMETERS)}",
    )
    start: dict[str, Number] = Field(
        default_factory=dict, description="a table [start] of parameters where the search begins"
    )


@dataclass(frozen=True, kw_only=True)
class LoadCases:
    """What a file of load cases says.

    Attributes:
        body: of the ship.
        loads: of each data file; None for the unknown one.
        beam_m, period_s: of the ship.
        known, start: parameters by name.
    """

    body: Body
    loads: tuple[Load | None, ...]
    beam_m: float
    period_s: float
    known: Mapping[str, float]
    start: Mapping[str, float]


def load_cases(path: Path | str) -> LoadCases:
    """Read a file of load cases.

    Raises:
        FileError: unreadable, or something in it is wrong, missing or unknown.
    """
    entry = Entry(Path(path))
    file = check_table(LoadsFile, read_toml(entry.path), entry)
    ship = file.ship
    for name in file.start:
        if name in file.known:
            raise entry.at("start").at(name).error("is also under [known], expected it under one of them")
    return LoadCases(
        body=Body(
            mass_kg=ship.mass_kg, z_g=-ship.mass_height_m, z_s=-ship.sensor_height_m,
            sensor_from_axis=ship.sensor_above_axis,
        ),
        loads=tuple(_load(table, entry.at("load").item(number)) for number, table in enumerate(file.load, start=1)),
        beam_m=ship.beam_m,
        period_s=ship.period_s,
        known=_named(file.known, entry.at("known")),
        start=_named(file.start, entry.at("start")),
    )  # fmt: skip


def _load(table: LoadTable, entry: Entry) -> Load | None:
    if not table.unknown:
        same = Load(mass_kg=table.mass_kg, z_m=-table.height_m, inertia_kgm2=table.inertia_kgm2)
        return same if table.mass_kg else NOMINAL
    if table.mass_kg or table.height_m or table.inertia_kgm2:
        raise entry.error("is unknown = true and states a load, expected one of them")
    return None


def _named(given: Mapping[str, float], entry: Entry) -> Mapping[str, float]:
    for name, value in given.items():
        if name not in UNITS:
            raise entry.unknown(name, [f"{known} ({MEANINGS[known]}, {UNITS[known]})" for known in PARAMETERS])
        if name == "A_x" and value <= 0:
            raise entry.at(name).error(f"is {value:g}, expected more than 0: {MEANINGS[name]} [{UNITS[name]}]")
    return given
