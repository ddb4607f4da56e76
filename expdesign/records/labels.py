"""Labels of manoeuvres in measured data: a column of texts, or the beginnings of the files' names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from expdesign.errors import FileError, UnknownName
from expdesign.records.file import FIRST_ROW, LABEL, read_cells
from expdesign.signals import Record

LABEL_SOURCES = ("column", "file")
"""Where labels are: in the column `manoeuvre`, or before the first underscore of a file's name."""


def row_labels(record: Record, paths: Sequence[Path], source: str) -> tuple[tuple[str, ...], ...]:
    """The label of every sample of every batch; "" where there is none.

    Args:
        record: as `load_records` gives it.
        paths: the files that it was read from.
        source: one of `LABEL_SOURCES`.

    Raises:
        UnknownName: no such source.
        FileError: a file has no column `manoeuvre`.
    """
    if source not in LABEL_SOURCES:
        raise UnknownName("source of labels", source, known=LABEL_SOURCES)
    named = {name: path for path in paths for name in (path.name, str(path))}
    texts = {path: _label_column(path) for path in paths} if source == "column" else {}
    found = []
    for batch in record.batches:
        path = named[batch.name if batch.name in named else batch.name.rpartition(",")[0]]
        first = batch.first_row - FIRST_ROW
        by_name = (path.stem.partition("_")[0],) * len(batch)
        found.append(texts[path][first : first + len(batch)] if texts else by_name)
    return tuple(found)


def _label_column(path: Path) -> tuple[str, ...]:
    """The text of every row."""
    cells = read_cells(path)
    if LABEL not in cells.header:
        raise FileError(path, "row 1", f"names no {LABEL}, expected a column with the label of every row")
    column = cells.header.index(LABEL)
    return tuple(text.strip() for _, columns in cells.blocks() for text in columns[column])
