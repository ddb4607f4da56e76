"""Signs, clocks, averages across north, gaps and broken lines: what a log hides is undone where that is certain, and
told; a mapping may say otherwise; what cannot be read ends in one line."""

from __future__ import annotations

import json
import math
import os
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.importing import Channel, Sampled, Stretch, cut_by_plan, lag_of, zone_lag_of
from expdesign.importing.channels import set_right
from expdesign.signals import Commands
from logged_trial import (
    START_S,
    Voyage,
    iso,
    logger_rows,
    nmea,
    voyage,
    write_dialect,
    write_nmea,
    write_own,
    write_parquet,
    write_ulog,
)

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def trip() -> Voyage:
    return voyage()


def run_import(*logs: Path, options: tuple[str, ...] = ("--length-m", "50")) -> tuple[int, dict[str, object], Path]:
    """Exit status, import.json and the folder."""
    out = logs[0].parent / "out"
    status = main(["import", *map(str, logs), "--out", str(out), "--quiet", *options])
    said = out / "import.json"
    return status, json.loads(said.read_text()) if status == 0 else {}, out


def notes_of(said: dict[str, object]) -> str:
    return "\n".join(said["notes"])  # type: ignore[arg-type]


def columns_of(said: dict[str, object], out: Path, run: int = 0) -> dict[str, np.ndarray]:
    """Columns of a run, times counted as in the log."""
    file = out / said["runs"][run]["file"]  # type: ignore[index]
    names = file.read_text().partition("\n")[0].split(",")
    table = dict(zip(names, np.loadtxt(file, delimiter=",", skiprows=1).T, strict=True))
    return {**table, "time_s": table["time_s"] + said["begins_s"]}  # type: ignore[operator]


def wrapped(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2 * np.pi) - np.pi


# Signs and conventions.


def test_a_rudder_that_turns_the_ship_the_wrong_way_is_told(tmp_path: Path, trip: Voyage) -> None:
    other = replace(trip, order_rad=-trip.order_rad, rudder_rad=-trip.rudder_rad).every(5)
    for name, case, told in (("right", trip.every(5), False), ("wrong", other, True)):
        (tmp_path / name).mkdir()
        status, said, _ = run_import(write_own(tmp_path / name / "a.csv", case))
        assert status == 0
        assert ("turns against the rudder" in notes_of(said)) == told


def test_course_in_place_of_heading_is_told(tmp_path: Path, trip: Voyage) -> None:
    for name, case, told in (("right", trip, False), ("course", replace(trip, heading_rad=trip.course_rad), True)):
        (tmp_path / name).mkdir()
        _, said, _ = run_import(write_dialect(tmp_path / name / "a.csv", case.every(10)))
        assert ("holds course over ground" in notes_of(said)) == told


def test_a_rate_of_turn_to_port_is_turned_over(tmp_path: Path, trip: Voyage) -> None:
    path = write_dialect(tmp_path / "a.csv", replace(trip, r_radps=-trip.r_radps).every(10))
    _, said, out = run_import(path)
    rate = next(use for use in said["channels"] if use["column"] == "r_radps")  # type: ignore[attr-defined]
    assert rate["scale"] == -1.0
    assert "the other way than HDG" in rate["why"]
    table = columns_of(said, out)
    assert np.abs(table["r_radps"] - np.interp(table["time_s"], trip.time_s, trip.r_radps)).max() < 1e-6


@pytest.mark.parametrize(("unit", "factor"), [("deg/s", 1.0), ("deg/min", 60.0), ("rad/s", math.pi / 180)])
@pytest.mark.parametrize(("speed", "knots"), [("kn", 1.0), ("m/s", 1852 / 3600), ("km/h", 1.852)])
def test_units_are_found_by_what_the_ship_did(
    unit: str, factor: float, speed: str, knots: float, tmp_path: Path, trip: Voyage
) -> None:
    rows = logger_rows(trip.every(10))
    rows[:, 5] *= factor / 60
    rows[:, 2] *= knots
    table = np.column_stack([trip.every(10).time_s, rows])
    head = "time,lat,lon,sog,cog,hdg,rot,rpm,rudder order,rudder angle"
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=head, comments="", fmt="%.9f")
    _, said, _ = run_import(tmp_path / "a.csv")
    units = {use["column"]: use["unit"] for use in said["channels"]}  # type: ignore[attr-defined]
    assert units["r_radps"] == {"deg/s": "degps", "deg/min": "degpmin", "rad/s": "radps"}[unit]
    assert units["sog_mps"] == {"kn": "kn", "m/s": "mps", "km/h": "kmph"}[speed]


def test_a_magnetic_heading_is_made_true_by_the_logs_variation(tmp_path: Path, trip: Voyage) -> None:
    _, said, out = run_import(write_nmea(tmp_path / "a.nmea", trip.every(5), magnetic=-7.5))
    assert "magnetic; the variation added is -7.5 degrees" in notes_of(said)
    table = columns_of(said, out)
    off = wrapped(table["heading_rad"] - np.interp(table["time_s"], trip.time_s, np.unwrap(trip.heading_rad)))
    assert np.abs(off).max() < 2e-6


def test_averages_across_north_are_left_out(tmp_path: Path) -> None:
    trip = voyage(heading=0.05)  # the zig-zag swings through north
    rows = logger_rows(trip)
    count = len(rows) // 10 * 10
    mean = rows[:count].reshape(-1, 10, 9).mean(axis=1)  # of degrees, also from 359 to 1
    times = trip.time_s[:count].reshape(-1, 10).mean(axis=1)
    spoilt = np.abs(wrapped(np.radians(mean[:, 4]) - np.interp(times, trip.time_s, np.unwrap(trip.heading_rad)))) > 0.1
    assert spoilt.sum() >= 5
    names = "time,lat,lon,sog,cog,hdg,rot,rpm,rudder order,rudder angle"
    mean[:, 3] = np.degrees(np.interp(times, trip.time_s, np.unwrap(trip.course_rad))) % 360
    np.savetxt(tmp_path / "a.csv", np.column_stack([times, mean]), delimiter=",", header=names, comments="", fmt="%.9f")
    _, said, out = run_import(tmp_path / "a.csv")
    assert f"heading_rad: {spoilt.sum()} readings on the way through north" in notes_of(said)
    table = columns_of(said, out)
    off = wrapped(table["heading_rad"] - np.interp(table["time_s"], trip.time_s, np.unwrap(trip.heading_rad)))
    assert np.abs(off).max() < 0.01  # a reading is missing where the turn bends: the line between its neighbours


def test_an_antenna_is_moved_to_midships(tmp_path: Path, trip: Voyage) -> None:
    ahead, aside = 18.0, -4.0
    c, s = np.cos(trip.heading_rad), np.sin(trip.heading_rad)
    north, east = trip.north_m + c * ahead - s * aside, trip.east_m + s * ahead + c * aside
    u, v = trip.u_mps - trip.r_radps * aside, trip.v_mps + trip.r_radps * ahead
    seen = replace(trip, north_m=north, east_m=east, u_mps=u, v_mps=v)
    path = write_dialect(tmp_path / "a.csv", seen.every(5))
    assert run_import(path)[0] == 0
    mapping = tmp_path / "out" / "mapping.toml"
    text = mapping.read_text().replace("antenna_forward_m = 0.0", f"antenna_forward_m = {ahead}")
    (tmp_path / "m.toml").write_text(text.replace("antenna_starboard_m = 0.0", f"antenna_starboard_m = {aside}"))
    _, said, out = run_import(path, options=("--map", str(tmp_path / "m.toml")))
    table = columns_of(said, out)
    for name, truth in (("lat_deg", trip.lat_deg), ("lon_deg", trip.lon_deg)):
        off = 111e3 * np.abs(table[name] - np.interp(table["time_s"], trip.time_s, truth)).max()
        assert off < 0.1, name  # a sphere for the 18 m from the antenna
    for name in ("u_mps", "v_mps"):
        assert np.abs(table[name] - np.interp(table["time_s"], trip.time_s, getattr(trip, name))).max() < 1e-3


# Clocks.


@pytest.mark.parametrize("offset_s", [100.0, 0.0, 7.25])
def test_a_rudder_of_another_clock_is_set_by_the_turn(offset_s: float, tmp_path: Path, trip: Voyage) -> None:
    bridge = write_nmea(tmp_path / "bridge.nmea", replace(trip, rudder_rad=np.nan * trip.rudder_rad).every(5))
    bridge.write_text("\n".join(line for line in bridge.read_text().splitlines() if "RSA" not in line) + "\n")
    part = slice(500, 9000, 2)
    table = np.column_stack([trip.time_s[part] - trip.time_s[500] + offset_s, np.degrees(trip.rudder_rad[part])])
    np.savetxt(tmp_path / "rudder.csv", table, delimiter=",", header="t_s,rudder_deg", comments="", fmt="%.4f")
    truth = trip.time_s[500] - offset_s
    status, said, _ = run_import(bridge, tmp_path / "rudder.csv")
    assert status == 0
    clock = next(one for one in said["clocks"] if one["file"] == "rudder.csv")  # type: ignore[attr-defined]
    assert abs(clock["offset_s"] - truth) < 4 * clock["offset_std_s"]
    assert clock["offset_std_s"] < 0.5
    assert "are added to its times, by rudder and turn" in notes_of(said)


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


def test_jitter_hardly_moves_what_is_recorded(tmp_path: Path, trip: Voyage) -> None:
    rng = np.random.default_rng(1)
    part = trip.every(5)
    late = rng.normal(scale=0.05, size=len(part.time_s))
    shaken = Voyage(*(
        part.time_s + late if name == "time_s" else np.interp(part.time_s + late, trip.time_s, values)
        for name in part.__dataclass_fields__
        if (values := np.unwrap(getattr(trip, name)) if name == "heading_rad" else getattr(trip, name)) is not None
    ))  # fmt: skip
    _, said, out = run_import(
        write_own(tmp_path / "a.csv", replace(shaken, heading_rad=shaken.heading_rad % (2 * np.pi)))
    )
    table = columns_of(said, out)
    begin = table["time_s"] + START_S
    for name, bound in (("r_radps", 2e-4), ("u_mps", 1e-3)):  # curvature over half a second
        assert np.abs(table[name] - np.interp(begin, trip.time_s, getattr(trip, name))).max() < bound


def test_gaps_part_the_record_and_broken_lines_are_counted(tmp_path: Path, trip: Voyage) -> None:
    lines = write_dialect(tmp_path / "a.csv", trip.every(5)).read_text().splitlines()
    gone = {k for k in range(2, len(lines)) if 1450 < k < 1530}  # in the circle
    spoilt = {300: lines[300][:20], 777: "?;?", 901: lines[901].replace(lines[901].split(";")[4], "x,y", 1)}
    kept = [spoilt.get(k, line) for k, line in enumerate(lines) if k not in gone]
    (tmp_path / "a.csv").write_text("\n".join(kept) + "\n")
    _, said, out = run_import(tmp_path / "a.csv")
    text = notes_of(said)
    assert "left out 2 lines without the 10 cells of a row" in text
    assert "left out 1 cell of COG without a number" in text
    for run in range(len(said["runs"])):  # type: ignore[arg-type]
        assert np.diff(columns_of(said, out, run)["time_s"]).max() < 0.51


def test_broken_sentences_are_counted(tmp_path: Path, trip: Voyage) -> None:
    _, said, _ = run_import(write_nmea(tmp_path / "a.nmea", trip.every(5), broken=60))
    found = [int(count) for count in re.findall(r"left out (\d+) (?:sentence|line)", notes_of(said))]
    # one of 60 lines may break where only the checksum tells; GSV is not read, so that its breaks are not seen
    assert 40 <= sum(found) <= 60


def test_slow_sensors_keep_their_interval(tmp_path: Path, trip: Voyage) -> None:
    lines = [
        line
        for k, line in enumerate(nmea(trip.every(2)))
        if not (line.startswith(("$GPRMC", "$GPGGA")) and (k // 7) % 25)
    ]
    # the heading comes with a time of reception, so that it has one between the fixes
    stamps = [START_S + 0.2 * (k // 7) for k in range(7 * len(trip.every(2).time_s))]
    kept = [
        k for k, line in enumerate(nmea(trip.every(2))) if not (line.startswith(("$GPRMC", "$GPGGA")) and (k // 7) % 25)
    ]
    (tmp_path / "a.txt").write_text(
        "\n".join(f"{stamps[k]:.3f} {line}" for k, line in zip(kept, lines, strict=True)) + "\n"
    )
    _, said, out = run_import(tmp_path / "a.txt")
    assert "lat_deg is read every 5 s" in notes_of(said)
    assert "position_interval_s = 5.0" in (out / "instruments.toml").read_text()
    assert said["sample_time_s"] == 1.0


# Runs of a plan.


def test_the_runs_of_a_plan_are_found_by_its_commands() -> None:
    rng = np.random.default_rng(2)
    plan = np.repeat(rng.uniform(-0.5, 0.5, 60), 10)
    commands = Commands(sample_time_s=1.0, names=("n1", "rudder1"), values=np.column_stack([np.full(600, 3.0), plan]))
    seen = np.concatenate([np.zeros(137), plan, np.zeros(80)]) + rng.normal(scale=0.02, size=817)
    stretch = Stretch(time_s=np.arange(817.0), columns={"rudder1_rad": seen, "u_mps": np.ones(817)})
    record = Sampled(stretches=(stretch,), sample_time_s=1.0, notes=(), held_s={}, channels={})
    runs, words = cut_by_plan(record, commands, [("circle a", 0, 200), ("zig-zag b", 350, 600)])
    assert [(run.name, run.stretch.time_s[0], len(run.stretch)) for run in runs] == [
        ("circle a", 137.0, 200),
        ("zig-zag b", 487.0, 250),
    ]
    assert "begins 137.0 s" in words
    other = Commands(sample_time_s=1.0, names=("rudder1",), values=np.repeat(rng.uniform(-0.5, 0.5, 60), 10)[:, None])
    runs, words = cut_by_plan(record, other, [("a", 0, 200)])
    assert not runs
    assert "not found" in words


# The mapping.


def test_a_mapping_says_otherwise(tmp_path: Path, trip: Voyage) -> None:
    path = write_dialect(tmp_path / "a.csv", trip.every(10))
    _, said, out = run_import(path)
    text = (out / "mapping.toml").read_text()
    block = next(part for part in text.split("[[channel]]") if 'column = "reached_rudder1_rad"' in part)
    (tmp_path / "m.toml").write_text(text.replace(block, block.replace("scale = 1.0", "scale = -2.0\noffset = 0.01")))
    before = columns_of(said, out)
    _, said, out = run_import(path, options=("--map", str(tmp_path / "m.toml")))
    after = columns_of(said, out)
    for time_s in after["time_s"][::50]:
        one = np.interp(time_s, before["time_s"], before["reached_rudder1_rad"])
        other = np.interp(time_s, after["time_s"], after["reached_rudder1_rad"])
        assert other == pytest.approx(0.01 - 2.0 * one, abs=1e-7)


BAD = {
    "column": ('column = "sog_mps"', 'column = "speed"', "channel[3].column: is 'speed'"),
    "unit": ('unit = "kn"', 'unit = "furlong"', "channel[3].unit: is 'furlong'"),
    "file": ('file = "a.csv"', 'file = "b.csv"', "channel[1].file: is 'b.csv', expected one of a.csv"),
    "channel": ('channel = "HDG"', 'channel = "HDGX"', "channel[5].channel: is 'HDGX', which a.csv has not"),
    "key": ("length_m = 50.0", "lenght_m = 50.0", "lenght_m: is not a known key, did you mean 'length_m'"),
    "twice": (
        'column = "reached_rudder1_rad"',
        'column = "rudder1_rad"',
        "channel[9].column: is 'rudder1_rad' as in channel[8]",
    ),
    "sample time": ("sample_time_s = 0.0", "sample_time_s = -1.0", "sample_time_s: is -1, expected at least 0"),
    "not TOML": ("[[file]]", "[[file]", "is not valid TOML"),
    "scale": (
        'column = "lat_deg"\nunit = "deg"\nscale = 1.0',
        'column = "lat_deg"\nunit = "deg"\nscale = "x"',
        "expected a number, without quotes",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_wrong_mapping_is_one_line_with_file_key_and_what_would_be_right(
    case: str, tmp_path: Path, trip: Voyage, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_dialect(tmp_path / "a.csv", trip.every(50))
    assert run_import(path)[0] == 0
    old, new, message = BAD[case]
    text = (tmp_path / "out" / "mapping.toml").read_text()
    assert old in text
    (tmp_path / "m.toml").write_text(text.replace(old, new, 1))
    before = sorted((tmp_path / "out").iterdir())
    capsys.readouterr()
    assert run_import(path, options=("--map", str(tmp_path / "m.toml")))[0] == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert "m.toml" in lines[0]
    assert message in lines[0]
    assert sorted((tmp_path / "out").iterdir()) == before


def test_a_second_import_takes_the_runs_of_the_first_away(tmp_path: Path, trip: Voyage) -> None:
    assert run_import(write_dialect(tmp_path / "a.csv", trip.every(10)))[0] == 0
    own = tmp_path / "out" / "measured.csv"
    own.write_text("of someone else\n")
    assert len(list((tmp_path / "out").glob("*.csv"))) == 3
    circle = voyage(parts=(("steady", 100.0), ("circle", 400.0)))
    assert run_import(write_dialect(tmp_path / "a.csv", circle.every(10)))[0] == 0
    assert sorted(path.name for path in (tmp_path / "out").glob("*.csv")) == [
        "01-turning-circle-35-starboard.csv",
        "measured.csv",
    ]


# What cannot be read.


def hostile(folder: Path, trip: Voyage) -> dict[str, bytes]:
    part = trip.every(100)
    parquet, ulog = write_parquet(folder / "x", part).read_bytes(), write_ulog(folder / "y", part).read_bytes()
    return {
        "empty": b"", "blank": b"\n\n  \n", "zeros": bytes(5000), "noise": np.random.default_rng(0).bytes(5000),
        "prose": b"We sailed at noon.\nThe sea was calm, the wind light.\n" * 20, "header": b"time,lat,lon\n",
        "one row": b"time,lat,lon\n1,2,3\n", "zip": b"PK\x03\x04" + bytes(200), "parquet": parquet[: len(parquet) // 2],
        "ulog": ulog[:300], "old excel": b"\xd0\xcf\x11\xe0" + bytes(600), "bag": b"#ROSBAG V2.0\n" + bytes(100),
        "mcap": b"\x89MCAP0\r\n" + bytes(50), "sqlite": b"SQLite format 3\0" + bytes(200),
        "hdf": b"\x89HDF\r\n\x1a\n" + bytes(99),
        "matlab": b"MATLAB 5.0 MAT-file" + bytes(300), "board": b"\xa3\x95\x80" + bytes(400),
        "quotes": b'a,b\n"1,2\n3,4\n5,6\n', "one line": b"1," * 300_000, "no numbers": b"a;b\nc;d\ne;f\n",
    }  # fmt: skip


def test_a_hostile_file_gets_one_line(tmp_path: Path, trip: Voyage, capsys: pytest.CaptureFixture[str]) -> None:
    for name, content in hostile(tmp_path, trip).items():
        path = tmp_path / f"{name}.log"
        path.write_bytes(content)
        capsys.readouterr()
        status = main(["import", str(path), "--out", str(tmp_path / "out"), "--quiet"])
        lines = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("expdesign: note")]
        assert (status, len(lines)) in ((2, 1), (3, 1)), (name, status, lines)
        assert "defect" not in lines[0]
        if status == 2:
            assert path.name in lines[0], name
            assert not (tmp_path / "out" / "import.json").exists()


def test_any_choice_of_channels_is_imported_or_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trip = voyage(parts=(("steady", 40.0), ("zigzag", 80.0), ("circle", 100.0))).every(10)
    names = ("lat", "lon", "sog", "cog", "hdg", "rot", "rpm", "rudder order", "rudder angle")
    table = {
        **dict(zip(names, logger_rows(trip).T, strict=True)), "rpm port": 60 * trip.n_rps, "rpm stbd": 60 * trip.n_rps,
        "azimuth port deg": np.degrees(trip.rudder_rad), "bow thruster rpm": 0 * trip.n_rps, "depth": trip.n_rps - 8,
        "wind speed": 3 + np.sin(trip.time_s), "wind angle": 90 + np.sin(trip.time_s), "u": trip.u_mps, "v": trip.v_mps,
        "heading (magnetic)": np.degrees(trip.heading_rad), "throttle %": 0 * trip.n_rps + 60,
        "rudder %": np.degrees(trip.order_rad) / 0.35, "north_m": trip.north_m, "east_m": trip.east_m,
    }  # fmt: skip
    done = []
    for seed in range(7):
        rng = np.random.default_rng(seed)
        chosen = [name for name in table if rng.random() < 0.5]
        values = np.column_stack([trip.time_s, *(table[name] for name in chosen)])
        values[rng.random(values.shape) < 0.02 * (seed % 2)] = np.nan
        values = values[:: -1 if seed % 5 == 4 else 1][: 30 if seed % 7 == 6 else None]
        head = ",".join(["time", *chosen])
        np.savetxt(tmp_path / "a.csv", values, delimiter=",", header=head, comments="", fmt="%.6f")
        capsys.readouterr()
        done.append(run_import(tmp_path / "a.csv")[0])
        lines = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("expdesign: note")]
        assert done[-1] in (0, 3), (chosen, lines)
        assert len(lines) == (done[-1] == 3), (chosen, lines)
    assert done.count(0) >= 3


def test_what_is_no_log_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name, what in (
        ("folder", "is a folder without metadata.yaml"),
        ("pipe", "is a pipe"),
        ("none", "does not exist"),
    ):
        assert main(["import", str(tmp_path / name), "--out", str(tmp_path / "out")]) == 2
        assert what in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_missing_library_is_told_with_its_extra(
    tmp_path: Path, trip: Voyage, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_parquet(tmp_path / "a.parquet", trip.every(100))
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(["import", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "pip install 'expdesign[logs]'" in capsys.readouterr().err.splitlines()[-1]


def test_a_table_without_a_clock_asks_for_its_interval(
    tmp_path: Path, trip: Voyage, capsys: pytest.CaptureFixture[str]
) -> None:
    part = trip.every(10)
    names = "lat,lon,sog,cog,hdg,rot,rpm,rudder order,rudder angle"
    np.savetxt(tmp_path / "a.csv", logger_rows(part), delimiter=",", header=names, comments="", fmt="%.8f")
    status, _, out = run_import(tmp_path / "a.csv")
    assert status == 3
    assert "give sample_time_s" in capsys.readouterr().err
    text = (out / "mapping.toml").read_text()
    head, _, rest = text.partition("[[file]]")
    (tmp_path / "m.toml").write_text(head + "[[file]]" + rest.replace("sample_time_s = 0.0", "sample_time_s = 1.0", 1))
    status, said, out = run_import(tmp_path / "a.csv", options=("--map", str(tmp_path / "m.toml")))
    assert status == 0
    assert len(said["runs"]) == 2  # type: ignore[arg-type]


# Logs of others.

FIELD = Path(__file__).parents[2] / "shared" / "data" / "field"


@pytest.mark.outside
@pytest.mark.parametrize(
    ("log", "status", "told"),
    [
        ("logs/nmea-drift.txt", 0, "left out 1 line that is no sentence"),
        ("logs/dinghy-tabs.log", 0, "no heading is recorded"),
        ("logs/survey-boat.txt", None, "spread evenly between the satellite times"),
        ("logs/soundings-negative.txt", 3, "negative, a height of the bottom: turned over"),
        ("bay/logger.csv", 0, "the velocity over ground"),
    ],
)
def test_logs_of_others_are_read(
    log: str, status: int | None, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if not (FIELD / log).exists():
        pytest.skip("shared data are not here")
    found = main(["import", str(FIELD / log), "--out", str(tmp_path / "out")])
    shown = capsys.readouterr()
    assert found == status if status is not None else found in (0, 3)
    assert told in shown.out + shown.err


def test_readings_that_a_log_repeats_give_noise_and_interval_of_their_own(tmp_path: Path, trip: Voyage) -> None:
    rng = np.random.default_rng(4)
    part = trip.every(2)
    rows = logger_rows(part)
    count = len(rows) // 5 * 5
    noisy = rows[:count:5, :2] + rng.normal(scale=[2.7e-6, 4.65e-6], size=(count // 5, 2))  # 0.3 m
    rows = np.column_stack([np.repeat(noisy, 5, axis=0), rows[:count, 2:]])
    rows[:, 4] = (rows[:, 4] + rng.normal(scale=0.2, size=count)) % 360
    head = "time,lat,lon,sog,cog,hdg,rot,rpm,rudder order,rudder angle"
    table = np.column_stack([part.time_s[:count], rows])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=head, comments="", fmt="%.8f")
    _, _, out = run_import(tmp_path / "a.csv")
    sensors = dict(re.findall(r"^(\w+) = ([\d.e-]+)", (out / "instruments.toml").read_text(), re.MULTILINE))
    assert float(sensors["position_interval_s"]) == 1.0
    # of 1300 and 6500 readings: a robust deviation of third differences is known to about 4 and 2 per cent
    assert float(sensors["position_m"]) == pytest.approx(0.3, rel=0.15)
    assert float(sensors["heading_rad"]) == pytest.approx(math.radians(0.2), rel=0.08)
