"""Refused in one line: files that are no text, impossible positions, files that do not fit together, wrong requests."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from expdesign.errors import FileError, InputError, UnknownName
from expdesign.records import load_records
from record_files import SAMPLE_TIME_S, csv_text, motion, texts, write_trial

LAT, LON = 60.15, 24.95
METRES_PER_DEGREE = 111_412.0
Data = dict[str, np.ndarray]


def geographic(data: Data) -> Data:
    """The trial with latitudes and longitudes in place of metres."""
    lat = LAT + data["north_m"] / METRES_PER_DEGREE
    lon = LON + data["east_m"] / (METRES_PER_DEGREE * np.cos(np.radians(LAT)))
    rest = {name: values for name, values in data.items() if name not in ("north_m", "east_m")}
    return rest | {"lat_deg": lat, "lon_deg": lon}


def swap(data: Data) -> Data:
    return data | {"lat_deg": data["lon_deg"], "lon_deg": data["lat_deg"]}


def north_of(lat: float) -> Callable[[Data], Data]:
    return lambda data: data | {"lat_deg": data["lat_deg"] + lat - LAT, "lon_deg": data["lon_deg"] + 100}


def first_fix_lost(data: Data) -> Data:
    late = np.arange(len(data["lat_deg"])) > 2
    return data | {"lat_deg": data["lat_deg"] * late, "lon_deg": data["lon_deg"] * late}


def minutes(data: Data) -> Data:
    """Degrees and minutes run together, as receivers write them."""
    return data | {
        name: np.floor(data[name]) * 100 + 60 * (data[name] % 1) + 100 * shift
        for name, shift in (("lat_deg", 0), ("lon_deg", 0))
    }


POSITIONS: dict[str, tuple[Callable[[Data], Data], str]] = {
    "exchanged, in range": (
        swap,
        "u_mps: disagrees with the positions by 49%, but only by 0% if lat_deg and lon_deg are exchanged; "
        "expected units, signs and axes as in the column names",
    ),
    "exchanged, out of range": (
        lambda data: swap(north_of(LAT)(data)),
        "lat_deg: is 124.95 in row 2 (and out of range in rows 3 to 81), expected -90 to 90 degrees; "
        "are lat_deg and lon_deg exchanged?",
    ),
    "no fix": (first_fix_lost, "lat_deg: is 0 with lon_deg 0 in rows 2 to 4, expected a position fix"),
    "east of 180": (
        lambda data: data | {"lon_deg": data["lon_deg"] + 300},
        "lon_deg: is 324.95 in row 2 (and out of range in rows 3 to 81), expected -180 to 180 degrees",
    ),
    "minutes": (
        minutes,
        "lat_deg: is 6009 in row 2 (and out of range in rows 3 to 81), expected -90 to 90 degrees; "
        "degrees and minutes run together (ddmm.mm) must be split",
    ),
    "jump": (
        lambda data: data | {"lat_deg": data["lat_deg"] + 0.01 * (np.arange(len(data["lat_deg"])) == 38)},
        "lat_deg: position jumps by 1115 m in rows 40, 41, expected what a ship can do in 0.5 s",
    ),
}


@pytest.mark.parametrize("kind", POSITIONS)
def test_impossible_positions_give_one_line(tmp_path: Path, kind: str) -> None:
    spoil, message = POSITIONS[kind]
    path = write_trial(tmp_path / "trial.csv", spoil(geographic(motion())))
    with pytest.raises(FileError) as caught:
        load_records(path, velocity="difference" if kind == "jump" else "auto")
    assert str(caught.value) == f"{path}: {message}"


def test_a_jump_of_positions_that_nothing_is_derived_from_is_noted(tmp_path: Path) -> None:
    data = motion()
    data["north_m"][38] = 500.0
    record = load_records(write_trial(tmp_path / "trial.csv", data))
    assert "trial.csv: the position changes by up to 474 m at once in rows 40, 41" in record.notes
    with pytest.raises(FileError, match=r"north_m: position jumps by 473\.9 m in rows 40, 41, expected what a ship"):
        load_records(tmp_path / "trial.csv", velocity="smoothed")


CONTENTS: dict[str, tuple[bytes, str]] = {
    "latin": (b"time_s,u_mps\n0,1\xb0\n", "is not UTF-8 text (byte 0xb0 at offset 16)"),
    "utf-16": ("time_s,u_mps\n0,1\n".encode("utf-16"), "is not UTF-8 text (byte 0xff at offset 0)"),
    "spreadsheet": (b"PK\x03\x04rest", "is a spreadsheet or archive, expected CSV text"),
    "nul": (b"time_s,tau_x,u_mps,v_mps,r_radps\n0,1,1,0,0\x00\n", "r_radps: is '0\\x00' in row 2, expected a number"),
    "huge cell": (
        b'time_s,u_mps\n"' + b"1" * 200_000 + b'",1\n',
        "row 2: is not readable CSV (field larger than field limit (131072)), "
        "expected numbers between commas, without quotes",
    ),
}


@pytest.mark.parametrize("kind", CONTENTS)
def test_what_is_no_text_gives_one_line(tmp_path: Path, kind: str) -> None:
    content, message = CONTENTS[kind]
    path = tmp_path / "trial.csv"
    path.write_bytes(content)
    with pytest.raises(FileError) as caught:
        load_records(path)
    assert str(caught.value) == f"{path}: {message}"


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"nothing\.csv: does not exist, expected a CSV file$"):
        load_records(tmp_path / "nothing.csv")
    with pytest.raises(FileError, match=r"is a directory, expected a CSV file$"):
        load_records(tmp_path)


SECONDS: dict[str, tuple[Callable[[Data], Data], str]] = {
    "sample time": (
        lambda data: data | {"time_s": 2 * data["time_s"]},
        "time_s: has a sample every 1 s, expected every 0.5 s, as the first file (first.csv) has it; "
        "expdesign import --sample-time 0.5 resamples it",
    ),
    "inputs": (
        lambda data: {name: values for name, values in data.items() if name != "n1_rps"},
        "row 1: names no n1_rps, expected every input of the first file (first.csv); the file gives rudder1_rad",
    ),
}


@pytest.mark.parametrize("kind", SECONDS)
def test_files_must_fit_together(tmp_path: Path, kind: str) -> None:
    spoil, message = SECONDS[kind]
    first = write_trial(tmp_path / "first.csv", motion())
    second = write_trial(tmp_path / "second.csv", spoil(motion()))
    with pytest.raises(FileError) as caught:
        load_records([first, second])
    assert str(caught.value) == f"{second}: {message}"


CLOCKS = [
    (1000.0, "has a sample every 500 s, expected at most 20 s (is it in milliseconds?)"),
    (1 / 60, "has a sample every 0.00833333 s, expected every 0.5 s, as the vessel has it (is it in minutes?)"),
    (
        3.0,
        "has a sample every 1.5 s, expected every 0.5 s, as the vessel has it; expdesign import --sample-time 0.5 "
        "resamples it",
    ),
]


@pytest.mark.parametrize(("factor", "message"), CLOCKS)
def test_another_unit_of_time_is_named(tmp_path: Path, factor: float, message: str) -> None:
    data = motion()
    path = write_trial(tmp_path / "trial.csv", data | {"time_s": factor * data["time_s"]})
    with pytest.raises(FileError) as caught:
        load_records(path, sample_time_s=SAMPLE_TIME_S if "vessel" in message else None)
    assert str(caught.value) == f"{path}: time_s: {message}"


def test_milliseconds_show_in_the_turning_when_the_sample_time_is_possible(tmp_path: Path) -> None:
    path = write_trial(tmp_path / "trial.csv", _fast(motion()))
    with pytest.raises(FileError) as caught:
        load_records(path)
    found = "r_radps: disagrees with the change of heading by 100%, but only by 2% if time_s is in milliseconds"
    assert str(caught.value) == f"{path}: {found}; expected units, signs and axes as in the column names"


@pytest.mark.parametrize(("unit", "factor"), [("minutes", 1 / 60), ("hours", 1 / 3600)])
@pytest.mark.parametrize("outputs", [("u_mps", "v_mps", "r_radps"), ("u_mps", "v_mps"), ("r_radps",), ()])
@pytest.mark.parametrize("where", [geographic, dict])
def test_longer_units_of_time_show_in_the_motion_whatever_is_measured(
    tmp_path: Path, where: Callable[[Data], Data], outputs: tuple[str, ...], unit: str, factor: float
) -> None:
    data = motion()
    velocities = {"u_mps", "v_mps", "r_radps"}
    kept = {name: values for name, values in data.items() if name not in velocities or name in outputs}
    path = write_trial(tmp_path / "trial.csv", where(kept | {"time_s": factor * data["time_s"]}))
    with pytest.raises(FileError) as caught:
        load_records(path)
    named = f"if time_s is in {unit}; expected units" in str(caught.value)
    assert named or ("at most 60 m/s; are time_s and" in str(caught.value) and "r_radps" not in outputs)
    assert named == bool(outputs)


@pytest.mark.parametrize("factor", [100.0, 1000.0])
def test_positions_in_smaller_units_move_too_fast_for_a_ship(tmp_path: Path, factor: float) -> None:
    data = {name: values for name, values in motion().items() if name not in ("u_mps", "v_mps", "r_radps")}
    shorter = {name: factor * data[name] for name in ("north_m", "east_m")}
    path = write_trial(tmp_path / "trial.csv", data | shorter)
    with pytest.raises(FileError, match=r"jumps|the position moves at .* m/s over ground, expected at most 60 m/s"):
        load_records(path)


def test_an_unknown_factor_is_noted(tmp_path: Path) -> None:
    data = motion()
    path = write_trial(tmp_path / "trial.csv", data | {"r_radps": 2 * data["r_radps"]})
    assert load_records(path).notes == ("trial.csv: heading and r_radps disagree by 50% over 10 s",)


def test_a_heading_that_is_off_by_a_constant_is_noted(tmp_path: Path) -> None:
    data = motion()
    path = write_trial(tmp_path / "trial.csv", data | {"heading_rad": data["heading_rad"] + np.radians(40)})
    found = "trial.csv: positions and measured velocities disagree by 68% over 10 s, only by 0% with -40 degrees added"
    assert load_records(path).notes == (f"{found} to the heading",)


def _fast(data: Data) -> Data:
    """The trial sampled at 100 Hz, in milliseconds."""
    time = np.arange(0, 30, 0.01)
    dense = {name: np.interp(time, data["time_s"], values) for name, values in data.items()}
    return dense | {"time_s": 1000 * time}


METHODS = [
    ("measured", ("u_mps",), "row 1: names no u_mps, expected it"),
    (
        "difference",
        ("north_m", "east_m"),
        "row 1: gives no u: expected north_m and east_m (or lat_deg and lon_deg) with heading_rad (or heading_deg)",
    ),
    ("smoothed", ("heading_rad",), "row 1: gives no u: expected north_m and east_m (or lat_deg and lon_deg) with "),
]


@pytest.mark.parametrize(("method", "without", "message"), METHODS)
def test_a_method_that_lacks_its_columns_says_which(
    tmp_path: Path, method: str, without: tuple[str, ...], message: str
) -> None:
    path = write_trial(tmp_path / "trial.csv", {n: v for n, v in motion().items() if n not in without})
    with pytest.raises(FileError) as caught:
        load_records(path, velocity=method)
    assert str(caught.value).startswith(f"{path}: {message}")


def test_batches_too_short_to_difference_are_refused_when_none_is_left(tmp_path: Path) -> None:
    data = {name: values[:9] for name, values in motion().items()}
    data["batch"] = np.arange(9) // 3
    path = write_trial(tmp_path / "trial.csv", data)
    with pytest.raises(FileError, match="leaves no batch long enough to derive velocities in, expected 4 samples"):
        load_records(path, velocity="difference")


def test_azimuth_angles_in_degrees_are_refused(tmp_path: Path) -> None:
    data = motion()
    path = write_trial(tmp_path / "trial.csv", data | {"a1_rad": 30 + data["time_s"]})
    with pytest.raises(FileError) as caught:
        load_records(path)
    assert str(caught.value) == f"{path}: a1_rad: is 30 in row 2, expected radians; degrees belong under a1_deg"


def test_wrong_requests_are_refused(tmp_path: Path) -> None:
    path = write_trial(tmp_path / "trial.csv", motion())
    with pytest.raises(InputError, match="no data files are given"):
        load_records([])
    with pytest.raises(InputError, match="is given twice"):
        load_records([path, str(path)])
    with pytest.raises(UnknownName, match="unknown velocity method 'smooth', did you mean 'smoothed'"):
        load_records(path, velocity="smooth")
    with pytest.raises(UnknownName, match="unknown output 'p'"):
        load_records(path, outputs=("p",))
    with pytest.raises(InputError, match="heading_std_rad is -1"):
        load_records(path, heading_std_rad=-1.0)
    with pytest.raises(InputError, match="sample_time_s is 0"):
        load_records(path, sample_time_s=0.0)


def test_a_tail_may_not_be_most_of_the_file(tmp_path: Path) -> None:
    columns = texts(motion())
    columns["depth_m"][40:] = ["nan"] * 40
    path = tmp_path / "trial.csv"
    path.write_text(csv_text(columns), encoding="utf-8")
    assert len(load_records(path).batches[0]) == 40
    columns["depth_m"][39] = "nan"
    path.write_text(csv_text(columns), encoding="utf-8")
    with pytest.raises(FileError, match="depth_m: holds no number in rows 41 to 81, more than half of the file"):
        load_records(path)
