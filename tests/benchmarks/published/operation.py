"""Yaw models of a naval vessel in operation: influence of noise, changes that show, and alarms, beside a thesis's.

``python tests/benchmarks/published/operation.py [--runs N]``: voyages of 600 s at 10 Hz with pod angles and speeds held
for 12 to 40 s. The thesis gives neither its excitation nor its anti-alias filter: here the noise that it lists is
averaged over 5 samples, and every fourth sample is used. Estimates are by output error from the true parameters.
Alarms: voyages of 500 s, ten models each estimated from one noisy voyage, constants of the sum calibrated so that 2 %
of nominal voyages raise an alarm; the heavier ship has 10 % more moment of inertia.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))
from dataclasses import replace

from expdesign.monitoring.yaw import (
    NOMINAL,
    YAW_MODELS,
    Detector,
    YawData,
    YawModel,
    alarm_samples,
    estimate_yaw,
    simulate_yaw,
)
from expdesign.simulation.naval import NOMINAL as SHIP
from expdesign.simulation.naval import Hull
from naval_case import harbour, heavier, measured

EVERY = 4
THESIS_ALARMS = {"full": "1.7 % false, 3.5 % missed, 219 s", "simplified": "0.9 % false, 6.7 % missed, 272 s"}
"""Means over its ten estimated models."""


def damped(term: str, factor: float) -> Hull:
    """Another coefficient in yaw."""
    yaw = {**SHIP.coefficients["r"], term: factor * SHIP.coefficients["r"][term]}
    return replace(SHIP, coefficients={**SHIP.coefficients, "r": yaw})


def noise_study(runs: int) -> None:
    """Bias and spread of every parameter."""
    data = measured(harbour(seed=1), count=runs, seed=0, every=EVERY)
    found = {name: estimate_yaw(YAW_MODELS[name], data, NOMINAL) for name in ("full", "simplified")}
    exact = measured(harbour(seed=1), count=1, seed=0, noise=0.0, every=EVERY)
    without = {name: estimate_yaw(YAW_MODELS[name], exact, NOMINAL) for name in found}
    print(f"{runs} voyages of the nominal ship, in per cent of the true value:\n")
    print("| parameter | full: bias | spread | simplified: bias | spread | bias without noise |")
    print("|---|---|---|---|---|---|")
    for name in YAW_MODELS["full"].parameters:
        cells = [name]
        for structure in ("full", "simplified"):
            if name in YAW_MODELS[structure].parameters:
                error = 100.0 * (found[structure].of(name) / NOMINAL[name] - 1.0)
                cells += [f"{error.mean():+.1f}", f"{error.std():.1f}"]
            else:
                cells += ["", ""]
        simple = YAW_MODELS["simplified"].parameters
        cells.append(
            f"{100.0 * (without['simplified'].of(name)[0] / NOMINAL[name] - 1.0):+.1f}" if name in simple else ""
        )
        print(f"| {' | '.join(cells)} |")


def change_study(runs: int) -> None:
    """Shift of every parameter by changes of the ship, in standard deviations of a single estimate."""
    changes = {
        "moment of inertia + 10 %": heavier(inertia=1.1), "moment of inertia + 20 %": heavier(inertia=1.2),
        "mass + 10 %": heavier(mass=1.1), "mass + 40 %": heavier(mass=1.4), "N_rr + 20 %": damped("r|r|", 1.2),
        "N_rv + 20 %": damped("r|v|", 1.2), "N_uv + 20 %": damped("|u|v", 1.2),
    }  # fmt: skip
    print("\nShift of the mean estimate, in standard deviations of one:\n")
    for structure in ("full", "simplified"):
        model = YAW_MODELS[structure]
        before = estimate_yaw(model, measured(harbour(seed=1), count=runs, seed=0, every=EVERY), NOMINAL)
        print(f"| {structure}: change | {' | '.join(model.parameters)} |")
        print("|---" * (1 + len(model.parameters)) + "|")
        for name, hull in changes.items():
            data = measured(harbour(hull, seed=1), count=runs, seed=1, every=EVERY)
            after = estimate_yaw(model, data, NOMINAL)
            spread = np.hypot(before.parameters.std(axis=0), after.parameters.std(axis=0)) / np.sqrt(2.0)
            shift = (after.parameters.mean(axis=0) - before.parameters.mean(axis=0)) / spread
            print(f"| {name} | {' | '.join(f'{value:+.1f}' for value in shift)} |", flush=True)
        print()


def alarm_study(runs: int) -> None:
    """False and missed alarms of the sum, with models estimated from noisy data."""
    print("| model | prior | false | missed | median time | thesis, mean of ten |")
    print("|---|---|---|---|---|---|")
    voyages = {
        name: measured(harbour(hull, seconds=500.0, seed=20), count=runs, seed=seed, every=EVERY)
        for name, hull, seed in (("calibration", SHIP, 2), ("nominal", SHIP, 3), ("heavier", heavier(inertia=1.1), 4))
    }
    learnt = measured(harbour(seconds=500.0, seed=21), count=10, seed=5, every=EVERY)
    for structure in ("full", "simplified"):
        model = YAW_MODELS[structure]
        estimates = estimate_yaw(model, learnt, NOMINAL).parameters
        true = np.array([NOMINAL[name] for name in model.parameters])
        for prior, values in (("true", true[None]), ("estimated, mean of ten", estimates)):
            rows = np.mean([_alarms(model, theta, voyages) for theta in values], axis=0)
            shown = THESIS_ALARMS[structure] if prior != "true" else ""
            print(f"| {structure} | {prior} | {rows[0]:.1%} | {rows[1]:.1%} | {rows[2]:.0f} s | {shown} |", flush=True)


def _alarms(model: YawModel, theta: np.ndarray, voyages: dict[str, YawData]) -> tuple[float, float, float]:
    residual = {name: data.r - simulate_yaw(model, data, theta)[0] for name, data in voyages.items()}
    tuned = Detector.calibrated(residual["calibration"], false_share=0.02)
    false, found = (alarm_samples(tuned, residual[name]) for name in ("nominal", "heavier"))
    seconds = 0.1 * EVERY * np.nanmedian(found) if np.isfinite(found).any() else np.nan
    return float(np.isfinite(false).mean()), float(np.isnan(found).mean()), float(seconds)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=100)
    runs = parser.parse_args().runs
    noise_study(runs)
    change_study(runs)
    alarm_study(runs)
