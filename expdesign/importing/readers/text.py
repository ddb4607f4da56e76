"""Text: tables of any dialect, NMEA 0183, and both in one file.

A table's separator, decimal sign, header, units and clock are told from its first lines. Rows without a clock of their
own stand between sentences with satellite time, and are spread evenly from one to the next.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.errors import FileError
from expdesign.importing.channels import COMPUTER, DAY_S, GNSS, NONE, OWN, Log, channels_of, spread
from expdesign.importing.readers.dialect import SEPARATORS, encoding_of, sniffed
from expdesign.importing.readers.nmea import Sentences
from expdesign.importing.readers.table import TextTable
from expdesign.importing.units import counted

BLOCK_BYTES = 1 << 20  # read at once
SNIFFED = 400  # lines that a dialect is told from
MOST_COLUMNS = 2000


def read_text(path: Path, sample_time_s: float) -> Log:
    """The log.

    Args:
        sample_time_s: between rows of a table without a clock [s]; 0 where it is not known.

    Raises:
        FileError: empty, no text, or without rows or sentences.
    """
    encoding = encoding_of(path)
    with path.open(encoding=encoding, errors="replace", newline=None) as file:
        sample = file.readlines(BLOCK_BYTES)[:SNIFFED]
    if not any(line.strip() for line in sample):
        raise FileError(path, "", "is empty, expected a log")
    if (wide := max(line.count(separator) for line in sample[:2] for separator in SEPARATORS[:-1])) > MOST_COLUMNS:
        raise FileError(path, "row 1", f"has {wide + 1} columns, expected at most {MOST_COLUMNS}")
    plain = [line for line in sample if not _is_sentence(line) and line.strip()]
    dialect = sniffed(plain)
    table = None if dialect is None else TextTable(path, dialect, plain)
    sentences, place, other, before, cut = Sentences(path.name), 0, 0, "", False
    with path.open(encoding=encoding, errors="replace", newline=None) as file:
        while lines := file.readlines(BLOCK_BYTES):
            marked = [(place + k, line) for k, line in enumerate(lines) if _is_sentence(line)]
            if marked:
                sentences.add(marked)
                left = [(place + k, line) for k, line in enumerate(lines) if not _is_sentence(line)]
            else:
                left = list(enumerate(lines, start=place))
            left = [pair for pair in left if not pair[1].isspace()]
            if left:
                before, last = left[-2][1] if len(left) > 1 else before, left[-1][1]
                cut = dialect is not None and dialect.is_cut(last, before)
                left, before = left[:-1] if cut else left, last
            if table is not None:
                table.add(left)
            else:
                other += len(left)
            place += len(lines)
    if not sentences.count and table is None:
        expected = "a table of numbers with a header, NMEA 0183, or a format of expdesign explain import"
        raise FileError(path, "", f"holds no rows of numbers and no NMEA sentences that are read, expected {expected}")
    log = _joined(path, sentences, table, other, sample_time_s)
    words = "left out the last line, which has no end and may be cut"
    return replace(log, notes=(words, *log.notes)) if cut else log


def _joined(path: Path, sentences: Sentences, table: TextTable | None, other: int, sample_time_s: float) -> Log:
    stamps, at, dated = sentences.anchors()
    received, received_at = sentences.received()
    notes = list(_line_notes(sentences, other))
    clock = GNSS if len(stamps) > 1 and dated else OWN
    if len(stamps) > 1 and len(received) > 1:
        apart = spread(at, received, received_at) - stamps
        late = float(np.nanmedian(apart))
        notes.append(f"times of reception are {late:.3f} s after satellite time in the median, and are moved by that")
        stamps, at = received - late, received_at
    elif len(received) > 1:
        stamps, at, clock = received, received_at, COMPUTER if received[0] > DAY_S * 3650 else OWN
    elif sentences.count and len(stamps) > 1:
        notes.append(
            "sentences without a time of their own take that of the fix before them, and are late or early by up to "
            f"{np.median(np.diff(stamps)):.3g} s"
        )
    channels = sentences.channels(stamps, at)
    if sentences.count and len(stamps) < 2:
        clock = NONE
        notes.append("no sentence has a time, so that none can be used: log RMC, GGA or ZDA too, or times of reception")
    unused = [f"{name} ({count})" for name, count in sentences.unread.most_common()]
    if table is not None:
        columns, times, own_clock, table_notes = table.columns(stamps, at, sample_time_s)
        clock = clock if clock == GNSS and own_clock in (GNSS, NONE) else own_clock
        notes += table_notes
        outside = int((~np.isfinite(times)).sum()) if own_clock == GNSS and table.time_name == "time" else 0
        if outside:
            notes.append(f"{counted(outside, 'row')} before the first satellite time are left out")
            known = np.isfinite(times)
            columns, times = {name: values[known] for name, values in columns.items()}, times[known]
        found, clock_notes = channels_of(columns, times, source=path.name, units=table.units, what=table.time_name)
        channels, notes, unused = [*channels, *found], [*notes, *clock_notes], [*unused, *table.texts()]
    return Log(source=path.name, clock=clock, channels=tuple(channels), notes=tuple(notes), unused=tuple(unused))


def _is_sentence(line: str) -> bool:
    """Whether a line is, or ends in, a sentence of NMEA 0183; reports of the own ship may stand behind a time."""
    return "$" in line or line.startswith("!") or "VDO," in line


def _line_notes(sentences: Sentences, other: int) -> Iterator[str]:
    if sentences.broken:
        yield f"left out {counted(sentences.broken, 'sentence')} with a wrong checksum"
    if sentences.garbled:
        yield f"left out {counted(sentences.garbled, 'line')} with a $ but no whole sentence"
    if sentences.no_numbers:
        yield f"left out {counted(sentences.no_numbers, 'reading')} of transducers (XDR) without a number"
    for what, count in sentences.doubtful.most_common():
        yield f"used {counted(count, 'position')} that no satellite gave: {what}"
    for datum, count in sentences.datums.most_common():
        told = counted(count, "sentence")
        yield f"positions are of the datum {datum} by {told} (DTM), and may be off by 100 m and more"
    if sentences.unchecked:
        yield f"used {counted(sentences.unchecked, 'sentence')} without a checksum"
    if other:
        yield (
            f"left out {counted(other, 'line')} that is no sentence"
            if other == 1
            else (f"left out {other} lines that are no sentences")
        )


def is_text(path: Path, head: bytes) -> bool:
    """Whether a file may be text: the last reader that is asked."""
    return True
