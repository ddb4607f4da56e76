"""Each way in which a data file may be wrong gives one line: where, what was found, what would be right."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from expdesign.errors import FileError
from expdesign.records import load_records
from record_files import Columns, csv_text, motion, texts, write_trial

VESSEL = ("n1", "rudder1")
DEGREES = 180 / np.pi

Spoil = Callable[[Columns], str]


def cell(name: str, row: int, text: str) -> Spoil:
    """Another text in one cell; the header is row 1."""
    return cells({name: {row: text}})


def cells(changes: dict[str, dict[int, str]]) -> Spoil:
    def spoil(columns: Columns) -> str:
        for name, rows in changes.items():
            for row, text in rows.items():
                columns[name][row - 2] = text
        return csv_text(columns)

    return spoil


def column(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    """Other numbers in one column."""
    return columns_by({name: lambda data: change(data[name])})


def columns_by(changes: dict[str, Callable[[dict[str, np.ndarray]], np.ndarray]]) -> Spoil:
    def spoil(columns: Columns) -> str:
        data = {name: np.array(list(map(float, values))) for name, values in columns.items()}
        return csv_text(columns | texts({name: np.asarray(change(data)) for name, change in changes.items()}))

    return spoil


def named(names: dict[str, str | None]) -> Spoil:
    """Other names in the header; None leaves a column out."""

    def spoil(columns: Columns) -> str:
        return csv_text({new: values for name, values in columns.items() if (new := names.get(name, name)) is not None})

    return spoil


def text(change: Callable[[str], str]) -> Spoil:
    return lambda columns: change(csv_text(columns))


def line(row: int, change: Callable[[str], str]) -> Spoil:
    """Another text of one row."""

    def spoil(columns: Columns) -> str:
        lines = csv_text(columns).splitlines()
        lines[row - 1] = change(lines[row - 1])
        return "\n".join(lines)

    return spoil


CASES: dict[str, tuple[Spoil, str]] = {
    "empty": (text(lambda _: ""), "is empty, expected a header row and one row per sample"),
    "blank": (text(lambda _: "\n  \n"), "is empty, expected a header row and one row per sample"),
    "header only": (text(lambda t: t.partition("\n")[0]), "has a header but no data, expected one row per sample"),
    "one sample": (text(lambda t: "\n".join(t.splitlines()[:2])), "has one sample (row 2), expected two or more"),
    "semicolons": (lambda c: csv_text(c, ";"), "row 1: is separated by ';', expected commas (and decimal points)"),
    "semicolons and decimal commas": (
        lambda c: csv_text(c, ";").replace(".", ","),
        "row 1: is separated by ';', expected commas (and decimal points)",
    ),
    "tabs": (lambda c: csv_text(c, "\t"), "row 1: is separated by tabs, expected commas (and decimal points)"),
    "blanks": (lambda c: csv_text(c, " "), "row 1: is separated by blanks, expected commas"),
    "decimal commas": (
        text(lambda t: t.replace(".", ",")),
        "row 2: has 24 cells, expected 12 cells as in the header; 79 more rows differ too: decimal commas?",
    ),
    "quoted decimal comma": (
        cell("u_mps", 12, '"2,1"'),
        "u_mps: is '2,1' in row 12, expected a number with a decimal point",
    ),
    "comment first": (
        text(lambda t: "# sea trial\n" + t),
        "row 1: is a comment, expected the header with names such as time_s",
    ),
    "no header": (
        text(lambda t: t.partition("\n")[2]),
        "row 1: holds numbers, expected the header with names such as time_s",
    ),
    "units row": (
        line(2, lambda _: "s,m,m,rad,m/s,m/s,rad/s,1/s,rad,m/s,rad,m"),
        "time_s: is 's' in row 2, expected a number",
    ),
    "duplicate column": (
        line(1, lambda t: t.replace("east_m", "north_m")),
        "row 1: names north_m in columns 2 and 3, expected it once",
    ),
    "short row": (line(30, lambda t: t.rpartition(",")[0]), "row 30: has 11 cells, expected 12 cells as in the header"),
    "cut off row": (line(81, lambda t: t[:12]), "row 81: has 2 cells, expected 12 cells as in the header"),
    "blank row": (line(30, lambda _: ""), "row 30: is empty, expected 12 cells as in the header"),
    "long rows": (line(30, lambda t: t + ",1"), "row 30: has 13 cells, expected 12 cells as in the header"),
    "unclosed quote": (
        line(30, lambda t: '"' + t),
        "row 30: is not readable CSV (unexpected end of data), expected numbers between commas, without quotes",
    ),
    "text": (cell("u_mps", 12, "abc"), "u_mps: is 'abc' in row 12, expected a number"),
    "long text": (
        cell("u_mps", 12, "x" * 500),
        "u_mps: is 'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxx...' in row 12, expected a number",
    ),
    "error value": (cell("u_mps", 12, "#DIV/0!"), "u_mps: is '#DIV/0!' in row 12, expected a number"),
    "underscore": (cell("n1_rps", 12, "1_000"), "n1_rps: is '1_000' in row 12, expected a number"),
    "clock time": (
        cell("time_s", 2, "2026-11-21 09:00:00"),
        "time_s: is '2026-11-21 09:00:00' in row 2, expected seconds as one number",
    ),
    "nan inside": (
        cells({"v_mps": {12: "nan", 13: "NaN", 40: "nan"}}),
        "v_mps: is 'nan' in rows 12, 13, 40, expected a number in every row",
    ),
    "empty inside": (cell("heading_rad", 12, ""), "heading_rad: is empty in row 12, expected a number in every row"),
    "nan in optional": (
        cells({"depth_m": {12: "nan", 13: "nan", 14: "nan", 20: "nan"}}),
        "depth_m: is 'nan' in rows 12 to 14, 20, expected a number in every row",
    ),
    "every other row": (
        cells({"wind_speed_mps": dict.fromkeys(range(11, 71, 2), "")}),
        "wind_speed_mps: is empty in rows 11, 13, 15 and 27 more, expected a number in every row",
    ),
    "infinite": (
        cells({"r_radps": {12: "inf", 15: "-inf"}}),
        "r_radps: is infinite in rows 12, 15, expected finite numbers up to 1e+15",
    ),
    "huge": (cell("time_s", 12, "1e300"), "time_s: is 1e+300 in row 12, expected finite numbers up to 1e+15"),
    "no numbers": (
        cells({"u_mps": dict.fromkeys(range(2, 82), "")}),
        "u_mps: holds no number in any row, expected one in every row",
    ),
    "long tail": (
        cells({"u_mps": dict.fromkeys(range(30, 82), "nan")}),
        "u_mps: holds no number in rows 30 to 81, more than half of the file; expected one in every row",
    ),
    "repeated time": (
        cells({"time_s": {12: "4.5", 13: "4.5"}}),
        "time_s: stays at 4.5 in rows 12, 13, expected increasing times",
    ),
    "backward time": (
        cell("time_s", 12, "4.2"),
        "time_s: goes back from 4.5 to 4.2 in row 12, expected increasing times",
    ),
    "clock reset": (
        column("time_s", lambda t: t % 20.0),
        "time_s: goes back from 19.5 to 0 in row 42, expected increasing times: a clock that was "
        "reset needs a batch column that changes there",
    ),
    "milliseconds": (
        column("time_s", lambda t: 1000 * t),
        "time_s: has a sample every 500 s, expected every 0.5 s, as the vessel has it (is it in milliseconds?)",
    ),
    "too quick": (
        column("time_s", lambda t: t / 1e9),
        "time_s: has a sample every 5e-10 s, expected 0.0001 s or more",
    ),
    "irregular": (
        cells({"time_s": {12: "5.2", 13: "5.3"}}),
        "time_s: advances by 0.7 s in rows 12 to 14, expected even steps of 0.5 s within 25%",
    ),
    "gaps everywhere": (
        column("time_s", lambda t: t + 0.6 * np.floor(t)),
        "time_s: advances by 1.1 s in rows 4, 6, 8 and 36 more, expected even steps of 0.5 s within 25%",
    ),
    "broken batch number": (
        columns_by({"batch": lambda d: np.where(d["time_s"] < 10, 1, 1.5)}),
        "batch: is 1.5 in row 22 (and broken in rows 23 to 81), expected whole numbers",
    ),
    "batch comes back": (
        columns_by({"batch": lambda d: 1 + (np.abs(d["time_s"] - 20) < 5)}),
        "batch: is 1 again in row 52, expected the rows of a batch to follow each other",
    ),
    "batch per row": (
        columns_by({"batch": lambda d: np.arange(len(d["time_s"]))}),
        "batch: changes at every row, expected batches of two or more samples",
    ),
    "no time": (named({"time_s": None}), "row 1: names no time_s, expected it"),
    "unitless time": (named({"time_s": "time"}), "row 1: names time without a unit, expected time_s"),
    "mistyped time": (named({"time_s": "tme_s"}), "row 1: names no time_s, expected it (is tme_s a misspelling?)"),
    "no inputs": (
        named({"n1_rps": None, "rudder1_rad": None}),
        "row 1: names no n1_rps rudder1_rad, expected every input of the vessel; the file gives none",
    ),
    "other inputs": (
        named({"n1_rps": "tau_x", "rudder1_rad": "tau_psi"}),
        "row 1: names no n1_rps rudder1_rad, expected every input of the vessel; the file gives tau_x, tau_psi",
    ),
    "mistyped input": (
        named({"rudder1_rad": "ruder1_rad"}),
        "row 1: names no rudder1_rad, expected every input of the vessel; the file gives n1_rps (is "
        "ruder1_rad a misspelling?)",
    ),
    "unitless input": (named({"rudder1_rad": "rudder1"}), "row 1: names rudder1 without a unit, expected rudder1_rad"),
    "no velocity": (
        named({"u_mps": None, "heading_rad": None}),
        "row 1: gives no u: expected u_mps, or north_m and east_m (or lat_deg and lon_deg) with "
        "heading_rad (or heading_deg)",
    ),
    "no yaw rate": (
        named({"r_radps": None, "heading_rad": None}),
        "row 1: gives no r: expected r_radps, or heading_rad (or heading_deg)",
    ),
    "mistyped velocity": (
        named({"u_mps": "surge_u_mps", "north_m": None, "east_m": None}),
        "row 1: gives no u: expected u_mps, or north_m and east_m (or lat_deg and lon_deg) with "
        "heading_rad (or heading_deg) (is surge_u_mps a misspelling?)",
    ),
    "unitless heading": (
        named({"heading_rad": "heading"}),
        "row 1: names heading without a unit, expected heading_rad or heading_deg",
    ),
    "half a position": (named({"east_m": None}), "row 1: names north_m but no east_m, expected both"),
    "half a wind": (
        named({"wind_angle_rad": "wind_dir"}),
        "row 1: names wind_speed_mps but no wind_angle_rad, expected both (is wind_dir a misspelling?)",
    ),
    "latitude alone": (
        named({"north_m": None, "east_m": "lat_deg"}),
        "row 1: names lat_deg but no lon_deg, expected both",
    ),
    "two units": (
        named({"u_mps": "u_kmh", "v_mps": "u_knots"}),
        "row 1: gives u_mps twice, as u_kmh and u_knots, expected one of them",
    ),
    "heading in degrees": (
        column("heading_rad", lambda a: a * DEGREES + 200),
        "heading_rad: is 217.1887339 in row 2, expected radians; degrees belong under heading_deg",
    ),
    "heading in wrapped degrees": (
        column("heading_rad", lambda a: (a * DEGREES) % 360),
        "heading_rad: is 17.18873385 in row 2, expected radians; degrees belong under heading_deg",
    ),
    "heading in small degrees": (
        column("heading_rad", lambda a: (a - 0.2) * DEGREES),
        "r_radps: disagrees with the change of heading by 98%, but only by 0% if the heading is in "
        "degrees under a radian name; expected units, signs and axes as in the column names",
    ),
    "wind angle in degrees": (
        column("wind_angle_rad", lambda a: a * DEGREES),
        "wind_angle_rad: is 57.29577951 in row 2, expected radians; degrees belong under wind_angle_deg",
    ),
    "rudder in degrees": (
        column("rudder1_rad", lambda a: a * DEGREES),
        "rudder1_rad: is 1.712434858 in row 5 (and out of range in rows 6 to 62, 68 to 81), expected "
        "-1.57 to 1.57 rad; degrees belong under rudder1_deg",
    ),
    "yaw rate in degrees": (
        column("r_radps", lambda r: r * DEGREES),
        "r_radps: disagrees with the change of heading by 98%, but only by 0% if r_radps is in "
        "degrees per second, or the heading in radians under a degree name; expected units, signs "
        "and axes as in the column names",
    ),
    "knots": (
        columns_by({n: lambda d, n=n: d[n] / 0.5144 for n in ("u_mps", "v_mps")}),
        "u_mps: disagrees with the positions by 49%, but only by 0% if u_mps and v_mps are in knots; "
        "expected units, signs and axes as in the column names",
    ),
    "kilometres per hour": (
        columns_by({n: lambda d, n=n: d[n] * 3.6 for n in ("u_mps", "v_mps")}),
        "u_mps: disagrees with the positions by 72%, but only by 0% if u_mps and v_mps are in km/h; "
        "expected units, signs and axes as in the column names",
    ),
    "backwards": (
        columns_by({n: lambda d, n=n: -d[n] for n in ("u_mps", "v_mps")}),
        "u_mps: disagrees with the positions by 200%, but only by 0% if u_mps and v_mps have the "
        "wrong sign; expected units, signs and axes as in the column names",
    ),
    "yaw rate to port": (
        column("r_radps", lambda r: -r),
        "r_radps: disagrees with the change of heading by 200%, but only by 0% if r_radps is "
        "positive to port, or the heading counts counter-clockwise; expected units, signs and axes "
        "as in the column names",
    ),
    "exchanged axes": (
        columns_by({"north_m": lambda d: d["east_m"], "east_m": lambda d: d["north_m"]}),
        "u_mps: disagrees with the positions by 30%, but only by 0% if north_m and east_m are "
        "exchanged; expected units, signs and axes as in the column names",
    ),
    "west": (
        column("east_m", lambda e: -e),
        "u_mps: disagrees with the positions by 138%, but only by 0% if east_m is positive to west; "
        "expected units, signs and axes as in the column names",
    ),
    "east-north heading": (
        columns_by({"heading_rad": lambda d: np.pi / 2 - d["heading_rad"], "r_radps": lambda d: -d["r_radps"]}),
        "u_mps: disagrees with the positions by 31%, but only by 0% if the heading counts "
        "counter-clockwise from east; expected units, signs and axes as in the column names",
    ),
    "radians under degrees": (
        named({"heading_rad": "heading_deg"}),
        "r_radps: disagrees with the change of heading by 98%, but only by 0% if r_radps is in "
        "degrees per second, or the heading in radians under a degree name; expected units, signs "
        "and axes as in the column names",
    ),
    "impossible speed": (
        column("u_mps", lambda u: 100 * u),
        "u_mps: is 200 in row 2 (and out of range in rows 3 to 81), expected -60 to 60 m/s",
    ),
    "spike": (
        cell("u_mps", 40, "31.5"),
        "u_mps: jumps by 29.61 m/s in rows 40, 41, expected what a ship can do in 0.5 s",
    ),
    "heading jump": (
        column("heading_rad", lambda a: a + np.where(np.arange(len(a)) > 37, 2.0, 0.0)),
        "heading_rad: jumps by 1.991 rad in row 40, expected what a ship can do in 0.5 s",
    ),
    "yaw rate spike": (
        cell("r_radps", 40, "-2.5"),
        "r_radps: jumps by 2.483 rad/s in rows 40, 41, expected what a ship can do in 0.5 s",
    ),
    "negative wind speed": (
        cells({"wind_speed_mps": {12: "-1", 13: "-1.5"}}),
        "wind_speed_mps: is -1 in row 12 (and out of range in row 13), expected 0 to 120 m/s",
    ),
    "negative depth": (
        column("depth_m", lambda d: -d),
        "depth_m: is -20 in row 2 (and out of range in rows 3 to 81), expected more than 0, counted "
        "downwards, at most 12000 m",
    ),
    "sentinel": (
        cell("depth_m", 12, "-9999"),
        "depth_m: is -9999 in row 12, expected more than 0, counted downwards, at most 12000 m",
    ),
    "wind another way": (
        columns_by(
            {
                "wind_u_mps": lambda d: d["wind_speed_mps"] * np.cos(d["wind_angle_rad"]),
                "wind_v_mps": lambda d: -d["wind_speed_mps"] * np.sin(d["wind_angle_rad"]),
            }
        ),
        "wind_angle_rad: counts counter-clockwise, as wind_u_mps and wind_v_mps show; expected where "
        "it comes from, clockwise from the bow",
    ),
}


def spoiled(tmp_path: Path, content: str) -> Path:
    path = tmp_path / "trial.csv"
    path.write_text(content, encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", CASES)
def test_a_bad_file_gives_one_line(tmp_path: Path, kind: str) -> None:
    spoil, message = CASES[kind]
    path = spoiled(tmp_path, spoil(texts(motion())))
    with pytest.raises(FileError) as caught:
        load_records([path], vessel_inputs=VESSEL, sample_time_s=0.5)
    assert str(caught.value) == f"{path}: {message}"
    assert "\n" not in message


@pytest.mark.parametrize("speed_mps", [2.0, 0.0])
def test_noise_is_no_mistake(tmp_path: Path, speed_mps: float) -> None:
    """Of 60 short records straight ahead or at rest, with noise in heading, place and velocities, none is refused."""
    rng, noise = np.random.default_rng(0), {"heading_rad": 0.03, "r_radps": 0.02}
    if not speed_mps:
        noise |= {"north_m": 1.0, "east_m": 1.0, "u_mps": 0.4, "v_mps": 0.4}
    for number in range(60):
        columns = motion(count := int(rng.integers(22, 90)))
        straight = {"u_mps": speed_mps, "v_mps": 0.0, "north_m": speed_mps * columns["time_s"], "east_m": 0.0}
        columns |= {name: np.broadcast_to(value, count) for name, value in straight.items()}
        columns |= {name: straight.get(name, 0.0) + std * rng.standard_normal(count) for name, std in noise.items()}
        load_records([write_trial(tmp_path / f"{number}.csv", columns)], vessel_inputs=VESSEL, sample_time_s=0.5)
