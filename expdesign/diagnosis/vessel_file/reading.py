"""The extended model of a vessel file and a record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from expdesign.diagnosis.data import derived_outputs, has_heading
from expdesign.diagnosis.model import RESPONSES, ROLL, ExtendedModel, response_effect, term_library, values_by_group
from expdesign.diagnosis.vessel_file.stated_std import stated_std
from expdesign.errors import InputError
from expdesign.estimation.regression import model_for
from expdesign.signals import Batch, Record
from expdesign.simulation import acting_response
from expdesign.vessel import Environment, Response, Roll, Sensors, Vessel, VesselModel
from expdesign.vessel.structures import SHOAL


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
    from_pose = "u" in derived
    place = sensors.position if from_pose else sensors.velocity
    velocity_s = 0.0 if from_pose else sensors.velocity.delay_s
    return {
        "heading_bias": -(sensors.heading_bias_rad if from_pose else sensors.velocity_angle_rad),
        "log": 0.0 if from_pose else sensors.velocity_scale - 1.0,
        "gyro": 0.0 if "r" in derived else sensors.yaw_rate_scale - 1.0,
        "lever:forward": place.forward_m,
        "lever:starboard": place.starboard_m,
        "late:u": velocity_s,
        "late:v": velocity_s,
        "late:r": 0.0 if "r" in derived else sensors.yaw_rate.delay_s,
        "late:psi": sensors.heading.delay_s,
        "late:position": sensors.position.delay_s if from_pose else 0.0,
    }


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
