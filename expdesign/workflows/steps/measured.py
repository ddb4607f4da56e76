"""Measured data of a vessel."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from expdesign.errors import FileError, NoAnswer
from expdesign.estimation.regression import with_depth
from expdesign.input_files import check_ends
from expdesign.kinematics import checked
from expdesign.records import load_records
from expdesign.reduction import reduced
from expdesign.scenario import equipped_vessel
from expdesign.signals import Record
from expdesign.vessel import Vessel, column_name
from expdesign.vessel.structures import FORCE_SIGNALS


def data_files(data: Sequence[Path]) -> tuple[Path, ...]:
    """Files, and the CSV files of folders in the order of their names.

    Raises:
        FileError: a folder without CSV files.
    """
    found: list[Path] = []
    for path in data:
        inside = sorted(path.glob("*.csv")) if path.is_dir() else [path]
        if not inside:
            raise FileError(path, "", "is a folder without CSV files, expected some")
        found += inside
    return tuple(found)


def equipped(vessel: Path, data: Sequence[Path]) -> tuple[Vessel, tuple[str, ...]]:
    """The vessel of a file, with what imports beside the data tell of sensors and actuators, and notes on that.

    Errors as of `equipped_vessel` and `data_files`.
    """
    return equipped_vessel(vessel, data_files(data))


def measured(
    data: Sequence[Path], vessel: Vessel, *, velocity: str = "auto", undo: bool = True, told: Sequence[str] = ()
) -> Record:
    """Measured data of a vessel: its own actuators' signals, or generalised forces where the first file has those.

    A folder stands for the CSV files in it.

    A model in discrete form holds for one sample time, which the data must have; in continuous form any will do. Faults
    of instruments that are certain are told, and undone if asked for. `told` are notes on the vessel of `equipped`.
    """
    data = data_files(data)
    inputs, header = vessel.model.inputs, _header(data[0])
    if not {column_name(name) for name in inputs} <= header and set(FORCE_SIGNALS) <= header:
        inputs = FORCE_SIGNALS
    record = load_records(
        list(data),
        vessel_inputs=inputs,
        sample_time_s=vessel.sample_time_s if vessel.model.form == "discrete" else None,
        velocity=velocity,
        heading_std_rad=vessel.sensors.heading_rad or None,
        outputs=vessel.model.outputs,
        actuators=vessel.model.actuators,
    )
    record = with_depth(record, vessel.draught_m) if vessel.model.reads_depth else record
    record = replace(record, notes=(*told, *record.notes))
    return checked(record, vessel, smoothed=velocity == "smoothed", undo=undo)


def reduced_data(data: Sequence[Path], vessel: Vessel, *, velocity: str = "auto", told: Sequence[str] = ()) -> Record:
    """Measured data of a vessel, reduced by what its file states of actuators and sensors."""
    return reduced(measured(data, vessel, velocity=velocity, told=told), vessel, smoothed=velocity == "smoothed")


@contextmanager
def doubted(record: Record) -> Iterator[None]:
    """Say the doubts about a record beside a refusal of the block: they may be why there is no answer."""
    try:
        yield
    except NoAnswer as error:
        for doubt in record.doubts:
            error.add_note(doubt)
        raise


def _header(path: Path) -> set[str]:
    """Names in the first row; empty where the file cannot be read, of which the reader will complain."""
    check_ends(path, "a CSV file")
    try:
        with path.open(encoding="utf-8-sig") as file:
            return {cell.strip(' "') for cell in re.split("[,;\t]", file.readline().strip())}
    except (OSError, UnicodeDecodeError):
        return set()
