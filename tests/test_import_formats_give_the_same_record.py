"""One simulated voyage, written as logs of every format by writers that are not ours, is imported as it was sailed."""

from __future__ import annotations

import importlib.util
import json
import math
import struct
from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import scipy
from pynmeagps import NMEAReader

from binary_logs import (
    write_ardupilot,
    write_excel,
    write_matlab,
    write_matlab73,
    write_parquet,
    write_ros,
    write_telemetry,
    write_ulog,
)
from expdesign.cli import main
from expdesign.errors import FileError
from expdesign.importing import channels, guess, read_log
from logged_trial import (
    RATE_RADPS,
    SHIP,
    START_S,
    Voyage,
    nmea,
    sentence,
    voyage,
    write_dialect,
    write_n2k,
    write_nmea,
    write_opencpn,
    write_own,
    write_signalk,
)

pytestmark = pytest.mark.usefixtures("undrawn")

KNOT, DEGREE = 1852 / 3600, math.pi / 180
EXTRA = {
    write_excel: "openpyxl", write_parquet: "pyarrow", write_matlab73: "h5py", write_ulog: "pyulog",
    write_ros: "rosbags", write_ardupilot: "pymavlink", write_telemetry: "pymavlink",
    write_n2k: "nmea2000",
}  # fmt: skip


@pytest.fixture(scope="module")
def trip() -> Voyage:
    return voyage()


def imported(path: Path, *options: str) -> tuple[dict[str, np.ndarray], dict[str, object]]:
    """Columns of all runs one after the other, with the time in UTC, and import.json."""
    out = path.parent / "out"
    assert main(["import", str(path), "--length-m", "50", "--out", str(out), "--quiet", *options]) == 0
    said = json.loads((out / "import.json").read_text())
    tables = []
    for run in said["runs"]:
        names = (out / run["file"]).read_text().partition("\n")[0].split(",")
        tables.append(dict(zip(names, np.loadtxt(out / run["file"], delimiter=",", skiprows=1).T, strict=True)))
    columns = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
    begins_s = said["begins_s"]
    if begins_s < 1e9:  # a clock of its own: a time of day, or seconds from the beginning
        begins_s += START_S - START_S % 86400 if begins_s > 3600 else START_S
    columns["time_s"] += begins_s
    return columns, said


def errors(columns: dict[str, np.ndarray], trip: Voyage) -> dict[str, float]:
    """Largest difference from the truth at the same times, by column."""
    truth = {
        "lat_deg": trip.lat_deg, "lon_deg": trip.lon_deg, "heading_rad": np.unwrap(trip.heading_rad),
        "u_mps": trip.u_mps, "v_mps": trip.v_mps, "r_radps": trip.r_radps, "n1_rps": trip.n_rps,
        "rudder1_rad": trip.order_rad, "reached_rudder1_rad": trip.rudder_rad, "reached_n1_rps": trip.n_rps,
        "tau_psi": trip.order_rad / math.radians(35),
    }  # fmt: skip
    found = {}
    for name in columns.keys() & truth.keys():
        error = columns[name] - np.interp(columns["time_s"], trip.time_s, truth[name])
        if name == "heading_rad":
            error = (error + np.pi) % (2 * np.pi) - np.pi
        found[name] = float(np.abs(error).max())
    return found


# rounding of what each writer writes, at most; a turn of 0.03 rad/s times the rounding of times adds to headings
FINE = {"lat_deg": 1e-8, "lon_deg": 1e-8, "heading_rad": 1.5e-6, "u_mps": 5e-5, "v_mps": 5e-5, "r_radps": 2e-8}
BOARD = {"lat_deg": 6e-8, "lon_deg": 6e-8, "heading_rad": 1e-4, "u_mps": 5e-4, "v_mps": 5e-4, "r_radps": 1e-7}
BUS = {"lat_deg": 6e-8, "lon_deg": 6e-8, "heading_rad": 7e-5, "u_mps": 6e-3, "v_mps": 6e-3, "r_radps": 1e-7}
TELEMETRY = {**BOARD, "u_mps": 8e-3, "v_mps": 8e-3}
CASES: dict[str, tuple[str, Callable[[Path, Voyage], Path], dict[str, float], set[str]]] = {
    "ours": ("a.csv", write_own, FINE, {"n1_rps", "rudder1_rad", "reached_rudder1_rad"}),
    **{
        f"dialect {stamps}{separator!r}": (
            "a.csv", partial(write_dialect, separator=separator, comma=comma, stamps=stamps), FINE,
            {"n1_rps", "rudder1_rad", "reached_rudder1_rad"},
        )
        for stamps, separator, comma in (
            ("iso", ";", True), ("split", "\t", False), ("s", ",", False), ("ms", ",", False), ("us", "|", False),
            ("ns", ";", False), ("day", "\t", True), ("hhmmss", ",", False),
        )
    },
    "nmea": ("a.nmea", write_nmea, FINE, {"n1_rps", "reached_rudder1_rad"}),
    "opencpn": ("a.csv", write_opencpn, FINE, {"n1_rps", "reached_rudder1_rad"}),
    **{
        f"nmea 2000 {form}": (
            f"a.{form}", partial(write_n2k, form=form), BUS, {"n1_rps", "rudder1_rad", "reached_rudder1_rad"}
        )
        for form in ("plain", "candump", "frames", "ascii", "json")
    },
    **{
        f"signal k{served * ' of a server'}": (
            "a.log", partial(write_signalk, served=served), FINE, {"n1_rps", "rudder1_rad", "reached_rudder1_rad"}
        )
        for served in (False, True)
    },
    "excel": ("a.xlsx", write_excel, FINE, {"n1_rps", "rudder1_rad", "reached_rudder1_rad"}),
    "parquet": ("a.parquet", write_parquet, FINE, {"n1_rps", "rudder1_rad", "reached_rudder1_rad"}),
    "matlab": ("a.mat", write_matlab, FINE, {"n1_rps", "rudder1_rad", "reached_rudder1_rad"}),
    "matlab 7.3": ("a.mat", write_matlab73, FINE, {"n1_rps", "rudder1_rad", "reached_rudder1_rad"}),
    "ardupilot": ("a.bin", write_ardupilot, BOARD, {"tau_psi"}),
    "telemetry": ("a.tlog", write_telemetry, TELEMETRY, {"tau_psi"}),
    "px4": ("a.ulg", write_ulog, {**FINE, "heading_rad": 2e-6}, {"tau_psi"}),
    "ros 1": ("a.bag", partial(write_ros, kind="ros1"), FINE, {"n1_rps", "rudder1_rad", "reached_rudder1_rad"}),
    "ros 2": ("a", partial(write_ros, kind="sqlite3"), FINE, {"n1_rps", "rudder1_rad", "reached_rudder1_rad"}),
    "mcap": ("a", partial(write_ros, kind="mcap"), FINE, {"n1_rps", "rudder1_rad", "reached_rudder1_rad"}),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_a_voyage_is_imported_as_it_was_sailed(case: str, tmp_path: Path, trip: Voyage) -> None:
    name, write, bounds, inputs = CASES[case]
    extra = EXTRA.get(getattr(write, "func", write))
    if extra and importlib.util.find_spec(extra) is None:
        pytest.skip(f"needs {extra}")
    every = 5 if "tau_psi" in inputs else 10  # rounded pulses at 1 Hz do not show where a zig-zag of 20 degrees turns
    columns, said = imported(write(tmp_path / name, trip.every(every)))
    found = errors(columns, trip)
    assert set(bounds) | inputs <= set(found)
    assert {key: found[key] for key in bounds if found[key] > bounds[key]} == {}
    # an order is 0 or +-35 degrees, +-20 degrees, or a tenth of a degree for the course; pulses are rounded to 1/500
    rounded = 6e-5 if case.startswith("nmea 2000") else 2e-6
    assert all(found[key] < (2e-3 if key == "tau_psi" else rounded) for key in inputs)
    assert [run["what"] for run in said["runs"]] == ["zig-zag 20/20 starboard", "turning circle 35 starboard"]


@pytest.mark.parametrize("case", CASES)
def test_a_log_beyond_the_limit_of_memory_is_refused_in_one_line(
    case: str, tmp_path: Path, trip: Voyage, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, write, _, _ = CASES[case]
    extra = EXTRA.get(getattr(write, "func", write))
    if extra and importlib.util.find_spec(extra) is None:
        pytest.skip(f"needs {extra}")
    path = write(tmp_path / name, trip.every(50))
    size = read_log(path).size
    with pytest.raises(FileError, match="makes more than 60 million readings and times, which is the most of all logs"):
        read_log(path, beside=channels.MOST_NUMBERS - size + 1)
    monkeypatch.setattr(channels, "MOST_NUMBERS", size // 4)
    with pytest.raises(FileError, match=r"holds more than .* million readings and times, which is the most at once"):
        read_log(path)


def test_a_line_without_end_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"time,lat,lon\n1,2,3\n" + b"4," * (1 << 24))
    with pytest.raises(FileError, match="has a line of more than 16 MB"):
        read_log(path)


def test_a_file_of_matlab_that_unpacks_without_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"a": {"b": np.zeros(200_000)}}, do_compression=True)
    assert path.stat().st_size < 5000
    monkeypatch.setattr(channels, "MOST_NUMBERS", 100_000)
    with pytest.raises(FileError, match=r"holds more than 0\.1 million"):
        read_log(path)


@pytest.mark.parametrize(
    "form",
    [
        "{0:%Y-%m-%dT%H:%M:%S.%f}+00:00        ",  # of a logger on the network
        "NAV {0:%Y/%m/%d %H:%M:%S.%f} GPS ",  # of research vessels, as the next three
        "{0:%m/%d/%Y},{0:%H:%M:%S.%f},",
        "cnav\t{0:%Y:%j:%H:%M:%S.%f}\t",
        "[{0:%d.%m.%Y %H:%M:%S.%f}] ",
        "s330 {0:%Y-%m-%d:%H:%M:%S.%f} ",
        "{0:%d-%b-%Y %H:%M:%S.%f} ",
        "{1:.3f} ",
        "{2:.0f};",
        "\\s:gps,c:{1:.0f}*55\\",
    ],
)
def test_times_of_reception_are_found_before_sentences(form: str, tmp_path: Path, trip: Voyage) -> None:
    part = trip.every(10)
    lines, each = nmea(part), 7
    later_s = 10 * 86400.0  # on the 19th, so that no date can be read with the month first and last
    stamps = [part.time_s[k // each] + later_s for k in range(len(lines))]
    heads = [form.format(datetime.fromtimestamp(t, UTC), t, t * 1e3) for t in stamps]
    kept = [head + line for head, line in zip(heads, lines, strict=True) if line[3:6] in ("HDT", "ROT")]
    (tmp_path / "a.log").write_text("\n".join(kept) + "\n")
    (heading,) = (channel for channel in read_log(tmp_path / "a.log").channels if channel.name == "HEHDT.headingT")
    assert np.abs(heading.time_s - part.time_s - later_s).max() < 1e-3


def test_columns_of_sentences_are_those_of_the_librarys_parser(tmp_path: Path, trip: Voyage) -> None:
    part = trip.every(100)
    lines = nmea(part, magnetic=-7.5)
    (tmp_path / "a.nmea").write_text("\n".join(lines) + "\n")
    log = read_log(tmp_path / "a.nmea")
    parsed = [NMEAReader.parse(line) for line in lines]
    fields = {"GPRMC.spd": "spd", "GPRMC.cog": "cog", "GPGGA.lat": "lat", "GPGGA.lon": "lon",
              "HCHDG.headingM": "headingM",
              "TIROT.rot": "rot", "IIRSA.stbdangle": "stbdangle"}  # fmt: skip
    own = {channel.name: channel.values for channel in log.channels}
    for name, field in fields.items():
        theirs = [getattr(one, field) for one in parsed if one.identity == name.partition(".")[0]]
        assert np.abs(own[name] - theirs).max() < 1e-9, name  # the library rounds to ten decimals
    assert np.all(own["HCHDG.variation"] == -7.5)


SENTENCES = {
    "IIRSA,-12.3,A,4.5,A": {"IIRSA.stbdangle": -12.3, "IIRSA.portangle": 4.5},
    "IIRSA,-12.3,V,4.5,A": {"IIRSA.portangle": 4.5},
    "IIRPM,S,1,-120.5,80,A": {"IIRPM.rpm shaft 1 starboard": -120.5},
    "IIRPM,E,2,1500,80,A": {"IIRPM.rpm engine 2 port": 1500.0},
    "IIROR,12.5,A,-3.0,A,B": {"IIROR.rudder order starboard": 12.5, "IIROR.rudder order port": -3.0},
    "IIROR,12.5,V,,V,B": {},
    "IIPRC,50.0,A,90.0,R,,V,B,1": {"IIPRC.rpm order engine 1 starboard": 90.0},
    "IIPRC,50.0,A,75.0,P,,V,B,0": {"IIPRC.rpm order engine 0": 75.0},
    "IITRC,1,120.0,R,,V,,B,A": {"IITRC.rpm order thruster 1 bow": 120.0},
    "IITRC,2,80.0,P,,V,345.5,B,A": {
        "IITRC.rpm order thruster 2 stern": 80.0, "IITRC.azimuth order thruster 2 stern": 345.5,
    },
    "IITRD,2,118,R,,V,344": {
        "IITRD.rpm actual thruster 2 stern": 118.0, "IITRD.azimuth actual thruster 2 stern": 344.0,
    },
    "PSXN,23,-2.82,1.00,235.18,-1.66": {"PSXN.roll": -2.82, "PSXN.heading": 235.18},
    "PSXN,20,1,0,0,0": {},
    "PASHR,120000.50,235.18,T,-2.82,+1.00,-1.66,0.1,0.1,0.2,1": {"PASHR.heading": 235.18, "PASHR.roll": -2.82},
    "TIROT,-45.7,A": {"TIROT.rot": -45.7},
    "TIROT,-45.7,V": {},
    "HEHDT,271.25,T": {"HEHDT.headingT": 271.25},
    "HETHS,271.25,A": {"HETHS.headt": 271.25},
    "HCHDG,98.3,2.0,E,12.6,W": {"HCHDG.headingM": 98.3, "HCHDG.variation": -12.6, "HCHDG.deviation": 2.0},
    "HCHDM,98.3,M": {"HCHDM.headingM": 98.3},
    "GPVTG,54.7,T,34.4,M,5.5,N,10.2,K,A": {"GPVTG.cogt": 54.7, "GPVTG.sogn": 5.5},
    "VDVBW,12.5,0.25,A,13.1,-0.5,A,,,,": {
        "VDVBW.longwaterspd": 12.5, "VDVBW.transwaterspd": 0.25, "VDVBW.longgroundspd": 13.1,
        "VDVBW.transgroundspd": -0.5,
    },
    "VWVHW,120.5,T,118.0,M,5.0,N,9.26,K": {"VWVHW.hdgT": 120.5, "VWVHW.hdgM": 118.0, "VWVHW.spdN": 5.0},
    "GNGNS,120000.00,3722.425671,S,12258.856215,W,DAAA,14,0.9,1005.543,6.5,,,S": {
        "GNGNS.lat": -(37 + 22.425671 / 60), "GNGNS.lon": -(122 + 58.856215 / 60),
    },
    "GPGLL,3722.425671,N,12258.856215,W,120000.00,V,N": {},
    "WIMWV,214.8,R,10.0,N,A": {"WIMWV.angle.R": 214.8, "WIMWV.speed.R": 10.0 * KNOT},
    "WIMWV,214.8,T,36.0,K,A": {"WIMWV.angle.T": 214.8, "WIMWV.speed.T": 10.0},
    "SDDPT,12.4,-0.8,100": {"SDDPT.depth": 12.4, "SDDPT.offset": -0.8},
    "SDDBT,40.7,f,12.4,M,6.8,F": {"SDDBT.depthm": 12.4},
    "YXXDR,A,-5.5,D,PITCH,A,3.25,D,ROLL": {"YXXDR.PITCH": -5.5, "YXXDR.ROLL": 3.25},
}  # fmt: skip


@pytest.mark.parametrize("body", SENTENCES)
def test_each_sentence_is_read_as_its_definition_says(body: str, tmp_path: Path) -> None:
    clock = ["GPZDA,120000.00,09,10,2025,00,00", "GPZDA,120001.00,09,10,2025,00,00"]
    (tmp_path / "a.log").write_text("\n".join(map(sentence, [clock[0], body, clock[1], body])) + "\n")
    log = read_log(tmp_path / "a.log")
    assert {channel.name: channel.values[0] for channel in log.channels} == pytest.approx(SENTENCES[body], abs=1e-9)
    assert all(abs(channel.time_s[0] - 1_760_011_200.0) < 1e-6 for channel in log.channels)
    assert log.clock == "satellite time"


@pytest.mark.parametrize("received", [False, True])
def test_reports_of_the_own_ships_ais_are_read(received: bool, tmp_path: Path, trip: Voyage) -> None:
    pyais = pytest.importorskip("pyais")
    part, lines = trip.every(20), []
    for k, time_s in enumerate(part.time_s.tolist()):
        own = {"msg_type": (1, 2, 3, 18)[k % 4], "mmsi": 219000001, "lat": part.lat_deg[k], "lon": part.lon_deg[k],
               "speed": part.speed_mps[k] / KNOT, "course": math.degrees(part.course_rad[k]),
               "heading": 511 if k % 10 == 9 else round(math.degrees(part.heading_rad[k])) % 360}  # fmt: skip
        (line,) = pyais.encode_dict(own, talker_id="AI", sentence_type="VDO")
        clock = f"{datetime.fromtimestamp(time_s, UTC):%H%M%S.%f,%d,%m,%Y}"
        lines += [f"{time_s:.1f} {line}"] if received else [sentence(f"GPZDA,{clock},00,00"), line]
    away = {"msg_type": 1, "mmsi": 230000002, "lat": 10.0, "lon": 10.0}
    others = pyais.encode_dict(away, talker_id="AI", sentence_type="VDM")
    spoilt = line[:24] + ("1" if line[24] == "0" else "0") + line[25:]  # its checksum is wrong now
    lines += [spoilt] * (not received)
    (tmp_path / "a.nmea").write_text("\n".join([*lines, *others * (not received)]) + "\n")
    table = {channel.name: channel for channel in read_log(tmp_path / "a.nmea").channels}
    # a report has ten-thousandths of minutes, tenths of knots and of degrees, and whole degrees of heading
    assert np.abs(table["AIVDO.lat"].values - part.lat_deg).max() < 1e-4 / 60
    assert np.abs(table["AIVDO.spd"].values - part.speed_mps / KNOT).max() < 0.1
    assert len(table["AIVDO.headt"]) == len(part.time_s) - len(part.time_s) // 10
    assert np.abs(table["AIVDO.lat"].time_s - part.time_s).max() < 1e-3
    uses = {use.channel: use.column for use in guess([read_log(tmp_path / "a.nmea")]).uses}
    assert uses == {"AIVDO.lat": "lat_deg", "AIVDO.lon": "lon_deg", "AIVDO.spd": "sog_mps", "AIVDO.cog": "cog_rad",
                    "AIVDO.headt": "heading_rad"}  # fmt: skip


def test_rows_of_structures_are_a_table_and_objects_of_matlab_are_told(tmp_path: Path, trip: Voyage) -> None:
    part = trip.every(50)
    rows = np.zeros(len(part.time_s), dtype=[("t", "O"), ("hdg", "O")])
    rows["t"], rows["hdg"] = part.time_s - START_S, np.degrees(part.heading_rad)
    scipy.io.savemat(tmp_path / "a.mat", {"log": rows})
    (heading,) = read_log(tmp_path / "a.mat").channels
    assert np.allclose(heading.values, np.degrees(part.heading_rad), atol=1e-12)
    assert np.allclose(heading.time_s, part.time_s - START_S)

    def element(kind: int, data: bytes) -> bytes:
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    places = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 2, 1)) + element(1, b"")
    inner = element(14, places + element(6, struct.pack("<II", 1, 2)))
    flags = element(6, struct.pack("<II", 17, 0))  # an opaque object, as MATLAB writes a table
    table = element(14, flags + element(1, b"T") + element(1, b"MCOS") + element(1, b"timetable") + inner)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x100) + b"IM"
    (tmp_path / "b.mat").write_bytes(head + table)
    with pytest.raises(FileError, match=r"T: is a table, a timetable .* expected vectors or a file of writetable"):
        read_log(tmp_path / "b.mat")
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "c.mat", "w") as file:
        own = [file.create_dataset(f"#refs#/{k}", data=[[value]]).ref for k, value in enumerate(rows["hdg"])]
        file.create_dataset("log/hdg", data=np.array([own], dtype=h5py.ref_dtype))
        file["log/t"] = np.array(rows["t"], dtype=float)
        file.create_dataset("T", data=np.zeros((1, 6), "u4")).attrs["MATLAB_object_decode"] = 3
    log = read_log(tmp_path / "c.mat")
    assert np.allclose(log.channels[0].values, np.degrees(part.heading_rad), atol=1e-12)
    assert log.unused == ("T (an object of MATLAB)",)


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("GPDTM,OHI,,0.0,N,0.0,E,0.0,W84", "positions are of the datum OHI by 2 sentences (DTM)"),
        ("GPGGA,120000.00,3722.4,N,12258.9,W,8,12,0.7,0.82,M,,M,,", "no satellite gave: simulated (GPGGA)"),
        ("GPGGA,120000.00,3722.4,N,12258.9,W,6,12,0.7,0.82,M,,M,,", "no satellite gave: estimated (GPGGA)"),
        ("GPRMC,120000.00,A,3722.4,N,12258.9,W,0.1,1.0,091025,,,M", "no satellite gave: put in by hand (GPRMC)"),
    ],
)
def test_doubts_that_sentences_state_are_told(body: str, told: str, tmp_path: Path) -> None:
    clock = ["GPZDA,120000.00,09,10,2025,00,00", "GPZDA,120001.00,09,10,2025,00,00"]
    (tmp_path / "a.log").write_text("\n".join(map(sentence, [clock[0], body, clock[1], body])) + "\n")
    assert told in "\n".join(read_log(tmp_path / "a.log").notes)


@pytest.mark.thorough
def test_order_and_feedback_give_the_slew_rate(tmp_path: Path, trip: Voyage) -> None:
    _, said = imported(write_own(tmp_path / "a.csv", trip))
    rate = said["actuators"]["rudder1"]["rate"]  # type: ignore[index]
    assert abs(rate["value"] - RATE_RADPS) < 0.002 * RATE_RADPS
    assert "angle_rate_radps = 0.05" in (tmp_path / "out" / "instruments.toml").read_text()


@pytest.mark.thorough
def test_the_folder_is_what_other_commands_take(
    tmp_path: Path, trip: Voyage, capsys: pytest.CaptureFixture[str]
) -> None:
    imported(write_dialect(tmp_path / "a.csv", trip.every(10)))
    (tmp_path / "ship.toml").write_text(SHIP)
    ship = ["--vessel", str(tmp_path / "ship.toml"), "--json", "--out"]
    assert main(["estimate", str(tmp_path / "out"), *ship, str(tmp_path / "e"), "--method", "ls", "--quiet"]) == 0
    found = json.loads((tmp_path / "e" / "estimate.json").read_text())
    assert main(["indices", str(tmp_path / "out"), *ship, str(tmp_path / "i"), "--quiet"]) == 0
    assert (
        main(["mine", str(tmp_path / "out"), *ship, str(tmp_path / "m"), "--keep", "1", "--mean", "none", "--quiet"])
        == 0
    )
    for name, truth in (("N_ud", 0.0005), ("N_ur", -0.02), ("Y_ur", -0.3)):  # of differences over a second
        assert found["ls"]["parameters"][name]["value"] == pytest.approx(truth, rel=0.02)
