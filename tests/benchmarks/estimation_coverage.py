"""How often 95 % intervals hold the truth, parameter by parameter, and why not more or less often.

``python tests/benchmarks/estimation_coverage.py [--trials 1000] [--method iv-augmented] [--samples 1000] [--batches 9]
[--wandering] [--derived]``, shared among processes or workers by `--jobs` or `--scheduler`. Every trial has its own
input, sensor noise, which enters through the regressors, and current; see `coverage_cases.Case`. Without `--method`
every method is tried. `--short` tries `iv` from twelve batches of 300 samples, the optimised runs of the model ship.

`--table` counts every method in the cases of `TABLE`, one row each: the share of all intervals with its standard error
from the spread between trials, the least share of a parameter, and the range of predicted over actual standard
deviation (the root of mean squares).

Columns of the others: share of intervals that hold the truth, with its Monte Carlo error; predicted over actual
standard deviation; bias over actual standard deviation; kurtosis of the error (3 for a normal one).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from coverage_cases import METHODS, Case, Tried, tried
from estimation_case import many_short_batches
from shared_work import add_sharing, shared_work

TABLE = tuple(
    Case(method=method, wandering=wandering, samples=samples, batches=batches, derived=derived)
    for wandering, samples, batches, derived in (
        (False, 1000, 1, False),
        (True, 1000, 1, False),
        (True, 4000, 1, False),
        (False, 1000, 5, False),
        (True, 1000, 5, False),
        (False, 1000, 1, True),
        (True, 4000, 5, True),
    )
    for method in METHODS
    if not (method == "ls" and (wandering or derived))
)
"""Least squares only where it is right: exact sensors, and disturbances without memory."""


def short(trials: int, seed: int) -> Tried:
    """Many short batches of the model ship."""
    found = many_short_batches(trials, seed=seed)
    return Tried(found.parameters, found.estimates - found.truth, found.stated, found.failed)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--method", choices=METHODS, nargs="*", default=METHODS)
    parser.add_argument("--samples", type=int, default=4000)
    parser.add_argument("--batches", type=int, default=1)
    parser.add_argument("--wandering", action="store_true")
    parser.add_argument("--derived", action="store_true")
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--seed", type=int, default=31)
    add_sharing(parser)
    chosen = parser.parse_args()
    with shared_work(chosen):
        if chosen.short:
            show("iv, twelve short batches", short(chosen.trials, chosen.seed))
            return
        if chosen.table:
            show_table(chosen.trials, chosen.seed, chosen.method)
            return
        for method in chosen.method:
            case = Case(
                method=method,
                wandering=chosen.wandering,
                samples=chosen.samples,
                batches=chosen.batches,
                derived=chosen.derived,
            )
            show(str(case), tried(case, chosen.trials, seed=chosen.seed))


def show_table(trials: int, seed: int, methods: Sequence[str]) -> None:
    """One row for each case of the table."""
    print("| method | current | samples | velocities | trials | without estimate | held | least | predicted / actual |")
    print("|---|---|---|---|---|---|---|---|---|")
    for case in (item for item in TABLE if item.method in methods):
        found = tried(case, trials, seed=seed)
        held = np.abs(found.errors) < 1.96 * found.std
        chance = held.mean(axis=1).std(ddof=1) / np.sqrt(len(held))
        ratio = np.sqrt((found.std**2).mean(axis=0)) / found.errors.std(axis=0, ddof=1)
        least = int(np.argmin(found.held))
        cells = (
            case.method,
            "wandering" if case.wandering else "white",
            f"{case.batches} x {case.samples // case.batches}",
            "derived" if case.derived else "measured",
            len(held),
            found.failed,
            f"{100 * held.mean():.1f} ± {100 * chance:.1f} %",
            f"{100 * found.held[least]:.0f} % ({found.names[least]})",
            f"{ratio.min():.2f} to {ratio.max():.2f}",
        )
        print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def show(title: str, found: Tried) -> None:
    """One table."""
    errors, std, covered = found.errors, found.std, found.held
    actual = errors.std(axis=0, ddof=1)
    centred = errors - errors.mean(axis=0)
    print(f"{title}, {len(errors)} trials, {found.failed} without an estimate")
    print(f"{'':12} {'covered':>16} {'predicted/actual':>17} {'bias/std':>9} {'kurtosis':>9}")
    for index, name in enumerate(found.names):
        share, chance = covered[index], np.sqrt(covered[index] * (1 - covered[index]) / len(errors))
        ratio = np.sqrt((std[:, index] ** 2).mean()) / actual[index]
        bias = errors[:, index].mean() / actual[index]
        kurtosis = (centred[:, index] ** 4).mean() / (centred[:, index] ** 2).mean() ** 2
        print(f"{name:12} {share:8.3f} ± {chance:.3f} {ratio:17.3f} {bias:+9.3f} {kurtosis:9.2f}")
    print(f"all together {covered.mean():.4f}, least {covered.min():.3f}, most {covered.max():.3f}")


if __name__ == "__main__":
    main()
