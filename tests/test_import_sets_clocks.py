"""Clocks of several logs are set by what these saw; stamps of one are set right; what was moved is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.importing import Channel, lag_of, zone_lag_of
from expdesign.importing.channels import set_right
from imported_runs import columns_of, notes_of, run_import
from logged_trial import (
    Voyage,
    iso,
    voyage,
    write_nmea,
)

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def trip() -> Voyage:
    return voyage(parts=(("steady", 60.0), ("zigzag", 200.0), ("steady", 150.0), ("circle", 250.0)))


@pytest.mark.parametrize("offset_s", [100.0, 0.0, 7.25])
def test_a_rudder_of_another_clock_is_set_by_the_turn(offset_s: float, tmp_path: Path, trip: Voyage) -> None:
    bridge = write_nmea(tmp_path / "bridge.nmea", replace(trip, rudder_rad=np.nan * trip.rudder_rad).every(5))
    bridge.write_text("\n".join(line for line in bridge.read_text().splitlines() if "RSA" not in line) + "\n")
    part = slice(500, 6000, 2)
    table = np.column_stack([trip.time_s[part] - trip.time_s[500] + offset_s, np.degrees(trip.rudder_rad[part])])
    np.savetxt(tmp_path / "rudder.csv", table, delimiter=",", header="t_s,rudder_deg", comments="", fmt="%.4f")
    truth = trip.time_s[500] - offset_s
    status, said, _ = run_import(bridge, tmp_path / "rudder.csv")
    assert status == 0
    clock = next(one for one in said["clocks"] if one["file"] == "rudder.csv")  # type: ignore[attr-defined]
    assert abs(clock["offset_s"] - truth) < 4 * clock["offset_std_s"]
    assert clock["offset_std_s"] < 0.5
    assert "are added to its times, by rudder and turn" in notes_of(said)


@pytest.mark.thorough
@pytest.mark.parametrize("late_s", [0.0, 2.3, -40.0])
def test_a_computers_clock_is_held_against_what_a_receiver_saw(late_s: float, tmp_path: Path, trip: Voyage) -> None:
    bridge = write_nmea(tmp_path / "bridge.nmea", trip.every(5))
    kept = [line for line in bridge.read_text().splitlines() if "RSA" not in line and "RPM" not in line]
    bridge.write_text("\n".join(kept) + "\n")
    part = trip.every(5)
    rows = zip(part.time_s + late_s, np.degrees(part.order_rad), np.degrees(part.rudder_rad), strict=True)
    lines = [f"{iso(when)};{order:.1f};{angle:.1f}" for when, order, angle in rows]
    (tmp_path / "plc.csv").write_text("\n".join(["Timestamp;Rudder setpoint;Rudder actual", *lines]) + "\n")
    _, said, out = run_import(bridge, tmp_path / "plc.csv")
    clock = next(one for one in said["clocks"] if one["file"] == "plc.csv")  # type: ignore[attr-defined]
    assert abs(clock["offset_s"] + late_s) < max(0.1, 4 * clock["offset_std_s"])
    assert "agrees with the others" in notes_of(said) if not late_s else "are added to its times" in notes_of(said)
    before = columns_of(said, out)
    _, said, out = run_import(bridge, tmp_path / "plc.csv", options=("--map", str(out / "mapping.toml")))
    assert np.allclose(columns_of(said, out)["reached_rudder1_rad"], before["reached_rudder1_rad"])
    assert not late_s or "are added to its times, as the mapping says" in notes_of(said)


@pytest.mark.parametrize(
    ("late_s", "told"),
    [
        (7200.0, "of a zone 2 h after the other's"), (-5 * 3600.0 + 1.3, "of a zone 5 h before the other's"),
        (5.75 * 3600.0, "of a zone 5.75 h after the other's"), (-1024 * 604800.0, "1 times 1024 weeks behind"),
        (-1024 * 604800.0 + 3600.0, "and of a zone 1 h after"), (30 * 86400.0, ""), (600.0, ""),
    ],
)  # fmt: skip
def test_a_clock_of_another_zone_or_week_is_set_by_what_both_saw(late_s: float, told: str, trip: Voyage) -> None:
    part = trip.every(10)
    own, other = (
        {"heading_rad": Channel(name="h", source="a", time_s=part.time_s + late, values=part.heading_rad)}
        for late in (late_s, 0.0)
    )
    found = zone_lag_of(own, other)
    assert (found is not None) == bool(told)
    if found is not None:
        assert abs(found[0].offset_s + late_s) < max(0.1, 4 * found[0].std_s)
        assert told in found[1]


def test_lags_of_noisy_series_are_within_their_standard_errors() -> None:
    scores = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        time_s = np.arange(0.0, 600.0, 0.5)
        smooth = np.convolve(rng.normal(size=len(time_s) + 60), np.hanning(61) / 30, "valid")
        lag_s = rng.uniform(-20, 20)
        own = Channel(
            name="r",
            source="a",
            time_s=time_s[100:-100] - lag_s,
            values=smooth[100:-100] + rng.normal(scale=0.05, size=len(time_s) - 200),
        )
        other = Channel(name="r", source="b", time_s=time_s, values=smooth + rng.normal(scale=0.05, size=len(time_s)))
        found = lag_of({"r_radps": own}, {"r_radps": other}, near=False)
        assert found is not None
        scores.append((found.offset_s - lag_s) / found.std_s)
    # of 30 standard normal numbers the mean square is 1 +- 0.26; blocks of few readings make it up to twice that
    assert np.mean(np.square(scores)) < 2.5
    assert np.abs(scores).max() < 5


@pytest.mark.parametrize("heading", [0.3, 2.0])
@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("late_s", [0.0, 40.0])
def test_a_course_turns_later_than_a_heading_by_the_drift(late_s: float, swapped: bool, heading: float) -> None:
    trip = voyage(parts=(("steady", 30.0), ("zigzag", 120.0), ("steady", 60.0), ("circle", 150.0)), heading=heading)
    part = trip.every(5)
    gyro = {"heading_rad": Channel(name="h", source="a", time_s=part.time_s + late_s, values=part.heading_rad)}
    course = {
        name: Channel(name=name, source="b", time_s=part.time_s, values=values)
        for name, values in (("cog_rad", part.course_rad), ("sog_mps", part.speed_mps))
    }
    own, other = (course, gyro) if swapped else (gyro, course)
    found = lag_of(own, other, near=True, length_m=(50.0, 0.0))
    assert found is not None
    assert abs(found.offset_s + (-late_s if swapped else late_s)) < 2 * found.std_s
    assert "late by" in found.by
    assert found.std_s < 2.5  # a fifth of the time in which she sails her length


def test_logs_that_saw_nothing_alike_are_not_put_together(
    tmp_path: Path, trip: Voyage, capsys: pytest.CaptureFixture[str]
) -> None:
    np.savetxt(
        tmp_path / "b.csv",
        np.column_stack([np.arange(500.0), 10 + np.sin(np.arange(500.0))]),
        delimiter=",",
        header="t_s,depth_m",
        comments="",
    )
    status, _, out = run_import(write_nmea(tmp_path / "a.nmea", trip.every(10)), tmp_path / "b.csv")
    assert status == 3
    assert "expected offset_s under [[file]]" in capsys.readouterr().err
    assert (out / "mapping.toml").exists()


def test_stamps_that_repeat_swap_and_begin_anew_are_set_right() -> None:
    even = np.arange(0.0, 20.0, 0.2)
    order, times, notes = set_right(np.floor(even), what="x")
    assert np.allclose(times, even)
    assert "repeat" in notes[0]
    swapped = even.copy()
    swapped[[10, 11, 40, 41]] = swapped[[11, 10, 41, 40]]
    order, times, notes = set_right(swapped, what="x")
    assert np.allclose(times, even)
    assert list(order[10:12]) == [11, 10]
    assert "2 stamps go back" in notes[0]
    order, times, notes = set_right(even[::-1], what="x")
    assert np.allclose(times, even)
    assert order[0] == len(even) - 1
    assert "last row comes first" in notes[0]
    reset = np.concatenate([even, even])
    order, times, notes = set_right(reset, what="x")
    assert (np.diff(times) > 0).all()
    assert np.diff(times).max() > 30
    assert "begun anew" in notes[0]


AT = 1.7e9 + np.arange(0.0, 1000.0)
STRAYS = {
    "an old row again": np.insert(AT, 700, AT[640]),
    "old rows again": np.insert(AT, [700] * 10, AT[640:650]),
    "a stamp of nought": np.where(np.arange(1000) == 700, 0.0, AT),
    "a stamp far ahead": np.where(np.arange(1000) == 700, 9e9, AT),
    "several of both": np.where(np.isin(np.arange(1000), (200, 201, 500)), 9e9, np.insert(AT[:-1], 700, AT[10])),
}


@pytest.mark.parametrize("kind", STRAYS)
def test_a_few_stamps_out_of_order_move_nothing_that_follows(kind: str) -> None:
    stamps = STRAYS[kind]
    order, times, notes = set_right(stamps, what="x")
    assert np.array_equal(times, stamps[order])
    assert (np.diff(times) > 0).all()
    strays = len(stamps) - len(order)
    assert 1 <= strays <= 10
    assert notes == [f"x: {f'{strays} rows are' if strays > 1 else '1 row is'} out of order in time and left out"]


def test_parts_with_dates_are_sorted_and_those_without_go_on_after_a_gap() -> None:
    swapped = np.concatenate([AT[500:], AT[:500]])
    order, times, notes = set_right(swapped, what="x")
    assert np.array_equal(times, AT)
    assert np.array_equal(swapped[order], AT)
    assert notes == ["x: its 2 parts are not in the order of their dates; they are sorted"]
    _, times, notes = set_right(swapped - 1.7e9, what="x")
    assert (np.diff(times) > 0).all()
    assert times.max() > 1000.0
    assert notes == ["x: the clock goes back once and counts as begun anew after a gap there"]
