"""A linear regression with several outputs, in several batches: y(k) = Phi(k)^T theta + eps(k).

Arrays put samples first: `Phi` is (k, n, p), so that sample k's regression matrix of the literature, Phi(k), is the
transpose of `Phi[k]`. Instruments have the same layout, (k, n, q). Model terms and nuisance regressors read batches as
tables of signals.

Source: F. Ljungberg, doctoral thesis, Linköping University, (2.14)-(2.21).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from expdesign.errors import InputError, UnknownName
from expdesign.signals import Batch, Record
from expdesign.values import Array, closed, frozen_set, seal
from expdesign.vessel import NUMPY, Actuator, Limit, VesselModel
from expdesign.vessel.structures import FORCE_SIGNALS, SHOAL

Integers = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Regression:
    """Data of a linear regression."""

    parameters: tuple[str, ...]  # names of the p columns
    Phi: Array  # (k, n, p) regressors
    y: Array  # (k, n) what they explain
    batch: Integers | None = None  # (k,) number of the batch of each row, rising; all zeros when left out
    # (k,) sample number within the batch, so that lags skip rows left out; counted when left out
    step: Integers | None = None
    outputs: tuple[str, ...] = ()  # names of the n outputs, "y1", "y2" ... when left out.
    # (k,) of the ship [rad], by which the covariance knows disturbances that keep their side of the chart while the
    # ship turns; None where it is not known
    heading: Array | None = None
    # (k, n) groups of rows for each output, from whose instruments the mean is subtracted separately, counted from 1; 0
    # for rows that it does not use. None for one group of all.
    strata: Integers | None = None

    def __post_init__(self) -> None:
        seal(self, Phi="k n p", y="k n", heading="k")
        k, n, p = self.Phi.shape
        if len(self.parameters) != p:
            raise InputError(f"Regression has {p} columns for {len(self.parameters)} parameter names")
        if not (np.isfinite(self.Phi).all() and np.isfinite(self.y).all()):
            raise InputError("Regression holds numbers that are not finite; leave such rows out")
        batch = np.zeros(k, dtype=np.int64) if self.batch is None else np.array(self.batch, dtype=np.int64)
        if batch.shape != (k,) or (np.diff(batch) < 0).any():
            raise InputError(f"Regression.batch needs {k} batch numbers that never fall")
        step = _count(batch) if self.step is None else np.array(self.step, dtype=np.int64)
        if step.shape != (k,) or ((np.diff(step) <= 0) & (np.diff(batch) == 0)).any():
            raise InputError(f"Regression.step needs {k} sample numbers that rise within every batch")
        if self.heading is not None and not np.isfinite(self.heading).all():
            raise InputError("Regression.heading holds numbers that are not finite; give none")
        if self.strata is not None and self.strata.shape != (k, n):
            raise InputError(f"Regression.strata has shape {self.strata.shape}, expected {(k, n)}")
        frozen_set(self, "batch", batch)
        frozen_set(self, "step", step)
        frozen_set(self, "outputs", self.outputs or tuple(f"y{i + 1}" for i in range(n)))

    def __len__(self) -> int:
        return len(self.y)

    @property
    def batch_of(self) -> Integers:
        """(k,) batch numbers."""
        assert self.batch is not None  # set at birth
        return self.batch

    @property
    def chosen(self) -> Mask | None:
        """(k, n) which rows each output uses; None for all."""
        return None if self.strata is None else self.strata != 0

    @property
    def groups(self) -> Integers:
        """(k, n) `strata`, of which there is one where there are none."""
        return np.ones(self.y.shape, dtype=np.int64) if self.strata is None else self.strata

    @property
    def used(self) -> Mask:
        """(k, n) which rows each output uses."""
        return np.asarray(self.groups != 0)

    @property
    def step_of(self) -> Integers:
        """(k,) sample numbers within the batches."""
        assert self.step is not None  # set at birth
        return self.step

    def at(self, rows: Integers | slice) -> Regression:
        """Some of its rows."""
        return replace(
            self,
            Phi=closed(self.Phi[rows]),
            y=self.y[rows],
            batch=self.batch_of[rows],
            step=self.step_of[rows],
            heading=None if self.heading is None else self.heading[rows],
            strata=None if self.strata is None else self.strata[rows],
        )

    def residuals(self, values: Array) -> Array:
        """(k, n) y - Phi^T theta for parameters (p,)."""
        return np.asarray(self.y - self.Phi @ values)


def single_output(Phi: Array, y: Array, *, parameters: tuple[str, ...], batch: Integers | None = None) -> Regression:
    """A regression of one output from regressors (k, p) and values (k,)."""
    return Regression(parameters=parameters, Phi=Phi[:, None, :], y=y[:, None], batch=batch)


def batch_slices(batch: Integers) -> list[slice]:
    """The rows of each batch, in order."""
    edges = np.flatnonzero(np.diff(batch)) + 1
    bounds = [0, *edges.tolist(), len(batch)]
    return [slice(low, high) for low, high in pairwise(bounds)]


def _count(batch: Integers) -> Integers:
    starts = np.searchsorted(batch, batch, side="left")
    return np.asarray(np.arange(len(batch)) - starts, dtype=np.int64)


# Zero-mean instruments: without their mean, constants and even moments of the noise drop out of the IV equations.
#
# Subtracting the mean over the complete data equals adding one constant nuisance parameter per output, subtracting it
# per batch equals one constant per output and batch (Lemmas 7.1 and 7.2). The complete way never has more variance.
#
# Source: F. Ljungberg, doctoral thesis, Linköping University, (4.40), (7.19), (7.20).

MEANS = ("none", "batch", "complete")


def subtract_mean(rows: Array, batch: Integers, mean: str) -> Array:
    """Rows (k, ...) without their mean over the complete data, or over each batch; "none" returns them as they are.

    Raises:
        UnknownName: `mean` is not one of `MEANS`.
    """
    if mean not in MEANS:
        raise UnknownName("instrument mean", mean, known=MEANS)
    if mean == "none":
        return rows
    if mean == "complete":
        return np.asarray(rows - rows.mean(axis=0))
    result = rows.copy()
    for number in np.unique(batch):
        chosen = batch == number
        result[chosen] -= rows[chosen].mean(axis=0)
    return result


Table = dict[str, Array]
VANE = "vane"
"""Beside the signals of a table: the standard deviation of the vane's angle, where the wind is from one [rad]."""
AIR = ("u_q", "v_q")


def model_for(model: VesselModel, record: Record) -> VesselModel:
    """The model driven by the inputs that were recorded: its own actuators, or plain generalised forces.

    Where draught over depth is recorded as one more input, the terms that depend on depth read it.

    Raises:
        InputError: no batches, or the recorded inputs do not drive the model.
    """
    if not record.batches:
        raise InputError("the record holds no batches")
    recorded = record.batches[0].input_names
    for batch in record.batches:
        if batch.input_names != recorded:
            raise InputError(f"{batch.name} has inputs {', '.join(batch.input_names)}, expected {', '.join(recorded)}")
    if SHOAL in recorded:
        model = in_depth(model)
    if set(model.inputs) <= set(recorded):
        return model
    needs = {name for expression in model.expressions for name in expression.signals} & set(model.inputs)
    if set(FORCE_SIGNALS) <= set(recorded) and not needs - {*FORCE_SIGNALS, SHOAL}:
        force = Actuator(kind="force", number=1, limits=(Limit(), Limit(), Limit()))
        depth = tuple(actuator for actuator in model.actuators if actuator.kind == "depth")
        return replace(model, actuators=(force, *depth))
    raise InputError(
        f"{record.batches[0].name} has inputs {', '.join(recorded)}, expected {', '.join(model.inputs)} "
        f"or {', '.join(FORCE_SIGNALS)}"
    )


def with_depth(record: Record, draught_m: float) -> Record:
    """The record with draught over depth as one more input, 0 where a batch has no depth, with a note."""
    batches = []
    for batch in record.batches:
        shoal = np.zeros(len(batch)) if batch.depth_m is None else draught_m / batch.depth_m
        inputs = np.column_stack([batch.inputs, shoal])
        batches.append(replace(batch, inputs=inputs, input_names=(*batch.input_names, SHOAL)))
    missing = [batch.name for batch in record.batches if batch.depth_m is None]
    notes = [f"{', '.join(missing)}: depth_m is not measured, deep water is assumed."]
    return replace(record, batches=tuple(batches), notes=(*record.notes, *(notes if missing else [])))


def in_depth(model: VesselModel) -> VesselModel:
    """The model with draught over depth as one more input, as in records and commands with depth."""
    if SHOAL in model.inputs:
        return model
    return replace(model, actuators=(*model.actuators, Actuator(kind="depth", number=1, limits=(Limit(),))))


def inputs_of(model: VesselModel, batch: Batch) -> Array:
    """(k, m) recorded inputs in the model's order."""
    return batch.inputs[:, [batch.input_names.index(name) for name in model.inputs]]


def drive_of(model: VesselModel, batch: Batch, *, substeps: int, times: Sequence[str] = ()) -> Array:
    """(k, c) inputs held over each sample, c = m, or those of its s parts and their shares of it, c = s m + s.

    Args:
        batch: recorded, or with delivered inputs.
        substeps: integrator steps per sample; a single one takes the mean over it.
        times: names of uncertain times of the actuators; derivatives by each follow in c columns [1/s].
    """
    steps, held = batch.delivered, parts_of(batch, substeps=substeps) == 1
    if steps is None:
        return inputs_of(model, batch)
    order, count = [batch.input_names.index(name) for name in model.inputs], len(batch)
    places = [steps.times.index(name) for name in times]
    values, shares = steps.values[:, :, order], steps.shares
    pairs = [(values, shares)]
    for place in places:
        pairs.append((steps.values_by_time[:, :, order, place], steps.shares_by_time[:, place]))
    if not held:
        return np.hstack([x for v, s in pairs for x in (v.reshape(count, -1), np.tile(s, (count, 1)))])
    moved = [np.einsum("ksm,s->km", v, shares) + np.einsum("ksm,s->km", values, s) for v, s in pairs[1:]]
    return np.hstack([inputs_of(model, batch), *moved])


def drive_width(inputs: int, parts: int) -> int:
    """Columns of `drive_of`."""
    return inputs if parts == 1 else parts * (inputs + 1)


def parts_of(batch: Batch, *, substeps: int) -> int:
    """Parts of a sample with inputs of their own, for simulations of so many steps per sample."""
    return 1 if batch.delivered is None or substeps == 1 else len(batch.delivered.shares)


def inputs_within(model: VesselModel, batch: Batch) -> tuple[tuple[float, Table], ...]:
    """Share of each part of a sample, and the signals of its inputs; one part without any where inputs are held."""
    if batch.delivered is None:
        return ((1.0, {}),)
    still = (np.zeros(len(batch)),) * 5
    found = []
    for share, values in zip(batch.delivered.shares.tolist(), _delivered(model, batch).swapaxes(0, 1), strict=True):
        table = model.signals(still[:3], still[3:], values.T, NUMPY)
        found.append((share, {name: np.asarray(table[name]) for name in (*FORCE_SIGNALS, *model.inputs)}))
    return tuple(found)


def _delivered(model: VesselModel, batch: Batch) -> Array:
    """(k, s, m) delivered inputs in the model's order."""
    assert batch.delivered is not None  # asked before
    return np.asarray(batch.delivered.values[:, :, [batch.input_names.index(name) for name in model.inputs]])


def measured_table(model: VesselModel, batch: Batch, *, wind_measured: bool) -> Table:
    """Measured signals; without measured wind the air velocities are those over ground.

    Raises:
        InputError: wind is asked for and was not measured.
    """
    if wind_measured and batch.wind is None:
        raise InputError(f"{batch.name} has no measured wind; use a predictor without wind")
    air = batch.wind if wind_measured and batch.wind is not None else batch.velocity[:, :2]
    table = signal_table(model, batch.velocity, air, heading_of(batch), inputs_of(model, batch))
    return {**table, VANE: np.array(batch.vane_std_rad)} if wind_measured and batch.vane_std_rad else table


def signal_table(model: VesselModel, velocity: Array, air: Array, heading: Array, inputs: Array) -> Table:
    """Every signal (k,) that a term may read, and the heading as "psi"."""
    table = model.signals(tuple(velocity.T), tuple(air.T), inputs.T, NUMPY)
    count = len(velocity)
    return {name: np.broadcast_to(np.asarray(values, dtype=float), (count,)) for name, values in table.items()} | {
        "psi": heading
    }


def heading_of(batch: Batch) -> Array:
    """(k,) measured heading [rad], nan where there is none."""
    return np.full(len(batch), np.nan) if batch.pose is None else batch.pose[:, 2]
