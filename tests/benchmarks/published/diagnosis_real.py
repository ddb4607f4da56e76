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
this version or of another (copies of this file and `diagnosis_real_faults` in its folder), and `--table FILE ...`
compares such files. Both studies say what they took (processor seconds), in Markdown.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from diagnosis_real_faults import (
    AHEAD_S,
    FAULTS,
    SEEN,
    STD,
    answer,
    current_of,
    error_ahead,
    kinematics_see,
    of_instruments,
    oracle,
)
from expdesign.assessment import EstimateOptions, assess
from expdesign.diagnosis import Diagnosis, diagnose
from expdesign.diagnosis.model import resisting
from expdesign.errors import InputError, NoAnswer, NotInformative
from expdesign.estimation.regression import AIR
from expdesign.processes import as_finished
from expdesign.records import load_records
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import Vessel
from real_data_cases import POND, TANK, Case, vessel_of
from shared_work import add_sharing, shared_work

try:
    from expdesign.kinematics import checked
except ImportError:  # a version that has none
    checked = None

PACE_S = 0.5
"""Time between samples after averaging: the ships need seconds for anything they do."""
LONGEST_S, JUDGED_S = 300.0, 200.0
"""Length that every run is cut to, and every one with a fault, to keep the studies short."""
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

    Raises:
        NotInformative: the data tell nothing of parameters of which none is left to hold.
    """
    ship = vessel_of(case)
    model = ship.model
    kept = [i for i, expression in enumerate(model.expressions) if wind or not set(AIR) & set(expression.signals)]
    zeros = np.zeros(len(kept))
    terms = tuple(model.terms[i] for i in kept)
    still = replace(model, terms=terms, parameters=zeros, parameter_std=zeros, sample_time_s=PACE_S)
    return simulating(replace(ship, model=still, sample_time_s=PACE_S), record, "ls-air" if wind else "ls")


def simulating(ship: Vessel, record: Record, method: str) -> Vessel:
    """A ship fitted by a method of least squares.

    Where the model runs away on these data, damping that grows fastest with speed and pushes is taken out, and the rest
    fitted anew: nobody has a model in use that cannot be simulated. Where the data do not tell parameters apart, the
    first of them is held, as `estimate` advises.

    Raises:
        NotInformative: the data tell nothing of parameters of which none is left to hold.
    """
    held = list[str]()
    fastest = max(float(np.nanmax(np.abs(batch.velocity))) for batch in record.batches)
    while True:
        options = EstimateOptions(methods=(method,), mean="none", fixed=tuple(held))
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
    """The pond's model with wind by output error after least squares."""
    fitted = fitted_vessel(case, record, wind=True)
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """Runs of a ship: the model is fitted to some, others are judged, and others nobody uses."""

    vessel: Vessel
    judged: Record
    unseen: Record | None


def tank_trial(data: Path, rng: np.random.Generator) -> Trial:
    """Of the 7 m model, by least squares."""
    names = [file.stem for file in sorted((data / TANK.folder).glob("*.csv")) if "10_10" not in file.stem]
    judged, fitted, unseen = divided(names, 3, 2, rng)
    vessel = fitted_vessel(TANK, runs(TANK, data, fitted), wind=False)
    return Trial(vessel=vessel, judged=read(data / TANK.folder, judged), unseen=runs(TANK, data, unseen))


def pond_trial(data: Path, rng: np.random.Generator) -> Trial:
    """Of the 3 m model, by output error with wind."""
    names = [file.stem for file in sorted((data / POND.folder).glob("*.csv")) if file.stem.startswith(WINDY)]
    judged, unseen, fitted = divided(names, 3, 4, rng)
    vessel = best_vessel(POND, runs(POND, data, fitted[:8]))
    return Trial(vessel=vessel, judged=read(data / POND.folder, judged), unseen=runs(POND, data, unseen))


def crash_trial(data: Path, _rng: np.random.Generator) -> Trial:
    """Of the 7 m model by a vessel file that `estimate` wrote of other runs."""
    folder = data / "field" / "crash"
    return Trial(
        vessel=load_vessel(folder / "vessel.toml"),
        judged=read(folder, ("zz_20_10_p", "zz_20_10_s")),
        unseen=runs(TANK, data, ("zigzag_30_05", "zigzag_15_01")),
    )


def other_tank_trial(data: Path, rng: np.random.Generator) -> Trial:
    """Of the same hull in another tank, four runs: two are judged, by a model of the turning circle and one more."""
    folder = data / "field" / "oe-worse"
    judged, fitted, _ = divided(["zz_-10", "zz_10", "zz_20"], 2, 1, rng)
    start = load_vessel(folder / "marin10.toml")
    start = replace(start, model=replace(start.model, parameter_std=np.zeros(len(start.model.terms))))
    vessel = simulating(start, averaged(read(folder, (*fitted, "tc_35"))), "ls")
    return Trial(vessel=vessel, judged=read(folder, judged), unseen=None)


def clean_trial(data: Path, rng: np.random.Generator) -> Trial:
    """Of a simulated 30 m vessel."""
    ship = load_vessel(data / "clean-30m" / "vessel.toml")
    record = load_records([data / "clean-30m" / "trial.csv"], vessel_inputs=ship.model.inputs, sample_time_s=1.0)
    names = [batch.name for batch in record.batches]
    judged, fitted, unseen = (
        Record(batches=tuple(batch for batch in record.batches if batch.name in some))
        for some in divided(names, 3, 3, rng)
    )
    return Trial(vessel=simulating(ship, fitted, "ls"), judged=judged, unseen=unseen)


HULLS: dict[str, Callable[[Path, np.random.Generator], Trial]] = {
    "tank": tank_trial, "tank 20/10": crash_trial, "other tank": other_tank_trial, "clean 30 m": clean_trial,
    "pond": pond_trial,
}  # fmt: skip


@lru_cache(maxsize=1)
def trial_of(hull: str, data: Path, number: int, seed: int) -> Trial:
    """The trial of a hull, which all faults share."""
    return HULLS[hull](data, np.random.default_rng([seed, number]))


def divided(names: Sequence[str], first: int, second: int, rng: np.random.Generator) -> tuple[tuple[str, ...], ...]:
    """So many names, so many others, and the rest."""
    drawn = rng.permutation(list(names)).tolist()
    return tuple(map(tuple, (drawn[:first], drawn[first : first + second], drawn[first + second :])))


def read(folder: Path, names: Sequence[str]) -> Record:
    """Runs as recorded."""
    return load_records([folder / f"{name}.csv" for name in sorted(names)], vessel_inputs=("n1", "rudder1"))


def averaged(record: Record) -> Record:
    """Means over `PACE_S`, and no more than `JUDGED_S` of each run, where samples are closer."""
    every = round(PACE_S / record.batches[0].sample_time_s)
    return record if every < 2 else replace(
        record, batches=tuple(averaged_over(batch, every, JUDGED_S) for batch in record.batches)
    )  # fmt: skip


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
        vessel, *effect = changed
        effects = (tuple(effect),)
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
    row["named"], row["off"] = answer(injected, found, effects, of_instruments(trial.judged))
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


def told_faults(*logs: Sequence[dict[str, Any]]) -> Iterator[str]:
    """A row per hull and fault, with the answers of every log, then counts."""
    columns = " | ".join(f"named {at + 1} | off {at + 1} | said {at + 1}" for at in range(len(logs)))
    yield f"| hull | fault | instruments, oracle's p | {columns} |"
    yield "|" + "---|" * (3 + 3 * len(logs))
    tables = [{(row["hull"], row["fault"], row["number"]): row for row in rows} for rows in logs]
    seen_keys = [key for key, row in tables[0].items() if row["named"] is not None]
    for key in seen_keys:
        rows = [table.get(key) for table in tables]
        cells = [cell for row in rows for cell in cells_of(row)]
        yield f"| {key[0]} | {key[1]} | {seen_words(rows[0])} | {' | '.join(cells)} |"
    for at, table in enumerate(tables):
        rows = [table[key] for key in seen_keys if key in table]
        visible = [row for row in rows if row["fault"] != "untouched" and visible_to_oracle(tables[0][key_of(row)])]
        right = [row for row in visible if row["named"] in RIGHT]
        sized = [row for row in visible if row["named"] in RIGHT and row.get("off") is not None]
        close = [row for row in sized if row["off"] <= STD]
        clean = [row for row in rows if row["fault"] == "untouched"]
        kept = [keeps_promise(row) for row in clean if row["findings"] and row.get("promised")]
        silent = sum(not row["findings"] and not row.get("doubts") for row in clean)
        yield (
            f"{at + 1}: of {len(visible)} faults that an oracle sees {len(right)} are named first or as equivalent; "
            f"{len(close)} of {len(sized)} sizes are within {STD:g} standard errors; of {len(clean)} untouched sets "
            f"{silent} are silent, and the findings of {sum(kept)} of {len(kept)} others improve unseen runs by what "
            f"they state; {seconds_words([row for row in rows if row.get('seconds')])}."
        )


RIGHT = ("record", "first", "equivalent")


def key_of(row: dict[str, Any]) -> tuple[str, str, int]:
    """Of a trial."""
    return row["hull"], row["fault"], row["number"]


def cells_of(row: dict[str, Any] | None) -> tuple[str, str, str]:
    """How a fault was named, how far off its size is, and all that was found."""
    if row is None:
        return "?", "", ""
    off = "" if row.get("off") is None else f"{row['off']:.1f}"
    doubts = [text.partition(": ")[2][:60] for text in row.get("doubts", ())]
    unseen = ""
    if row["fault"] == "untouched" and row["findings"] and row.get("promised"):
        ((output, least),) = row["promised"]
        share = row["unseen"]["uvr".index(output)]
        unseen = f" (unseen runs {100 * share:+.0f} %, stated {100 * least:+.0f} % of {output})"
    if not row["findings"] and "no answer" in row["verdict"]:
        return "no answer", "", row["verdict"][:100]
    return row["named"] or "-", off, "; ".join([*doubts, found_words(row)]) + unseen


def seen_words(row: dict[str, Any]) -> str:
    """What the oracles say."""
    if not row.get("seen"):
        return ""
    instruments, p_value = row["seen"]
    return ("yes" if instruments else "no") + ("" if p_value is None else f", {p_value:.1e}")


def visible_to_oracle(row: dict[str, Any]) -> bool:
    """Whether any oracle sees the fault."""
    instruments, p_value = row.get("seen") or (False, None)
    return bool(instruments or (p_value is not None and p_value < SEEN))


def keeps_promise(row: dict[str, Any]) -> bool:
    """Whether unseen runs improve by what the findings state at least."""
    ((output, least),) = row["promised"]
    return bool(row["unseen"]["uvr".index(output)] >= min(least, 1.0))


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


def sorted_rows(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """By hull, fault and trial."""
    hulls, faults = list(HULLS), [item.name for item in FAULTS]
    return sorted(rows, key=lambda row: (hulls.index(row["hull"]), faults.index(row["fault"]), row["number"]))


def read_log(path: Path) -> list[dict[str, Any]]:
    """Rows of a log."""
    return sorted_rows([json.loads(line) for line in path.read_text().splitlines()])


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
    parser.add_argument("--fault", choices=[item.name for item in FAULTS], help="only this one")
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
