"""Load trials of a simulated model ship: `python tests/benchmarks/roll_trials.py STUDY [--runs N] [--seed N]`.

bound: errors of estimates, over the least standard deviations that roll-plan states.
height: these least standard deviations by the height of the inertial sensor.
late: mean errors where the accelerometer is late, as where its clock is off.
waves: errors over these least standard deviations in waves of a period near that of roll, as [roll.waves] has them.

Three load cases of a minute each, k known, no waves but there; the ship is scenarios/vessels/roll-model.toml.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from expdesign.roll import PARAMETERS
from expdesign.vessel import Vessel
from expdesign.waves import Waves
from rolling_ship import bound, error_and_bound, estimated, roll_model

HEIGHTS_M = (0.05, 0.1, 0.23, 0.5)
LATE_S = (0.0, 0.002, 0.005, 0.01, 0.02)


def over_bound(runs: int, seed: int) -> None:
    """Root mean square of error over bound, of each parameter and of all."""
    found = np.array([np.divide(*error_and_bound(roll_model(), seed + run)) for run in range(runs)])
    names = bound(roll_model(), seed)[0].free
    for name, column in zip(names, found.T, strict=True):
        print(f"| {name} | {np.sqrt(np.mean(column**2)):.2f} | {column.mean():+.2f} |")
    print(f"| all | {np.sqrt(np.mean(found**2)):.2f} | |")


def height(runs: int, seed: int) -> None:
    """Mean bounds, in percent of each parameter's value."""
    for height_m in HEIGHTS_M:
        ship = _sensed_at(roll_model(), height_m)
        pairs = [bound(ship, seed + run) for run in range(runs)]
        mean = np.mean([least / question.size for question, least in pairs], axis=0)
        told = zip(pairs[0][0].free, mean, strict=True)
        print(f"| {height_m:g} m | " + " | ".join(f"{name} {100 * share:.2f} %" for name, share in told) + " |")


def _sensed_at(ship: Vessel, height_m: float) -> Vessel:
    assert ship.pendulum is not None
    return replace(ship, pendulum=replace(ship.pendulum, body=replace(ship.pendulum.body, z_s=-height_m)))


def late(runs: int, seed: int) -> None:
    """Mean errors, in percent of each parameter's value."""
    question = bound(roll_model(), seed)[0]
    for late_s in LATE_S:
        errors = [error_and_bound(roll_model(), seed + run, late_s=late_s)[0] for run in range(runs)]
        told = zip(question.free, np.mean(errors, axis=0) / question.theta[question.places], strict=True)
        print(f"| {1000 * late_s:g} ms | " + " | ".join(f"{name} {100 * share:+.1f} %" for name, share in told) + " |")


def waves(runs: int, seed: int) -> None:
    """Root mean square of error over bound where intervals are trusted, and how many are; the bound of m in percent."""
    ship = roll_model()
    assert ship.pendulum is not None
    for height_m in (0.002, 0.005, 0.01, 0.02):
        sea = Waves(height_m=height_m, period_s=1.2, from_rad=1.0)
        there, ratios, trusted = replace(ship, pendulum=replace(ship.pendulum, waves=sea)), [], []
        for run in range(runs):
            question, least = bound(there, seed + run)
            one = estimated(there, question, seed + run)
            ratios.append((one.theta - question.theta)[question.places] / least)
            trusted.append(one.trusted)
        rms = np.sqrt(np.mean(np.square(ratios)[trusted])) if any(trusted) else np.nan
        share = 100 * least[question.free.index("m")] / question.theta[PARAMETERS.index("m")]
        print(f"| {1000 * height_m:g} mm | {rms:.2f} | {sum(trusted)} of {runs} | {share:.1f} % |", flush=True)


STUDIES = {"bound": over_bound, "height": height, "late": late, "waves": waves}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study", choices=STUDIES)
    parser.add_argument("--runs", type=int, default=6)
    parser.add_argument("--seed", type=int, default=401)
    asked = parser.parse_args()
    STUDIES[asked.study](asked.runs, asked.seed)
