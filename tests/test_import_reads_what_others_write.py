"""Kinds of tables and sentences as loggers of others write them, each made here: they are read as they are meant."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from expdesign.importing import Log, guess, read_log
from logged_trial import Voyage, dm, sentence, voyage

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def trip() -> Voyage:
    return voyage(parts=(("steady", 30.0), ("zigzag", 100.0), ("circle", 150.0))).every(10)


Row = Callable[[Voyage, int, datetime], str]


def packed(value: float, width: int, side: str = "") -> str:
    """Degrees and minutes run together."""
    return f"{int(value):0{width}d}{60 * (value % 1):07.4f}{side}"


def coach(trip: Voyage, k: int, when: datetime) -> str:
    place = f"{packed(trip.lat_deg[k], 2, 'N')}\t{packed(trip.lon_deg[k], 3, 'E')}"
    knots, course, heading = trip.speed_mps[k] / KNOT, np.degrees(trip.course_rad[k]), np.degrees(trip.heading_rad[k])
    return f"{when:%d/%m/%y\t%H:%M:%S}\t{knots:.3f}\t{course:.2f}\t{heading:.2f}\tTrue\t{place}\t-"


def dated(trip: Voyage, k: int, when: datetime) -> str:
    knots, course, heading = trip.speed_mps[k] / KNOT, np.degrees(trip.course_rad[k]), np.degrees(trip.heading_rad[k])
    place = f"{trip.lat_deg[k]:.7f},{trip.lon_deg[k]:.7f}"
    return f"{when:%Y%m%d,%H%M%S}.00,UTC,{place},8.0,{knots:.3f},{course:.2f},{heading:.2f}"


def radians(trip: Voyage, k: int, when: datetime) -> str:
    place = f"{trip.lat_deg[k]:.7f},{trip.lon_deg[k]:.7f}"
    knots, course = trip.speed_mps[k] / KNOT, np.degrees(trip.course_rad[k])
    return f"{when:%Y-%m-%dT%H:%M:%S}Z,{place},{knots:.3f},{course:.2f},{trip.heading_rad[k]:.5f}"


def exponents(trip: Voyage, k: int, when: datetime) -> str:
    place = f"{trip.lat_deg[k]:.7f},{trip.lon_deg[k]:.7f}"
    course, heading = np.degrees(trip.course_rad[k]), np.degrees(trip.heading_rad[k])
    rate = np.degrees(trip.r_radps[k])
    moving = f"{trip.speed_mps[k] * 3.6:.3f},{course:.2f},{heading:.2f},{rate:.4f}"
    return f"AUS,{when:%Y-%m-%d %H:%M:%S}+00:00,{place},{moving}"


def regatta(trip: Voyage, k: int, when: datetime) -> str:
    knots, heading, course = trip.speed_mps[k] / KNOT, np.degrees(trip.heading_rad[k]), np.degrees(trip.course_rad[k])
    own = f"{packed(trip.lon_deg[k], 2)}\t{packed(trip.lat_deg[k], 2)}"
    return f"{20800 + k}\t5:00\t0.000000\t0.000000\t{own}\t{knots:.3f}\t{course:.2f}\t{heading:.2f}"


KNOT = 1852 / 3600
TABLES: dict[str, tuple[str, Row]] = {
    "settings before the table, years of two digits, degrees and minutes with a side": (
        "------ DAMPING ------\nBS:\t0.598\nHDG:\t0.598\n\n------ LOG ------\n"
        "Date\tTime\tSOG\tCOG\tHDG\tWindType\tLat\tLon\tSet",
        coach,
    ),
    "dates and times that are numbers": ("Logger\nDate,Time,TimeZone,LAT,LON,DPT,SOG,COG,HDG", dated),
    "a heading in radians beside a course in degrees": ("ISODateTimeUTC,Lat,Lon,SOG,COG,Heading", radians),
    "units with exponents": (
        "BOAT,DATETIME,LATITUDE_GPS_unk,LONGITUDE_GPS_unk,GPS_SOG_km_h_1,GPS_COG_deg,HEADING_deg,RATE_YAW_deg_s_1",
        exponents,
    ),
    "buoys beside the boat, and a count-down that stands still": (
        "SECOND\tCOUNTDOWN\tLON_BUOY_P\tLAT_BUOY_P\tLON_BOAT\tLAT_BOAT\tBOAT_SPEED\tCOG\tHEADING", regatta,
    ),
}  # fmt: skip


def columns(log: Log) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Column -> times and values in its unit, as guessed."""
    table = {channel.name: channel for channel in log.channels}
    used = {use.column: use.applied(table[use.channel]) for use in guess([log]).uses if use.column}
    return {name: (channel.time_s, channel.values) for name, channel in used.items()}


@pytest.mark.parametrize("case", TABLES)
def test_a_table_is_read_as_it_is_meant(case: str, tmp_path: Path, trip: Voyage) -> None:
    head, row = TABLES[case]
    rows = [row(trip, k, datetime.fromtimestamp(round(time_s), UTC)) for k, time_s in enumerate(trip.time_s.tolist())]
    (tmp_path / "a.txt").write_text("\n".join([head, *rows]) + "\n")
    found = columns(read_log(tmp_path / "a.txt"))
    times = found["lat_deg"][0]
    assert np.abs(np.diff(times) - 1.0).max() < 1e-6
    if times[0] > 1e8:
        assert abs(times[0] - trip.time_s[0]) < 1.0
    # of the last digits that are written
    for name, truth, bound in (
        ("lat_deg", trip.lat_deg, 1e-6), ("lon_deg", trip.lon_deg, 1e-6), ("sog_mps", trip.speed_mps, 1e-3),
    ):  # fmt: skip
        assert np.abs(found[name][1] - truth).max() < bound, name
    for name, angle in (("heading_rad", trip.heading_rad), ("cog_rad", trip.course_rad)):
        assert np.abs(np.angle(np.exp(1j * (found[name][1] - angle)))).max() < 2e-4, name
    if "RATE" in head:
        assert np.abs(found["r_radps"][1] - trip.r_radps).max() < 1e-5


def test_transducers_with_broken_readings_are_counted(tmp_path: Path, trip: Voyage) -> None:
    lines = []
    for k, time_s in enumerate(trip.time_s.tolist()):
        clock = f"{datetime.fromtimestamp(round(time_s), UTC):%H%M%S}.00"
        place = f"{dm(trip.lat_deg[k], 2)},N,{dm(trip.lon_deg[k], 3)},E"
        rudder = np.degrees(trip.rudder_rad[k])
        lines += [
            sentence(f"GPRMC,{clock},A,{place},5.0,10.0,091025,,,A"),
            "$SDVLW,$SDVLW,,N,322.0,N*59",
            sentence(f"IIXDR,A,-1.-3,D,TRIM,A,{rudder:.2f},D,RUDDER"),
        ]
    (tmp_path / "a.log").write_text("\n".join(lines) + "\n")
    log = read_log(tmp_path / "a.log")
    assert f"left out {len(trip.time_s)} readings of transducers (XDR) without a number" in log.notes
    (name,) = (name for name in columns(log) if "rudder" in name)
    assert np.abs(columns(log)[name][1] - trip.rudder_rad).max() < 1e-4
