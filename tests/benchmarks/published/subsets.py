"""Estimates from all subsets of a tanker's runs: mean fit, spread, and how often one estimator beats another.

`python tests/benchmarks/published/subsets.py --data FOLDER` reads `FOLDER/kvlcc2-hsva-7m` and `FOLDER/esso-osaka-3m`; a
folder that is not there is left out. Each subset takes so many runs of each kind; its models simulate the test runs,
stretch by stretch from the measured velocity, those with wind terms in the measured wind. Instruments are simulated
once, from the least-squares estimate, without mean subtraction and with a block for each run. A subset is unstable
where the simulation of a stretch diverges; it has no fit and loses every comparison.

Sign tests count the subsets in which an estimator's mean fit is the higher one; subsets share runs, so the chance given
for as many wins, of a fair coin, is too small.

Source: F. Ljungberg, doctoral thesis, Linköping University, 6.2.2, (6.5)-(6.11), tables 6.8-6.14, for another ship.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

sys.path.insert(0, str(Path(__file__).parents[1]))
from expdesign.assessment.misfit import TEST, check_run
from expdesign.errors import NoAnswer
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate, method_named
from expdesign.estimation.replay import Integration
from expdesign.estimation.solve import Weighting
from expdesign.processes import in_order
from expdesign.records import load_records
from expdesign.signals import Batch, Record
from expdesign.simulation.run import SUBSTEPS
from expdesign.values import Array
from real_data_cases import POND, TANK, Case, vessel_of
from shared_work import add_sharing, shared_work

CONTINUOUS = Integration("rk4", SUBSTEPS)


@dataclass(frozen=True, kw_only=True)
class Study:
    """How subsets of a ship's runs are made.

    Attributes:
        case: the ship.
        kinds: starts of file names, and how many runs of each kind a subset has.
        tests: starts of the names of test runs.
        methods: compared, the first with all others.
        stretch_s: simulated from one measured velocity.
        told: parameters whose mean and spread are told.
    """

    case: Case
    kinds: tuple[tuple[tuple[str, ...], int], ...]
    tests: tuple[str, ...]
    methods: tuple[str, ...]
    stretch_s: float
    told: tuple[str, ...]


STUDIES = (
    Study(
        case=TANK,
        kinds=((("zigzag_10_05", "zigzag_15_05", "zigzag_25_05", "zigzag_30_05", "zigzag_10_01", "zigzag_15_01"), 3),),
        tests=("zigzag_20_10_p", "zigzag_10_10_p"),
        methods=("ls", "iv"),
        stretch_s=60.0,
        told=("X_abs_u_u", "Y_v", "N_r"),
    ),
    Study(
        case=POND,
        kinds=((POND.used[:3], 2), (POND.used[4:7], 2)),
        tests=POND.tests,
        methods=("ls", "ls-no-current", "ls-air", "iv", "iv-no-current", "iv-air"),
        stretch_s=30.0,
        told=("X_u", "Y_v", "N_r", "W_abs_u_u", "W_abs_v_v", "W_uv"),
    ),
)


@dataclass(frozen=True, eq=False)
class Found:
    """A method's models of all subsets.

    Attributes:
        fits: (s, n) mean fit of the test stretches [%], minus infinity where a simulation diverges.
        values: of each subset, by name; empty without an estimate.
    """

    fits: Array
    values: tuple[Mapping[str, float], ...]


def subsets(study: Study, names: Sequence[str]) -> list[tuple[str, ...]]:
    """Names of the runs of every subset."""
    kinds = [
        list(combinations([name for name in names if name.startswith(starts)], count)) for starts, count in study.kinds
    ]
    return [tuple(name for part in parts for name in part) for parts in product(*kinds)]


def compared(study: Study, runs: Mapping[str, Record]) -> dict[str, Found]:
    """Every method on every subset of runs by name."""
    chosen = subsets(study, sorted(runs))
    stretches = [
        part
        for name, record in runs.items()
        if name.startswith(study.tests)
        for batch in record.batches
        for part in _stretches(batch, study.stretch_s)
    ]
    tasks = [(method, subset) for method in study.methods for subset in chosen]
    results = list(in_order(_judged, (study, dict(runs), stretches), tasks))
    return {
        method: Found(np.array([fit for fit, _ in own]), tuple(values for _, values in own))
        for number, method in enumerate(study.methods)
        for own in (results[number * len(chosen) : (number + 1) * len(chosen)],)
    }


def _stretches(batch: Batch, length_s: float) -> Iterator[Batch]:
    length = round(length_s / batch.sample_time_s)
    for first in range(0, len(batch) - length + 1, length):
        yield batch.cut(slice(first, first + length))


def _judged(
    study: Study, runs: dict[str, Record], stretches: list[Batch], method: str, subset: tuple[str, ...]
) -> tuple[Array, dict[str, float]]:
    """(n,) mean fit, and the parameters."""
    vessel = vessel_of(study.case)
    settings = Settings(
        weighting=Weighting(mean="none", blocks="batch", covariance="hc0"),
        start="ls",
        most_refinements=0,
        integration=CONTINUOUS,
        quadrature="trapezoid",
    )
    record = Record(batches=tuple(batch for name in subset for batch in runs[name].batches))
    try:
        found = estimate(record, vessel.model, method=method, settings=settings)
    except NoAnswer:
        return np.full(len(vessel.model.outputs), -np.inf), {}
    model, wind = found.model(vessel.model), method_named(method).weather.wind
    fits = np.array(
        [check_run(model, part, use=TEST, wind=wind, integration=CONTINUOUS).fit_percent for part in stretches]
    )
    return np.where(np.isnan(fits).any(axis=0), -np.inf, fits.mean(axis=0)), found.assignments


def table(study: Study, found: Mapping[str, Found]) -> Iterator[str]:
    """Lines of text."""
    outputs = ("surge", "sway", "yaw rate")
    yield f"| {study.case.folder} | {' | '.join(f'fit {name} [%] | wins' for name in outputs)} | unstable |"
    yield "|---" * (2 + 2 * len(outputs)) + "|"
    first = found[study.methods[0]].fits
    for method, item in found.items():
        stable = item.fits[np.isfinite(item.fits).all(axis=1)]
        cells = []
        for column in range(item.fits.shape[1]):
            pair = f"{stable[:, column].mean():.1f} ± {stable[:, column].std(ddof=1):.1f}" if len(stable) > 1 else "-"
            wins, count = int((item.fits[:, column] > first[:, column]).sum()), len(first)
            chance = binomtest(wins, count).pvalue
            cells += [pair, "" if method == study.methods[0] else f"{wins} of {count} ({chance:.2g})"]
        yield f"| {method} | {' | '.join(cells)} | {len(first) - len(stable)} of {len(first)} |"
    yield f"\n| {study.case.folder} | {' | '.join(study.told)} |"
    yield "|---" * (1 + len(study.told)) + "|"
    for method, item in found.items():
        cells = []
        for name in study.told:
            values = np.array([own[name] for own in item.values if own])
            cells.append(f"{values.mean():.3g} ± {values.std(ddof=1):.2g}" if len(values) > 1 and values.any() else "-")
        yield f"| {method} | {' | '.join(cells)} |"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--data", type=Path, required=True)
    add_sharing(parser)
    chosen = parser.parse_args()
    with shared_work(chosen):
        for study in STUDIES:
            files = sorted((chosen.data / study.case.folder).glob("*.csv"))
            if not files:
                print(f"{study.case.folder}: no files in {chosen.data}, left out")
                continue
            wanted = (*study.tests, *(start for starts, _ in study.kinds for start in starts))
            inputs = vessel_of(study.case).model.inputs
            runs = {f.stem: load_records(f, vessel_inputs=inputs) for f in files if f.stem.startswith(wanted)}
            print("\n".join(table(study, compared(study, runs))), flush=True)


if __name__ == "__main__":
    main()
