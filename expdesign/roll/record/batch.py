"""Runs of roll from batches of measured data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.errors import InputError, UnknownName
from expdesign.roll.runs import Run
from expdesign.signals import AUXILIARY, Batch
from expdesign.simulation import acting_response, delivered_at_samples, steering_signals
from expdesign.values import Array
from expdesign.vessel import IDEAL, Vessel

NEEDED = ("roll_rate_radps", "imu_lateral_mps2")
"""Columns needed besides r_radps and the rudder."""


def missing_columns(batch: Batch) -> tuple[str, ...]:
    """Columns of `NEEDED` that a batch does not measure."""
    return tuple(name for name in NEEDED if not batch.measures(name))


def roll_run(batch: Batch, *, rudder: Sequence[str] = (), ship: Vessel | None = None) -> Run:
    """Signals of a batch; the accelerometer counts to port in the room of roll.

    Args:
        batch: measured.
        rudder: signals whose mean steers; found by their kinds when empty.
        ship: whose file states how late actuators are; None for none.

    Raises:
        InputError: a column is missing, or nothing steers.
    """
    for name in missing_columns(batch):
        raise InputError(f"{name}: is missing, expected it beside r_radps and the rudder")
    assert batch.auxiliary is not None
    roll_rate, sensed = (batch.auxiliary[:, AUXILIARY.index(name)] for name in NEEDED)
    chosen = [batch.input_names.index(name) for name in _rudders(batch.input_names, rudder)]
    steering = _delivered(batch, batch.inputs, ship)[:, chosen].mean(axis=1)
    signals = np.column_stack([roll_rate, -sensed, batch.velocity[:, 2], steering])
    planned = None
    if batch.planned is not None and batch.planned.shape[1] == len(batch.input_names):
        planned = _delivered(batch, batch.planned, ship)[:, chosen].mean(axis=1)
    return Run(step_s=batch.sample_time_s, signals=signals, planned=planned)


def planned_everywhere(runs: Sequence[Run]) -> bool:
    """Whether every run has a planned rudder that moves, from which instruments may come."""
    return all(run.planned is not None and run.planned.std() > 0 for run in runs)


def with_one_source(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Runs with planned rudders in all of them or in none."""
    return tuple(runs) if planned_everywhere(runs) else tuple(replace(run, planned=None) for run in runs)


def _delivered(batch: Batch, given: Array, ship: Vessel | None) -> Array:
    """(k, m) inputs at the samples, with the lags and dead times that the vessel file states for its signals."""
    inputs = np.array(given)
    if ship is None:
        return inputs
    for signal, response in zip(ship.model.inputs, ship.responses, strict=True):
        if signal in batch.input_names and response != IDEAL:
            column = batch.input_names.index(signal)
            own = acting_response(batch, signal, response) if given is batch.inputs else response
            commanded = inputs[:, [column]]
            inputs[:, column] = delivered_at_samples([own], commanded, sample_time_s=batch.sample_time_s)[:-1, 0]
    return inputs


def _rudders(names: tuple[str, ...], asked: Sequence[str]) -> tuple[str, ...]:
    for name in asked:
        if name not in names:
            raise UnknownName("rudder signal", name, known=names)
    chosen = tuple(asked) or steering_signals(names)
    if not chosen:
        raise InputError(f"the inputs {', '.join(names)} have no rudder, expected rudder1 or a1, or --rudder")
    return chosen
