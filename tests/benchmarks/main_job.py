"""Time and memory of the main job on the example scenarios, and how good its plans are.

Run from anywhere with the package installed: ``python tests/benchmarks/main_job.py``. Besides seconds, which depend on
the machine, each time is given as a multiple of a fixed loop of plain Python timed in the same run.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def baseline_s() -> float:
    """Seconds for ten million additions in plain Python, best of three."""
    times = []
    for _ in range(3):
        began = time.perf_counter()
        total = 0
        for number in range(10_000_000):
            total += number
        times.append(time.perf_counter() - began)
    return min(times)


def main_job(name: str) -> tuple[float, float, dict[str, float]]:
    """Wall seconds, peak memory of this job [MiB] and the summary of one run."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "expdesign", "run", str(SCENARIOS / f"{name}.toml"), "--out", folder]
        began = time.perf_counter()
        with subprocess.Popen([*command, "--json", "--quiet"], stdout=subprocess.PIPE) as process:
            output = process.stdout.read()
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise SystemExit(f"{name}: exit status {process.returncode}")
        return time.perf_counter() - began, usage.ru_maxrss / 1024, json.loads(output)["summary"]


if __name__ == "__main__":
    unit_s = baseline_s()
    print(f"baseline loop {unit_s:.2f} s\n")
    print("| scenario | wall | x baseline | peak memory | informative | repositioning | its bound | clearance |")
    print("|---|---|---|---|---|---|---|---|")
    for name in ("helsinki", "model-ship"):
        wall_s, peak_mib, facts = main_job(name)
        print(
            f"| {name} | {wall_s:.0f} s | {wall_s / unit_s:.0f} | {peak_mib:.0f} MiB | {facts['informative_s']:.0f} s "
            f"| {facts['repositioning_s']:.0f} s | {facts['repositioning_bound_s']:.0f} s "
            f"| {facts['least_clearance_m']:.1f} m |"
        )
