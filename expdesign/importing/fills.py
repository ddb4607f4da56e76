"""Readings that stand for none: fill values of receivers, loggers and AIS, and positions at 0, 0; they are left out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from expdesign.importing.channels import Channel, Log
from expdesign.importing.mapping import counted
from expdesign.importing.names import family_of, marked
from expdesign.values import Array

NINES = tuple(float(f"{'9' * digits}{end}") for digits in (2, 3, 4, 5, 6) for end in ("", ".9", ".99"))
FILLS = np.array([
    *NINES, 511.0, 51.1, 102.3, 102.2, 1023.0, 91.0, 181.0, 128.0, 127.0, 327.67, 327.68, 655.35, 3276.7, 6553.5,
    32767.0, 32768.0, 65535.0, 2147483647.0, 2147483648.0, 4294967295.0, 214.7483647, 1e10, 1e15,
])  # fmt: skip
"""Sizes of numbers that stand for no reading: nines; of AIS (ITU-R M.1371: speed 102.3, heading 511, position 91 and
181, rate of turn 128); the largest of integers, plain and scaled."""
APART = 1.2
"""Ratio to the largest of other readings beyond which one of these is no reading."""
MOST = 0.95  # share of readings that may be fills, else these are readings


def cleaned(log: Log) -> Log:
    """The log without readings that stand for none, with notes on how many of which."""
    channels, notes = [], [*log.notes]
    at_zero = dict(_at_zero(log))
    for channel in log.channels:
        values = channel.values
        gone = at_zero.get(id(channel), np.zeros(len(values), dtype=bool))
        if gone.any():
            notes.append(f"{channel.name}: {counted(int(gone.sum()), 'position')} at 0, 0 left out")
        for fill in sorted(_fills(values[~gone])):
            own = np.isclose(values, fill, rtol=1e-7, atol=0.0)
            notes.append(
                f"{channel.name}: {counted(int(own.sum()), 'reading')} of {fill:.10g} left out, which says none"
            )
            gone = gone | own
        if gone.all() and len(gone):
            continue
        channels.append(replace(channel, time_s=channel.time_s[~gone], values=values[~gone]) if gone.any() else channel)
    return replace(log, channels=tuple(channels), notes=tuple(notes))


def _fills(values: Array) -> Iterator[float]:
    """Fill values among readings, each far beyond all others of its sign."""
    left = values
    while len(left):
        largest = left[np.argmax(np.abs(left))]
        own = np.isclose(left, largest, rtol=1e-7, atol=0.0)
        rest = left[~own]
        known = np.isclose(FILLS, abs(largest), rtol=1e-7, atol=0.0).any()
        if not known or not len(rest) or len(rest) < (1.0 - MOST) * len(values):
            return
        if abs(largest) < APART * float(np.abs(rest).max()):
            return
        yield float(largest)
        left = rest


def _at_zero(log: Log) -> Iterator[tuple[int, np.ndarray]]:
    """(identity of a channel, (k,) where latitude and longitude beside each other are both 0)."""
    places: dict[str, dict[tuple[str, str], Channel]] = {"lat_deg": {}, "lon_deg": {}}
    for channel in log.channels:
        if (column := marked(channel).column) in places:
            places[column].setdefault(family_of(channel), channel)
    for family, lat in places["lat_deg"].items():
        lon = places["lon_deg"].get(family)
        if lon is None or len(lon) != len(lat):
            continue
        zero = (lat.values == 0.0) & (lon.values == 0.0)
        if zero.any() and not zero.all():
            yield id(lat), zero
            yield id(lon), zero
