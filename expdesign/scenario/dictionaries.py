"""Dictionary files, the command files of recorded primitives, and files of load cases.

Load cases say what is known of a ship's masses, and what lay on board in each run.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from expdesign.dictionary import FAMILIES
from expdesign.dictionary.spec import Family, PrimitiveSpec, complete_settings
from expdesign.errors import FileError, InputError
from expdesign.roll import MEANINGS, PARAMETERS, UNITS, Body, Load
from expdesign.scenario.tables import (
    Entry,
    Number,
    Positive,
    Table,
    Text,
    check_table,
    read_text,
    read_toml,
    see,
    shown,
)
from expdesign.scenario.vessels.pendulum_table import BodyTable, LoadTable
from expdesign.signals import Commands
from expdesign.values import Array
from expdesign.vessel import Vessel, column_name

SIGNAL = re.compile(r"(n\d+)_rps|(a\d+|rudder\d+)_rad|(tau_x|tau_y|tau_psi)")
MOTION = ("u_mps", "v_mps", "r_radps")
SPREAD = 1e-3  # share of a sample time by which steps of time may differ


def load_recorded(path: Path | str) -> tuple[Commands, dict[str, float]]:
    """Commands of a file, and the entry velocity where the file has it.

    Args:
        path: a CSV with `time_s` in even steps and one column for each actuator signal, named as in commands.csv
            (`n1_rps`, `a1_rad`, `rudder1_rad`, `tau_x`), each held to the next row. With `u_mps`, `v_mps`, `r_radps`
            (through water) the first row is the entry state. Other columns are left alone.

    Raises:
        FileError: unreadable, without commands, with uneven times or with cells that are not numbers.
    """
    source = Path(path)
    rows = list(csv.reader(io.StringIO(read_text(source, "a CSV file"))))
    header = [cell.strip() for cell in rows[0]] if rows else []
    if len(set(header)) < len(header):
        raise FileError(source, "row 1", "names a column twice")
    if "time_s" not in header:
        raise FileError(source, "row 1", "has no column time_s, expected one and columns like n1_rps, a1_rad, tau_x")
    names = [name for name in header if SIGNAL.fullmatch(name)]
    if not names:
        raise FileError(source, "row 1", "has no column of commands, expected names like n1_rps, a1_rad, tau_x")
    motion = [name for name in MOTION if name in header]
    table = _numbers(source, header, [row for row in rows[1:] if row], ["time_s", *names, *motion])
    sample_time_s = _step(source, table[:, 0])
    signals = tuple(signal_of(name) for name in names)
    commands = Commands(sample_time_s=sample_time_s, names=signals, values=table[:, 1 : 1 + len(names)])
    entry = dict(zip(motion, table[0, 1 + len(names) :].tolist(), strict=True))
    keys = dict(zip(MOTION, ("speed_mps", "sway_mps", "yaw_rate_radps"), strict=True))
    return commands, {keys[name]: value for name, value in entry.items()}


def signal_of(column: str) -> str:
    """The actuator signal of a column: n1_rps -> n1."""
    found = SIGNAL.fullmatch(column)
    assert found is not None
    name = next(part for part in found.groups() if part)
    assert column_name(name) == column
    return name


def _numbers(path: Path, header: Sequence[str], rows: Sequence[Sequence[str]], wanted: Sequence[str]) -> Array:
    """(k, c) the wanted columns."""
    places = [header.index(name) for name in wanted]
    table = np.empty((len(rows), len(wanted)))
    for number, row in enumerate(rows):
        for column, place in enumerate(places):
            cell = row[place] if place < len(row) else ""
            try:
                table[number, column] = float(cell)
            except ValueError:
                table[number, column] = np.nan
            if not abs(table[number, column]) < 1e12:
                raise FileError(path, f"row {number + 2}, {wanted[column]}", f"is {cell!r}, expected a number")
    return table


def _step(path: Path, time_s: Array) -> float:
    if len(time_s) < 2:
        raise FileError(path, "", f"has {len(time_s)} rows of commands, expected at least 2")
    steps = np.diff(time_s)
    middle = float(np.median(steps))
    uneven = np.flatnonzero(~(np.abs(steps - middle) <= SPREAD * abs(middle)))
    if middle <= 0 or len(uneven):
        row = int(uneven[0]) + 3 if len(uneven) else 3
        raise FileError(path, f"row {row}, time_s", f"is {time_s[row - 2]:g}, expected even steps of {abs(middle):g} s")
    return float((time_s[-1] - time_s[0]) / len(steps))


LARGEST_GRID = 10_000
NAME = re.compile(r"\w([\w .+-]{0,78}[\w+-])?")
NAME_RULE = "at most 80 letters, digits, spaces and . _ + - that can name a file"


class NameTable(Table):
    """`[dictionary]`."""

    name: Text = Field(description="a name for the dictionary")


class PrimitiveTable(Table):
    """Keys of `[[primitives]]` in addition to the settings of the family."""

    family: Text = Field(description="the manoeuvre family, see expdesign explain families")
    name: Text | None = Field(
        default=None,
        description="the name of the manoeuvre; the family's when not given, with -2, -3 ... for further entries",
    )
    file: Text | None = Field(
        default=None, description="the path of a CSV of commands, for family 'recorded', which takes its length from it"
    )


class DictionaryTable(Table):
    """The whole file."""

    topic = "dictionary"

    dictionary: NameTable = Field(description="a table [dictionary] with a name")
    primitives: list[dict[str, Any]] = Field(min_length=1, description="at least one table [[primitives]]")


def load_dictionary(path: Path | str, *, families: tuple[Family, ...] = FAMILIES) -> tuple[PrimitiveSpec, ...]:
    """Read a dictionary file.

    Each `[[primitives]]` names a family and gives its settings; one with lists of values stands for every combination,
    in the order of the file, the last list running fastest. Names are given by `name` or else by the family (with -2,
    -3 ... for further entries of the same family); a grid adds `-setting-value`, without the unit, for every list.
    `family = "recorded"` takes `file`, the path of a CSV of commands relative to this file, instead of a duration.

    Args:
        path: a TOML file with `[dictionary]` and `[[primitives]]`.
        families: the manoeuvre families it may ask for.

    Raises:
        FileError: unreadable, or something in it is wrong, missing or unknown, or a name occurs twice.
    """
    entry = Entry(Path(path))
    file = check_table(DictionaryTable, read_toml(entry.path), entry)
    by_name = {family.name: family for family in families}
    specs: dict[str, PrimitiveSpec] = {}
    unnamed: dict[str, int] = {}
    for index, row in enumerate(file.primitives, start=1):
        place = entry.at("primitives").item(index)
        family = _family(row, by_name, place.at("family"))
        stem = _stem(row, family, unnamed, place.at("name"))
        for spec in (
            _recorded(row, family, stem, place) if family.name == "recorded" else _grid(row, family, stem, place)
        ):
            if spec.name in specs:
                raise place.at("name").error(f"is {spec.name!r}, expected a name not used before")
            specs[spec.name] = replace(spec, place=f"{place.path}: {place.key}")
    return tuple(specs.values())


def _family(row: Mapping[str, Any], families: Mapping[str, Family], entry: Entry) -> Family:
    name = row.get("family")
    if not isinstance(name, str):
        found = "is missing" if name is None else f"is {shown(name)}"
        raise entry.error(f"{found}, expected one of {', '.join(families)}{see('families')}")
    if name not in families:
        raise entry.unknown(name, families)
    return families[name]


def _stem(row: Mapping[str, Any], family: Family, unnamed: dict[str, int], entry: Entry) -> str:
    """The given name, or the family's with a number from the second unnamed entry on."""
    if "name" not in row:
        unnamed[family.name] = count = unnamed.get(family.name, 0) + 1
        return family.name if count == 1 else f"{family.name}-{count}"
    name = row["name"]
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise entry.error(f"is {shown(name)}, expected {NAME_RULE}")
    return name


def _recorded(row: Mapping[str, Any], family: Family, stem: str, entry: Entry) -> Iterator[PrimitiveSpec]:
    """The one primitive of a command file; its duration is the file's."""
    named = row.get("file")
    if not isinstance(named, str) or not named:
        found = "is missing" if named is None else f"is {shown(named)}"
        raise entry.at("file").error(f"{found}, expected {PrimitiveTable.model_fields['file'].description}")
    if "duration_s" in row:
        raise entry.at("duration_s").error("is given, but the duration of a recorded primitive is that of its file")
    commands, begins = load_recorded(entry.at("file").file(named))
    rest = {name: value for name, value in row.items() if name != "file"}
    for name in rest:
        if name not in ("family", "name") and isinstance(rest[name], list):
            raise entry.at(name).error("is a list, expected a number")
    whole = {**begins, **rest, "duration_s": commands.duration_s}
    for spec in _grid(whole, family, stem, entry):
        yield replace(spec, commands=commands)


def _grid(row: Mapping[str, Any], family: Family, stem: str, entry: Entry) -> Iterator[PrimitiveSpec]:
    given = {name: value for name, value in row.items() if name not in PrimitiveTable.model_fields}
    axes = {name: _values(value, entry.at(name)) for name, value in given.items()}
    count = math.prod(len(values) for values in axes.values())
    if count > LARGEST_GRID:
        raise entry.error(f"makes {count} primitives, expected at most {LARGEST_GRID}")
    lists = [name for name, value in given.items() if isinstance(value, list)]
    for combination in product(*axes.values()):
        settings = dict(zip(axes, combination, strict=True))
        try:
            complete = complete_settings(family, settings)
        except InputError as error:
            raise entry.error(f"{error}{see(family.name)}") from None
        name = "-".join([stem, *(f"{_without_unit(name)}-{settings[name]:.12g}" for name in lists)])
        yield PrimitiveSpec(name=name, family=family.name, settings=complete)


def _without_unit(setting: str) -> str:
    """The setting's name as it reads in a primitive's: yaw_rate_radps -> yaw-rate."""
    return re.sub(r"_(s|m|mps|rad|radps)$", "", setting).replace("_", "-")


def _values(value: object, entry: Entry) -> list[float]:
    """One value as a list of one, or a list without repeats."""
    values: list[Any] = value if isinstance(value, list) else [value]
    if not values:
        raise entry.error("is an empty list, expected a number or a list of numbers")
    for number in values:
        if type(number) not in (int, float) or not abs(number) < 1e300:
            raise entry.error(f"is {shown(number)}, expected a finite number or a list of them")
    repeats = [number for number, times in Counter(values).items() if times > 1]
    if repeats:
        raise entry.error(f"has {shown(float(repeats[0]))} more than once, expected different values")
    return [float(number) for number in values]


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
