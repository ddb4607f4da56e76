"""Time and memory of the main job on the example scenarios, and how good its plans are.

Run from anywhere with the package installed: ``python tests/benchmarks/main_job.py``. Besides seconds, which depend on
the machine, each time is given as a multiple of a fixed loop of plain Python timed in the same run. Processor seconds
count the work of all processes of the job, whatever else the machine does meanwhile; memory is that of the largest.
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
    """Processor seconds for ten million additions in plain Python, best of three."""
    times = []
    for _ in range(3):
        began = time.process_time()
        total = 0
        for number in range(10_000_000):
            total += number
        times.append(time.process_time() - began)
    return min(times)


def main_job(scenario: Path) -> tuple[float, float, float, dict[str, float]]:
    """Wall and processor seconds, peak memory of this job [MiB] and the summary of one run."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "expdesign", "run", str(scenario), "--out", folder]
        began = time.perf_counter()
        with subprocess.Popen([*command, "--json", "--quiet"], stdout=subprocess.PIPE) as process:
            output = process.stdout.read()
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise SystemExit(f"{scenario}: exit status {process.returncode}")
        busy_s = usage.ru_utime + usage.ru_stime
        return time.perf_counter() - began, busy_s, usage.ru_maxrss / 1024, json.loads(output)["summary"]


if __name__ == "__main__":
    unit_s = baseline_s()
    print(f"baseline loop {unit_s:.2f} s of processor time\n")
    print(
        "| scenario | wall | processor | x baseline | peak memory | informative | repositioning | bound | clearance |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name in ("helsinki", "model-ship"):
        wall_s, busy_s, peak_mib, facts = main_job(SCENARIOS / f"{name}.toml")
        print(
            f"| {name} | {wall_s:.0f} s | {busy_s:.0f} s | {busy_s / unit_s:.0f} | {peak_mib:.0f} MiB "
            f"| {facts['informative_s']:.0f} s | {facts['repositioning_s']:.0f} s "
            f"| {facts['repositioning_bound_s']:.0f} s | {facts['least_clearance_m']:.1f} m |"
        )
