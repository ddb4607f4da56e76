"""Signs, units, averages across north, gaps and broken lines: what a log hides is undone where certain, and told."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.importing import guess, read_log
from expdesign.scenario import load_vessel
from imported_runs import columns_of, notes_of, run_import, wrapped
from logged_trial import (
    START_S,
    Voyage,
    logger_rows,
    nmea,
    sentence,
    voyage,
    write_dialect,
    write_nmea,
    write_own,
)

pytestmark = pytest.mark.usefixtures("undrawn")
ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def trip() -> Voyage:
    return voyage(parts=(("steady", 60.0), ("zigzag", 200.0), ("steady", 150.0), ("circle", 250.0)))


@pytest.mark.thorough
def test_a_rudder_that_turns_the_ship_the_wrong_way_is_told(tmp_path: Path, trip: Voyage) -> None:
    other = replace(trip, order_rad=-trip.order_rad, rudder_rad=-trip.rudder_rad).every(5)
    for name, case, told in (("right", trip.every(5), False), ("wrong", other, True)):
        (tmp_path / name).mkdir()
        status, said, _ = run_import(write_own(tmp_path / name / "a.csv", case))
        assert status == 0
        assert ("turns against the rudder" in notes_of(said)) == told


@pytest.mark.thorough
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
    units = {use.column: use.unit for use in guess([read_log(tmp_path / "a.csv")]).uses}
    assert units["r_radps"] == {"deg/s": "degps", "deg/min": "degpmin", "rad/s": "radps"}[unit]
    assert units["sog_mps"] == {"kn": "kn", "m/s": "mps", "km/h": "kmph"}[speed]


def test_a_magnetic_heading_is_made_true_by_the_logs_variation(tmp_path: Path, trip: Voyage) -> None:
    _, said, out = run_import(write_nmea(tmp_path / "a.nmea", trip.every(5), magnetic=-7.5))
    assert "magnetic; the variation added is -7.5 degrees" in notes_of(said)
    table = columns_of(said, out)
    off = wrapped(table["heading_rad"] - np.interp(table["time_s"], trip.time_s, np.unwrap(trip.heading_rad)))
    assert np.abs(off).max() < 2e-6


@pytest.mark.thorough
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


@pytest.mark.thorough
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
    gone = {k for k in range(2, len(lines)) if 950 < k < 1030}  # in the circle
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
    assert re.search(r"lat_deg.* are read every 5 s", notes_of(said))
    assert "position_interval_s = 5.0" in (out / "instruments.toml").read_text()
    assert said["sample_time_s"] == 1.0


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


@pytest.mark.parametrize("quoted", [False, True])
@pytest.mark.parametrize("form", [".1f", ".4f", ".0f"])
def test_a_table_that_is_cut_anywhere_in_its_last_line_gives_no_wrong_reading(
    form: str, quoted: bool, tmp_path: Path
) -> None:
    rows = [[f"{k:{form}}", f"{54 + k / 1e4:.6f}", "18.500000", f"{5 * (k % 9):{form}}"] for k in range(95, 125)]
    lines = [
        ",".join(f'"{cell}"' if quoted else cell for cell in row) for row in (["time", "lat", "lon", "hdg"], *rows)
    ]
    whole = "\n".join(lines) + "\n"
    for end in range(len(whole) - len(lines[-1]), len(whole) + 1):
        (tmp_path / "a.csv").write_text(whole[:end])
        log = read_log(tmp_path / "a.csv")
        table = {channel.name: channel.values for channel in log.channels}
        rest = whole[len(whole) - len(lines[-1]) - 1 : end].strip()
        count = len(table["hdg"])
        assert np.allclose(table["hdg"], [5 * (k % 9) for k in range(95, 125)][:count], atol=0)
        assert np.allclose(table["lat"], [54 + k / 1e4 for k in range(95, 125)][:count], atol=1e-9)
        assert count == 30 or not rest or any("left out" in note for note in log.notes)
    assert count == 30


def test_sentences_that_are_cut_anywhere_give_no_wrong_reading(tmp_path: Path) -> None:
    lines = [
        sentence(body)
        for k in range(20)
        for body in (f"GPZDA,1200{k:02d}.00,09,10,2025,00,00", f"HEHDT,{100 + k}.25,T")
    ]
    whole = "\n".join(lines) + "\n"
    for end in range(len(whole) - len(lines[-1]) - 1, len(whole)):
        (tmp_path / "a.nmea").write_text(whole[:end])
        log = read_log(tmp_path / "a.nmea")
        (heading,) = log.channels
        assert np.array_equal(heading.values, 100.25 + np.arange(len(heading)))
        assert len(heading) in (19, 20)


SPEEDS = {
    "positions alone": (),
    "speed and course": ("SOG [m/s]", "COG [deg]"),
    "surge": ("surge speed [m/s]",),
    "surge and sway": ("surge speed [m/s]", "sway speed [m/s]"),
}


@pytest.mark.parametrize("kind", SPEEDS)
@pytest.mark.parametrize("from_east", [True, False])
def test_headings_that_count_the_other_way_are_refused_with_what_turns_them_over(
    kind: str, from_east: bool, tmp_path: Path, trip: Voyage, capsys: pytest.CaptureFixture[str]
) -> None:
    own = trip.every(5)
    heading = (math.pi / 2 if from_east else 0.0) - own.heading_rad
    table = {
        "time": own.time_s, "Lat": own.lat_deg, "Lon": own.lon_deg, "yaw [deg]": np.degrees(wrapped(heading)),
        "yaw rate [rad/s]": -own.r_radps, "rpm": own.n_rps * 60, "rudder order [deg]": np.degrees(own.order_rad),
        **{name: {"SOG [m/s]": own.speed_mps, "COG [deg]": np.degrees(own.course_rad) % 360,
                  "surge speed [m/s]": own.u_mps, "sway speed [m/s]": own.v_mps}[name] for name in SPEEDS[kind]},
    }  # fmt: skip
    path = tmp_path / "a.csv"
    np.savetxt(
        path, np.stack(list(table.values()), axis=1), delimiter=",", header=",".join(table), comments="", fmt="%.9f"
    )
    status, _, out = run_import(path)
    said = capsys.readouterr().err
    assert status == 3
    assert ("scale = -1.0 and offset = 1.5708 of the heading" in said) == from_east
    assert "scale = -1.0 of its rate, turn it over" in said
    mapping = (out / "mapping.toml").read_text()
    blocks = mapping.split("[[channel]]")
    for k, block in enumerate(blocks):
        if '"heading_rad"' in block:
            blocks[k] = (
                re.sub(r"scale = .*\n|offset = .*\n", "", block) + "scale = -1.0\n" + "offset = 1.5708\n" * from_east
            )
        elif '"r_radps"' in block:
            blocks[k] = re.sub(r"scale = .*\n", "", block) + "scale = -1.0\n"
    (tmp_path / "turned.toml").write_text("[[channel]]".join(blocks))
    status, said_json, out = run_import(path, options=("--map", str(tmp_path / "turned.toml")))
    assert status == 0, capsys.readouterr().err
    found = columns_of(said_json, out)
    assert np.abs(wrapped(found["heading_rad"] - np.interp(found["time_s"], own.time_s, own.heading_rad))).max() < 1e-3


def test_one_rudder_and_one_lever_of_a_log_are_those_of_all_of_the_vessel(tmp_path: Path, trip: Voyage) -> None:
    single = load_vessel(ROOT / "scenarios/vessels/logged-50m.toml").actuators
    twin = (*single, *(replace(one, number=2) for one in single))
    log = read_log(write_dialect(tmp_path / "a.csv", trip.every(10)))
    alone, both = (
        {use.column: use for use in guess([log], actuators).uses if use.column} for actuators in (single, twin)
    )
    inputs = {name for name in alone if "rudder" in name or name.endswith("_rps")}
    assert inputs
    assert set(both) == set(alone) | {name.replace("1_", "2_") for name in inputs}
    for name in inputs:
        second = both[name.replace("1_", "2_")]
        assert second.channel == both[name].channel
        assert "of all 2, as the log has one" in second.why
    sided = replace(log, channels=tuple(
        replace(one, name=f"{one.name} port") if "rudder" in one.name.lower() else one for one in log.channels
    ))  # fmt: skip
    assert not any(use.column.endswith("rudder2_rad") for use in guess([sided], twin).uses)
