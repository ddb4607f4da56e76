"""How often 95 % intervals hold the truth, parameter by parameter, and why not more or less often.

``python tests/benchmarks/estimation_coverage.py [--trials 1000] [--case iv-augmented]``, shared among
processes or workers by `--jobs` or `--scheduler`: every trial has its own input
(but for short batches), sensor noise, which enters through the regressors, and current. Cases:

- iv, iv-augmented: one batch of `--samples` samples, white current, for iv-augmented around a mean;
- wandering: the same as iv-augmented with a current of 100 s correlation;
- short: `iv` from twelve batches of 300 samples, the optimised runs of the model ship, white current.

Columns: share of intervals that hold the truth, with its Monte Carlo error; predicted over actual standard deviation;
bias over actual standard deviation; kurtosis of the error (3 for a normal one).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from estimation_case import CALM_CURRENT, STEADY_CURRENT, WANDERING_CURRENT, errors_and_std, many_short_batches
from shared_work import add_sharing, shared_work

LONG = {
    "iv": ("iv", CALM_CURRENT),
    "iv-augmented": ("iv-augmented", STEADY_CURRENT),
    "wandering": ("iv-augmented", WANDERING_CURRENT),
}


def tried(case: str, trials: int, samples: int, seed: int) -> tuple[tuple[str, ...], np.ndarray, np.ndarray, int]:
    """Names, errors (t, p), stated standard deviations (t, p) and trials without a usable estimate."""
    if case in LONG:
        method, weather = LONG[case]
        return errors_and_std(trials, samples, method, weather, seed=seed)
    found = many_short_batches(trials, seed=seed)
    return found.parameters, found.estimates - found.truth, found.stated, found.failed


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--samples", type=int, default=4000)
    parser.add_argument("--case", choices=(*LONG, "short"), default="iv-augmented")
    parser.add_argument("--seed", type=int, default=31)
    add_sharing(parser)
    chosen = parser.parse_args()
    with shared_work(chosen):
        names, errors, std, failed = tried(chosen.case, chosen.trials, chosen.samples, chosen.seed)
    actual = errors.std(axis=0, ddof=1)
    covered = (np.abs(errors) < 1.96 * std).mean(axis=0)
    centred = errors - errors.mean(axis=0)
    print(f"{chosen.case}, {len(errors)} trials, {failed} without a usable estimate")
    print(f"{'':12} {'covered':>16} {'predicted/actual':>17} {'bias/std':>9} {'kurtosis':>9}")
    for index, name in enumerate(names):
        share, chance = covered[index], np.sqrt(covered[index] * (1 - covered[index]) / len(errors))
        ratio = np.sqrt((std[:, index] ** 2).mean()) / actual[index]
        bias = errors[:, index].mean() / actual[index]
        kurtosis = (centred[:, index] ** 4).mean() / (centred[:, index] ** 2).mean() ** 2
        print(f"{name:12} {share:8.3f} ± {chance:.3f} {ratio:17.3f} {bias:+9.3f} {kurtosis:9.2f}")
    print(f"all together {covered.mean():.4f}, least {covered.min():.3f}, most {covered.max():.3f}")


if __name__ == "__main__":
    main()
