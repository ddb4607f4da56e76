"""Samples without a reading are told, column by column: how many, over which gaps, and what stands there instead."""

from __future__ import annotations

import re

import numpy as np
import pytest

from expdesign.importing import Channel, sampled
from expdesign.importing.mapping import Mapping
from expdesign.importing.sampling import GAP, SAME, Sampled

COLUMNS = (
    "u_mps",
    "v_mps",
    "r_radps",
    "heading_rad",
    "lat_deg",
    "lon_deg",
    "n1_rps",
    "reached_rudder1_rad",
    "roll_rad",
)
COUNT = 700
MISSING = {
    "none": np.zeros(COUNT, dtype=bool),
    "six of seven": np.arange(COUNT) % 7 != 0,
    "half, by chance": np.random.default_rng(3).random(COUNT) < 0.5,
    "two at a time": np.arange(COUNT) % 50 < 2,
    "one gap of a minute": (np.arange(COUNT) >= 300) & (np.arange(COUNT) < 360),
}


def record(column: str, missing: np.ndarray, step_s: float) -> tuple[Sampled, np.ndarray]:
    """All columns once a step, but for one, of which readings are missing; and the times of its readings."""
    times = step_s * np.arange(COUNT)
    there = {name: times[~missing] if name == column else times for name in COLUMNS}
    table = {
        name: Channel(name=name, source="a.csv", time_s=own.copy(), values=np.sin(0.01 * own))
        for name, own in there.items()
    }
    return sampled(table, Mapping(uses=(), files=())), there[column]


def without_reading(times: np.ndarray, readings: np.ndarray, step_s: float) -> np.ndarray:
    """Which times (k,) have no reading within half a step, and lie after the last or between distant ones."""
    after = np.clip(np.searchsorted(readings, times - 1e-9), 1, len(readings) - 1)
    before = after - 1
    near = np.minimum(times - readings[before], np.abs(readings[after] - times)) < 0.5 * step_s
    return ~near & ((readings[after] - readings[before] > SAME * step_s) | (times > readings[-1]))


@pytest.mark.parametrize("step_s", [0.1, 0.7, 1.0])
@pytest.mark.parametrize("kind", MISSING)
@pytest.mark.parametrize("column", COLUMNS)
def test_what_is_filled_is_told_with_its_share_and_its_longest_gap(column: str, kind: str, step_s: float) -> None:
    found, readings = record(column, MISSING[kind], step_s)
    own = [note for note in found.notes if note.startswith(f"{column} ") and "in between" in note]
    times = np.concatenate(
        [stretch.time_s for stretch in found.stretches if column in stretch.columns] or [np.zeros(0)]
    )
    empty = without_reading(times, readings, found.sample_time_s)
    if not empty.any():
        assert own == []
        return
    (note,) = own
    longest, percent = re.search(r"gaps of ([\d.]+) s at most, in ([\d.]+)% of the samples", note).groups()  # type: ignore[union-attr]
    assert float(percent) == pytest.approx(100.0 * empty.mean(), abs=0.51)
    after = np.clip(np.searchsorted(readings, times[empty]), 1, len(readings) - 1)
    gaps = np.maximum(readings[after], times[empty]) - readings[after - 1]
    assert float(longest) == pytest.approx(gaps.max(), rel=6e-3)
    usual = float(np.median(np.diff(readings)))
    assert gaps.max() <= max(GAP * max(usual, found.sample_time_s), 1.5) + 1e-9
    slow = usual > SAME * found.sample_time_s
    assert ("repeated" in note) == (column == "n1_rps" or slow)
    for stretch in found.stretches:  # what is told is what stands there
        between = without_reading(stretch.time_s, readings, found.sample_time_s)
        at = np.searchsorted(readings, stretch.time_s[between]) - 1
        last = np.sin(0.01 * readings)[at]
        held = np.isclose(stretch.columns[column][between], last, rtol=0.0, atol=1e-12)
        assert held.all() == ("repeated" in note)


@pytest.mark.parametrize("column", COLUMNS)
def test_a_record_that_is_cut_at_a_gap_names_the_column_that_has_it(column: str) -> None:
    found, _ = record(column, MISSING["one gap of a minute"], 1.0)
    said = f"{column} has a gap of 61 s, too long to be filled: the record is cut there"
    beside = column == "roll_rad"  # the record does without it
    assert (said in found.notes) == (not beside)
    assert len(found.stretches) == (1 if beside else 2)
    assert ("roll_rad does not cover all of a stretch, and is left out of it" in found.notes) == beside


def test_a_pause_of_the_whole_log_is_no_gap_of_one_column() -> None:
    times = np.r_[np.arange(300.0), 500.0 + np.arange(300.0)]
    table = {name: Channel(name=name, source="a.csv", time_s=times.copy(), values=np.sin(times)) for name in COLUMNS}
    notes = sampled(table, Mapping(uses=(), files=())).notes
    assert notes == ("all main columns have a gap of 201 s, too long to be filled: the record is cut there",)


@pytest.mark.parametrize(("speed_rps", "told"), [(2.0, False), (60.0, False), (180.0, True)])
def test_a_shaft_speed_that_no_shaft_has_is_asked_about(speed_rps: float, told: bool) -> None:
    times = np.arange(100.0)
    values = {"u_mps": np.ones(100), "v_mps": np.zeros(100), "n1_rps": np.full(100, speed_rps)}
    table = {name: Channel(name=name, source="a.csv", time_s=times, values=own) for name, own in values.items()}
    assert ("is the channel in rpm" in " ".join(sampled(table, Mapping(uses=(), files=())).notes)) == told
