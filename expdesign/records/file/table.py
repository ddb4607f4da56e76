"""The numbers of one file in SI units, with the rows they come from: complete, finite and within reason."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from expdesign.errors import FileError
from expdesign.records.file.cells import FIRST_ROW, Cells, read_cells, shown
from expdesign.records.file.names import REACHED, Inputs, Source, Sources, choose_columns, is_input
from expdesign.signals import AUXILIARY
from expdesign.values import Array

LARGEST_NUMBER = 1e15  # limit above which a number is an error
LISTED_ROWS = 3  # stretches of rows that a message lists
WIND_DISAGREEMENT = 0.3  # relative difference between vane and components that gets a note
WIND_EXPLAINED = 0.1  # remaining relative difference at which a wrong direction convention is the explanation
MISSING = ("", "na", "n/a", "nan", "-nan", "null", "none")
OPTIONAL = (
    ("wind_u_mps", "wind_v_mps"), ("wind_speed_mps", "wind_angle_rad"), ("depth_m",), ("steered",),
    *((name,) for name in AUXILIARY),
)  # fmt: skip

Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """Columns of one file."""

    path: Path  # the file
    header: tuple[str, ...]  # names in row 1
    columns: Mapping[str, Array]  # contract name -> (k,) in the contract's unit
    sources: Sources  # contract name -> where it stands in the file
    first_row: int = FIRST_ROW  # row of the file that sample 0 comes from
    notes: tuple[str, ...] = ()  # unusual data and their treatment

    def __len__(self) -> int:
        return len(self.columns["time_s"])

    def error(self, name: str, problem: str) -> FileError:
        """The error about a column, under the name the file gives it."""
        return FileError(self.path, self.sources[name].header, problem)

    def value(self, name: str, index: int) -> str:
        """A number as it stands in the file."""
        return f"{self.columns[name][index] / self.sources[name].factor:.10g}"

    @property
    def inputs(self) -> tuple[str, ...]:
        """Input columns, in file order."""
        names = (name.removeprefix(REACHED) for name in self.columns)
        return tuple(dict.fromkeys(name for name in names if is_input(name)))

    def stack(self, *names: str) -> Array:
        """Columns side by side, (k, m); nan where one is not there."""
        columns = np.full((len(self), len(names)), np.nan)
        for index, name in enumerate(names):
            columns[:, index] = self.columns.get(name, np.nan)
        return columns

    def found(self, name: str, wrong: Mask, also: str) -> str:
        """The first wrong value with its row, and the other rows where a mask (k,) is set: `is 7 in row 3 (...)`."""
        first = int(np.argmax(wrong))
        rest = wrong & (np.arange(len(wrong)) > first)
        more = f" (and {also} in {self.rows(rest)})" if rest.any() else ""
        return f"is {self.value(name, first)} in row {first + self.first_row}{more}"

    def rows(self, wrong: Mask) -> str:
        """The rows of the file where a mask (k,) is set, in words."""
        return rows_in_words(np.flatnonzero(wrong) + self.first_row)

    def noted(self, *notes: str) -> Table:
        """The table with more notes."""
        return replace(self, notes=(*self.notes, *notes))


def read_table(path: Path, *, inputs: Inputs | None) -> Table:
    """Read the columns that are used.

    Raises:
        FileError: unreadable, columns missing, cells that are no numbers, infinite, or missing inside the data.
    """
    cells = read_cells(path)
    sources, notes = _choose(cells, inputs)
    columns = _read_columns(cells, sources)
    table = Table(path=path, header=cells.header, columns=columns, sources=sources, notes=notes)
    return _without_missing(_without_empty_columns(table), cells)


def rows_in_words(rows: NDArray[np.int_]) -> str:
    """Row numbers, ascending: `row 12`, `rows 12 to 15, 20`, `rows 2, 4, 6 and 17 more`."""
    stretches = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    words = [f"{part[0]} to {part[-1]}" if len(part) > 2 else ", ".join(map(str, part)) for part in stretches]
    rest = sum(len(part) for part in stretches[LISTED_ROWS:])
    return f"row{'s' if len(rows) > 1 else ''} {', '.join(words[:LISTED_ROWS])}" + (f" and {rest} more" if rest else "")


class _Numbers:
    """One column in SI units, taken block by block; missing cells are nan."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.parts: list[Array] = []
        self.wrong: tuple[int, str] | None = None
        self.underscored: tuple[int, str] | None = None

    def add(self, first_row: int, texts: Sequence[str]) -> None:
        """Take the cells of a block; the first that is no number is kept for the message."""
        try:
            values = np.fromiter(map(float, texts), dtype=float, count=len(texts))
        except ValueError:
            values = np.array([self._number(row, text) for row, text in enumerate(texts, start=first_row)])
        if self.underscored is None and "_" in "".join(texts):
            self.underscored = next((row, text) for row, text in enumerate(texts, start=first_row) if "_" in text)
        self.parts.append(values)

    def _number(self, row: int, text: str) -> float:
        if text.strip().lower() in MISSING:
            return np.nan
        try:
            return float(text)
        except ValueError:
            self.wrong = self.wrong or (row, text)
            return np.nan

    def values(self, path: Path) -> Array:
        """All of them.

        Raises:
            FileError: one is no number, infinite, or larger than any measurement.
        """
        if found := self.wrong or self.underscored:
            raise _not_a_number(path, self.source, *found)
        values = np.concatenate(self.parts)
        self.parts.clear()
        return _in_units(path, self.source, values)


def _in_units(path: Path, source: Source, values: Array) -> Array:
    """A column in SI units."""
    huge = np.abs(values) > LARGEST_NUMBER
    if huge.any():
        rows = rows_in_words(np.flatnonzero(huge) + FIRST_ROW)
        found_value = "infinite" if np.isinf(values).any() else f"{values[int(np.argmax(huge))]:.6g}"
        expected = f"expected finite numbers up to {LARGEST_NUMBER:g}"
        raise FileError(path, source.header, f"is {found_value} in {rows}, {expected}")
    if source.factor != 1.0:
        values *= source.factor
    return values


def _read_columns(cells: Cells, sources: Sources) -> dict[str, Array]:
    """The chosen columns; the whole file is looked at before the first cell is complained of."""
    plain = cells.numbers([source.column for source in sources.values()])
    if plain is not None:
        return {
            name: _in_units(cells.path, source, column.copy())
            for (name, source), column in zip(sources.items(), plain.T, strict=True)
        }
    taken = {name: _Numbers(source) for name, source in sources.items()}
    for first_row, texts in cells.blocks():
        for column in taken.values():
            column.add(first_row, texts[column.source.column])
    return {name: column.values(cells.path) for name, column in taken.items()}


def _choose(cells: Cells, inputs: Inputs | None) -> tuple[Sources, tuple[str, ...]]:
    """The columns that are used; rows that cannot be read go before names that do not fit."""
    try:
        return choose_columns(cells.path, cells.header, inputs=inputs)
    except FileError:
        for _ in cells.blocks():
            pass
        raise


def _not_a_number(path: Path, source: Source, row: int, text: str) -> FileError:
    expected = "a number"
    if re.fullmatch(r"\s*-?\d+,\d+\s*", text):
        expected = "a number with a decimal point"
    elif source.name == "time_s" and ":" in text:
        expected = "seconds as one number"
    return FileError(path, source.header, f"is {shown(text)} in row {row}, expected {expected}")


def _without_empty_columns(table: Table) -> Table:
    """Optional columns without any number are not measured; required ones are an error."""
    empty = [name for name, values in table.columns.items() if np.isnan(values).all()]
    dropped = {name for group in OPTIONAL for name in group if any(other in empty for other in group)}
    for name in empty:
        if name not in dropped:
            raise table.error(name, "holds no number in any row, expected one in every row")
    gone = [name for name in table.columns if name in dropped]
    columns = {name: values for name, values in table.columns.items() if name not in dropped}
    names = [table.sources[name].header for name in gone if name in empty]
    return replace(table, columns=columns).noted(*(f"{name} holds no numbers: not measured" for name in names))


def _without_missing(table: Table, cells: Cells) -> Table:
    """Cut the rows at the start and end that lack a number; inside the data a lacking number is an error."""
    missing = {name: np.isnan(values) for name, values in table.columns.items()}
    complete = np.flatnonzero(~np.any(list(missing.values()), axis=0))
    if not len(complete):
        raise FileError(table.path, "", "has no row with a number in every column that is used, expected such rows")
    first, last = int(complete[0]), int(complete[-1]) + 1
    for name in sorted(missing, key=lambda name: -int(missing[name].sum())):
        _check_inside(table, cells, name, missing[name], slice(first, last))
    columns = {name: values[first:last] for name, values in table.columns.items()}
    notes = list(_cuts(table, missing, first, last))
    return replace(table, columns=columns, first_row=FIRST_ROW + first).noted(*notes)


def _check_inside(table: Table, cells: Cells, name: str, missing: Mask, kept: slice) -> None:
    inside = np.zeros(len(missing), dtype=bool)
    inside[kept] = missing[kept]
    if 2 * (kept.stop - kept.start) < len(missing) and missing.any():
        problem = f"holds no number in {table.rows(missing)}, more than half of the file; expected one in every row"
        raise table.error(name, problem)
    if inside.any():
        text = cells.text(int(np.argmax(inside)) + FIRST_ROW, table.sources[name].column).strip()
        found = f"is {shown(text)}" if text else "is empty"
        raise table.error(name, f"{found} in {table.rows(inside)}, expected a number in every row")


def _cuts(table: Table, missing: Mapping[str, Mask], first: int, last: int) -> Iterator[str]:
    count = len(table)
    for place, part in (("start", slice(0, first)), ("end", slice(last, count))):
        names = [table.sources[name].header for name, mask in missing.items() if mask[part].any()]
        if names:
            rows = rows_in_words(np.arange(count)[part] + FIRST_ROW)
            yield f"cut {rows} at the {place}, where {', '.join(names)} {'is' if len(names) == 1 else 'are'} missing"


CARTESIAN = ("wind_u_mps", "wind_v_mps")
VANE = ("wind_speed_mps", "wind_angle_rad")


def relative_wind(table: Table) -> Array | None:
    """(k, 2) u_q, v_q [m/s], the ship's velocity through the air, or None when not measured; Cartesian goes first."""
    if CARTESIAN[0] in table.columns:
        return table.stack(*CARTESIAN)
    return vane_wind(*table.stack(*VANE).T) if VANE[0] in table.columns else None


def vane_wind(speed_mps: Array, angle_rad: Array) -> Array:
    """(k, 2) u_q, v_q [m/s] from the speed and the direction it comes from, clockwise from the bow."""
    return np.stack([speed_mps * np.cos(angle_rad), speed_mps * np.sin(angle_rad)], axis=-1)


def check_wind(table: Table) -> Table:
    """Compare vane and Cartesian wind where a file has both; the latter is used.

    Raises:
        FileError: they differ by the direction convention of the angle.
    """
    if not {*CARTESIAN, *VANE} <= set(table.columns):
        return table
    cartesian, vane = table.stack(*CARTESIAN), vane_wind(*table.stack(*VANE).T)
    size = float(np.linalg.norm(cartesian)) or 1.0
    off = float(np.linalg.norm(cartesian - vane)) / size
    if off <= WIND_DISAGREEMENT:
        return table.noted("the vane's wind agrees with wind_u_mps and wind_v_mps, which are used")
    for text, signs in (("counts counter-clockwise", (1, -1)), ("says where it blows to", (-1, -1))):
        if float(np.linalg.norm(cartesian - vane * signs)) / size < WIND_EXPLAINED:
            problem = f"{text}, as wind_u_mps and wind_v_mps show; expected where it comes from, clockwise from the bow"
            raise table.error(VANE[1], problem)
    return table.noted(f"the vane's wind differs by {off:.0%} from wind_u_mps and wind_v_mps, which are used")
