"""MATLAB files: up to version 7 by scipy, version 7.3 by h5py."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from expdesign.importing.channels import Log
from expdesign.importing.readers.columns import columns_log, flat


def read_matlab(path: Path, sample_time_s: float) -> Log:
    """Vectors and matrices, also those in structures."""
    import scipy.io

    content = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    columns = {name: values for key, value in content.items() if key[:2] != "__" for name, values in _of(key, value)}
    return columns_log(path.name, columns, sample_time_s)


def _of(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    if hasattr(value, "_fieldnames"):
        for field in value._fieldnames:
            yield from _of(f"{name}.{field}", getattr(value, field))
    else:
        yield from flat(name, value)


def read_matlab73(path: Path, sample_time_s: float) -> Log:
    """Data sets of numbers of one or two dimensions, in groups as deep as they are."""
    import h5py

    columns: dict[str, np.ndarray] = {}

    def take(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "biuf" and not name.startswith("#refs#"):
            columns.update(flat(name.replace("/", "."), item[()]))

    with h5py.File(path) as file:
        file.visititems(take)
    return columns_log(path.name, columns, sample_time_s)
