"""Measured trials that faults are injected into: runs that a model is fitted to, and runs that are judged.

Records are averaged to what the ships' motion asks for. A model is fitted by least squares, or on the pond by output
error with terms of the wind after it, to drawn runs; others are judged, and others nobody uses.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from diagnosis_real_faults import AHEAD_S, error_ahead
from expdesign.assessment import EstimateOptions, assess
from expdesign.diagnosis.model import resisting
from expdesign.errors import InputError, NotInformative
from expdesign.estimation.regression import AIR
from expdesign.records import load_records
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import Vessel
from real_data_cases import POND, TANK, Case, vessel_of

PACE_S = 0.5  # time between samples after averaging: the ships need seconds for anything they do
LONGEST_S, JUDGED_S = 300.0, 200.0
"""Length that every run is cut to, and every one with a fault, to keep the studies short."""
WINDY = ("random", "turn_14", "zigzag")
"""Runs of the pond under way in wind; berthing is slow and short, cut turns are parts of others."""


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


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """Runs of a ship: the model is fitted to some, others are judged, and others nobody uses."""

    vessel: Vessel
    judged: Record
    unseen: Record | None
    true: Vessel | None = None  # of simulated runs


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
    unseen = (*unseen, *fitted[8:])
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
    return Trial(vessel=simulating(ship, fitted, "ls"), judged=judged, unseen=unseen, true=ship)


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
