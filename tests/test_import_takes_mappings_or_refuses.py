"""A mapping or a plan says otherwise than the guess; what cannot be read ends in one line."""

from __future__ import annotations

import os
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

from binary_logs import write_parquet, write_ulog
from expdesign.cli import main
from expdesign.importing import Run, Sampled, Stretch, cut_by_plan, file_name
from expdesign.signals import Commands
from imported_runs import columns_of, notes_of, run_import
from logged_trial import Voyage, logger_rows, voyage, write_dialect

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def trip() -> Voyage:
    return voyage(parts=(("steady", 60.0), ("zigzag", 200.0), ("steady", 150.0), ("circle", 250.0)))


def test_the_runs_of_a_plan_are_found_by_its_commands() -> None:
    rng = np.random.default_rng(2)
    plan = np.repeat(rng.uniform(-0.5, 0.5, 60), 10)
    commands = Commands(sample_time_s=1.0, names=("n1", "rudder1"), values=np.column_stack([np.full(600, 3.0), plan]))
    seen = np.concatenate([np.zeros(137), plan, np.zeros(80)]) + rng.normal(scale=0.02, size=817)
    stretch = Stretch(time_s=np.arange(817.0), columns={"rudder1_rad": seen, "u_mps": np.ones(817)})
    record = Sampled(stretches=(stretch,), sample_time_s=1.0, notes=(), held_s={}, channels={})
    legs = [("circle a", 0, 200), ("zig-zag b", 350, 600), ("stop", 610, 660)]
    runs, words = cut_by_plan(record, commands, legs[:2], length_m=10.0)
    assert [(run.name, run.stretch.time_s[0], len(run.stretch), run.approach_s) for run in runs] == [
        ("circle a", 107.0, 230, 30.0),  # with the approach of three ship lengths at 1 m/s
        ("zig-zag b", 457.0, 280, 30.0),
    ]
    (_, after), _ = cut_by_plan(record, commands, legs[1:], length_m=10.0)
    assert (after.stretch.time_s[0], after.approach_s) == (737.0, 10.0)  # what another run has is no approach
    assert "begins 137.0 s" in words
    other = Commands(sample_time_s=1.0, names=("rudder1",), values=np.repeat(rng.uniform(-0.5, 0.5, 60), 10)[:, None])
    runs, words = cut_by_plan(record, other, [("a", 0, 200)], length_m=10.0)
    assert not runs
    assert "not found" in words


def test_files_of_runs_to_port_and_to_starboard_are_not_named_alike() -> None:
    stretch = Stretch(time_s=np.arange(3.0), columns={})
    names = ("circle-helm--0.6", "circle-helm-0.6", "zig-zag b")
    runs = [Run(name=name, family="as planned", stretch=stretch, approach_s=0.0) for name in names]
    assert [file_name(1, run) for run in runs] == [
        "01-circle-helm-minus-0-6.csv", "01-circle-helm-0-6.csv", "01-zig-zag-b.csv"
    ]  # fmt: skip


@pytest.mark.thorough
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
    "name": ('name = "a.csv"', 'name = "b.csv"', "file[1].name: is 'b.csv', expected one of a.csv"),
    "no scale": ("scale = 1.0", "scale = 0.0", "channel[1].scale: is 0, expected another number"),
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


@pytest.mark.thorough
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


@pytest.mark.thorough
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


@pytest.mark.parametrize(("card", "held"), [("coaster-80m", "--fixed X_n1_astern"), ("", "logged-50m.toml")])
def test_the_estimate_that_is_suggested_runs(
    card: str, held: str, tmp_path: Path, trip: Voyage, monkeypatch: pytest.MonkeyPatch
) -> None:
    vessel = ROOT / "scenarios/vessels/logged-50m.toml"
    if card:  # no run goes astern, which her model has a parameter for
        main(["nominal", str(ROOT / f"scenarios/cards/{card}.toml"), "--out", str(tmp_path / "card"), "--quiet"])
        vessel = tmp_path / "card/vessel.toml"
    path = write_dialect(tmp_path / "a.csv", trip.every(10))
    _, _, out = run_import(path, options=("--vessel", str(vessel)))
    (command,) = re.findall(r"expdesign estimate [^<]*", (out / "import.html").read_text())
    assert command.strip().endswith(held)
    monkeypatch.chdir(tmp_path)
    assert main([*shlex.split(command)[1:], "--method", "ls", "--quiet"]) == 0


def test_no_estimate_is_suggested_where_there_is_none(tmp_path: Path) -> None:
    short = write_dialect(tmp_path / "a.csv", voyage(parts=(("zigzag", 24.0),)).every(20))
    vessel = ROOT / "scenarios/vessels/logged-50m.toml"
    _, said, out = run_import(short, options=("--vessel", str(vessel), "--sample-time", "2"))
    assert "no estimate can be had from these runs: the data have" in notes_of(said)
    assert "expdesign estimate" not in (out / "import.html").read_text()
