"""Batches as tables of signals, the form that model terms and nuisance regressors read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.errors import InputError
from expdesign.signals import Batch, Record
from expdesign.values import Array
from expdesign.vessel import NUMPY, Actuator, Limit, VesselModel
from expdesign.vessel.structures import FORCE_SIGNALS, SHOAL

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
        model: gives the order of inputs.
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
