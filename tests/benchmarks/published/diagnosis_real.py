"""Diagnosis on the free-running trials of two tankers: what is found, and does it help on runs that nobody used?

`python tests/benchmarks/published/diagnosis_real.py --data FOLDER` reads the folders that `real_data` reads.
A model without any term of the wind is fitted to some runs by least squares and diagnosed on the same runs. Then runs
that were used for neither are predicted 30 s ahead, anew every 30 s from what is measured: by the model as fitted, by
one fitted in the same way with terms of the wind, where wind is found, and by the vessel file with all findings. What
a vessel file cannot hold, such as a roll mode, takes no part in that prediction.

`--study triples` does so for drawn triples of the pond's runs (`--trials`, `--seed`), and predicts all other runs.
`--study faults` injects faults into the records of drawn triples of each ship's runs, or into the model that was fitted
to them, and asks for the right name first. On the pond that model has terms of the wind and is fitted by output error:
least squares alone leave up to three times its error in yaw, and the parameters are then rightly named first. Both say
what it took (processor seconds), in Markdown.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from diagnosis_real_faults import AHEAD_S, FAULTS, error_ahead
from expdesign.assessment import EstimateOptions, assess
from expdesign.diagnosis import Diagnosis, diagnose
from expdesign.diagnosis.accuracy import accuracy
from expdesign.diagnosis.model import resisting
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.errors import InputError, NotInformative
from expdesign.estimation.regression import AIR
from expdesign.processes import as_finished
from expdesign.records import load_records
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import Vessel
from real_data_cases import POND, TANK, Case, vessel_of
from shared_work import add_sharing, shared_work

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
WINDY = ("random", "turn_14", "zigzag")
"""Runs of the pond under way in wind; berthing is slow and short, cut turns are parts of others."""
TRIPLE, VISIBLE = 3, 0.01
"""Runs of a trial; reduction of an error below which a finding improves nothing."""


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

    What is measured is averaged around an instant, inputs from there to the next one. Headings are continuous in a
    batch, so means are right for them too.
    """
    count = min(len(batch), int(longest_s / batch.sample_time_s)) // every - 1

    def means(values: Array | None, begin: int = every // 2) -> Array | None:
        rows = slice(begin, begin + count * every)
        return None if values is None else values[rows].reshape(count, every, -1).mean(axis=1)

    inputs, velocity = means(batch.inputs, every), means(batch.velocity)
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
    """The case's ship with or without terms of the wind, fitted by least squares.

    Where the model runs away on these data, damping that grows fastest with speed and pushes is taken out, and the rest
    fitted anew: nobody has a model in use that cannot be simulated. Where the data do not tell parameters apart, the
    first of them is held, as `estimate` advises.

    Raises:
        NotInformative: the data tell nothing of parameters of which none is left to hold.
    """
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
    methods, held = ("ls-air" if wind else "ls",), list[str]()
    fastest = max(float(np.nanmax(np.abs(batch.velocity))) for batch in record.batches)
    while True:
        options = EstimateOptions(methods=methods, mean="none", fixed=tuple(held))
        try:
            model = assess(ship, record, options).best.model
        except NotInformative as error:
            if not error.parameters:
                raise
            held.append(error.parameters[0])
            continue
        values = dict(zip(model.names, model.parameters.tolist(), strict=True))
        pushing = [name for name, sign in resisting(model).items() if values[name] * sign < 0]
        if not pushing or error_ahead(replace(ship, model=model), record).max() < fastest:
            return replace(ship, model=model)
        held += pushing


def best_vessel(case: Case, record: Record) -> Vessel:
    """The model that faults are hidden from: of the tank by least squares, of the pond by output error after them."""
    fitted = fitted_vessel(case, record, wind=case.folder == POND.folder)
    if case.folder != POND.folder:
        return fitted
    model = fitted.model
    held = tuple(name for name, value in zip(model.names, model.parameters.tolist(), strict=True) if value == 0.0)
    options = EstimateOptions(methods=("oe-air",), mean="none", horizon_s=AHEAD_S, fixed=held)
    return replace(fitted, model=assess(fitted, record, options).best.model)


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


def drawn_names(case: Case, data: Path, kinds: tuple[str, ...], rng: np.random.Generator) -> tuple[str, ...]:
    """Three runs whose names begin so."""
    names = [file.stem for file in sorted((data / case.folder).glob("*.csv")) if file.stem.startswith(kinds)]
    return tuple(sorted(rng.choice(names, TRIPLE, replace=False).tolist()))


def row_of(found: Diagnosis, seconds: float) -> dict[str, object]:
    """What is told of a diagnosis, and its processor time."""
    return {
        "seconds": seconds,
        "findings": [
            (item.cause, item.gain, max((one.share for one in item.error_reductions), default=0.0))
            for item in found.findings
        ],
        "verdict": found.verdict,
    }


def timed(vessel: Vessel, record: Record, seed: int) -> tuple[Diagnosis, float]:
    """A diagnosis, and its processor time."""
    begin = time.process_time()
    found = diagnose(vessel, record, seed=seed)
    return found, time.process_time() - begin


def triple(data: Path, number: int, seed: int) -> dict[str, object]:
    """Three runs of the pond: is wind named first, and how do the others' errors ahead change by what is found?"""
    names = drawn_names(POND, data, WINDY, np.random.default_rng([seed, number]))
    record = runs(POND, data, names)
    try:
        fitted = fitted_vessel(POND, record, wind=False)
    except NotInformative as error:
        return {
            "number": number, "runs": names, "seconds": 0.0, "findings": [], "verdict": f"no model: {error}",
            "ratio": None, "wind": None,
        }  # fmt: skip
    found, seconds = timed(fitted, record, number)
    others = tuple(
        file.stem for file in sorted((data / POND.folder).glob("*.csv"))
        if file.stem.startswith(WINDY) and file.stem not in names
    )  # fmt: skip
    unused = runs(POND, data, others)
    before, after = (error_ahead(vessel, unused) for vessel in (fitted, found.extended))
    with_wind = error_ahead(fitted_vessel(POND, record, wind=True), unused)
    return row_of(found, seconds) | {
        "number": number, "runs": names, "ratio": (after / before).tolist(), "wind": (with_wind / before).tolist(),
    }  # fmt: skip


def fault(data: Path, case: Case, place: int, number: int, seed: int) -> dict[str, object]:
    """Three runs of a ship with a fault: is it named first?"""
    rng = np.random.default_rng([seed, number])
    names = drawn_names(case, data, WINDY if case.folder == POND.folder else ("zigzag",), rng)
    record = runs(case, data, names)
    known = best_vessel(case, record)
    trial = FAULTS[place].inject(known, record, rng)
    row = {"number": number, "runs": names, "fault": FAULTS[place].name}
    if trial is None:
        return row | {"seconds": 0.0, "findings": [], "verdict": "no such fault", "right": None}
    vessel, faulty, right = trial
    found, seconds = timed(vessel, faulty, number)
    lost = float((accuracy(extended_model(known, record), record).fit - found.before.fit).mean())
    return row | row_of(found, seconds) | {"right": bool(found.findings) and right(found.findings[0]), "lost": lost}


def told_triples(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """A row per triple, and the counts."""
    yield "| triple | runs | found | error ahead after / before: u, v, r | fitted with wind / before | processor |"
    yield "|---|---|---|---|---|---|"
    for row in rows:
        names = ", ".join(short(name) for name in row["runs"])
        if row["ratio"] is None:
            yield f"| {row['number']} | {names} | {row['verdict']} | | | |"
            continue
        ratios = ["{:.2f} {:.2f} {:.2f}".format(*row[key]) for key in ("ratio", "wind")]
        yield f"| {row['number']} | {names} | {found_words(row)} | {' | '.join(ratios)} | {row['seconds']:.1f} s |"
    fitted = [row for row in rows if row["ratio"] is not None]
    windy = [row for row in fitted if row["findings"][:1] != [] and row["findings"][0][0] == "wind"]
    yield f"Wind first in {len(windy)} of {len(rows)}, {len(rows) - len(fitted)} of which are no model."
    if fitted:
        sway = np.array([row["ratio"][1] for row in fitted])
        yield (
            f"Other causes beside it in {sum(len(row['findings']) > 1 for row in windy)}; sway error ahead less in "
            f"{(sway < 1).sum()}, median ratio {np.median(sway):.2f}; {seconds_words(fitted)}."
        )


def told_faults(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """A row per fault, and what was named wrongly."""
    yield "| fault | named first | points lost | others beside it | without visible gain | named instead | processor |"
    yield "|---|---|---|---|---|---|---|"
    for name in dict.fromkeys(row["fault"] for row in rows):
        some = [row for row in rows if row["fault"] == name and row["right"] is not None]
        if not some:
            continue
        beside = sum(len(row["findings"]) > bool(row["right"]) for row in some)
        small = sum(any(gain < VISIBLE for *_, gain in row["findings"]) for row in some)
        instead = "; ".join(f"{row['number']}: {found_words(row)}" for row in some if not row["right"])
        count = f"{sum(row['right'] for row in some)} of {len(some)}"
        lost = ", ".join(f"{row['lost']:.0f}" for row in some)
        yield f"| {name} | {count} | {lost} | {beside} | {small} | {instead} | {seconds_words(some)} |"


def found_words(row: dict[str, Any]) -> str:
    """Causes with their gains in points."""
    return ", ".join(f"{cause} {gain:+.1f}" for cause, gain, _ in row["findings"]) or "nothing"


def seconds_words(rows: Sequence[dict[str, Any]]) -> str:
    """Median and largest processor time."""
    times = [row["seconds"] for row in rows]
    return f"median {np.median(times):.1f} s, largest {max(times):.1f} s"


def short(name: str) -> str:
    """A run's name without date."""
    kind, *_, rest = name.partition("_")
    return f"{kind} {rest.split('_', 1)[-1]}"


def counted(chosen: argparse.Namespace) -> Iterator[str]:
    """The studies that count."""
    with shared_work(chosen):
        if chosen.study == "triples":
            tasks: Iterator[tuple[Any, ...]] = ((number, chosen.seed) for number in range(chosen.first, chosen.trials))
            work = as_finished(triple, (chosen.data,), tasks)
        else:
            places = [at for at, item in enumerate(FAULTS) if chosen.fault in (None, item.name)]
            case = POND if chosen.ship == POND.folder else TANK
            tasks = ((case, at, number, chosen.seed) for number in range(chosen.first, chosen.trials) for at in places)
            work = as_finished(fault, (chosen.data,), tasks)
        rows = []
        for row in work:
            rows.append(row)
            if chosen.log:
                with chosen.log.open("a") as file:
                    file.write(json.dumps(row) + "\n")
    order = {item.name: at for at, item in enumerate(FAULTS)}
    rows.sort(key=lambda row: (order.get(row.get("fault", ""), 0), row["number"]))
    yield from told_triples(rows) if chosen.study == "triples" else told_faults(rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the study for the data in a folder."""
    parser = argparse.ArgumentParser(prog="python tests/benchmarks/published/diagnosis_real.py", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with the folders of the two ships")
    parser.add_argument(
        "--ship", choices=[case.folder for case in (POND, TANK)], help="only this one; of --study faults the tank's"
    )
    parser.add_argument("--seed", type=int, default=0, help="of all chance")
    parser.add_argument("--study", choices=("groups", "triples", "faults"), default="groups")
    parser.add_argument("--trials", type=int, default=20, help="triples of runs, counted from 0")
    parser.add_argument("--first", type=int, default=0, help="number of the first triple")
    parser.add_argument("--fault", choices=[item.name for item in FAULTS], help="only this one")
    parser.add_argument("--log", type=Path, help="file to add a line of JSON for each trial to")
    add_sharing(parser)
    chosen = parser.parse_args(arguments)
    if not all((chosen.data / case.folder).is_dir() for case in (POND, TANK)):
        sys.stdout.write(f"{chosen.data} lacks {POND.folder} or {TANK.folder}: nothing is measured\n")
        return 0
    lines = counted(chosen) if chosen.study != "groups" else (
        line
        for case in (POND, TANK)
        if chosen.ship in (None, case.folder)
        for line in told(case, tried(case, chosen.data, seed=chosen.seed))
    )  # fmt: skip
    for line in lines:
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
