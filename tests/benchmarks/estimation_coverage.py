"""How often 95 % intervals hold the truth, parameter by parameter, and why not more or less often.

``python tests/benchmarks/estimation_coverage.py [--trials 1000] [--samples 4000] [--method iv-augmented]``: every trial
has its own input, sensor noise (which enters through the regressors) and white current. Columns: share of intervals
that hold the truth, with its Monte Carlo error; predicted over actual standard deviation; bias over actual standard
deviation; kurtosis of the error (3 for a normal one).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from estimation_case import CALM_CURRENT, STEADY_CURRENT, errors_and_std

WEATHERS = {"iv": CALM_CURRENT, "iv-augmented": STEADY_CURRENT}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--samples", type=int, default=4000)
    parser.add_argument("--method", choices=tuple(WEATHERS), default="iv-augmented")
    parser.add_argument("--seed", type=int, default=31)
    chosen = parser.parse_args()
    names, errors, std, failed = errors_and_std(
        chosen.trials, chosen.samples, chosen.method, WEATHERS[chosen.method], seed=chosen.seed
    )
    actual = errors.std(axis=0, ddof=1)
    covered = (np.abs(errors) < 1.96 * std).mean(axis=0)
    centred = errors - errors.mean(axis=0)
    print(f"{chosen.method}, {len(errors)} trials of {chosen.samples} samples, {failed} without a usable estimate")
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
