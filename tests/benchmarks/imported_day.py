"""A day at 10 Hz as CSV, NMEA 0183 and Parquet: processor seconds and peak memory of an import.

    PYTHONPATH=tests python tests/benchmarks/imported_day.py [--hours 24]

Each import is a process of its own; its seconds are beside those of splitting the same lines at their commas in Python,
so that the ratio holds on any machine.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from logged_trial import NAMES, START_S, STEP_S, dm, logger_rows, sentence, voyage

LIMIT_MB = 4000


def rows(hours: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and rows of a logger: one voyage again and again."""
    one = logger_rows(voyage())
    count = round(hours * 3600 / STEP_S)
    return START_S + STEP_S * np.arange(count), np.resize(one, (count, one.shape[1]))


def write_csv(path: Path, hours: float) -> None:
    """A logger's CSV with milliseconds since 1970."""
    times, table = rows(hours)
    with path.open("w") as file:
        file.write(",".join(["Time", *NAMES]) + "\n")
        form = "%.0f,%.8f,%.8f" + ",%.4f" * (table.shape[1] - 2) + "\n"
        for at, row in zip(times.tolist(), table.tolist(), strict=True):
            file.write(form % (at * 1e3, *row))


def write_nmea(path: Path, hours: float) -> None:
    """RMC, HDT, ROT, RSA and RPM, ten times a second."""
    times, table = rows(hours)
    with path.open("w") as file:
        for at, row in zip(times.tolist(), table.tolist(), strict=True):
            lat, lon, knots, course, heading, rot, rpm, _, rudder = row
            stamp = time.gmtime(at)
            clock = f"{stamp.tm_hour:02d}{stamp.tm_min:02d}{stamp.tm_sec:02d}.{at % 1 * 10:.0f}"
            date = f"{stamp.tm_mday:02d}{stamp.tm_mon:02d}{stamp.tm_year % 100:02d}"
            place = f"{dm(lat, 2)},N,{dm(lon, 3)},E"
            bodies = (f"GPRMC,{clock},A,{place},{knots:.4f},{course:.3f},{date},,,A", f"HEHDT,{heading:.3f},T",
                      f"TIROT,{rot:.3f},A", f"IIRSA,{rudder:.2f},A,,V", f"IIRPM,S,0,{rpm:.1f},100,A")  # fmt: skip
            file.write("\n".join(map(sentence, bodies)) + "\n")


def write_parquet(path: Path, hours: float) -> None:
    """A table with time stamps."""
    import pyarrow
    import pyarrow.parquet

    times, table = rows(hours)
    columns = {"time": (times * 1e9).astype("datetime64[ns]"), **dict(zip(NAMES, table.T, strict=True))}
    pyarrow.parquet.write_table(pyarrow.table(columns), path)


CASES: dict[str, tuple[str, Callable[[Path, float], None]]] = {
    "CSV": ("a.csv", write_csv), "NMEA 0183": ("a.nmea", write_nmea), "Parquet": ("a.parquet", write_parquet),
}  # fmt: skip


def measured(words: list[str]) -> tuple[float, float, float]:
    """Processor seconds, wall seconds and peak memory [MB] of a process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.perf_counter()
    code = (
        "import resource, sys; from pathlib import Path; from expdesign.cli import main; "
        f"resource.setrlimit(resource.RLIMIT_AS, ({LIMIT_MB} * 2**20,) * 2); "
        "status = main(sys.argv[1:]); state = Path('/proc/self/status').read_text(); "
        "print(status, state.partition('VmHWM:')[2].split()[0])"  # its own: ru_maxrss begins with that of its parent
    )
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True)
    status, peak_kb = done.stdout.split()[-2:]
    if status != "0":
        raise SystemExit(f"exit {status}: {done.stderr[-400:]}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return used, time.perf_counter() - begun, float(peak_kb) / 1024


def of_lines(path: Path) -> float:
    """Processor seconds of splitting every line at its commas."""
    begun = time.process_time()
    with path.open(encoding="latin-1") as file:
        for line in file:
            line.split(",")
    return time.process_time() - begun


def main() -> None:
    """One line of the table for each format."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--case", choices=CASES, action="append")
    given = parser.parse_args()
    print("| log | MB | processor s | wall s | times splitting its lines | peak MB |\n|---|---|---|---|---|---|")
    for case in given.case or CASES:
        name, write = CASES[case]
        with TemporaryDirectory() as place:
            path = Path(place) / name
            write(path, given.hours)
            used, wall, peak = measured(["import", str(path), "--length-m", "50", "--out", f"{place}/out", "--quiet"])
            ratio = f"{used / of_lines(path):.1f}" if name != "a.parquet" else "-"
            size = path.stat().st_size / 1e6
            print(f"| {case} | {size:.0f} | {used:.1f} | {wall:.1f} | {ratio} | {peak:.0f} |", flush=True)


if __name__ == "__main__":
    main()
