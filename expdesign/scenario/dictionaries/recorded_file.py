"""Command files of recorded or hand-made primitives: a CSV like commands.csv, with units in the names."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from expdesign.errors import FileError
from expdesign.scenario.tables import read_text
from expdesign.signals import Commands
from expdesign.values import Array
from expdesign.vessel import column_name

SIGNAL = re.compile(r"(n\d+)_rps|(a\d+|rudder\d+)_rad|(tau_x|tau_y|tau_psi)")
MOTION = ("u_mps", "v_mps", "r_radps")
SPREAD = 1e-3
"""Share of a sample time by which steps of time may differ."""


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
    rows = list(csv.reader(io.StringIO(read_text(source, "CSV"))))
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
