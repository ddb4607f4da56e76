"""Files whose columns of numbers are read whole: Excel by openpyxl, Parquet by pyarrow, MATLAB by scipy and h5py."""

from __future__ import annotations

import os
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import datetime, time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np

from expdesign.errors import FileError
from expdesign.importing.channels import COMPUTER, GNSS, MOST_NUMBERS, NONE, OWN, Log, channels_of, check_size
from expdesign.importing.languages import words
from expdesign.importing.mapping import split_unit
from expdesign.importing.readers.text import read_text
from expdesign.importing.times import TIME_NAME, Clock, clock_of, read_stamps

MOST_COLUMNS = 64  # columns of one array beyond which it is an image or a map


def columns_log(source: str, columns: Mapping[str, np.ndarray], sample_time_s: float) -> Log:
    """A log of columns, which share a clock where they have one length and one part of their names before the last dot.

    Args:
        source: name of the file.
        columns: arrays (k,) of numbers, times or texts by name.
        sample_time_s: between rows without a clock [s]; 0 where it is not known.
    """
    channels, notes, unused, clocks = [], [], [], set()
    for group in _groups(columns):
        own = {name: columns[name] for name in group}
        found = _clock(own, columns)
        name, times, clock, how = found.name, found.times, found.kind, found.how
        if times is None and sample_time_s > 0:
            times, clock = np.asarray(np.arange(len(next(iter(own.values())))) * sample_time_s), OWN
            how = f"{', '.join(own)}: count as {sample_time_s:g} s apart, as the mapping says"
        elif times is None:
            times, clock = np.arange(len(next(iter(own.values()))), dtype=float), NONE
            how = (
                f"{', '.join(own)}: no clock, expected sample_time_s under [[file]] in the mapping, where rows are "
                "evenly spaced"
            )
        left = {key: values for key, values in own.items() if key not in found.taken}
        texts = [key for key, values in left.items() if values.dtype.kind not in "biuf"]
        numbers = {key: np.asarray(values, dtype=float) for key, values in left.items() if key not in texts}
        units = {key: split_unit(key)[1] for key in numbers}
        own_channels, more = channels_of(numbers, np.asarray(times), source=source, units=units, what=name)
        channels += own_channels
        notes += [how, *more]
        unused += texts
        clocks.add(clock)
    clock = next((kind for kind in (GNSS, COMPUTER, OWN) if kind in clocks), NONE)
    return Log(source=source, clock=clock, channels=tuple(channels), notes=tuple(dict.fromkeys(notes)),
               unused=tuple(unused))  # fmt: skip


def flat(name: str, value: object) -> Iterator[tuple[str, np.ndarray]]:
    """(name, (k,)) of an array of one or two dimensions, whose columns are numbered from 1."""
    array = np.squeeze(np.asarray(value))
    if array.ndim == 1 and len(array) > 1 and array.dtype.kind in "biufMUSO":
        yield name, array
    elif array.ndim == 2 and array.dtype.kind in "biuf":
        rows = array if array.shape[0] >= array.shape[1] else array.T
        if rows.shape[1] <= MOST_COLUMNS:
            yield from ((f"{name}{k}", column) for k, column in enumerate(rows.T, start=1))


def _groups(columns: Mapping[str, np.ndarray]) -> list[list[str]]:
    groups: dict[tuple[str, int], list[str]] = {}
    for name, values in columns.items():
        groups.setdefault((name.rpartition(".")[0], len(values)), []).append(name)
    return list(groups.values())


def _clock(own: Mapping[str, np.ndarray], every: Mapping[str, np.ndarray]) -> Clock:
    """The clock of a group of columns, or else of one of another group that is as long."""
    rows = len(next(iter(own.values())))
    beside = {name: values for name, values in every.items() if len(values) == rows and name not in own}
    for table in (own, beside):
        for name, values in table.items():
            if values.dtype.kind == "M":
                whole = values.astype("datetime64[ns]").astype(np.int64) / 1e9
                times = np.where(np.isnat(values), np.nan, whole)
                return Clock(frozenset({name}), times, COMPUTER, f"time is {name}, date and time", name)
        texts = {name: read_stamps([str(text) for text in v]) for name, v in table.items() if v.dtype.kind in "USO"}
        numbers = {name: v.astype(float) for name, v in table.items() if v.dtype.kind in "iuf"}
        last = {name: name.rpartition(".")[2] for name in (*numbers, *texts)}  # a clock is named in its structure
        found = clock_of(
            {name: v for name, v in numbers.items() if table is own or TIME_NAME.search(words(last[name]))},
            {name: stamps for name, stamps in texts.items() if stamps.kind}, {},
        )  # fmt: skip
        if found.times is not None:
            return found
    return Clock(frozenset(), None, NONE, "")


MOST_ROWS = 1 << 20  # of a sheet
MOST_UNPACKED = 1_000_000_000  # bytes of a spreadsheet; a day at 10 Hz takes about a third


def read_excel(path: Path, sample_time_s: float) -> Log:
    """The first sheet with two rows or more, read as the text that it shows."""
    import openpyxl

    _check_archive(path)
    with path.open("rb") as file:
        return _first_sheet(openpyxl.load_workbook(file, read_only=True, data_only=True), path, sample_time_s)


def _check_archive(path: Path) -> None:
    """Raise FileError where a zip archive is no spreadsheet, or would fill the memory."""
    with zipfile.ZipFile(path) as archive:
        if "xl/workbook.xml" not in archive.namelist():
            inside = ", ".join(archive.namelist()[:3]) or "nothing"
            raise FileError(path, "", f"is a zip archive with {inside}, expected the log itself, unpacked")
        size = sum(item.file_size for item in archive.infolist())
    if size > MOST_UNPACKED:
        most = f"{MOST_UNPACKED / 1e9:.1f} GB: export it as CSV"
        raise FileError(path, "", f"unpacks to {size / 1e9:.1f} GB, expected at most {most}")


def _first_sheet(book: Any, path: Path, sample_time_s: float) -> Log:
    try:
        for sheet in book.worksheets:
            with TemporaryDirectory(prefix="expdesign-") as folder:
                copy = Path(folder) / path.name
                with copy.open("w", encoding="utf-8") as file:
                    rows = (row for row in sheet.iter_rows(values_only=True) if any(map(_filled, row)))
                    count = 0
                    for count, row in enumerate(rows, start=1):
                        file.write("\t".join(map(_text, row)) + "\n")
                        if count > MOST_ROWS:
                            break
                if count > MOST_ROWS:
                    raise FileError(
                        path, "", f"has more than {MOST_ROWS} rows, which no spreadsheet has: export it as CSV"
                    )
                if count < 2:
                    continue
                log = read_text(copy, sample_time_s)
            others = [other.title for other in book.worksheets if other is not sheet]
            unused = [f"sheet {name}" for name in others]
            full = f"all {MOST_ROWS} rows of the sheet are filled: what came later may be lost; export as CSV"
            return replace(log, unused=(*log.unused, *unused), notes=(*log.notes, *[full] * (count == MOST_ROWS)))
    finally:
        book.close()
    raise FileError(path, "", "has no sheet with rows, expected a header and one row per sample")


def _filled(cell: object) -> bool:
    return cell is not None


def _text(cell: object) -> str:
    if cell is None:
        return ""
    if isinstance(cell, datetime):
        return cell.isoformat(sep=" ")
    return cell.isoformat() if isinstance(cell, time) else str(cell).replace("\t", " ").replace("\n", " ")


def read_parquet(path: Path, sample_time_s: float) -> Log:
    """All columns of numbers, times and texts; other ones are left out."""
    import pyarrow
    import pyarrow.parquet

    columns, unused = {}, []
    file = pyarrow.parquet.ParquetFile(path)
    check_size(file.metadata.num_rows * len(file.schema_arrow.names))
    for name in file.schema_arrow.names:  # one at a time, so that the file is not in the memory twice
        column = file.read([name]).column(0)
        if pyarrow.types.is_dictionary(column.type):
            column = column.cast(column.type.value_type)
        if pyarrow.types.is_decimal(column.type):
            column = column.cast(pyarrow.float64())
        kind = column.type
        if pyarrow.types.is_temporal(kind):
            columns[name] = np.asarray(column.cast(pyarrow.timestamp("ns")).to_numpy(), dtype="datetime64[ns]")
        elif pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(kind) or pyarrow.types.is_boolean(kind):
            columns[name] = np.asarray(column.to_numpy(), dtype=float)
        elif pyarrow.types.is_string(kind) or pyarrow.types.is_large_string(kind):
            columns[name] = np.asarray(column.to_numpy(), dtype=object)
        else:
            unused.append(f"{name} ({kind})")
    log = columns_log(path.name, columns, sample_time_s)
    return replace(log, unused=(*log.unused, *unused))


def read_matlab(path: Path, sample_time_s: float) -> Log:
    """Vectors and matrices, also those in structures."""
    import scipy.io

    check_size(_unpacked(path) // BYTES)
    content = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    objects: list[str] = []
    columns = {
        name: values for key, value in content.items() if key[:2] != "__" for name, values in _of(key, value, objects)
    }
    return _log(path, columns, objects, sample_time_s)


BYTES = 8  # of a number
COMPRESSED = 15
BLOCK_BYTES = 1 << 16  # of which zlib makes at most a thousand times as many


def _unpacked(path: Path) -> int:
    """Bytes of a file of version 5 once it is unpacked, counted no further than matters.

    Its elements begin with their kind and their length, each of 32 bits; those of kind 15 are compressed by zlib
    (MathWorks, MAT-File Format, 2023).
    """
    total = 0
    with path.open("rb") as file:
        file.seek(126)
        order: Literal["little", "big"] = "big" if file.read(2) == b"MI" else "little"
        while len(tag := file.read(8)) == 8 and total <= MOST_NUMBERS * BYTES:
            kind, length = (int.from_bytes(tag[part : part + 4], order) for part in (0, 4))
            if kind != COMPRESSED:
                total += length
                file.seek(length, os.SEEK_CUR)
                continue
            inside = zlib.decompressobj()
            while length > 0 and total <= MOST_NUMBERS * BYTES and (block := file.read(min(length, BLOCK_BYTES))):
                length -= len(block)
                total += len(inside.decompress(block))
    return total


OBJECT = (
    "is a table, a timetable or another object of MATLAB, which only MATLAB reads, expected vectors or a file of "
    "writetable(T, 'log.csv'), or of writetimetable(T, 'log.csv')"
)


def _log(path: Path, columns: dict[str, np.ndarray], objects: list[str], sample_time_s: float) -> Log:
    if objects and not columns:
        raise FileError(path, objects[0], OBJECT)
    log = columns_log(path.name, columns, sample_time_s)
    return replace(log, unused=(*log.unused, *(f"{name} (an object of MATLAB)" for name in objects)))


def _of(name: str, value: Any, objects: list[str]) -> Iterator[tuple[str, np.ndarray]]:
    if type(value).__name__ == "MatlabOpaque":
        own = value.flat[0]
        objects.append(next((cell.decode() for cell in own if isinstance(cell, bytes)), name))
    elif hasattr(value, "_fieldnames"):
        for field in value._fieldnames:
            yield from _of(f"{name}.{field}", getattr(value, field), objects)
    elif isinstance(value, np.ndarray) and value.size and all(hasattr(row, "_fieldnames") for row in value.flat):
        for field in value.flat[0]._fieldnames:
            column = [getattr(row, field, np.nan) for row in value.flat]
            if all(np.ndim(cell) == 0 for cell in column):  # a structure for each row
                yield from flat(f"{name}.{field}", np.array(column))
    else:
        yield from flat(name, value)


def read_matlab73(path: Path, sample_time_s: float) -> Log:
    """Data sets of numbers of one or two dimensions, in groups as deep as they are, and rows of structures."""
    import h5py

    columns: dict[str, np.ndarray] = {}
    objects: list[str] = []
    size = 0

    def take(name: str, item: Any) -> None:
        nonlocal size
        if name.startswith("#"):
            return
        size += item.size if isinstance(item, h5py.Dataset) else 0
        check_size(size)
        if "MATLAB_object_decode" in item.attrs:
            objects.append(name)
        elif isinstance(item, h5py.Dataset) and item.dtype.kind in "biuf":
            columns.update(flat(name.replace("/", "."), item[()]))
        elif isinstance(item, h5py.Dataset) and h5py.check_ref_dtype(item.dtype) is h5py.Reference and item.size > 1:
            cells = [file[reference] for reference in item[()].flat]
            if all(isinstance(cell, h5py.Dataset) and cell.size == 1 and cell.dtype.kind in "biuf" for cell in cells):
                columns.update(flat(name.replace("/", "."), np.array([cell[()].flat[0] for cell in cells])))

    with h5py.File(path) as file:
        file.visititems(take)
    return _log(path, columns, objects, sample_time_s)
