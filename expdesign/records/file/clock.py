"""The clock of a file: its sample time, and the stretches without a gap."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from expdesign.errors import FileError
from expdesign.records.file.table import Mask, Table
from expdesign.values import Array

GAP_SAMPLE_TIMES = 1.5  # interval, in sample times, above which a new batch starts

GAP_SHARE = 0.2  # share of intervals that may be gaps before the sampling counts as irregular
JITTER_SHARE = 0.25  # largest deviation of an interval from the sample time, as a share of it
SAMPLE_TIME_MISMATCH = 0.01  # largest relative difference of two sample times that count as equal
LONGEST_SAMPLE_TIME_S = 20.0  # limit of IMO MSC/Circ.1053 for manoeuvring trials [s]
SHORTEST_SAMPLE_TIME_S = 1e-4  # limit below which the unit of time is questioned [s]


UNITS = ((1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds"), (1 / 60, "minutes"), (1 / 3600, "hours"))


@dataclass(frozen=True, kw_only=True)
class Clock:
    """How a file is sampled."""

    sample_time_s: float  # mean interval inside the batches [s]
    batches: tuple[slice, ...]  # stretches of samples, each with two or more
    notes: tuple[str, ...] = ()  # on gaps and dropped samples


def read_clock(table: Table, *, sample_time_s: float | None, whose: str = "the vessel") -> Clock:
    """Check the times of a file and cut it into batches.

    Args:
        table: with `time_s`, and `batch` where there is one.
        sample_time_s: what the intervals should be [s], or None for whatever they are.
        whose: owner of that sample time, for messages.

    Raises:
        FileError: times repeat, go backwards or are irregular; the sample time is another; batch numbers are no whole
            numbers or come back; no batch is left.
    """
    if len(table) < 2:
        raise FileError(table.path, "", f"has one sample (row {table.first_row}), expected two or more")
    announced = _announced(table)
    step = np.diff(table.columns["time_s"])
    _check_increasing(table, step, announced)
    inside = step[~announced]
    if not len(inside):
        raise table.error("batch", "changes at every row, expected batches of two or more samples")
    gap = ~announced & (step > GAP_SAMPLE_TIMES * np.median(inside))
    regular = ~announced & ~gap
    found_s = float(f"{step[regular].mean():.6g}")
    _check_sample_time(table, found_s, sample_time_s, whose)
    _check_regular(table, step, gap, regular, found_s)
    stretches = _stretches(announced | gap, len(table))
    kept = tuple(part for part in stretches if part.stop - part.start > 1)
    notes = (*_gap_notes(table, gap, step), *_short_notes(table, stretches))
    return Clock(sample_time_s=sample_time_s or found_s, batches=kept, notes=notes)


def same_sample_time(a_s: float, b_s: float) -> bool:
    """Whether two sample times differ by no more than rounding in files explains."""
    return abs(a_s - b_s) <= SAMPLE_TIME_MISMATCH * max(a_s, b_s)


def _announced(table: Table) -> Mask:
    """(k - 1,) where the batch column starts a new batch."""
    numbers = table.columns.get("batch")
    if numbers is None:
        return np.zeros(len(table) - 1, dtype=bool)
    broken = numbers != np.round(numbers)
    if broken.any():
        raise table.error("batch", f"{table.found('batch', broken, 'broken')}, expected whole numbers")
    change: Mask = np.diff(numbers) != 0
    starts = np.flatnonzero(np.concatenate([[True], change]))
    seen: set[float] = set()
    for start in starts.tolist():
        if numbers[start] in seen:
            found = f"is {numbers[start]:g} again in row {start + table.first_row}"
            raise table.error("batch", f"{found}, expected the rows of a batch to follow each other")
        seen.add(float(numbers[start]))
    return change


def _check_increasing(table: Table, step: Array, announced: Mask) -> None:
    repeated, backward = (np.concatenate([[False], wrong & ~announced]) for wrong in (step == 0, step < 0))
    if repeated.any():
        stuck = f"stays at {table.value('time_s', int(np.argmax(repeated)))} in {table.rows(repeated)}"
        raise table.error("time_s", f"{stuck}, expected increasing times")
    if backward.any():
        index = int(np.argmax(backward))
        now, before = table.value("time_s", index), table.value("time_s", index - 1)
        reset = table.columns["time_s"][index] <= table.columns["time_s"][0] + abs(step[0])
        why = ": a clock that was reset needs a batch column that changes there" if reset else ""
        problem = f"goes back from {before} to {now} in {table.rows(backward)}, expected increasing times{why}"
        raise table.error("time_s", problem)


def _check_sample_time(table: Table, found_s: float, wanted_s: float | None, whose: str) -> None:
    if found_s < SHORTEST_SAMPLE_TIME_S:
        raise table.error("time_s", f"has a sample every {found_s:g} s, expected {SHORTEST_SAMPLE_TIME_S:g} s or more")
    if wanted_s is None:
        if found_s > LONGEST_SAMPLE_TIME_S:
            most = f"expected at most {LONGEST_SAMPLE_TIME_S:g} s{_unit(found_s, None)}"
            raise table.error("time_s", f"has a sample every {found_s:g} s, {most}")
    elif not same_sample_time(found_s, wanted_s):
        problem = f"has a sample every {found_s:g} s, expected every {wanted_s:g} s, as {whose} has it"
        raise table.error("time_s", problem + _unit(found_s, wanted_s))


def _unit(found_s: float, wanted_s: float | None) -> str:
    if wanted_s is None:
        return " (is it in milliseconds?)"
    for factor, unit in UNITS:
        if same_sample_time(found_s, factor * wanted_s):
            return f" (is it in {unit}?)"
    return ""


def _check_regular(table: Table, step: Array, gap: Mask, regular: Mask, sample_time_s: float) -> None:
    odd = regular & (np.abs(step - sample_time_s) > JITTER_SHARE * sample_time_s)
    if gap.sum() > max(GAP_SHARE * len(step), 2):
        odd |= gap
    if odd.any():
        later = np.concatenate([[False], odd])
        found = f"advances by {step[int(np.argmax(odd))]:.6g} s in {table.rows(later)}"
        raise table.error("time_s", f"{found}, expected even steps of {sample_time_s:g} s within {JITTER_SHARE:.0%}")


def _stretches(cut: Mask, count: int) -> list[slice]:
    edges = [0, *(np.flatnonzero(cut) + 1).tolist(), count]
    return [slice(start, stop) for start, stop in pairwise(edges)]


def _gap_notes(table: Table, gap: Mask, step: Array) -> list[str]:
    if not gap.any():
        return []
    rows = table.rows(np.concatenate([[False], gap]))
    return [f"gaps in time_s of up to {step[gap].max():.6g} s start a new batch in {rows}"]


def _short_notes(table: Table, stretches: list[slice]) -> list[str]:
    lonely = np.zeros(len(table), dtype=bool)
    lonely[[part.start for part in stretches if part.stop - part.start == 1]] = True
    return [f"left out {table.rows(lonely)}, batches of a single sample"] if lonely.any() else []
