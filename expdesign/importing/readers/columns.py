"""Columns of numbers that are read whole, as Parquet, MATLAB and spreadsheets give them: their clock, and channels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from expdesign.importing.channels import COMPUTER, GNSS, NONE, OWN, Log, channels_of
from expdesign.importing.clocks import Clock, clock_of
from expdesign.importing.times import TIME_NAME, read_stamps
from expdesign.importing.units import split_unit, words

MOST_COLUMNS = 64
"""Columns of one array beyond which it is an image or a map."""


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
