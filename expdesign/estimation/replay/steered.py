"""Samples whose inputs follow the ship's motion: left out, or with instruments from the commands as planned.

Instruments simulated from inputs are valid where those inputs owe nothing to the disturbances. An autopilot, or a
helmsman on a track, answers with the inputs to what the disturbances did: with a current that lasts, instruments from
such inputs are correlated with the residual for as long as the current lasts. The commands as planned do not depend on
it, and drive the same ship. How the ship was steered is not known here, so the planned commands drive the model in
open loop; with a known controller they would drive the closed loop. That changes how strong instruments are, not
whether they are valid. Headings and winds of instruments stay the measured ones, as elsewhere.

Where steered samples are left out, what remains of a batch is simulated from its own first measured velocity, as every
batch is.

Source: closed-loop instrumental variables from an external signal, T. Söderström and P. Stoica, Instrumental Variable
Methods for System Identification (1983), and M. Gilson and P. Van den Hof, Automatica 41 (2005), 241-249.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from expdesign.errors import InputError, NotInformative
from expdesign.estimation.tuning import TUNING
from expdesign.signals import Batch, Record
from expdesign.vessel import column_name

AUTO, USE, LEAVE_OUT, PLANNED = "auto", "use", "leave-out", "planned"
STEERED = (AUTO, USE, LEAVE_OUT, PLANNED)


@dataclass(frozen=True)
class Steered:
    """What became of steered samples.

    Attributes:
        samples: marked as steered.
        of: all samples.
        treatment: "use", "leave-out" or "planned".
    """

    samples: int
    of: int
    treatment: str


def treatment_of(record: Record, choice: str, *, instruments: bool) -> Steered:
    """What to do with the steered samples of a record.

    Args:
        record: the data.
        choice: one of `STEERED`; "auto" for planned commands where there are some, else left out, in methods with
            instruments, and for use in others.
        instruments: whether the method has instruments.

    Raises:
        InputError: planned commands are asked for and a batch with steered samples has none.
    """
    marked = [batch for batch in record.batches if batch.steered is not None and batch.steered.any()]
    unplanned = [batch for batch in marked if batch.planned is None]
    planned = not unplanned
    if choice == PLANNED and unplanned:
        columns = ", ".join(f"planned_{column_name(name)}" for name in unplanned[0].input_names)
        raise InputError(f"{unplanned[0].name} has steered samples and no planned inputs, expected {columns}")
    treatment = choice
    if choice == AUTO:
        treatment = (PLANNED if planned else LEAVE_OUT) if instruments else USE
    elif choice == PLANNED and not instruments:
        treatment = USE
    count = sum(int(batch.steered.sum()) for batch in marked if batch.steered is not None)
    return Steered(samples=count, of=sum(map(len, record.batches)), treatment=treatment)


def open_loop(record: Record) -> Record:
    """The stretches without steered samples, each a batch.

    Raises:
        NotInformative: there are none.
    """
    parts = [part for batch in record.batches for part in _open_stretches(batch)]
    if not parts:
        raise NotInformative(
            "all samples are marked as steered and the data have no columns of planned inputs (planned_...); "
            "--steered use keeps them"
        )
    return replace(record, batches=tuple(parts))


def _open_stretches(batch: Batch) -> list[Batch]:
    if batch.steered is None or not batch.steered.any():
        return [batch]
    edges = np.flatnonzero(np.diff(np.concatenate([[1.0], batch.steered, [1.0]])))
    return [
        replace(batch.cut(slice(begin, end)), name=f"{batch.name}, sample {begin + 1} to {end}")
        for begin, end in edges.reshape(-1, 2).tolist()
        if end - begin >= TUNING.shortest_stretch
    ]


def as_planned(record: Record) -> Record:
    """The record with planned inputs in place of the measured ones of steered samples."""
    return replace(record, batches=tuple(map(_as_planned, record.batches)))


def _as_planned(batch: Batch) -> Batch:
    if batch.steered is None or batch.planned is None or not batch.steered.any():
        return batch
    places, m = batch.steered > 0, batch.planned.shape[1]
    inputs = batch.inputs.copy()
    inputs[places, :m] = batch.planned[places]
    delivered = batch.delivered
    if delivered is not None:
        values = delivered.values.copy()
        values[places, :, :m] = batch.planned[places, None]
        delivered = replace(delivered, values=values)
    return replace(batch, inputs=inputs, delivered=delivered)
