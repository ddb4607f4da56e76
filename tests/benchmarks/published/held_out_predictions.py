"""Predictions 30 s ahead of runs that no estimate has seen: what `expdesign estimate` writes, and SciPy alone.

`python tests/benchmarks/published/held_out_predictions.py --data FOLDER [--set NAME ...]` leaves runs out in turn,
estimates from the others, and predicts what was left out from measured velocities. The baseline is written here with
NumPy and SciPy: velocities averaged to half a second, least squares on central differences, then
`scipy.optimize.least_squares` on simulations of 5, 10 and 30 s from measured velocities. The same code judges all
models: the error of a prediction over the standard deviation of what was measured, geometric mean over runs, per cent.
Sets of simulated trials, by a generator that is not the package's, are sailed in a sea of varying current and wind with
noisy sensors, five seeds of each hull: by ships of the model's structure, and by ships with a term that it lacks.

Columns: least squares, instrumental variables and output error of the program, each asked for alone; what the vessel
file holds by default, and by which method; the baseline's least squares and output error; seconds of processor that the
default took, for all left-out runs together. `--fixed` adds output error over each horizon, asked for alone.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).parents[2]))
from diagnosis_case import Told, hidden_records
from diagnosis_case import vessel_of as vessel_of_hidden
from expdesign.assessment import EstimateOptions, assess
from expdesign.assessment.held_out import ranked
from expdesign.errors import NoAnswer
from expdesign.records import load_records
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import Vessel
from real_data_cases import POND, TANK, Case, vessel_of

AHEAD_S, HORIZONS_S, MEAN_S, STEP_S = 30.0, (5.0, 10.0, 30.0), 0.5, 0.5
FIXED_S = (10.0, 30.0)
"""Of predictions, of the baseline's simulations, of its averages, and of the integrator, at most [s]."""
MOST = 10.0  # largest error over a standard deviation that counts
Model = dict[str, float]


@dataclass(frozen=True, eq=False)
class Run:
    """Data at a constant step: velocities u, v, r (k, 3), inputs by name, and the air's own velocity (k, 2)."""

    step_s: float
    x: Array
    inputs: dict[str, Array]
    air: Array


def run_of(batch: Batch, mean_s: float = 0.0) -> Run:
    """Averaged over so many seconds; without wind the air is still."""
    every = max(1, round(mean_s / batch.sample_time_s))
    air = np.zeros((len(batch), 2)) if batch.wind is None else batch.velocity[:, :2] - batch.wind

    def means(rows: Array) -> Array:
        return rows[: len(rows) // every * every].reshape(-1, every, rows.shape[1]).mean(axis=1)

    inputs = means(batch.inputs)
    signals = {name: inputs[:, place] for place, name in enumerate(batch.input_names)}
    return Run(every * batch.sample_time_s, means(batch.velocity), signals, means(air))


class Plain:
    """A vessel's terms, evaluated as they are written."""

    def __init__(self, vessel: Vessel) -> None:
        """Compile the terms."""
        self.names = tuple(vessel.model.names)
        self.equation = np.array(["uvr".index(term.equation) for term in vessel.model.terms])
        self._terms = [compile(term.expression, "term", "eval") for term in vessel.model.terms]

    def terms(self, x: Array, inputs: dict[str, Array], air: Array) -> Array:
        """(p, ...) of velocities (..., 3)."""
        u, v, r = np.moveaxis(x, -1, 0)
        known = {"u": u, "v": v, "r": r, "u_q": u - air[..., 0], "v_q": v - air[..., 1], "abs": np.abs, "sin": np.sin}
        known |= {"cos": np.cos, "sqrt": np.sqrt, "__builtins__": {}}
        return np.stack([np.broadcast_to(eval(term, known, dict(inputs)), u.shape) for term in self._terms])  # noqa: S307

    def rates(self, theta: Array, x: Array, inputs: dict[str, Array], air: Array) -> Array:
        """(..., 3) accelerations."""
        each = theta.reshape(-1, *[1] * (x.ndim - 1)) * self.terms(x, inputs, air)
        return np.stack([each[self.equation == axis].sum(axis=0) for axis in range(3)], axis=-1)

    def errors(self, theta: Array, windows: Run) -> Array:
        """(L, w, 3) simulated from measured velocities, inputs held between samples, less measured."""
        substeps = max(1, int(np.ceil(windows.step_s / STEP_S - 1e-9)))
        h, x, rows = windows.step_s / substeps, windows.x[0], [windows.x[0]]
        with np.errstate(all="ignore"):
            for k in range(len(windows.x) - 1):
                inputs, air = {name: values[k] for name, values in windows.inputs.items()}, windows.air[k]
                for _ in range(substeps):
                    a = self.rates(theta, x, inputs, air)
                    b = self.rates(theta, x + h / 2 * a, inputs, air)
                    c = self.rates(theta, x + h / 2 * b, inputs, air)
                    d = self.rates(theta, x + h * c, inputs, air)
                    x = np.clip(x + h / 6 * (a + 2 * b + 2 * c + d), -50.0, 50.0)
                rows.append(x)
        return np.nan_to_num(np.array(rows) - windows.x, nan=50.0)

    def judged(self, model: Model, run: Run) -> Array:
        """(3,) errors over standard deviations."""
        error = self.errors(np.array([model[name] for name in self.names]), cut([run], AHEAD_S))
        return np.minimum(np.sqrt((error**2).mean(axis=(0, 1))) / run.x.std(axis=0), MOST)


def cut(runs: Sequence[Run], horizon_s: float, share: float = 1.0) -> Run:
    """Windows side by side, arrays (L, w, ...), each a share of the horizon after the last."""
    length = min([*(len(run.x) for run in runs), round(horizon_s / runs[0].step_s) + 1])
    places = [np.arange(0, len(run.x) - length + 1, max(1, round(share * (length - 1)))) for run in runs]

    def windows(rows: Sequence[Array]) -> Array:
        each = [own[firsts + np.arange(length)[:, None]] for own, firsts in zip(rows, places, strict=True)]
        return np.concatenate(each, axis=1)

    inputs = {name: windows([run.inputs[name] for run in runs]) for name in runs[0].inputs}
    return Run(runs[0].step_s, windows([run.x for run in runs]), inputs, windows([run.air for run in runs]))


def baseline(plain: Plain, runs: Sequence[Run]) -> tuple[Model, Model]:
    """Least squares, and output error from it."""
    theta = np.zeros(len(plain.names))
    rates = [(run.x[2:] - run.x[:-2]) / (2 * run.step_s) for run in runs]
    inner = [
        plain.terms(run.x[1:-1], {name: rows[1:-1] for name, rows in run.inputs.items()}, run.air[1:-1]) for run in runs
    ]
    for axis in range(3):
        own = plain.equation == axis
        Phi, y = np.concatenate([rows[own].T for rows in inner]), np.concatenate([rows[:, axis] for rows in rates])
        size = np.linalg.norm(Phi, axis=0) + 1e-300
        theta[own] = np.linalg.lstsq(Phi / size, y, rcond=None)[0] / size
    least = dict(zip(plain.names, theta.tolist(), strict=True))
    spread = np.concatenate([run.x for run in runs]).std(axis=0)
    for horizon_s in HORIZONS_S:
        scale, windows = np.maximum(np.abs(theta), 1e-8), cut(runs, horizon_s, 0.5)

        def residuals(z: Array, scale: Array = scale, windows: Run = windows) -> Array:
            return (plain.errors(z * scale, windows) / spread).ravel()

        theta = least_squares(residuals, theta / scale, x_scale="jac", max_nfev=40).x * scale
    return least, dict(zip(plain.names, theta.tolist(), strict=True))


Split = tuple[tuple[Batch, ...], tuple[Batch, ...]]
"""Runs to estimate from, and runs to predict."""


@dataclass(frozen=True)
class DataSet:
    """Ships with the splits of their runs, and the option `--mean`."""

    parts: tuple[tuple[Vessel, Split], ...]
    mean: str = "none"


def left_out(batches: Sequence[Batch], at_a_time: int) -> list[Split]:
    """Every run is left out once."""
    groups = [tuple(batches[first : first + at_a_time]) for first in range(0, len(batches), at_a_time)]
    return [(tuple(batch for batch in batches if batch not in apart), apart) for apart in groups]


def pairs_left_out(batches: Sequence[Batch]) -> list[Split]:
    """Every pair of runs."""
    return [
        (tuple(batch for batch in batches if batch not in apart), apart) for apart in itertools.combinations(batches, 2)
    ]


SEEDS = 5
LACKING = {"tug": "Y_abs_v_v", "barge": "X_vr", "coaster": "N_uv"}


def simulated(ship: str, *, lacking: bool) -> DataSet:
    """Three runs of five minutes to estimate from, two to predict."""
    known = vessel_of_hidden(ship, without=(LACKING[ship],) if lacking else ())
    told = Told(relative_std=0.2, current=(0.1, -0.1), wind=(2.0, -1.0))
    records = [hidden_records(ship, [told], seed=seed, batches=5)[0] for seed in range(SEEDS)]
    return DataSet(tuple((known, (record.batches[:3], record.batches[3:])) for record in records))


def data_sets(data: Path) -> dict[str, Callable[[], DataSet]]:
    """Those that are there."""

    def runs(folder: str, ship: Vessel, begin: tuple[str, ...] = ("",)) -> tuple[Batch, ...]:
        files = [path for path in sorted((data / folder).glob("*.csv")) if path.stem.startswith(begin)]
        return load_records(files, vessel_inputs=ship.model.inputs).batches

    def case(item: Case, begin: tuple[str, ...]) -> tuple[Vessel, tuple[Batch, ...]]:
        ship = vessel_of(item)
        return ship, runs(item.folder, ship, begin)

    def used(item: Case, at_a_time: int) -> DataSet:
        ship, batches = case(item, item.used)
        return DataSet(tuple((ship, split) for split in left_out(batches, at_a_time)), item.mean)

    def tests(item: Case) -> DataSet:
        ship, batches = case(item, item.used)
        return DataSet(((ship, (batches, case(item, item.tests)[1])),), item.mean)

    def tests_alone(item: Case) -> DataSet:
        ship, batches = case(item, item.tests)
        return DataSet(tuple((ship, split) for split in left_out(batches, 1)), item.mean)

    def field(folder: str, vessel: str, splits: Callable[[Sequence[Batch]], list[Split]]) -> DataSet:
        ship = load_vessel(data / "field" / folder / vessel)
        return DataSet(tuple((ship, split) for split in splits(runs(f"field/{folder}", ship))))

    def one(batches: Sequence[Batch]) -> list[Split]:
        return left_out(batches, 1)

    return {
        "tank": lambda: used(TANK, 1),
        "tank-others": lambda: tests(TANK),
        "tank-other-runs": lambda: tests_alone(TANK),
        "pond": lambda: used(POND, 3),
        "other-tank": lambda: field("oe-worse", "marin10.toml", one),
        "other-tank-pairs": lambda: field("oe-worse", "marin10.toml", pairs_left_out),
        "two-zigzags": lambda: field("crash", "vessel.toml", one),
        **{ship: partial(simulated, ship, lacking=False) for ship in LACKING},
        **{f"{ship}-lacking": partial(simulated, ship, lacking=True) for ship in LACKING},
    }


def studied(name: str, own: DataSet, *, fixed: bool) -> Iterator[str]:
    """Lines of the table."""
    rows: dict[str, list[Array]] = {}
    held: list[str] = []
    seconds = 0.0
    asked: dict[str, EstimateOptions] = {
        method: EstimateOptions(methods=(method,), mean=own.mean) for method in ("ls", "iv", "oe")
    }
    if fixed:
        asked |= {f"oe {h:g} s": EstimateOptions(methods=("oe",), mean=own.mean, horizon_s=h) for h in FIXED_S}
    for ship, (given, apart) in own.parts:
        plain, rest = Plain(ship), Record(batches=given)
        found: dict[str, Model | None] = {}
        for label, options in asked.items():
            try:
                found[label] = assess(ship, rest, options).best.estimate.assignments
            except NoAnswer:
                found[label] = None
        began = time.process_time()
        assessed = assess(ship, rest, EstimateOptions(mean=own.mean))
        seconds += time.process_time() - began
        held.append(assessed.compared[ranked(assessed.compared)[0]].label if assessed.compared else assessed.best.label)
        found["file"] = assessed.best.estimate.assignments
        found["SciPy ls"], found["SciPy oe"] = baseline(plain, [run_of(batch, MEAN_S) for batch in given])
        for key, model in found.items():
            for batch in apart:
                run = run_of(batch, MEAN_S)
                rows.setdefault(key, []).append(np.full(3, np.nan) if model is None else plain.judged(model, run))
    for key, shares in rows.items():
        each = 100 * np.exp(np.log(np.array(shares)).mean(axis=0))
        told = f"   {', '.join(held)}; {seconds:.0f} s" if key == "file" else ""
        lacking = sum(bool(np.isnan(row).any()) for row in shares)
        text = f"no answer for {lacking} of {len(shares)}" if lacking else "".join(f"{value:8.1f}" for value in each)
        yield f"{name:16} {key:10} {text}{told}"
    yield f"{name:16} file over SciPy oe: {compared(np.array(rows['file']), np.array(rows['SciPy oe']))}"


def compared(one: Array, other: Array) -> str:
    """Ratio of the errors (runs, 3) of two models, geometric means, with its standard error over runs."""
    logs = np.log(one / other).mean(axis=1)
    error = logs.std(ddof=1) / np.sqrt(len(logs)) if len(logs) > 1 else np.nan
    return f"{np.exp(logs.mean()):.2f} +- {np.exp(logs.mean()) * error:.2f} in {len(logs)} runs"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with the folders of the data sets")
    parser.add_argument("--set", nargs="*", dest="sets")
    parser.add_argument("--fixed", action="store_true", help="output error over fixed horizons too")
    chosen = parser.parse_args(arguments)
    for name, own in data_sets(chosen.data).items():
        if chosen.sets is None or name in chosen.sets:
            for line in studied(name, own(), fixed=chosen.fixed):
                sys.stdout.write(f"{line}\n")
                sys.stdout.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
