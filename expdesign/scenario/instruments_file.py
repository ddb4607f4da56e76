"""`instruments.toml`, which an import leaves beside its runs: what the logs tell of sensors and actuators.

It speaks for a vessel file that says nothing of them. What the vessel file states counts, and a difference is told.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field

from expdesign.scenario.tables import Entry, Positive, Table, check_table, read_toml
from expdesign.scenario.vessels import load_vessel, vessel_of
from expdesign.scenario.vessels.vessel_tables import SensorsTable
from expdesign.vessel import Vessel, response_keys, stem
from expdesign.vessel.actuators import SIGNALS
from expdesign.vessel.quantities import NOISE

INSTRUMENTS = "instruments.toml"
"""Its name."""
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
        path: of the vessel file.
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
) -> Iterator[tuple[str, dict[str, Any], Mapping[str, float]]]:
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
