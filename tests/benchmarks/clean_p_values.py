"""Are the p-values of clean data uniform? Trials of exactly the vessel that the diagnosis is given.

``nice python tests/benchmarks/clean_p_values.py [--trials 100] [--seed 1] [--ship ship-50m] [--pose]``

Ships: those of the examples without weather, and the 50 m ship of `clean_trials`. Every trial has four runs of 300 s
from rest with orders drawn anew every 20 to 60 s, simulated by the package and measured by the ship's own sensors;
parameters whose standard deviation the file states are drawn in every trial. Per ship: candidates of the catalogue with
their own p-value over all trials; those whose p-values a Kolmogorov-Smirnov test tells from uniform at 1 % (one in a
hundred by chance); shares of all p-values below 0.05 and 0.5; of the smallest adjusted p-value, which the diagnosis
decides by, the shares below 0.05 and 0.5; the same two shares of the p-values of `residuals` in diagnosis.json.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import kstest

sys.path.insert(0, str(Path(__file__).parents[1]))
from clean_trials import SHIP_50M, at_rate, clean_trial, p_values
from expdesign.diagnosis.accuracy import dependence, one_step_residuals
from expdesign.diagnosis.motion import stable_windows
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.scenario import load_vessel
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


def main() -> None:
    """A line per ship."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--ship")
    parser.add_argument("--pose", action="store_true", help="velocities from the pose")
    chosen = parser.parse_args()
    print(f"{'ship':20}{'tests':>6}{'KS<1%':>7}{'P<.05':>7}{'P<.5':>7}   adjusted P<.05, P<.5   residuals P<.05, P<.5")
    for name, ship in ships().items():
        if chosen.ship not in (None, name):
            continue
        by, adjusted, left = dict[object, list[float]](), [], []
        for number in range(chosen.trials):
            rng = np.random.default_rng([chosen.seed, number])
            record = clean_trial(one_of(ship, rng), rng, pose_only=chosen.pose)
            own, smallest = p_values(ship, record)
            adjusted.append(smallest)
            for key, value in own.items():
                by.setdefault(key, []).append(value)
            model = extended_model(ship, record)
            found = one_step_residuals(model, stable_windows(model, record))
            left += [dependence(found, output, what).p_value for output in found.outputs for what in found.variables]
        tested = [values for values in by.values() if len(values) == chosen.trials]
        every, small, rest = (np.concatenate(tested), np.array(adjusted), np.array(left)[np.isfinite(left)])
        unlike = sum(kstest(values, "uniform").pvalue < 0.01 for values in tested)
        print(f"{name:20}{len(tested):6}{unlike:7}{(every < 0.05).mean():7.3f}{(every < 0.5).mean():7.3f}"
              f"{(small < 0.05).mean():17.2f}{(small < 0.5).mean():6.2f}"
              f"{(rest < 0.05).mean():18.3f}{(rest < 0.5).mean():7.3f}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
