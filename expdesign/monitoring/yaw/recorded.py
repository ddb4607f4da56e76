"""Measured data of a ship as the inputs of a yaw model."""

from __future__ import annotations

import numpy as np

from expdesign.errors import InputError, NotInformative
from expdesign.estimation.regression import model_for
from expdesign.monitoring.yaw.model import INPUTS, YawData, YawModel
from expdesign.reduction import with_delivered_inputs
from expdesign.signals import AUXILIARY, Batch, Record
from expdesign.values import Array
from expdesign.vessel import NUMPY, VesselModel
from expdesign.vessel.structures import FORCE_SIGNALS

MOMENT = "actuator_psi_nm"
SIDE = ("sway_acceleration_mps2", "lateral_acceleration_mps2")
SAMPLES = 250
"""Of a stretch, at most; more are averaged."""


def needed_columns(model: YawModel) -> tuple[str, ...]:
    """Columns beside u, v, r that every row must have."""
    return ("roll_rad", *SIDE, MOMENT) if "M_v" in model.parameters else (MOMENT,)


def voyages(
    model: YawModel, vessel: VesselModel, record: Record, *, length_s: float, finest_s: float = 0.0
) -> tuple[YawData, Array]:
    """Consecutive parts of a record, each a voyage of its own.

    Args:
        model: whose inputs are wanted.
        vessel: model of the ship, whose terms give the moment of the drives where none is measured.
        record: measured data.
        length_s: of a part [s]; what is left at the end of a batch is left out.
        finest_s: samples are averaged until they are as long [s].

    Returns:
        The parts, and (n, 2) the batch and the sample that each begins with.

    Raises:
        InputError: a signal that the model needs is not measured.
        NotInformative: no part is long enough.
    """
    parts: list[dict[str, Array]] = []
    begins: list[tuple[int, int]] = []
    step_s = record.batches[0].sample_time_s
    width = max(1, int(finest_s / step_s + 1e-9))
    samples = width * max(2, round(length_s / step_s / width))
    for number, (batch, moment) in enumerate(zip(record.batches, _moments(vessel, record), strict=True)):
        signals = {**_signals(model, batch), "moment": moment}
        for first in range(0, len(batch) - samples + 1, samples):
            cut = slice(first, first + samples)
            parts.append({name: _means(values[cut], width) for name, values in signals.items()})
            begins.append((number, first))
    if not parts:
        raise NotInformative(f"the data have no {length_s:g} s without a gap, which a yaw model is tried on")
    table = {name: np.stack([part[name] for part in parts]) for name in ("r", *INPUTS)}
    return YawData(sample_time_s=width * step_s, **table), np.array(begins, dtype=float)


def _means(values: Array, width: int) -> Array:
    return np.asarray(values.reshape(-1, width).mean(axis=1))


def _signals(model: YawModel, batch: Batch) -> dict[str, Array]:
    u, v, r = batch.velocity.T
    for name, values in (("u_mps", u), ("v_mps", v), ("r_radps", r)):
        if not np.isfinite(values).all():
            raise InputError(f"{batch.name} has no {name}, which the yaw model {model.name} reads; expected it")
    still = np.zeros(len(batch))
    signals = {"r": r, "u": u, "v": v, "phi": still, "sway_acceleration": still}
    if "M_v" in model.parameters:
        side = [name for name in SIDE if batch.measures(name)]
        missing = ["roll_rad"] * (not batch.measures("roll_rad")) + [" or ".join(SIDE)] * (not side)
        if missing:
            raise InputError(
                f"{batch.name} has no {' and no '.join(missing)}, which the yaw model full reads; expected these "
                "columns, or --model yaw-simplified"
            )
        measured = auxiliary(batch, side[0])
        signals["sway_acceleration"] = measured if side[0] == SIDE[0] else measured - u * r
        signals["phi"] = auxiliary(batch, "roll_rad")
    return signals


def auxiliary(batch: Batch, name: str) -> Array:
    """(k,) one of `AUXILIARY`, which the batch measures."""
    assert batch.auxiliary is not None
    return np.asarray(batch.auxiliary[:, AUXILIARY.index(name)])


def measures_moment(record: Record) -> bool:
    """Whether the yaw moment of the drives is measured throughout."""
    return all(batch.measures(MOMENT) for batch in record.batches)


def _moments(vessel: VesselModel, record: Record) -> list[Array]:
    """(k,) yaw moment of the drives in every batch: measured [Nm], or by the vessel's terms [rad/s2]."""
    if measures_moment(record):
        return [auxiliary(batch, MOMENT) for batch in record.batches]
    model = model_for(vessel, record)
    inputs = {*model.inputs, *FORCE_SIGNALS}
    drives = np.array(
        [
            value if term.equation == "r" and inputs & set(expression.signals) else 0.0
            for term, expression, value in zip(model.terms, model.expressions, model.parameters.tolist(), strict=True)
        ]
    )
    if not drives.any():
        raise InputError(
            f"the data have no {MOMENT}, and no term of r in the vessel file reads an actuator; expected one of these"
        )
    found = []
    for batch in with_delivered_inputs(record, model).batches:
        columns = [batch.inputs[:, batch.input_names.index(name)] for name in model.inputs]
        u, v, r = batch.velocity.T
        air = (u, v) if batch.wind is None else tuple(batch.wind.T)
        values = model.regressors((u, v, r), air, columns, NUMPY)
        found.append(np.asarray(sum(p * x for p, x in zip(drives, values, strict=True) if p) / model.time_scale_s))
    return found
