"""Faults injected into measured trials, or into the model that was fitted to them, and the names they ought to get."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from expdesign.diagnosis import Finding
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.model.term_library import term_library
from expdesign.diagnosis.motion.simulation import simulate_from_measured
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.signals import Batch, Record
from expdesign.simulation.motion import to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel, VesselModel

AHEAD_S = 30.0
OFFSET_RAD, BIAS_RAD, GAIN, DELAY_S, CURRENT_MPS = np.radians(2.0), np.radians(3.0), 0.9, 1.0, 0.07
CERTAIN = 5.0
"""Parameters that are so many standard deviations from zero may be taken out or turned round."""
LEAST_COST = 0.1
"""Relative growth of some error 30 s ahead by which a term that is taken out or turned round must show."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault.

    Attributes:
        name: in the table.
        inject: of a model fitted to a record, and that record, with a generator of random numbers: the model in use and
            its data, and what is right about the first finding; None where the trial has no such fault.
    """

    name: str
    inject: Callable[[Vessel, Record, np.random.Generator], tuple[Vessel, Record, Callable[[Finding], bool]] | None]


def in_record(
    change: Callable[[Batch, np.random.Generator], Batch], cause: str, keys: str = ""
) -> Callable[[Vessel, Record, np.random.Generator], tuple[Vessel, Record, Callable[[Finding], bool]]]:
    """A fault of the data that is named rightly by a cause, whose effects begin so."""

    def inject(
        vessel: Vessel, record: Record, rng: np.random.Generator
    ) -> tuple[Vessel, Record, Callable[[Finding], bool]]:
        seed = int(rng.integers(2**31))
        batches = tuple(change(batch, np.random.default_rng(seed)) for batch in record.batches)
        return vessel, Record(batches=batches), lambda item: item.cause == cause and item.keys[0].startswith(keys)

    return inject


def _rudder(batch: Batch, change: Callable[[Array], Array]) -> Batch:
    inputs = np.array(batch.inputs)
    column = batch.input_names.index("rudder1")
    inputs[:, column] = change(inputs[:, column])
    return replace(batch, inputs=inputs)


def _early(batch: Batch, _rng: np.random.Generator) -> Batch:
    """Inputs as commands that actuators follow after the delay: recorded that much earlier than they act."""
    count = round(DELAY_S / batch.sample_time_s)
    ahead = np.concatenate([batch.inputs[count:], np.repeat(batch.inputs[-1:], count, axis=0)])
    return replace(batch, inputs=ahead)


def _misaligned(batch: Batch, _rng: np.random.Generator) -> Batch:
    """A compass that shows too much, with which velocities over ground were turned into the ship's axes."""
    assert batch.pose is not None
    c, s = np.cos(BIAS_RAD), np.sin(BIAS_RAD)
    u, v, r = batch.velocity.T
    return replace(
        batch,
        velocity=np.stack([u * c + v * s, v * c - u * s, r], axis=-1),
        pose=batch.pose + np.array([0.0, 0.0, BIAS_RAD]),
    )


def _drifting(batch: Batch, rng: np.random.Generator) -> Batch:
    """The same motion through the water in a current, towards any side."""
    assert batch.pose is not None
    toward = float(rng.uniform(0, 2 * np.pi))
    north, east = CURRENT_MPS * np.cos(toward), CURRENT_MPS * np.sin(toward)
    u_c, v_c = to_body((north, east), batch.pose[:, 2], NUMPY)
    time = np.arange(len(batch)) * batch.sample_time_s
    return replace(
        batch,
        velocity=batch.velocity + np.stack([u_c, v_c, np.zeros_like(u_c)], axis=-1),
        pose=batch.pose + np.stack([north * time, east * time, np.zeros_like(time)], axis=-1),
    )


def error_ahead(vessel: Vessel, record: Record) -> Array:
    """(3,) root mean square error of u, v, r predicted 30 s ahead, anew every 30 s, over all samples."""
    ship = extended_model(vessel, record)
    windows = cut_windows(ship.model, record, longest_s=AHEAD_S)
    return np.asarray(np.sqrt(np.nanmean(simulate_from_measured(ship, windows).error[..., :3] ** 2, axis=(0, 1))))


def _turned_round(
    vessel: Vessel, record: Record, _rng: np.random.Generator
) -> tuple[Vessel, Record, Callable[[Finding], bool]] | None:
    """The sign of the well-determined parameter that costs least, of those that cost enough."""
    changed = {name: _with_sign_turned(vessel.model, name) for name in _certain(vessel.model)}
    name = _smallest(vessel, record, changed)
    if name is None:
        return None
    return replace(vessel, model=changed[name]), record, lambda item: f"theta:{name}" in item.keys


def _taken_out(
    vessel: Vessel, record: Record, _rng: np.random.Generator
) -> tuple[Vessel, Record, Callable[[Finding], bool]] | None:
    """A term of the library likewise; terms of the air are named as wind."""
    changed = {name: _without(vessel.model, name) for name in _certain(vessel.model)}
    known = {
        name: model
        for name, model in changed.items()
        if any(_same_term(vessel.model, name, other) for other in term_library(model))
    }
    name = _smallest(vessel, record, known)
    if name is None:
        return None
    found = next(other for other in term_library(known[name]) if _same_term(vessel.model, name, other))
    return replace(vessel, model=known[name]), record, lambda item: f"term:{found}" in item.keys


def _same_term(model: VesselModel, name: str, other: str) -> bool:
    """Whether a library term that the model without one of its terms may get is that one: the only one it gains."""
    return other in term_library(_without(model, name)) and other not in term_library(model)


def _certain(model: VesselModel) -> list[str]:
    rows = zip(model.names, model.parameters.tolist(), model.parameter_std.tolist(), strict=True)
    return [name for name, value, std in rows if abs(value) > CERTAIN * std]


def _with_sign_turned(model: VesselModel, name: str) -> VesselModel:
    sign = np.where(np.array(model.names) == name, -1.0, 1.0)
    return replace(model, parameters=sign * model.parameters)


def _without(model: VesselModel, name: str) -> VesselModel:
    kept = [index for index, own in enumerate(model.names) if own != name]
    return replace(
        model,
        terms=tuple(model.terms[index] for index in kept),
        parameters=model.parameters[kept],
        parameter_std=model.parameter_std[kept],
    )


def _smallest(vessel: Vessel, record: Record, changed: dict[str, VesselModel]) -> str | None:
    """The change that costs least, of those that cost enough."""
    whole = error_ahead(vessel, record)
    costs = {
        name: float((error_ahead(replace(vessel, model=model), record) / whole).max()) - 1.0
        for name, model in changed.items()
    }
    return min((name for name, cost in costs.items() if cost >= LEAST_COST), key=lambda name: costs[name], default=None)


FAULTS = (
    Fault(name="untouched", inject=lambda vessel, record, _rng: (vessel, record, lambda _item: False)),
    Fault(
        name="rudder gain 0.9",
        inject=in_record(lambda batch, _rng: _rudder(batch, lambda angle: GAIN * angle), "actuator_scale"),
    ),
    Fault(
        name="rudder offset 2 deg",
        inject=in_record(
            lambda batch, _rng: _rudder(batch, lambda angle: angle + OFFSET_RAD), "thruster_asymmetry", "offset:"
        ),
    ),
    Fault(name="heading bias 3 deg", inject=in_record(_misaligned, "heading_bias")),
    Fault(name="delay 1 s", inject=in_record(_early, "actuator_delay")),
    Fault(name="current 0.07 m/s", inject=in_record(_drifting, "current")),
    Fault(name="sign turned", inject=_turned_round),
    Fault(name="term taken out", inject=_taken_out),
)
