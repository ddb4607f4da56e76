"""The extended model of a vessel file and a record, with stated standard deviations and the names of effects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from expdesign.diagnosis.data import derived_outputs, has_heading
from expdesign.diagnosis.model import (
    RESPONSES,
    ROLL,
    Effects,
    ExtendedModel,
    ahead_force_text,
    group_columns,
    response_effect,
    term_library,
    turns_by_force,
    values_by_group,
)
from expdesign.errors import InputError
from expdesign.estimation.regression import model_for
from expdesign.signals import Batch, Record
from expdesign.simulation import acting_response
from expdesign.vessel import Environment, Response, Roll, Sensors, Vessel, VesselModel, column_name
from expdesign.vessel.quantities import effect_row, rows_of
from expdesign.vessel.structures import SHOAL

SEARCHED = ("deadband",)
"""Kinds of effects that are found by trying values; fits have no derivative by them, so their values count as known."""


def stated_std(vessel: Vessel, inputs: tuple[str, ...], derived: tuple[str, ...], stated: Effects) -> dict[str, float]:
    """Standard deviation of every stated effect that has one.

    Args:
        vessel: its file.
        derived: velocities that come from the pose.
    """
    weather = vessel.environment
    flows = {"current": weather.current_std_mps, "wind": weather.wind_std_mps}
    found = {}
    for key in stated:
        kind = key.split(":")[0]
        given = (vessel.std.get(name, 0.0) for name in std_keys_of(key, inputs, derived))
        found[key] = flows[kind] if kind in flows else max(given, default=0.0) * _slope(key, stated[key])
    return {key: std for key, std in found.items() if std > 0 and key.split(":")[0] not in SEARCHED}


def found_std(vessel: Vessel, ship: ExtendedModel, std: Mapping[str, float], known: Sequence[str]) -> dict[str, float]:
    """`Vessel.std` with the standard errors of effects; `known` are the keys that the vessel's file may have."""
    named = {
        name: value / _slope(key, ship.get(key))
        for key, value in std.items()
        for name in std_keys_of(key, ship.model.inputs, ship.derived)
    }
    return {name: value for name, value in {**vessel.std, **named}.items() if name in known and value > 0}


def _slope(key: str, effect: float) -> float:
    """Change of an effect by that of the number which the vessel file states."""
    return effect**2 if key.startswith("slew:") and effect else 1.0


def with_std(weather: Environment, std: Mapping[str, float]) -> Environment:
    """Current and wind with the standard errors of their estimates, the larger one of their two components."""

    def largest(name: str, known: float) -> float:
        return max((std[key] for key in (f"{name}:north", f"{name}:east") if key in std), default=known)

    return replace(
        weather,
        current_std_mps=largest("current", weather.current_std_mps),
        wind_std_mps=largest("wind", weather.wind_std_mps),
    )


def std_keys_of(key: str, inputs: tuple[str, ...], derived: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Keys of `Vessel.std` that an effect belongs to; `derived` are velocities that come from the pose."""
    kind, _, rest = key.partition(":")
    if kind in RESPONSES:
        return tuple(f"{inputs[column]}_{RESPONSES[kind]}" for column in group_columns(rest, inputs))
    return tuple(row.key for row in rows_of(Sensors) if key in row.effects and row.is_shown(derived))


def extended_model(vessel: Vessel, record: Record) -> ExtendedModel:
    """The model in use, with the actuators, sensors and weather that its file states; no weather without a heading.

    Raises:
        InputError: draught over depth is an input of the record, but no depth is recorded.
    """
    model, max_draught_over_depth = _driven(vessel, record)
    derived = derived_outputs(record)
    effects = _answering(model, record) | _sensed(vessel.sensors, derived) | _rolled(model.roll)
    effects |= _flowing(vessel.environment) if has_heading(record) else {}
    known = {key: value for key, value in effects.items() if value}
    return ExtendedModel(
        model=model,
        library=term_library(model),
        draught_m=vessel.draught_m,
        length_m=vessel.length_m,
        beam_m=vessel.beam_m,
        derived=derived,
        max_draught_over_depth=max_draught_over_depth,
        effects=known,
        stated=known,
        stated_std=stated_std(vessel, model.inputs, derived, known),
        shown=record.shown,
    )


def _answering(model: VesselModel, record: Record) -> dict[str, float]:
    """Actuator responses of a vessel file, as far as they act on what is recorded (`simulation.acting_response`)."""
    rows = [row for actuator in model.actuators for row in zip(actuator.signals, actuator.responses, strict=True)]
    found = dict[str, float]()
    for kind, name in RESPONSES.items():
        values = {
            signal: response_effect(kind, getattr(_acting(record, signal, response), name)) for signal, response in rows
        }
        found |= {f"{kind}:{group}": value for group, value in values_by_group(values, model.inputs).items()}
    return found


def _acting(record: Record, signal: str, response: Response) -> Response:
    """The response that acts on the recorded values of a signal in any of the batches."""
    given = [acting_response(batch, signal, response) for batch in record.batches if signal in batch.input_names]
    return next((own for own in given if own == response), given[0] if given else response)


def _flowing(weather: Environment) -> dict[str, float]:
    """Current and wind of a vessel file; they act only with a heading."""
    flows = {"current": weather.current_to, "wind": weather.wind_to}
    return {
        f"{name}:{axis}": float(part)
        for name, flow in flows.items()
        for axis, part in zip(("north", "east"), flow, strict=True)
    }


def _sensed(sensors: Sensors, derived: tuple[str, ...]) -> dict[str, float]:
    """Sensor errors of a vessel file, of the sensors that the data come from."""
    rows = [row for row in rows_of(Sensors) if row.is_shown(derived)]
    return {key: row.sign * (getattr(sensors, row.key) - row.neutral) for row in rows for key in row.effects}


def _driven(vessel: Vessel, record: Record) -> tuple[VesselModel, float]:
    """The model driven by the recorded inputs, and the largest draught over depth; depth is no input here."""
    model = model_for(vessel.model, record)
    depths = [batch.depth_m for batch in record.batches if batch.depth_m is not None]
    if SHOAL in model.inputs and not depths and any(batch.inputs[:, _shoal(batch)].any() for batch in record.batches):
        raise InputError(f"the record has {SHOAL}, draught over depth, among its inputs, expected depth_m beside them")
    actuators = tuple(actuator for actuator in model.actuators if actuator.kind != "depth")
    max_draught_over_depth = float(np.nan_to_num(vessel.draught_m / np.concatenate(depths)).max()) if depths else 0.0
    return replace(model, actuators=actuators) if SHOAL in model.inputs else model, max_draught_over_depth


def _rolled(roll: Roll | None) -> dict[str, float]:
    """Roll mode of a vessel file."""
    return {} if roll is None else {key: float(getattr(roll, name)) for key, name in ROLL.items()}


def _shoal(batch: Batch) -> int:
    return batch.input_names.index(SHOAL)


def stated_values(keys: Iterable[str], ship: ExtendedModel) -> str:
    """A sentence on the values of these effects in the vessel file; empty without any."""
    stated = []
    for key in keys:
        if key in ship.stated:
            name, factor, offset, _ = public_name(key, ship)
            stated.append(f"{name} {offset + factor * ship.stated[key]:.3g}")
    return f" The vessel file states {', '.join(stated)}." if stated else ""


def public_name(key: str, ship: ExtendedModel) -> tuple[str, float, float, str]:
    """(name, factor, offset, unit) that turn an effect into a number of the results: value = offset + factor effect."""
    kind, _, rest = key.partition(":")
    model = ship.model
    if kind == "theta":
        return rest, 1.0, float(model.parameters[model.names.index(rest)]), ""
    if key == "heading_bias":  # as the vessel file counts it: of the compass, or of the velocity sensor's axes
        return ("heading_bias_rad" if "u" in ship.derived else "velocity_angle_rad"), -1.0, 0.0, "rad"
    if kind == "deadband":
        unit = _input_unit(rest, model)
        return f"deadband_{rest}_{unit}" if unit else f"deadband_{rest}", 1.0, 0.0, unit
    if kind == "slew":
        unit = _input_unit(rest, model)
        return f"slew_{rest}_s_per_{unit or 'unit'}", 1.0, 0.0, f"s/{unit}" if unit else "s"
    if key == "asymmetry":
        return _lean_name(model)
    row = effect_row(key)
    return row.result.format(rest), 1.0, row.neutral, row.unit


def _input_unit(group: str, model: VesselModel) -> str:
    """Unit of a group of inputs in names; generalised forces have none there."""
    signal = model.inputs[group_columns(group, model.inputs)[0]]
    return column_name(signal)[len(signal) + 1 :]


def _lean_name(model: VesselModel) -> tuple[str, float, float, str]:
    """Name of the yaw moment of ahead force: a length where force makes moments, else per unit of the model's input."""
    if turns_by_force(model):
        return "thrust_offset_m", 1.0, 0.0, "m"
    if ahead_force_text(model) == "tau_x":
        return "yaw_radps2_per_tau_x", 1.0, 0.0, ""
    return "yaw_radps2_per_rps2", 1.0, 0.0, "rad/s\N{SUPERSCRIPT TWO} per rps\N{SUPERSCRIPT TWO}"
