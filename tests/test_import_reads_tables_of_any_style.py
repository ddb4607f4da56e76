"""A table that a logger writes its own way is read as it is meant: clocks, places, angles, words, headers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.errors import FileError
from expdesign.importing import NONE, Channel, Log, guess, read_log
from foreign_tables import CLOCKS, NAMES, STYLES, Style, when
from logged_trial import Voyage, voyage


@pytest.fixture(scope="module")
def trip() -> Voyage:
    return voyage(parts=(("steady", 30.0), ("zigzag", 60.0))).every(10)


def read_log_of(style: Style, trip: Voyage, folder: Path) -> Log:
    """The log of a file of a style."""
    (folder / "a.csv").write_bytes(style.text(trip).encode(style.encoding))
    return read_log(folder / "a.csv")


def used(log: Log) -> dict[str, Channel]:
    """Column -> channel in its unit, as guessed."""
    table = {channel.name: channel for channel in log.channels}
    return {use.column: use.applied(table[use.channel]) for use in guess([log]).uses if use.column}


@pytest.mark.parametrize("style", STYLES)
def test_a_table_of_any_style_is_read_as_it_is_meant(style: str, tmp_path: Path, trip: Voyage) -> None:
    own = STYLES[style]
    log = read_log_of(own, trip, tmp_path)
    found = used(log)
    assert log.clock != NONE
    sense = -1.0 if own.south else 1.0
    # of the digits that are written, tenths of a degree at most
    truths = {
        "lat_deg": (sense * trip.lat_deg, 1e-6), "lon_deg": (sense * trip.lon_deg, 1e-6),
        "sog_mps": (trip.speed_mps, 1e-4), "r_radps": (trip.r_radps, 1e-6), "n1_rps": (trip.n_rps, 1e-4),
        "rudder1_rad": (trip.order_rad, 1e-5), "reached_rudder1_rad": (trip.rudder_rad, 1e-5),
        "heading_rad": (trip.heading_rad, 1e-3), "cog_rad": (trip.course_rad, 1e-3),
    }  # fmt: skip
    if own.largest != 35.0:  # which nothing in the file tells
        for name in ("rudder1_rad", "reached_rudder1_rad"):
            found[name] = replace(found[name], values=found[name].values * own.largest / 35.0)
    found.setdefault("n1_rps", found.get("reached_n1_rps", found["lat_deg"]))
    assert set(truths) <= set(found), {use.channel: (use.column, use.why) for use in guess([log]).uses}
    for name, (truth, bound) in truths.items():
        off = found[name].values - truth
        off = np.angle(np.exp(1j * off)) if name in ("heading_rad", "cog_rad") else off
        assert np.abs(off).max() < bound, name
        times = found[name].time_s - (
            trip.time_s if own.dated else trip.time_s - trip.time_s[0] + found[name].time_s[0]
        )
        assert np.abs(times).max() < 0.06, (name, log.notes)  # of days in nine digits
    assert style not in CLOCKS or own.dated == (found["lat_deg"].time_s[0] > 1e9)


# Column, and readings that stand for none: of AIS (ITU-R M.1371), of loggers, of integers.
FILLS = {
    "hdg": (511.0, 999.9, -9999.0, 65535.0, 655.35), "cog": (511.0, 999.0), "sog": (102.3, 999.99, -999.0, 65535.0),
    "rot": (-128.0, 32767.0, 99999.0), "rudder": (-999.0, 327.67, 99.9), "lat": (91.0, 2147483647.0, 99999.0),
    "lon": (181.0, -214.7483647, 9999.0), "rpm": (65535.0, -9999.0),
}  # fmt: skip


@pytest.mark.parametrize("column", FILLS)
def test_readings_that_stand_for_none_are_left_out_and_told(column: str, tmp_path: Path, trip: Voyage) -> None:
    plain = Style().cells.get(column, "{:.4f}".format)
    clean = read_log_of(Style(), trip, tmp_path)
    for fill in FILLS[column]:
        cells = iter([True, True, False] * len(trip.time_s))  # one of three rows
        style = Style(cells={column: lambda x, fill=fill, cells=cells: plain(x) if next(cells) else f"{fill:.10g}"})
        log = read_log_of(style, trip, tmp_path)
        assert (
            f"{NAMES[column]}: {len(trip.time_s) // 3} readings of {fill:.10g} left out, which says none" in log.notes
        )
        found, truth = used(log), used(clean)
        name = next(name for name, channel in truth.items() if len(channel) != len(found[name]))
        assert np.abs(found[name].values - truth[name].values[np.arange(len(truth[name])) % 3 < 2]).max() < 1e-4
        assert {use.column: use.unit for use in guess([log]).uses} == {
            use.column: use.unit for use in guess([clean]).uses
        }


def test_positions_at_0_0_are_left_out_and_told(tmp_path: Path, trip: Voyage) -> None:
    first = trip.time_s[5]
    lines = Style().text(trip).splitlines()
    spoilt = [",".join([line.split(",")[0], "0.0", "0.0", *line.split(",")[3:]]) for line in lines[1:6]]
    (tmp_path / "a.csv").write_text("\n".join([lines[0], *spoilt, *lines[6:]]) + "\n")
    log = read_log(tmp_path / "a.csv")
    assert "Latitude: 5 positions at 0, 0 left out" in log.notes
    assert used(log)["lat_deg"].time_s[0] == pytest.approx(first, abs=0.01)
    assert np.abs(used(log)["lat_deg"].values - trip.lat_deg[5:]).max() < 1e-6


def test_rows_of_several_vessels_are_refused(tmp_path: Path, trip: Voyage) -> None:
    names = iter([f"{219000000 + k % 3}" for k in range(len(trip.time_s))])
    style = Style(
        names={"time": "MMSI|BaseDateTime"}, cells={"time": lambda t: f"{next(names)}|{when(t):%Y-%m-%dT%H:%M:%S}"}
    )
    with pytest.raises(
        FileError, match=r"MMSI: names 3 vessels \(219000000, 219000001, 219000002, \.\.\.\), expected the"
    ):
        read_log_of(style, trip, tmp_path)


def test_places_that_are_named_the_wrong_way_round_are_told(tmp_path: Path, trip: Voyage) -> None:
    east = {"lat": lambda x: f"{x:.8f}", "lon": lambda x: f"{x + 100:.8f}"}
    log = read_log_of(Style(names={"lat": "Longitude", "lon": "Latitude"}, cells=east), trip, tmp_path)
    uses = {use.channel: use for use in guess([log]).uses}
    assert uses["Latitude"].column == ""
    assert "is it the longitude" in uses["Latitude"].why
