"""Free-running trials of two tankers: what structures explain, how well estimates simulate, and what limits that.

`python tests/benchmarks/published/real_data.py --data FOLDER` reads `FOLDER/kvlcc2-hsva-7m` (zig-zags in a towing tank,
hardly any noise) and `FOLDER/esso-osaka-3m` (a pond, 0.05-0.4 m/s in winds of 1-2 m/s), CSV files of measured data; a
folder that is not there is left out.

First, how much of measured accelerations a structure explains: least squares on smoothed velocities. Accelerations are
derivatives of quadratics fitted to the velocities over a sliding window; inputs and wind are smoothed alike. This says
what a structure can reach at best on real data, before any question of noise in regressors: too short a window leaves
noise in the accelerations, too long a one takes the manoeuvre out of them. Rows for half and twice the window show how
much of a difference to other people's numbers is the filter's. Then, method by method, every run simulated with
parameters from some of them.

Source: A. Savitzky and M. J. E. Golay, Analytical Chemistry 36 (1964), 1627-1639.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.signal import savgol_filter

from expdesign.assessment import EstimateOptions, assess, sentence
from expdesign.assessment.misfit import AHEAD_S
from expdesign.conventions import OUTPUTS
from expdesign.errors import InputError, NoAnswer
from expdesign.estimation.regression import AIR, heading_of, inputs_of, model_for, signal_table
from expdesign.records import load_records
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel, VesselModel
from real_data_cases import CASES, Case, vessel_of


def explained_accelerations(
    model: VesselModel, record: Record, *, window_s: float, wind: bool = False
) -> dict[str, float]:
    """R^2 of the accelerations of each output, pooled over all runs, by least squares.

    Args:
        model: gives the terms; its parameters do not matter.
        record: the data.
        window_s: length of the sliding window [s], at least three samples.
        wind: use measured wind; otherwise terms of air velocities are left out.

    Returns:
        Output -> R^2, nan where the acceleration is constant.

    Raises:
        InputError: a window too short, or wind is asked for and not measured.
        NoAnswer: no run is longer than the window.
    """
    driven = model_for(model, record)
    parts = [_smoothed(driven, batch, window_s, wind) for batch in record.batches]
    parts = [(table, rates) for table, rates in parts if len(rates)]
    if not parts:
        raise NoAnswer(f"no run is longer than the window of {window_s:g} s")
    return {output: _explained(driven, output, parts, wind) for output in driven.outputs}


Part = tuple[dict[str, Array], Array]
"""Signals, each (k,), and accelerations (k, 3), of the samples with a whole window around them."""


def _smoothed(model: VesselModel, batch: Batch, window_s: float, wind: bool) -> Part:
    half = round(window_s / batch.sample_time_s / 2)
    width = 2 * half + 1
    if half < 1:
        raise InputError(f"window_s is {window_s:g}, expected three samples of {batch.sample_time_s:g} s or more")
    if wind and batch.wind is None:
        raise InputError(f"{batch.name} has no measured wind")
    if len(batch) < width:
        return {}, np.zeros((0, 3))

    def smooth(values: Array, derivative: int = 0) -> Array:
        filtered = savgol_filter(values, width, 2, deriv=derivative, delta=batch.sample_time_s, axis=0)
        return np.asarray(filtered[half : len(batch) - half])

    velocity = smooth(batch.velocity)
    air = smooth(batch.wind) if wind and batch.wind is not None else velocity[:, :2]
    heading = heading_of(batch)[half : len(batch) - half]
    return signal_table(model, velocity, air, heading, smooth(inputs_of(model, batch))), smooth(batch.velocity, 1)


def _explained(model: VesselModel, output: str, parts: list[Part], wind: bool) -> float:
    used = [
        expression
        for term, expression in zip(model.terms, model.expressions, strict=True)
        if term.equation == output and (wind or not set(AIR) & set(expression.signals))
    ]
    y = np.concatenate([rates[:, OUTPUTS.index(output)] for _, rates in parts])
    columns = [
        np.concatenate([np.broadcast_to(item.evaluate(table, NUMPY), len(rates)) for table, rates in parts])
        for item in used
    ]
    Phi = np.stack(columns, axis=1)
    size = np.linalg.norm(Phi, axis=0)
    Phi = Phi / np.where(size > 0, size, 1.0)
    residuals = y - Phi @ np.linalg.lstsq(Phi, y, rcond=None)[0]
    return float(1.0 - residuals.var() / y.var()) if y.var() > 0 else float("nan")


def studied(case: Case, data: Path) -> Iterator[str]:
    """Lines of text: what is explained, then the runs by each method."""
    files = sorted((data / case.folder).glob("*.csv"))
    if not files:
        yield f"{case.folder}: no files in {data / case.folder}, left out"
        return
    ship = vessel_of(case)
    yield from _explained_lines(case, ship, load_records(files, vessel_inputs=ship.model.inputs))
    used, tests = (
        load_records([file for file in files if file.stem.startswith(parts)], vessel_inputs=ship.model.inputs)
        for parts in (case.used, case.tests)
    )
    for name, horizon_s in case.methods:
        title = name if horizon_s is None else f"{name}, horizon {horizon_s:g} s"
        options = EstimateOptions(methods=(name,), mean=case.mean, horizon_s=horizon_s)
        try:
            found = assess(ship, used, options, tests=tests)
        except NoAnswer as error:
            yield f"\n{case.folder}, {title}: no answer: {error}"
            continue
        ahead = f"error {AHEAD_S:g} s ahead [% of the spread]"
        yield f"\n{case.folder}, {title}: fit of the simulated output [%], {ahead}"
        for limits, run in zip(found.limits, found.best.runs, strict=True):
            yield f"  {run.use[:4]} {run.batch.name:36}{_row(run.fit_percent)}   {_row(100 * limits.ahead_share)}"
            yield f"       {sentence(limits, run)}"


def _row(values: Array) -> str:
    return "".join(f"{value:8.1f}" for value in values)


def _explained_lines(case: Case, ship: Vessel, record: Record) -> Iterator[str]:
    windy = any(set(AIR) & set(expression.signals) for expression in ship.model.expressions)
    yield f"{case.folder}: R2 of accelerations by least squares, others' first"
    yield f"  published        {''.join(f'{value:8.2f}' for value in case.published)}"
    for wind in (True, False) if windy else (False,):
        for scale in (0.5, 1.0, 2.0):
            window_s = scale * case.window_s
            found = explained_accelerations(ship.model, record, window_s=window_s, wind=wind)
            what = "with wind" if wind else "no wind"
            yield f"  {what:9} {window_s:4g} s {''.join(f'{value:8.2f}' for value in found.values())}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the study for the data in a folder."""
    parser = argparse.ArgumentParser(prog="python tests/benchmarks/published/real_data.py", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with the folders of the two ships")
    parser.add_argument("--ship", choices=[case.folder for case in CASES], help="only this one")
    chosen = parser.parse_args(arguments)
    for case in CASES:
        if chosen.ship in (None, case.folder):
            for line in studied(case, chosen.data):
                sys.stdout.write(f"{line}\n")
                sys.stdout.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
