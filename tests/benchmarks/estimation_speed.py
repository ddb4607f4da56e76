"""Speed of one refined, augmented IV estimate from 5000 samples in memory, as ratios to baselines in the same run.

``python tests/benchmarks/estimation_speed.py``: the baselines are one plain least-squares solution of the same size
(15000 equations, 40 unknowns) and a plain Python loop that simulates the ship once over the same samples. Times are
processor time, the least of several.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from estimation_case import NOMINAL, STEADY_CURRENT, TRUE, commands, measured, record
from expdesign.estimation.methods import estimate
from expdesign.simulation import euler_step, motion_rates
from expdesign.vessel import SCALAR

SAMPLES, REPEATS = 5000, 9


def least_s(work: Callable[[], object]) -> float:
    """Least processor time of several calls [s]."""
    times = []
    for _ in range(REPEATS):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return min(times)


def plain_loop(inputs: np.ndarray) -> None:
    """One run of the ship, sample by sample."""
    state = (0.0, 0.0, 0.0, 1.7, 0.7, 0.0)
    for held in inputs.tolist():
        state = euler_step(lambda x, held=held: motion_rates(TRUE.model, x, held, ops=SCALAR), state, 1.0)


if __name__ == "__main__":
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
