"""One voyage as logs of every format: seconds of import and of estimate, and the parameters that are found.

    PYTHONPATH=tests:tests/benchmarks python tests/benchmarks/imported_logs.py

Times are wall clock within one process; the log is written in tenths of a second over 22 minutes.
"""

from __future__ import annotations

import contextlib
import io
import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

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
from logged_trial import (
    SHIP,
    Voyage,
    voyage,
    write_dialect,
    write_n2k,
    write_nmea,
    write_opencpn,
    write_own,
    write_signalk,
)

CASES: dict[str, tuple[str, Callable[[Path, Voyage], Path]]] = {
    "CSV of ours": ("a.csv", write_own),
    "CSV of a logger": ("a.csv", write_dialect),
    "NMEA 0183": ("a.nmea", write_nmea),
    "OpenCPN": ("a.csv", write_opencpn),
    "NMEA 2000, plain": ("a.log", partial(write_n2k, form="plain")),
    "NMEA 2000, candump": ("a.log", partial(write_n2k, form="candump")),
    "NMEA 2000, JSON": ("a.log", partial(write_n2k, form="json")),
    "Signal K": ("a.log", partial(write_signalk, served=True)),
    "Excel": ("a.xlsx", write_excel),
    "Parquet": ("a.parquet", write_parquet),
    "MATLAB": ("a.mat", write_matlab),
    "MATLAB 7.3": ("a.mat", write_matlab73),
    "ROS 1": ("a.bag", partial(write_ros, kind="ros1")),
    "ROS 2": ("a", partial(write_ros, kind="sqlite3")),
    "MCAP": ("a", partial(write_ros, kind="mcap")),
    "ArduPilot": ("a.bin", write_ardupilot),
    "ArduPilot, telemetry": ("a.tlog", write_telemetry),
    "PX4": ("a.ulg", write_ulog),
}
SHARES = ("ArduPilot", "ArduPilot, telemetry", "PX4")
"""Logs whose orders are shares of the largest, which the vessel file says."""
TRUTH = {"Y_uv": -0.02, "Y_ur": -0.3, "N_ur": -0.02, "N_ud": 0.0005}


def quiet(words: list[str]) -> tuple[int, float]:
    """Exit status and seconds of a command."""
    begun = time.perf_counter()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        status = main([*words, "--quiet"])
    return status, time.perf_counter() - begun


def row(case: str) -> str:
    """One line of the table."""
    name, write = CASES[case]
    with TemporaryDirectory() as place:
        folder = Path(place)
        log = write(folder / name, voyage().every(5))
        ship = SHIP[: SHIP.index("[sensors]")].replace("0.62", "0.610865")  # of which shares are: 35 degrees
        (folder / "ship.toml").write_text(ship)
        known = ["--vessel", str(folder / "ship.toml")] if case in SHARES else ["--length-m", "50"]
        status, imported_s = quiet(["import", str(log), *known, "--out", str(folder / "out")])
        if status:
            return f"| {case} | {imported_s:.1f} | exit {status} | |"
        words = ["estimate", str(folder / "out"), "--vessel", str(folder / "ship.toml"), "--method", "ls"]
        status, estimated_s = quiet([*words, "--out", str(folder / "e")])
        found = json.loads((folder / "e" / "estimate.json").read_text())["ls"]["parameters"] if not status else {}
    off = ", ".join(f"{key} {100 * (found[key]['value'] / true - 1):+.1f} %" for key, true in TRUTH.items() if found)
    return f"| {case} | {imported_s:.1f} | {estimated_s:.1f} | {off} |"


if __name__ == "__main__":
    print("| log | import s | estimate s | error of parameters |\n|---|---|---|---|")
    for case in CASES:
        print(row(case), flush=True)
