"""Our numbers beside published ones: `published/reference.py [--runs N] [--sets N] [--part NAME]`.

The published sizes are 500 runs of 5000 samples (1000 of 200 for the example); fewer runs only widen the chance error,
which the table counts in. Scores are differences in standard errors of the difference. The 3-DOF study is repeated with
several inputs, `--sets`, since the published one is not known; a verdict is that of most of them. Every table is
printed as soon as it is there; Ctrl-C ends the rest.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress as Bar
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1]))
import fir_example
import manoeuvring
import scalar_system
from manoeuvring import EQUATIONS, Case, Outcome, Progress
from published_tables import TABLES
from shared_work import add_sharing, shared_work

SAMPLES = 5000
OFFSETS = (0.0, 1.0, 2.5, 5.0, 10.0)


@dataclass(frozen=True, kw_only=True)
class Size:
    """How much is simulated.

    Attributes:
        runs: Monte Carlo runs.
        sets: inputs of the 3-DOF study, each with so many runs.
        seed: of all chance.
    """

    runs: int
    sets: int
    seed: int


def scalar_tables(size: Size, progress: Progress) -> Iterator[Table]:
    """Figures 4.1-4.11, 7.3 and 7.4."""
    rng = np.random.default_rng(size.seed)
    for index, case in enumerate(scalar_system.CASES):
        progress("scalar system", index / len(scalar_system.CASES))
        title = f"Scalar system, {case.name}: normalised errors, {size.runs} runs"
        table = _table(title, "estimate", "ours", "published", "mean", "spread")
        for row in scalar_system.run_case(case, runs=size.runs, samples=SAMPLES, rng=rng):
            ours, theirs = _pair(row.mean, row.std), _pair(row.published.mean, row.published.std)
            table.add_row(row.name, ours, theirs, f"{row.mean_score:+.1f}", f"{row.std_score:+.1f}")
        yield table


def fir_tables(size: Size, progress: Progress) -> Iterator[Table]:
    """Example 7.1: variance against what theory says (the source has a figure, no numbers)."""
    rng = np.random.default_rng(size.seed)
    table = _table("Example 7.1: variance x 1e4", "offset", "complete", "theory", "batchwise", "theory")
    for index, offset in enumerate(OFFSETS):
        progress("example 7.1", index / len(OFFSETS))
        found = fir_example.errors(offset, runs=20 * size.runs, rng=rng)  # variances need many; they are cheap
        cells = [
            f"{1e4 * value:.3f}"
            for mean in ("complete", "batch")
            for value in (found[mean].var(ddof=1), fir_example.predicted_variance(offset, mean))
        ]
        table.add_row(f"{offset:g}", *cells)
    yield table


def manoeuvring_tables(size: Size, progress: Progress) -> Iterator[Table]:
    """Tables 6.2-6.7, one per wind and estimator, then who is consistent."""
    verdicts = _table(
        f"Sets of {size.runs} runs, of {size.sets}, in which an estimator is consistent",
        "case",
        "estimator",
        *EQUATIONS.values(),
        "published",
        "agree",
    )
    for case in manoeuvring.CASES:
        sets = _sets(case, size, progress)
        for name, outcomes in sets.items():
            yield _outcome_table(manoeuvring.joined(outcomes))
            verdicts.add_row(case.name, name, *_verdict_cells(case.name, name, outcomes))
    yield verdicts


def _sets(case: Case, size: Size, progress: Progress) -> dict[str, list[Outcome]]:
    sets: dict[str, list[Outcome]] = {name: [] for name in manoeuvring.ESTIMATORS}
    for number in range(size.sets):

        def within(what: str, share: float, number: int = number) -> None:
            progress(f"{what}, input {number + 1} of {size.sets}", share)

        rng = np.random.default_rng([size.seed, number])
        for outcome in manoeuvring.run_case(case, runs=size.runs, rng=rng, progress=within):
            sets[outcome.estimator].append(outcome)
    return sets


def _outcome_table(outcome: Outcome) -> Table:
    published = TABLES[outcome.case, outcome.estimator]
    left = f", {outcome.unsettled} more without an estimate" if outcome.unsettled else ""
    table = _table(
        f"3-DOF ship, {outcome.case}, {outcome.estimator}: normalised errors, {outcome.settled} runs{left}",
        "parameter",
        "ours",
        "predicted spread",
        "published",
    )
    predicted = np.median(outcome.std, axis=0) if outcome.settled else np.full(len(outcome.parameters), np.nan)
    for name, mean, spread, std in zip(outcome.parameters, outcome.mean, outcome.spread, predicted, strict=True):
        table.add_row(name, _pair(mean, spread), f"{std:.4f}", _pair(*published[name]))
    return table


def _verdict_cells(case: str, estimator: str, outcomes: list[Outcome]) -> list[str]:
    counts = manoeuvring.consistent_sets(outcomes)
    ours = {letter for letter, count in counts.items() if 2 * count > len(outcomes)}
    theirs = {letter for letter in EQUATIONS if published_consistent(case, estimator, letter)}
    named = ", ".join(EQUATIONS[letter] for letter in EQUATIONS if letter in theirs) or "none"
    return [*(f"{count}/{len(outcomes)}" for count in counts.values()), named, "yes" if ours == theirs else "NO"]


def published_consistent(case: str, estimator: str, letter: str) -> bool:
    """Whether zero lies within mean plus/minus one standard deviation in the published table of an equation."""
    rows = TABLES[case, estimator]
    chosen = [pair for name, pair in rows.items() if manoeuvring.equation_of(name) == letter]
    return all(abs(mean) <= std for mean, std in chosen)


PARTS: dict[str, Callable[[Size, Progress], Iterator[Table]]] = {
    "scalar": scalar_tables,
    "fir": fir_tables,
    "manoeuvring": manoeuvring_tables,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables; progress goes to stderr. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python tests/benchmarks/published/reference.py", description=__doc__)
    parser.add_argument("--runs", type=int, default=50, help="Monte Carlo runs (published: 500)")
    parser.add_argument("--sets", type=int, default=5, help="inputs of the 3-DOF study")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--part", choices=tuple(PARTS), action="append", help="default: all")
    add_sharing(parser)
    chosen = parser.parse_args(arguments)
    size = Size(runs=chosen.runs, sets=chosen.sets, seed=chosen.seed)
    console = Console()
    with shared_work(chosen), Bar(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        try:
            for name in chosen.part or PARTS:
                for table in PARTS[name](size, lambda what, share: bar.update(task, description=what, completed=share)):
                    console.print(table)
        except KeyboardInterrupt:
            bar.console.print("interrupted; the tables above are complete")
            return 130
    return 0


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title)
    for column in columns:
        table.add_column(column)
    return table


def _pair(mean: float, std: float) -> str:
    return f"{mean:+.4f} ± {std:.4f}"


if __name__ == "__main__":
    sys.exit(main())
