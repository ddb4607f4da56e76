"""MATLAB files: up to version 7 by scipy, version 7.3 by h5py."""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from expdesign.errors import FileError
from expdesign.importing.channels import MOST_NUMBERS, Log, check_size
from expdesign.importing.readers.columns import columns_log, flat


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
