"""Predictions 30 s ahead of runs that no estimate has seen: what `expdesign estimate` writes, and SciPy alone.

`python tests/benchmarks/published/held_out_predictions.py --data FOLDER [--set NAME ...]` leaves runs out in turn,
estimates from the others, and predicts what was left out from measured velocities. The baseline is written here with
NumPy and SciPy: velocities averaged to half a second, least squares on central differences, then
`scipy.optimize.least_squares` on simulations of 5, 10 and 30 s from measured velocities. The same code judges all
models: the error of a prediction over the standard deviation of what was measured, geometric mean over runs, per cent.

Columns: least squares, instrumental variables and output error of the program, each asked for alone; what the vessel
file holds by default, and by which method; the baseline's least squares and output error; seconds of processor that the
default took, for all left-out runs together.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from expdesign.assessment import EstimateOptions, assess
from expdesign.errors import NoAnswer
from expdesign.records import load_records
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import Vessel
from real_data_cases import CASES, vessel_of

AHEAD_S, HORIZONS_S, MEAN_S, STEP_S = 30.0, (5.0, 10.0, 30.0), 0.5, 0.5
"""Of predictions, of the baseline's simulations, of its averages, and of the integrator, at most [s]."""
MOST = 10.0
"""Largest error over a standard deviation that counts."""
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


@dataclass(frozen=True)
class DataSet:
    """Runs of one ship, and how many are left out at a time."""

    ship: Vessel
    record: Record
    mean: str
    left_out: int = 1


def data_sets(data: Path) -> dict[str, Callable[[], DataSet]]:
    """Those that are there."""

    def case(place: int) -> DataSet:
        item = CASES[place]
        files = [path for path in sorted((data / item.folder).glob("*.csv")) if path.stem.startswith(item.used)]
        ship = vessel_of(item)
        return DataSet(ship, load_records(files, vessel_inputs=ship.model.inputs), item.mean, 3 if place else 1)

    def field(folder: str, vessel: str) -> DataSet:
        ship = load_vessel(data / "field" / folder / vessel)
        files = sorted((data / "field" / folder).glob("*.csv"))
        return DataSet(ship, load_records(files, vessel_inputs=ship.model.inputs), "none")

    return {
        "tank": lambda: case(0),
        "pond": lambda: case(1),
        "other-tank": lambda: field("oe-worse", "marin10.toml"),
        "two-zigzags": lambda: field("crash", "vessel.toml"),
    }


def studied(name: str, own: DataSet) -> Iterator[str]:
    """Lines of the table."""
    plain, batches = Plain(own.ship), own.record.batches
    rows: dict[str, list[Array]] = {}
    held: list[str] = []
    seconds = 0.0
    for first in range(0, len(batches), own.left_out):
        apart = batches[first : first + own.left_out]
        rest = Record(batches=tuple(batch for batch in batches if batch not in apart))
        found: dict[str, Model | None] = {}
        for method in ("ls", "iv", "oe"):
            try:
                options = EstimateOptions(methods=(method,), mean=own.mean)
                found[method] = assess(own.ship, rest, options).best.estimate.assignments
            except NoAnswer:
                found[method] = None
        began = time.process_time()
        best = assess(own.ship, rest, EstimateOptions(mean=own.mean)).best
        seconds += time.process_time() - began
        held.append(best.method.name)
        found["file"] = best.estimate.assignments
        found["SciPy ls"], found["SciPy oe"] = baseline(plain, [run_of(batch, MEAN_S) for batch in rest.batches])
        for key, model in found.items():
            for batch in apart:
                run = run_of(batch, MEAN_S)
                rows.setdefault(key, []).append(np.full(3, np.nan) if model is None else plain.judged(model, run))
    for key, shares in rows.items():
        each = 100 * np.exp(np.log(np.array(shares)).mean(axis=0))
        told = f"   {' '.join(held)}, {seconds:.0f} s" if key == "file" else ""
        lacking = sum(bool(np.isnan(row).any()) for row in shares)
        text = f"no answer for {lacking} of {len(shares)}" if lacking else "".join(f"{value:8.1f}" for value in each)
        yield f"{name:12} {key:10} {text}{told}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with the folders of the data sets")
    parser.add_argument("--set", nargs="*", dest="sets")
    chosen = parser.parse_args(arguments)
    for name, own in data_sets(chosen.data).items():
        if chosen.sets is None or name in chosen.sets:
            for line in studied(name, own()):
                sys.stdout.write(f"{line}\n")
                sys.stdout.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
