"""Output error where dead times are stated with an error: intervals that count it, and those of times taken as exact.

``python tests/benchmarks/uncertain_times.py [--trials N] [--seed S]``: three runs of a minute, a zig-zag, waves and a
pull-out of `dictionaries/fast-8m.toml`, are sailed by `fast-8m-true.toml` with noise, in waves that move it by 0.1 m/s,
with dead times of 0.5 s. The vessel file states dead times that are drawn around these with 0.15 s. Errors are root
mean squares over parameters of the error over the builder's standard deviation, stated ones the same of standard
deviations.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from expdesign.assessment import EstimateOptions, assess, settled
from expdesign.dictionary import build_dictionary
from expdesign.scenario import load_dictionary, load_vessel
from expdesign.vessel import Vessel, response_values, with_response_values
from expdesign.workflows.steps.measured import measured
from step_case import GUESS, TRUTH
from step_story import SCENARIOS, sailed

RUNS = ("zigzag-speed-7", "waves-speed-6-helm-period-6", "pull-out-speed-4-helm-0.3")
NAMES = ("n1_delay_s", "rudder1_delay_s")
STD_S = 0.15
OPTIONS = EstimateOptions(methods=("oe",), mean="none")
Row = tuple[float, float, float, float]
"""Error, stated error, share of intervals that hold the true parameters, and of those of times."""


def estimated(data: list[str], stated: Vessel) -> Row:
    """What output error finds with a vessel file."""
    ship, record = settled(stated, measured([Path(name) for name in data], stated), OPTIONS)
    found = assess(ship, record, OPTIONS, stated=stated).best
    truth, scale = load_vessel(TRUTH), load_vessel(GUESS).model.parameter_std
    error, std = found.model.parameters - truth.model.parameters, found.model.parameter_std
    times, right = response_values(found.model.actuators), response_values(truth.actuators)
    held = [abs(times[name] - right[name]) < 1.96 * found.std[name] for name in NAMES if name in found.std]
    sizes = [float(np.sqrt(np.mean((size / scale) ** 2))) for size in (error, std)]
    return (*sizes, float(np.mean(np.abs(error) < 1.96 * std)), float(np.mean(held)) if held else np.nan)


def trial(seed: int) -> dict[str, Row]:
    """Estimates from one set of runs."""
    rng, truth, guess = np.random.default_rng(seed), load_vessel(TRUTH), load_vessel(GUESS)
    dictionary = load_dictionary(SCENARIOS / "dictionaries" / "fast-8m.toml")
    runs = [run for run in build_dictionary(truth, dictionary) if run.name in RUNS]
    with tempfile.TemporaryDirectory() as name:
        data = sailed(Path(name), runs, rng)
        drawn = np.maximum(0.5 + STD_S * rng.standard_normal(2), 0.0).tolist()
        actuators = with_response_values(guess.actuators, dict(zip(NAMES, drawn, strict=True)))
        exact = replace(guess, model=replace(guess.model, actuators=actuators))
        files = {"taken as exact": exact, "estimated": replace(exact, std=dict.fromkeys(NAMES, STD_S))}
        return {what: estimated(data, vessel) for what, vessel in files.items()}


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=25)
    parser.add_argument("--seed", type=int, default=100)
    given = parser.parse_args()
    found = [trial(seed) for seed in range(given.seed, given.seed + given.trials)]
    print(f"{given.trials} trials:\n")
    print("| dead times | error | stated | intervals of parameters | of dead times |")
    print("|---|---|---|---|---|")
    for what in found[0]:
        rows = np.array([row[what] for row in found])
        error, stated = np.sqrt(np.mean(rows[:, :2] ** 2, axis=0)).tolist()
        share, spread = rows[:, 2].mean(), rows[:, 2].std(ddof=1) / np.sqrt(len(rows))
        times = "" if np.isnan(rows[:, 3]).any() else f"{rows[:, 3].mean():.2f}"
        print(f"| {what} | {error:.3f} | {stated:.3f} | {share:.3f} ± {spread:.3f} | {times} |")
