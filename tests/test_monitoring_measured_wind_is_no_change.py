"""A wind that is measured on board is no change of the ship, however it rises; without a vane that stays open."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.monitoring.changes import AIR_TERMS
from expdesign.records import pieces
from expdesign.vessel.structures import NUMPY, parse_expression
from sea_case import CASES, FRESH, HOUR, VANE, WINDS, Sea, Ship, sailed, vessel_file, written

MEASURED = Sea(wind=replace(FRESH, measured=True))


def monitored(folder: Path, voyage: Path, reference: Path) -> tuple[int, str]:
    """Exit status and verdict of the command on files."""
    words = [str(voyage), "--reference", str(reference), "--vessel", str(folder / "vessel.toml"), "--out", str(folder)]
    status = main(["monitor", *words, "--quiet"])
    told = json.loads((folder / "monitor.json").read_text()) if status == 0 else {"verdict": []}
    return status, " ".join(told["verdict"])


def without(path: Path, columns: Callable[[list[str]], list[str]]) -> Path:
    """A copy of a file with every row's cells changed."""
    rows = [",".join(columns(line.split(","))) for line in path.read_text().splitlines()]
    copy = path.with_name(f"{path.stem}-other.csv")
    copy.write_text("\n".join(rows) + "\n")
    return copy


@pytest.mark.parametrize("lever", [-0.1, 0.0, 0.1])
def test_air_drag_of_usual_laws_is_learnt_within_a_tenth(lever: float) -> None:
    """By the wind's angle: cosine, sine, and a side force whose arm moves with it (Blendermann 1994)."""
    angle = np.linspace(-np.pi, np.pi, 721)
    u, v = np.cos(angle), np.sin(angle)
    laws = {"u": u, "v": v, "r": v * (lever - 0.18 * (np.abs(angle) - np.pi / 2))}
    for equation, law in laws.items():
        terms = [
            parse_expression(one.expression, signals=("u_q", "v_q")) for one in AIR_TERMS if one.equation == equation
        ]
        table = np.stack([one.evaluate({"u_q": u, "v_q": v}, NUMPY) for one in terms], axis=-1)
        left = law - table @ np.linalg.lstsq(table, law, rcond=None)[0]
        assert np.abs(left).max() < 0.11 * np.abs(law).max()


@pytest.mark.thorough
def test_a_wind_that_rises_passes_for_no_change_where_it_is_measured_and_stays_open_where_not(tmp_path: Path) -> None:
    vessel_file(tmp_path / "vessel.toml")
    seed = 82020
    rising = replace(WINDS["rising by 5 m/s in an hour"], measured=True)
    files = {
        "known": sailed([Ship()], 4 * HOUR, seeds=[seed], sea=MEASURED)[0],
        "risen": sailed([Ship()], 3 * HOUR, seeds=[seed + 3], sea=Sea(wind=rising), since_s=HOUR)[0],
    }
    known, risen = (written(tmp_path / f"{name}.csv", table) for name, table in files.items())
    assert "the ship is the one of the reference" in monitored(tmp_path, risen, known)[1]
    assert "The wind is measured." in (tmp_path / "monitor.html").read_text()
    blind = [without(path, lambda cells: cells[: -len(VANE)]) for path in (risen, known)]
    verdict = monitored(tmp_path, *blind)[1]
    assert "the ship has changed, or the wind, which is not measured: " in verdict
    assert "record wind_speed_mps and wind_angle_rad in reference and data" in verdict
    assert monitored(tmp_path, blind[0], known)[0] == 2


@pytest.mark.thorough
def test_less_thrust_is_found_in_a_wind_that_is_measured_where_rows_without_it_are_left_out(tmp_path: Path) -> None:
    vessel_file(tmp_path / "vessel.toml")
    known, weaker = (
        written(tmp_path / f"{name}.csv", sailed([ship], seconds, seeds=[seed], sea=MEASURED, since_s=since_s)[0])
        for name, ship, seconds, seed, since_s in (
            ("known", Ship(), 4 * HOUR, 86000, 0), ("weaker", CASES["thrust - 8 %"], 2 * HOUR, 86001, HOUR)
        )
    )  # fmt: skip
    gappy = without(weaker, lambda cells: [*cells[:-2], "", ""] if cells[0].endswith("00") else cells)
    status, verdict = monitored(tmp_path, gappy, known)
    assert status == 0
    assert "the ship has changed: " in verdict
    alarm = json.loads((tmp_path / "monitor.json").read_text())["alarms"][-1]
    assert alarm["effect"] in ("gain", "theta:X_nn")
    assert json.loads((tmp_path / "monitor.json").read_text())["rows_without_numbers"] == 71  # from 100 s on


def test_rows_lack_a_wind_only_where_the_file_measures_one(tmp_path: Path) -> None:
    header = "time_s,u_mps,v_mps,r_radps,n1_rps,wind_speed_mps,wind_angle_rad"
    rows = [f"{k},4,0,0,3,5,0.1" if k % 10 else f"{k},4,0,0,3,," for k in range(100)]
    blank = [f"{k},4,0,0,3,," for k in range(100)]
    found = []
    for number, lines in enumerate((rows, blank)):
        path = tmp_path / f"{number}.csv"
        path.write_text("\n".join([header, *lines]) + "\n")
        (one,) = pieces(path, inputs=("n1",), stretch_s=10.0, most_rows=1000, unread=())
        found.append((len(one.lines), one.left_out))
    assert found == [(90, 10), (100, 0)]
