"""How well estimated models simulate, by the samples that they were estimated from, and how often they are unstable.

`python tests/benchmarks/published/fit_by_samples.py [--runs N] [--sets N] [--case NAME ...]`: the six estimators of the
study with current and wind, from the first 1000 to 5000 samples of each run, simulate a zig-zag without disturbances or
noise. The mean fit of surge, sway and yaw rate stands beside its standard deviation, over the runs whose model stays
bounded. The source leaves out a size at which a model is unstable in some run: 3 of 100 for IV2 and IV3 from 1000
samples. Here an unstable estimate is drawn to the first model and says so; `drawn` counts these, `unstable` the models
whose zig-zag diverges all the same, and estimates that fail.

Source: F. Ljungberg, doctoral thesis, Linköping University, 6.1, figures 6.2 and 6.3.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from expdesign.assessment.misfit import TEST, check_run
from expdesign.errors import NoAnswer
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate
from expdesign.processes import in_order
from expdesign.signals import Batch, Record
from expdesign.simulation import Ensemble, Environment, simulate_ensemble
from expdesign.values import Array
from expdesign.vessel import Sensors
from manoeuvring import CASES, ESTIMATORS, START_MPS, Case, nominal, ship, simulate_case
from shared_work import add_sharing, shared_work

SIZES = (1000, 2000, 3000, 4000, 5000)
DRAWN = "The data alone give an unstable model."
SWING_S, ZIGZAG_S = 60, 900


@dataclass(frozen=True, eq=False)
class Fits:
    """One estimator from one size.

    Attributes:
        fits: (runs, 3) of the zig-zag [%], nan where the model is unstable or there is no estimate.
        drawn: estimates drawn to the first model.
    """

    fits: Array
    drawn: int

    @property
    def unstable(self) -> int:
        """Runs without a model that simulates the zig-zag."""
        return int(np.isnan(self.fits).any(axis=1).sum())


def zigzag() -> Batch:
    """Undisturbed motion ahead: both propellers at 10 rps, the bow thruster straight, the stern one to either side."""
    side = np.where(np.arange(ZIGZAG_S) // SWING_S % 2, -1.0, 1.0)
    inputs = np.stack([np.full(ZIGZAG_S, 10.0), np.zeros(ZIGZAG_S), np.full(ZIGZAG_S, 10.0), 0.35 * side], axis=1)
    quiet = replace(ship(), sensors=Sensors())
    calm, rng = Environment(), np.random.default_rng(0)
    return simulate_ensemble(quiet, inputs, runs=1, environment=calm, rng=rng, velocity=START_MPS).batch(0)


def fits_by_samples(
    case: Case, *, runs: int, sets: int, sizes: Sequence[int] = SIZES, estimators: Sequence[str] = tuple(ESTIMATORS)
) -> dict[tuple[str, int], Fits]:
    """Every estimator from every size, on sets of runs with an input each."""
    tasks = [(name, size, run) for name in estimators for size in sizes for run in range(runs)]
    found: dict[tuple[str, int], list[tuple[Array, bool]]] = {}
    checked = zigzag()
    for number in range(sets):
        trials = simulate_case(case, runs=runs, rng=np.random.default_rng([1, number]))
        for (name, size, _), result in zip(tasks, in_order(_fitted, (trials, checked), tasks), strict=True):
            found.setdefault((name, size), []).append(result)
    return {
        key: Fits(np.array([fit for fit, _ in results]), sum(drawn for _, drawn in results))
        for key, results in found.items()
    }


def _fitted(trials: Ensemble, checked: Batch, estimator: str, size: int, run: int) -> tuple[Array, bool]:
    """(3,) fit of the zig-zag, nan without a bounded model, and whether the estimate was drawn to the first model."""
    model = nominal(ship().model)
    record = Record(batches=(trials.batch(run).cut(slice(0, size)),))
    try:
        found = estimate(record, model, method=ESTIMATORS[estimator], settings=Settings(wind="measured"))
    except NoAnswer:
        return np.full(3, np.nan), False
    drawn = any(warning.startswith(DRAWN) for warning in found.warnings)
    return check_run(found.model(model), checked, use=TEST, wind=False).fit_percent, drawn


def rows(found: dict[tuple[str, int], Fits]) -> Iterator[str]:
    """Of a table."""
    for (name, size), item in found.items():
        bounded = item.fits[~np.isnan(item.fits).any(axis=1)]
        cells = ["-"] * 3
        if len(bounded) > 1:
            pairs = zip(bounded.mean(axis=0), bounded.std(axis=0, ddof=1), strict=True)
            cells = [f"{mean:.1f} ± {std:.1f}" for mean, std in pairs]
        yield f"| {name} | {size} | {' | '.join(cells)} | {item.unstable} | {item.drawn} of {len(item.fits)} |"


def main() -> None:
    """Print both figures as tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--sets", type=int, default=10)
    parser.add_argument("--sizes", type=int, nargs="*", default=SIZES)
    parser.add_argument("--case", nargs="*", default=[case.name for case in CASES], help="of the study, all by default")
    add_sharing(parser)
    chosen = parser.parse_args()
    with shared_work(chosen):
        for case in CASES:
            if case.name not in chosen.case:
                continue
            print(f"\n{case.name}, {chosen.sets} inputs of {chosen.runs} runs:\n", flush=True)
            print("| estimator | samples | surge [%] | sway [%] | yaw rate [%] | unstable | drawn |")
            print("|---|---|---|---|---|---|---|")
            for name in ESTIMATORS:
                found = fits_by_samples(
                    case, runs=chosen.runs, sets=chosen.sets, sizes=chosen.sizes, estimators=(name,)
                )
                print("\n".join(rows(found)), flush=True)


if __name__ == "__main__":
    main()
