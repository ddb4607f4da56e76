"""Are the p-values of clean data uniform? Trials of exactly the vessel that the diagnosis is given.

``python tests/benchmarks/clean_p_values.py [--trials 100] [--seed 1] [--ship NAME ...] [--pose] [--data FOLDER]``

Ships: those of the examples without weather, and the 50 m ship of `clean_trials`. Every trial has four runs of 300 s
from rest with orders drawn anew every 20 to 60 s, simulated by the package and measured by the ship's own sensors;
parameters whose standard deviation the file states are drawn in every trial. Per ship: candidates of the catalogue with
their own p-value over all trials; those whose p-values a Kolmogorov-Smirnov test tells from uniform at 1 % (one in a
hundred by chance); shares of all p-values below 0.05 and 0.5; of the smallest adjusted p-value, which the diagnosis
decides by, the shares below 0.05 and 0.5; the same two shares of the p-values of `residuals` in diagnosis.json.

With the folder of measured trials a row follows for the untouched runs of each of their hulls, drawn by the same seed,
by a model that other runs gave (`published/diagnosis_real_hulls.py`): no such model is exact, so that these need not be
uniform. Of one trial the smallest adjusted p-value itself is told.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import kstest

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parent / "published"))
from clean_trials import SHIP_50M, at_rate, clean_trial, p_values
from diagnosis_real_hulls import HULLS, averaged, trial_of
from expdesign.diagnosis.accuracy import dependence, one_step_residuals
from expdesign.diagnosis.motion import stable_windows
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.kinematics import checked
from expdesign.scenario import load_vessel
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import Environment, Vessel

VESSELS = Path(__file__).parents[2] / "scenarios" / "vessels"
NAMED = ("azimuth-30m-true", "tender-20m-true", "coaster-80m", "fast-8m-true")


def ships() -> dict[str, Vessel]:
    """By name, without weather."""
    found = {name: load_vessel(VESSELS / f"{name}.toml") for name in NAMED}
    calm = {name: replace(one, environment=Environment()) for name, one in found.items()}
    return {"ship-50m": SHIP_50M, "ship-50m at 10 Hz": at_rate(SHIP_50M, 0.1), **calm}


def one_of(ship: Vessel, rng: np.random.Generator) -> Vessel:
    """The ship with parameters drawn from what her file states: p-values are uniform over what is believed."""
    (parameters,) = ship.model.drawn_parameters(1, rng)
    return replace(ship, model=replace(ship.model, parameters=parameters))


def residual_p_values(ship: Vessel, record: Record) -> list[float]:
    """Of the dependences of one-step residuals on all variables, where there are enough."""
    model = extended_model(ship, record)
    found = one_step_residuals(model, stable_windows(model, record))
    each = [dependence(found, output, what).p_value for output in found.outputs for what in found.variables]
    return [value for value in each if np.isfinite(value)]


def simulated_row(name: str, ship: Vessel, trials: int, seed: int, *, pose_only: bool) -> str:
    """Of so many trials of exactly that ship."""
    by, adjusted, left = dict[object, list[float]](), [], []
    for number in range(trials):
        rng = np.random.default_rng([seed, number])
        record = clean_trial(one_of(ship, rng), rng, pose_only=pose_only)
        own, smallest = p_values(ship, record)
        adjusted.append(smallest)
        for key, value in own.items():
            by.setdefault(key, []).append(value)
        left += residual_p_values(ship, record)
    tested = [values for values in by.values() if len(values) == trials]
    unlike = sum(kstest(values, "uniform").pvalue < 0.01 for values in tested)
    every = shares(np.concatenate(tested))
    return f"| {name} | {len(tested)} | {unlike} | {every} | {shares(adjusted)} | {shares(left)} |"


def measured_rows(data: Path, seed: int) -> Iterator[str]:
    """Of the untouched runs of every hull."""
    for hull in HULLS:
        trial = trial_of(hull, data, 0, seed)
        record = averaged(checked(trial.judged, trial.vessel))
        own, smallest = p_values(trial.vessel, record)
        left = shares(residual_p_values(trial.vessel, record))
        yield f"| {hull}, measured | {len(own)} | | {shares([*own.values()])} | {smallest:.2g} | {left} |"


def shares(p: Sequence[float] | Array) -> str:
    """Below 0.05 and 0.5."""
    return ", ".join(f"{(np.array(p) < level).mean():.2f}" for level in (0.05, 0.5))


def main() -> None:
    """A row per ship."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--ship", nargs="+")
    parser.add_argument("--pose", action="store_true", help="velocities from the pose")
    parser.add_argument("--data", type=Path, help="folder of measured trials")
    chosen = parser.parse_args()
    print("| ship | candidates | unlike uniform | p < 0.05, < 0.5 | smallest adjusted p | residuals |")
    print("|---|---|---|---|---|---|")
    for name, ship in ships().items():
        if not chosen.ship or name in chosen.ship:
            print(simulated_row(name, ship, chosen.trials, chosen.seed, pose_only=chosen.pose), flush=True)
    for row in measured_rows(chosen.data, chosen.seed) if chosen.data else ():
        print(row, flush=True)


if __name__ == "__main__":
    main()
