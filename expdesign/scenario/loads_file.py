"""Files of load cases: what is known of a ship's masses, and what lay on board in each run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from pydantic import Field

from expdesign.roll import MEANINGS, PARAMETERS, UNITS, Body, Load
from expdesign.scenario.tables import Entry, Number, Positive, Table, check_table, read_toml
from expdesign.scenario.vessels.pendulum_table import BodyTable, LoadTable
from expdesign.vessel import Vessel


class ShipTable(BodyTable):
    """`[ship]`."""

    beam_m: Positive = Field(description="her beam [m], from which a search begins")
    period_s: Positive = Field(description="her roll period [s], roughly; a filter must pass it")


class CaseTable(LoadTable):
    """`[[load]]`."""

    unknown: bool = Field(default=False, description="whether this load is the one that is sought")


class LoadsFile(Table):
    """A file of load cases."""

    topic: ClassVar[str] = "loads"

    ship: ShipTable | None = Field(
        default=None, description="a table [ship]; left out where a vessel file with [roll] says the same"
    )
    load: list[CaseTable] = Field(min_length=1, description="tables [[load]], one for each data file in their order")
    known: dict[str, Number] = Field(
        default_factory=dict,
        description=f"a table [known] of parameters not to estimate: {', '.join(PARAMETERS)}",
    )
    start: dict[str, Number] = Field(
        default_factory=dict, description="a table [start] of parameters where the search begins"
    )


@dataclass(frozen=True, kw_only=True)
class LoadCases:
    """What a file of load cases says."""

    body: Body  # of the ship
    loads: tuple[Load | None, ...]  # of each data file; None for the unknown one
    # beam_m, period_s: of the ship
    beam_m: float
    period_s: float
    # known, start: parameters by name
    known: Mapping[str, float]
    start: Mapping[str, float]


def load_cases(path: Path | str, vessel: Vessel | None = None) -> LoadCases:
    """Read a file of load cases.

    Args:
        vessel: whose [roll], if it has one, is in place of the file's [ship], and where the search begins.

    Raises:
        FileError: unreadable, or something in it is wrong, missing or unknown.
    """
    entry = Entry(Path(path))
    file = check_table(LoadsFile, read_toml(entry.path), entry)
    for name in file.start:
        if name in file.known:
            raise entry.at("start").at(name).error("is also under [known], expected it under one of them")
    known, start = _named(file.known, entry.at("known")), _named(file.start, entry.at("start"))
    loads = tuple(_load(table, entry.at("load").item(number)) for number, table in enumerate(file.load, start=1))
    if vessel is None or vessel.pendulum is None:
        if file.ship is None:
            raise entry.at("ship").error("is missing, expected this table, or --vessel with a file that has [roll]")
        return LoadCases(
            body=file.ship.body, loads=loads, beam_m=file.ship.beam_m, period_s=file.ship.period_s, known=known,
            start=start,
        )  # fmt: skip
    if file.ship is not None:
        raise entry.at("ship").error(f"is given, and [roll] of vessel {vessel.name!r} too, expected one of them")
    if not math.isfinite(vessel.pendulum.period_s):
        raise entry.error(f"vessel {vessel.name!r} does not stay upright by her [roll], expected one that does")
    begin = {name: value for name, value in vessel.pendulum.parameters.items() if name not in known}
    return LoadCases(
        body=vessel.pendulum.body, loads=loads, beam_m=vessel.beam_m, period_s=vessel.pendulum.period_s, known=known,
        start={**begin, **start},
    )  # fmt: skip


def _load(table: CaseTable, entry: Entry) -> Load | None:
    if not table.unknown:
        return table.load
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
