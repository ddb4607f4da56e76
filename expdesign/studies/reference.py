"""Our numbers beside published ones: `python -m expdesign.studies.reference [--runs N] [--seed N] [--part NAME]`.

The published sizes are 500 runs of 5000 samples (1000 of 200 for the example); fewer runs only widen the chance error,
which the table counts in. Scores are differences in standard errors of the difference.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from expdesign.studies import fir_example, manoeuvring, scalar_system
from expdesign.studies.published_tables import TABLES

SAMPLES = 5000


def scalar_table(runs: int, rng: np.random.Generator) -> Table:
    """Figures 4.1-4.11, 7.3 and 7.4."""
    table = _table("Scalar system: normalised errors", "case", "estimate", "ours", "published", "mean", "spread")
    for case in scalar_system.CASES:
        for row in scalar_system.run_case(case, runs=runs, samples=SAMPLES, rng=rng):
            table.add_row(
                row.case,
                row.name,
                _pair(row.mean, row.std),
                _pair(row.published.mean, row.published.std),
                f"{row.mean_score:+.1f}",
                f"{row.std_score:+.1f}",
            )
    return table


def fir_table(runs: int, rng: np.random.Generator) -> Table:
    """Example 7.1: variance against what theory says (the source has a figure, no numbers)."""
    table = _table("Example 7.1: variance x 1e4", "offset", "complete", "theory", "batchwise", "theory")
    for offset in (0.0, 1.0, 2.5, 5.0, 10.0):
        found = fir_example.errors(offset, runs=20 * runs, rng=rng)  # variances need many; they are cheap
        cells = [
            f"{1e4 * value:.3f}"
            for mean in ("complete", "batch")
            for value in (found[mean].var(ddof=1), fir_example.predicted_variance(offset, mean))
        ]
        table.add_row(f"{offset:g}", *cells)
    return table


def manoeuvring_table(runs: int, rng: np.random.Generator) -> Table:
    """Tables 6.2-6.7."""
    table = _table(
        "3-DOF ship: normalised errors", "case", "estimator", "parameter", "ours", "predicted std", "published"
    )
    for case in manoeuvring.CASES:
        for outcome in manoeuvring.run_case(case, runs=runs, rng=rng):
            published = TABLES.get((case.name, outcome.estimator), {})
            verdict = ", ".join(
                f"{name} {'consistent' if outcome.consistent(letter) else 'biased'}"
                for name, letter in (("surge", "X"), ("sway", "Y"), ("yaw", "N"))
            )
            table.add_row(case.name, outcome.estimator, verdict, "", "", "", style="bold")
            rows = zip(outcome.parameters, outcome.mean, outcome.spread, np.median(outcome.std, axis=0), strict=True)
            for name, mean, spread, predicted in rows:
                theirs = _pair(*published[name]) if name in published else ""
                table.add_row("", "", name, _pair(mean, spread), f"{predicted:.4f}", theirs)
    return table


PARTS: dict[str, Callable[[int, np.random.Generator], Table]] = {
    "scalar": scalar_table,
    "fir": fir_table,
    "manoeuvring": manoeuvring_table,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="python -m expdesign.studies.reference", description=__doc__)
    parser.add_argument("--runs", type=int, default=50, help="Monte Carlo runs (published: 500)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--part", choices=tuple(PARTS), action="append", help="default: all")
    chosen = parser.parse_args(arguments)
    console = Console()
    for name in chosen.part or PARTS:
        console.print(PARTS[name](chosen.runs, np.random.default_rng(chosen.seed)))


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title)
    for column in columns:
        table.add_column(column)
    return table


def _pair(mean: float, std: float) -> str:
    return f"{mean:+.4f} ± {std:.4f}"


if __name__ == "__main__":
    main()
