"""Excel by openpyxl, Parquet by pyarrow."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from datetime import datetime, time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from expdesign.errors import FileError
from expdesign.importing.channels import Log, check_size
from expdesign.importing.readers.columns import columns_log
from expdesign.importing.readers.text import read_text

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
