"""Speed of one refined, augmented IV estimate from 5000 samples in memory, as ratios to baselines in the same run.

``python tests/benchmarks/estimation_speed.py``: the baselines are one plain least-squares solution of the same size
(15000 equations, 40 unknowns) and a plain Python loop that simulates the ship once over the same samples. Times are
processor time, the least of several.

``python tests/benchmarks/estimation_speed.py --hour [METHOD ...]``: the whole command `estimate` from an hour of data
at 10 Hz to its page, method by method, in a process of its own. The baseline is a loop that adds five million squares.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from estimation_case import NOMINAL, STEADY_CURRENT, TRUE, commands, measured, record
from expdesign.estimation.methods import METHODS, estimate
from expdesign.scenario import load_vessel
from expdesign.signals import Commands
from expdesign.simulation import Environment, Variation, euler_step, motion_rates
from expdesign.vessel import SCALAR
from measured_trials import TUG, VESSELS, tug_commands, write_run

SAMPLES, REPEATS = 5000, 9
TUG_TRUE_FILE = VESSELS / "azimuth-30m-true.toml"
HOUR_S, SAMPLE_TIME_S = 3600, 0.1
WEATHER = Environment(wind_to=np.array([4.0, -3.0]), wind_variation=Variation(std_mps=0.5, correlation_s=30.0))


def least_s(work: Callable[[], object], calls: int = REPEATS) -> float:
    """Least processor time of several calls [s]."""
    times = []
    for _ in range(calls):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return min(times)


def plain_loop(inputs: np.ndarray) -> None:
    """One run of the ship, sample by sample."""
    state = (0.0, 0.0, 0.0, 1.7, 0.7, 0.0)
    for held in inputs.tolist():
        state = euler_step(lambda x, held=held: motion_rates(TRUE.model, x, held, ops=SCALAR), state, 1.0)


def repeated_estimates() -> None:
    """Print the time of one estimate, as ratios."""
    rng = np.random.default_rng(1)
    inputs = commands(SAMPLES, rng)
    data = record(measured(TRUE, inputs, weather=STEADY_CURRENT))
    A, y = rng.normal(size=(3 * SAMPLES, 40)), rng.normal(size=3 * SAMPLES)
    found = estimate(data, NOMINAL, method="iv-augmented")
    ours = least_s(lambda: estimate(data, NOMINAL, method="iv-augmented"))
    solving, looping = least_s(lambda: np.linalg.lstsq(A, y, rcond=None)), least_s(lambda: plain_loop(inputs))
    print(f"refined augmented IV, {SAMPLES} samples, {found.refinements} refinements: {ours * 1e3:.0f} ms")
    print(f"{ours / solving:.1f} x a plain least-squares solution of the same size ({solving * 1e3:.1f} ms)")
    print(f"{ours / looping:.2f} x one simulation in a plain Python loop ({looping * 1e3:.0f} ms)")


def squares() -> None:
    """The baseline of an hour."""
    total = 0.0
    for number in range(5_000_000):
        total += number * number


def hours(methods: list[str]) -> None:
    """Print the time of the command for an hour of data, by method."""
    held = tug_commands(HOUR_S + 1, seed=1)
    finer = np.repeat(held.values, round(1 / SAMPLE_TIME_S), axis=0)
    quick = Commands(sample_time_s=SAMPLE_TIME_S, names=held.names, values=finer[: round(HOUR_S / SAMPLE_TIME_S)])
    print("| method | processor | wall | x five million squares |")
    print("|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        true, vessel = (Path(folder) / path.name for path in (TUG_TRUE_FILE, TUG))
        for original, path in ((TUG_TRUE_FILE, true), (TUG, vessel)):
            slow = original.read_text("utf-8").replace('form = "discrete"', 'form = "continuous"')
            path.write_text(slow.replace("sample_time_s = 1.0", f"sample_time_s = {SAMPLE_TIME_S}"), "utf-8")
        begin = {"velocity": (1.7, 0.7, 0.0), "environment": WEATHER, "seed": 1}
        data = write_run(Path(folder) / "hour.csv", load_vessel(true), quick, **begin)
        for method in methods:
            asked = [sys.executable, "-m", "expdesign", "estimate", data, "--vessel", vessel, "--method", method]
            before, began = os.times(), time.perf_counter()
            subprocess.run([*asked, "--out", Path(folder) / method, "--quiet"], check=True)
            wall_s, after = time.perf_counter() - began, os.times()
            work_s = sum(after[2:4]) - sum(before[2:4])
            print(f"| {method} | {work_s:.1f} s | {wall_s:.1f} s | {work_s / least_s(squares, 1):.0f} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--hour", nargs="*", choices=[method.name for method in METHODS], metavar="METHOD")
    chosen = parser.parse_args()
    if chosen.hour is None:
        repeated_estimates()
    else:
        hours(chosen.hour or [method.name for method in METHODS])
