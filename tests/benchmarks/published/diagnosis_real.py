"""Diagnosis on the free-running trials of two tankers: what is found, and does it help on runs that nobody used?

`python tests/benchmarks/published/diagnosis_real.py --data FOLDER` reads the folders that `real_data` reads.
A model without any term of the wind is fitted to some runs by least squares and diagnosed on the same runs. Then runs
that were used for neither are predicted 30 s ahead, anew every 30 s from what is measured: by the model as fitted, by
one fitted in the same way with terms of the wind, where wind is found, and by the vessel file with all findings. What
a vessel file cannot hold, such as a roll mode, takes no part in that prediction.

`--study triples` does so for drawn triples of the pond's runs (`--trials`, `--seed`), and predicts all other runs.
`--study faults` fits a model to drawn runs of every ship, injects faults into the records of others, or into the model,
and asks for the right name first; what is found on untouched records must improve runs that nobody used. On the pond
the model has terms of the wind and is fitted by output error: least squares alone leave up to three times its error in
yaw. Oracles that know the fault say whether the records show it. `--log FILE` keeps a line of JSON for each trial, of
this version or of another (copies of these four files in its folder), and `--table FILE ...` compares such files. Both
studies say what they took (processor seconds), in Markdown.
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
sys.path.insert(0, str(Path(__file__).parents[2]))
from diagnosis_real_faults import (
    AHEAD_S,
    FAULTS,
    OF_MODEL,
    answer,
    current_of,
    error_ahead,
    kinematics_see,
    of_instruments,
    of_model,
    oracle,
    slew_times,
)
from diagnosis_real_hulls import HULLS, WINDY, averaged, fitted_vessel, runs, trial_of
from diagnosis_real_table import found_words, read_log, seconds_words, sorted_rows, told_faults
from expdesign.diagnosis import Diagnosis, diagnose
from expdesign.errors import NoAnswer, NotInformative
from expdesign.processes import as_finished
from expdesign.signals import Record
from expdesign.values import Array
from expdesign.vessel import Vessel
from real_data_cases import POND, TANK, Case
from shared_work import add_sharing, shared_work

try:
    from expdesign.kinematics import checked
except ImportError:  # a version that has none
    checked = None

HELD_OUT: dict[str, dict[str, tuple[str, ...]]] = {
    TANK.folder: {"zigzag_20_10_p": ("zigzag_20_10_p",), "zigzag_30_05": ("zigzag_30_05",)},
    POND.folder: {
        "zig-zags": ("zigzag_31-Jul-2020_13_22", "zigzag_31-Jul-2020_13_57"),
        "random": ("random_06-Aug-2020_16_24_25_5",),
        "turn": ("turn_14-Oct-2020_14_08",),
    },
}
"""Folder -> name of a group of runs -> how the names of its files begin."""
TRIPLE = 3  # runs of a trial


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


def fault(data: Path, hull: str, place: int, number: int, seed: int) -> dict[str, object]:
    """Runs of a ship with a fault: do oracles see it, is it named, and is its size right?"""
    injected = FAULTS[place]
    trial = trial_of(hull, data, number, seed)
    row: dict[str, Any] = {"number": number, "hull": hull, "fault": injected.name, "named": None}
    vessel, effects = trial.vessel, injected.effects
    kinds = {actuator.kind for actuator in vessel.model.actuators}
    if injected.needs and injected.needs not in kinds:
        return row
    clean, faulty = averaged(trial.judged), trial.judged
    if injected.batch:
        way = int(np.random.default_rng([seed, number, place]).integers(2**31))
        batches = tuple(injected.batch(batch, np.random.default_rng(way)) for batch in faulty.batches)
        faulty = replace(faulty, batches=batches)
        if injected.causes == ("current",):
            effects = tuple(zip((key for key, _ in effects), current_of(np.random.default_rng(way)), strict=True))
    if injected.model:
        changed = injected.model(vessel, clean)
        if changed is None:
            return row
        vessel, key, size = changed
        if trial.true is not None:
            model = trial.true.model
            size = dict(zip(model.names, model.parameters.tolist(), strict=True)).get(key.partition(":")[2], size)
        effects = ((key, size),)
    angle = "rudder" if "rudder" in kinds else "a"
    effects = tuple((key.replace("ANGLE", angle), value) for key, value in effects)
    own = averaged(faulty if checked is None else checked(faulty, vessel))
    faulty = averaged(faulty)
    begin = time.process_time()
    try:
        found = diagnose(vessel, own, seed=number)
    except NoAnswer as error:
        return row | {"named": "", "verdict": f"no answer: {error}", "findings": [], "seconds": 0.0, "seen": None}
    row |= row_of(found, time.process_time() - begin)
    own_size = of_model(vessel, clean, {*OF_MODEL} & {*dict(effects)}, slew_times(found))
    own_size |= of_instruments(trial.judged)
    row["named"], row["off"] = answer(injected, found, effects, own_size)
    row["doubts"] = list(getattr(own, "faults", ()))
    row["seen"] = [kinematics_see(clean, faulty) if injected.batch else False, None]
    known = not {"log"} & {key for key, _ in effects}
    row["seen"][1] = oracle(vessel, own, effects) if effects and known else None
    if trial.unseen is not None:
        before, after = (error_ahead(one, trial.unseen) for one in (vessel, found.extended))
        row["unseen"] = (1 - after / before).tolist()
        row["stated"] = [[one.output, one.share, one.low, one.high] for item in found.findings
                         for one in item.error_reductions]  # fmt: skip
        row["promised"] = promised(found)
    return row


def promised(found: Diagnosis) -> list[tuple[str, float]]:
    """(output, least reduction of its error) of all findings together, of outputs that they improve for certain."""
    left: dict[str, float] = {}
    for item in found.findings:
        for one in item.error_reductions:
            if np.isfinite(one.low):
                left[one.output] = left.get(one.output, 1.0) * (1.0 - one.low)
    best = min(left, key=left.__getitem__, default=None)
    return [] if best is None else [(best, 1.0 - left[best])]


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
            places = [at for at, item in enumerate(FAULTS) if not chosen.fault or item.name in chosen.fault]
            hulls = [name for name in HULLS if chosen.ship in (None, name)]
            tasks = (
                (hull, at, number, chosen.seed)
                for number in range(chosen.first, chosen.trials)
                for hull in hulls
                for at in places
            )
            work = as_finished(fault, (chosen.data,), tasks)
        rows = []
        for row in work:
            rows.append(row)
            if chosen.log:
                with chosen.log.open("a") as file:
                    file.write(json.dumps(row) + "\n")
    if chosen.study == "triples":
        yield from told_triples(sorted(rows, key=lambda row: row["number"]))
    else:
        yield from told_faults(sorted_rows(rows))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the study for the data in a folder."""
    parser = argparse.ArgumentParser(prog="python tests/benchmarks/published/diagnosis_real.py", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with the folders of the two ships")
    parser.add_argument(
        "--ship", choices=[POND.folder, TANK.folder, *HULLS], help="only this one; of --study faults a short name"
    )
    parser.add_argument("--seed", type=int, default=0, help="of all chance")
    parser.add_argument("--study", choices=("groups", "triples", "faults"), default="groups")
    parser.add_argument("--trials", type=int, default=20, help="triples of runs, counted from 0")
    parser.add_argument("--first", type=int, default=0, help="number of the first triple")
    parser.add_argument("--fault", nargs="+", choices=[item.name for item in FAULTS], help="only these")
    parser.add_argument("--log", type=Path, help="file to add a line of JSON for each trial to")
    parser.add_argument("--table", type=Path, nargs="+", help="only compare these logs of faults")
    add_sharing(parser)
    chosen = parser.parse_args(arguments)
    if chosen.table:
        sys.stdout.writelines(f"{line}\n" for line in told_faults(*map(read_log, chosen.table)))
        return 0
    if not all((chosen.data / case.folder).is_dir() for case in (POND, TANK)):
        sys.stdout.write(f"{chosen.data} lacks {POND.folder} or {TANK.folder}: nothing is measured\n")
        return 0
    if chosen.study == "groups":
        cases = [case for case in (POND, TANK) if chosen.ship in (None, case.folder)]
        lines = (line for case in cases for line in told(case, tried(case, chosen.data, seed=chosen.seed)))
    else:
        lines = counted(chosen)
    for line in lines:
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
