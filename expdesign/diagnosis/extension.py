"""From a vessel to a model with effects, and back: everything found becomes part of a vessel file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from expdesign.diagnosis.causes import library
from expdesign.diagnosis.data import derived_outputs, has_heading
from expdesign.diagnosis.found_model import found_model
from expdesign.diagnosis.model import ROLL, Extended, ahead_force_text, grouped, mean_wind, members, turns_by_force
from expdesign.errors import InputError
from expdesign.estimation.regression import model_for
from expdesign.signals import Batch, Record
from expdesign.vessel import Actuator, Environment, Response, Roll, Sensors, Vessel, VesselModel, column_name
from expdesign.vessel.structures import SHOAL

RESPONSES = {"lag": "lag_s", "delay": "delay_s", "deadband": "deadband", "offset": "offset"}


def as_extended(vessel: Vessel, record: Record) -> Extended:
    """The model in use, with the actuators, sensors and weather that its file states; no weather without a heading.

    Raises:
        InputError: draught over depth is an input of the record, but no depth is recorded.
    """
    model, shoalest = _driven(vessel, record)
    derived = derived_outputs(record)
    effects = _answering(model) | _sensed(vessel.sensors, derived) | _rolled(model.roll)
    effects |= _flowing(vessel.environment) if has_heading(record) else {}
    known = {key: value for key, value in effects.items() if value}
    return Extended(
        model=model,
        library=library(model),
        draught_m=vessel.draught_m,
        derived=derived,
        shoalest=shoalest,
        effects=known,
        stated=known,
    )


def _answering(model: VesselModel) -> dict[str, float]:
    """What a file says of how actuators answer."""
    rows = [row for actuator in model.actuators for row in zip(actuator.signals, actuator.responses, strict=True)]
    return {
        f"{kind}:{group}": value
        for kind, name in RESPONSES.items()
        for group, value in grouped({signal: getattr(how, name) for signal, how in rows}, model.inputs).items()
    }


def _flowing(weather: Environment) -> dict[str, float]:
    """What a file says of current and wind, which needs a heading to act in."""
    flows = {"current": weather.current_to, "wind": weather.wind_to}
    return {
        f"{name}:{way}": float(part)
        for name, flow in flows.items()
        for way, part in zip(("north", "east"), flow, strict=True)
    }


def _sensed(sensors: Sensors, derived: tuple[str, ...]) -> dict[str, float]:
    """What a file says of the sensors that the data come from."""
    from_pose = "u" in derived
    place = sensors.position if from_pose else sensors.velocity
    velocity_s = 0.0 if from_pose else sensors.velocity.delay_s
    return {
        "heading_bias": -(sensors.heading_bias_rad if from_pose else sensors.velocity_angle_rad),
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
    shoalest = float(np.nan_to_num(vessel.draught_m / np.concatenate(depths)).max()) if depths else 0.0
    return replace(model, actuators=actuators) if SHOAL in model.inputs else model, shoalest


def _rolled(roll: Roll | None) -> dict[str, float]:
    """What a file says of roll."""
    return {} if roll is None else {key: float(getattr(roll, name)) for key, name in ROLL.items()}


def _shoal(batch: Batch) -> int:
    return batch.input_names.index(SHOAL)


def extend(vessel: Vessel, ship: Extended, std: Mapping[str, float]) -> tuple[Vessel, tuple[str, ...]]:
    """The vessel with everything in `ship`, and what could not be written into it, one sentence each.

    Args:
        vessel: the model in use.
        ship: with effects found.
        std: standard errors of effects.
    """
    model, missing = found_model(vessel.model, ship, std)
    actuators, more = _actuators(model.actuators, ship)
    if "u" not in ship.derived and ship.get("late:u") != ship.get("late:v"):
        more = (*more, "The delay of u or v alone is written as one of the whole velocity sensor.")
    if any(key.startswith("late:") and value < 0 for key, value in ship.effects.items()):
        more = (
            *more,
            "The vessel file leaves out a delay below zero, and its simulation gains nothing by that finding.",
        )
    weather = vessel.environment
    if _has(ship, "current:"):
        weather = replace(weather, current_to=np.array([ship.get("current:north"), ship.get("current:east")]))
    if _has(ship, "wind:"):
        weather = replace(weather, wind_to=np.array(mean_wind(ship)))
    return (
        replace(
            vessel,
            model=replace(model, actuators=actuators),
            sensors=_sensors(vessel.sensors, ship),
            environment=weather,
        ),
        (*missing, *more),
    )


def _has(ship: Extended, prefix: str) -> bool:
    return any(key.startswith(prefix) for key in ship.effects)


def _actuators(actuators: tuple[Actuator, ...], ship: Extended) -> tuple[tuple[Actuator, ...], tuple[str, ...]]:
    own = tuple(name for actuator in actuators for name in actuator.signals)
    recorded = ship.model.inputs
    changes: dict[str, dict[str, float]] = {}
    lost = []
    for key, value in ship.effects.items():
        kind, _, group = key.partition(":")
        if kind not in RESPONSES:
            continue
        for index in members(group, recorded):
            if recorded[index] in own:
                row = changes.setdefault(recorded[index], {})
                row[RESPONSES[kind]] = row.get(RESPONSES[kind], 0.0) + value
            else:
                lost.append(
                    f"{kind} of {recorded[index]} is not in the vessel file, whose actuators take other signals."
                )
    result = []
    for actuator in actuators:
        responses = tuple(
            Response(**changes.get(signal, {})) if signal in recorded else response
            for signal, response in zip(actuator.signals, actuator.responses, strict=True)
        )
        result.append(replace(actuator, responses=responses))
    return tuple(result), tuple(dict.fromkeys(lost))


def _sensors(sensors: Sensors, ship: Extended) -> Sensors:
    get = ship.get

    def late(*keys: str) -> float:
        return max(0.0, *(get(key) for key in keys))

    lever = {"forward_m": get("lever:forward"), "starboard_m": get("lever:starboard")}
    sensors = replace(sensors, heading=replace(sensors.heading, delay_s=late("late:psi")))
    if "r" not in ship.derived:
        yaw_rate = replace(sensors.yaw_rate, delay_s=late("late:r"))
        sensors = replace(sensors, yaw_rate_scale=1.0 + get("gyro"), yaw_rate=yaw_rate)
    if "u" in ship.derived:
        position = replace(sensors.position, **lever, delay_s=late("late:position"))
        return replace(sensors, heading_bias_rad=0.0 - get("heading_bias"), position=position)
    velocity = replace(sensors.velocity, **lever, delay_s=late("late:u", "late:v"))
    return replace(sensors, velocity_angle_rad=0.0 - get("heading_bias"), velocity=velocity)


def as_stated(keys: Iterable[str], ship: Extended) -> str:
    """What the vessel file states of these effects, as a sentence to go on with; empty where it states nothing."""
    told = []
    for key in keys:
        if key in ship.stated:
            name, factor, offset, _ = public_name(key, ship)
            told.append(f"{name} {offset + factor * ship.stated[key]:.3g}")
    return f" The vessel file states {', '.join(told)}." if told else ""


def public_name(key: str, ship: Extended) -> tuple[str, float, float, str]:
    """(name, factor, offset, unit) that turn an effect into a number of the results: value = offset + factor effect."""
    kind, _, rest = key.partition(":")
    model = ship.model
    if kind == "theta":
        return rest, 1.0, float(model.parameters[model.names.index(rest)]), ""
    if key in NAMES:
        return NAMES[key][0], 1.0, 0.0, NAMES[key][1]
    if kind == "deadband":
        unit = _input_unit(rest, model)
        return f"deadband_{rest}_{unit}" if unit else f"deadband_{rest}", 1.0, 0.0, unit
    if key == "asymmetry":
        return _lean_name(model)
    if kind in PATTERNS:
        name, offset, unit = PATTERNS[kind]
        return name.format(rest), 1.0, offset, unit
    return ROLL[key], 1.0, 0.0, "rad/m" if key == "roll:yaw" else ""


NAMES = {
    "wind:toward": ("toward_rad", "rad"), "change:time": ("time_s", "s"), "heading_bias": ("heading_bias_rad", "rad"),
    "roll:period": ("roll_period_s", "s"), "roll:damping": ("roll_damping_ratio", ""),
}  # fmt: skip
"""Effect -> name in results and unit."""
PATTERNS = {
    "current": ("{}_mps", 0.0, "m/s"), "wind": ("{}_mps", 0.0, "m/s"), "offset": ("angle_offset_{}_rad", 0.0, "rad"),
    "lag": ("lag_{}_s", 0.0, "s"), "delay": ("delay_{}_s", 0.0, "s"), "lever": ("{}_m", 0.0, "m"),
    "late": ("{}_delay_s", 0.0, "s"), "shallow": ("{}_growth", 0.0, ""), "term": ("{}", 0.0, ""),
    "gain": ("factor", 1.0, ""), "gyro": ("factor", 1.0, ""), "inertia": ("inertia_factor_{}", 1.0, ""),
    "change": ("{}_factor", 1.0, ""),
}  # fmt: skip
"""Kind of effect -> name in results of one that ends in what stands for {}, what it is when nothing is wrong, unit."""


def _input_unit(group: str, model: VesselModel) -> str:
    """Unit of a group of inputs in names; generalised forces have none there."""
    signal = model.inputs[members(group, model.inputs)[0]]
    return column_name(signal)[len(signal) + 1 :]


def _lean_name(model: VesselModel) -> tuple[str, float, float, str]:
    """Name of the yaw moment of ahead force: a length where force makes moments, else what the model is driven by."""
    if turns_by_force(model):
        return "thrust_offset_m", 1.0, 0.0, "m"
    if ahead_force_text(model) == "tau_x":
        return "yaw_radps2_per_tau_x", 1.0, 0.0, ""
    return "yaw_radps2_per_rps2", 1.0, 0.0, "rad/s\N{SUPERSCRIPT TWO} per rps\N{SUPERSCRIPT TWO}"
