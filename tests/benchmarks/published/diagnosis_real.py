"""Diagnosis on the free-running trials of two tankers: what is found, and does it help on runs that nobody used?

`python tests/benchmarks/published/diagnosis_real.py --data FOLDER` reads the folders that `real_data` reads.
A model without any term of the wind is fitted to some runs by least squares and diagnosed on the same runs. Then runs
that were used for neither are predicted 30 s ahead, anew every 30 s from what is measured: by the model as fitted, by
one fitted in the same way with terms of the wind, where wind is found, and by the vessel file with all findings. What
a vessel file cannot hold, such as a roll mode, takes no part in that prediction.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from expdesign.assessment import EstimateOptions, assess
from expdesign.diagnosis import Diagnosis, diagnose
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.motion.simulation import simulate_from_measured
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.errors import InputError
from expdesign.estimation.regression import AIR
from expdesign.records import load_records
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import Vessel
from real_data_cases import POND, TANK, Case, vessel_of

AHEAD_S = 30.0
PACE_S = 0.5
"""Time between samples after averaging: the ships need seconds for anything they do."""
LONGEST_S = 300.0
"""Length that every run is cut to, to keep the study short."""
HELD_OUT: dict[str, dict[str, tuple[str, ...]]] = {
    TANK.folder: {"zigzag_20_10_p": ("zigzag_20_10_p",), "zigzag_30_05": ("zigzag_30_05",)},
    POND.folder: {
        "zig-zags": ("zigzag_31-Jul-2020_13_22", "zigzag_31-Jul-2020_13_57"),
        "random": ("random_06-Aug-2020_16_24_25_5",),
        "turn": ("turn_14-Oct-2020_14_08",),
    },
}
"""Folder -> name of a group of runs -> how the names of its files begin."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tried:
    """One ship's diagnosis and what it is worth on runs that were not used.

    Attributes:
        fitted: the model in use, without terms of the wind.
        found: its diagnosis.
        before, with_wind, after: group of runs -> (3,) root mean square error of u, v, r 30 s ahead: as fitted, fitted
            anew with terms of the wind (empty where wind is not found), and of the vessel file with all findings.
    """

    fitted: Vessel
    found: Diagnosis
    before: Mapping[str, Array]
    with_wind: Mapping[str, Array]
    after: Mapping[str, Array]


def averaged_over(batch: Batch, every: int, longest_s: float) -> Batch:
    """A batch with means over so many samples in place of single ones, cut to a length.

    Headings are continuous in a batch, so means are right for them too.
    """
    count = min(len(batch), int(longest_s / batch.sample_time_s)) // every

    def means(values: Array | None) -> Array | None:
        return None if values is None else values[: count * every].reshape(count, every, -1).mean(axis=1)

    inputs, velocity = means(batch.inputs), means(batch.velocity)
    assert inputs is not None  # a batch has both
    assert velocity is not None
    return Batch(
        name=batch.name,
        sample_time_s=batch.sample_time_s * every,
        input_names=batch.input_names,
        inputs=inputs,
        velocity=velocity,
        pose=means(batch.pose),
        wind=means(batch.wind),
        derived=batch.derived,
    )


def runs(case: Case, data: Path, beginnings: tuple[str, ...]) -> Record:
    """Runs of a case whose files begin so, averaged and cut.

    Raises:
        InputError: there are none.
    """
    files = [file for file in sorted((data / case.folder).glob("*.csv")) if file.stem.startswith(beginnings)]
    if not files:
        raise InputError(f"{data / case.folder} has no runs {', '.join(beginnings)}, expected measured CSV files")
    record = load_records(files, vessel_inputs=("n1", "rudder1"))
    every = round(PACE_S / case.sample_time_s)
    return Record(batches=tuple(averaged_over(batch, every, LONGEST_S) for batch in record.batches))


def fitted_vessel(case: Case, record: Record, *, wind: bool) -> Vessel:
    """The case's ship with or without terms of the wind, fitted by least squares."""
    ship = vessel_of(case)
    model = ship.model
    kept = [i for i, expression in enumerate(model.expressions) if wind or not set(AIR) & set(expression.signals)]
    zeros = np.zeros(len(kept))
    still = replace(
        model,
        terms=tuple(model.terms[i] for i in kept),
        parameters=zeros,
        parameter_std=zeros,
        sample_time_s=PACE_S,
    )
    ship = replace(ship, model=still, sample_time_s=PACE_S)
    return replace(
        ship,
        model=assess(ship, record, EstimateOptions(methods=("ls-air" if wind else "ls",), mean="none")).best.model,
    )


def error_ahead(vessel: Vessel, record: Record) -> Array:
    """(3,) root mean square error of u, v, r predicted 30 s ahead, anew every 30 s, over all samples."""
    ship = extended_model(vessel, record)
    windows = cut_windows(ship.model, record, longest_s=AHEAD_S)
    return np.asarray(np.sqrt(np.nanmean(simulate_from_measured(ship, windows).error[..., :3] ** 2, axis=(0, 1))))


def tried(case: Case, data: Path, *, seed: int = 0) -> Tried:
    """Fit, diagnose, and predict runs that were not used.

    Raises:
        InputError: runs are missing.
    """
    record = runs(case, data, case.used)
    fitted = fitted_vessel(case, record, wind=False)
    found = diagnose(fitted, record, seed=seed)
    groups = {name: runs(case, data, beginnings) for name, beginnings in HELD_OUT[case.folder].items()}

    def errors(vessel: Vessel) -> dict[str, Array]:
        return {name: error_ahead(vessel, group) for name, group in groups.items()}

    windy = any(item.cause == "wind" for item in found.findings)
    return Tried(
        fitted=fitted,
        found=found,
        before=errors(fitted),
        with_wind=errors(fitted_vessel(case, record, wind=True)) if windy else {},
        after=errors(found.extended),
    )


def told(case: Case, result: Tried) -> Iterator[str]:
    """Lines of text: the findings, then errors ahead."""
    yield f"{case.folder}: {result.found.verdict}"
    for item in result.found.findings:
        numbers = ", ".join(f"{one.name} {one.value:.4g} ({one.std:.2g})" for one in item.estimates)
        like = f"; or {', '.join(item.not_distinguishable_from)}" if item.not_distinguishable_from else ""
        yield f"  {item.cause:24} gain {item.gain:5.1f} points, p {item.p_value:.1e}: {numbers}{like}"
    yield f"  error {AHEAD_S:g} s ahead on runs not used: u, v [m/s], r [rad/s]"
    for name in result.before:
        for title, rows in (
            ("as fitted", result.before),
            ("with wind", result.with_wind),
            ("all findings", result.after),
        ):
            if name in rows:
                yield f"  {name:18} {title:13}{''.join(f'{value:9.4f}' for value in rows[name])}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the study for the data in a folder."""
    parser = argparse.ArgumentParser(prog="python tests/benchmarks/published/diagnosis_real.py", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with the folders of the two ships")
    parser.add_argument("--ship", choices=[case.folder for case in (POND, TANK)], help="only this one")
    parser.add_argument("--seed", type=int, default=0, help="of all chance")
    chosen = parser.parse_args(arguments)
    for case in (POND, TANK):
        if chosen.ship in (None, case.folder):
            for line in told(case, tried(case, chosen.data, seed=chosen.seed)):
                sys.stdout.write(f"{line}\n")
                sys.stdout.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
