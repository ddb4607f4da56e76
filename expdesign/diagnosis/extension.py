"""From a vessel to a model with effects, and back: everything found becomes part of a vessel file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from expdesign.diagnosis.causes.missing_term import library
from expdesign.diagnosis.causes.shallow_water import in_shallow_water
from expdesign.diagnosis.extended import ROLL, Extended
from expdesign.diagnosis.followed import grouped, members
from expdesign.diagnosis.parts import is_coriolis, is_damping, is_thrust, reads_rudder
from expdesign.diagnosis.surroundings import mean_wind
from expdesign.diagnosis.windows import derived_outputs, has_heading
from expdesign.errors import InputError
from expdesign.estimation.tables import model_for
from expdesign.signals import Batch, Record
from expdesign.vessel import Actuator, Environment, Response, Roll, Sensors, Term, Vessel, VesselModel
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
    model, missing = _model(vessel.model, ship, std)
    actuators, more = _actuators(model.actuators, ship)
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


def _model(model: VesselModel, ship: Extended, std: Mapping[str, float]) -> tuple[VesselModel, tuple[str, ...]]:
    get = ship.get
    values, stds = [], []
    for term, expression, value, known in zip(
        model.terms, model.expressions, model.parameters.tolist(), model.parameter_std.tolist(), strict=True
    ):
        key = f"theta:{term.name}"
        whole = value + get(key) + get(f"change:{key}")
        factor = 1.0
        if is_thrust(expression, ship.model):
            factor *= (1 + get("gain")) * (1 + get("change:gain"))
            factor *= 1.0 if reads_rudder(expression) else 1 + get("gain:propeller")
        elif is_damping(term, expression, ship.model):
            factor *= 1 + get("change:damping") + get(f"change:damping_{term.equation}")
        if not is_coriolis(term):
            factor /= 1 + get(f"inertia:{term.equation}")
        values.append(whole * factor)
        stds.append(abs(factor) * (std.get(key, known)))
    terms = list(model.terms)
    for key, value in ship.effects.items():
        if key.startswith("term:"):
            term = ship.library[key[5:]]
            terms.append(term)
            values.append(value / (1 + get(f"inertia:{term.equation}")))
            stds.append(std.get(key, 0.0))
    lean = _lean(model, ship)
    if lean is not None:
        terms.append(lean[0])
        values.append(lean[1])
        stds.append(0.0)
    missing = []
    if "change:time" in ship.effects:
        missing.append("The vessel file describes the ship after the change.")
    extended = replace(
        model,
        terms=tuple(terms),
        parameters=np.array(values, dtype=float),
        parameter_std=np.array(stds, dtype=float),
        roll=ship.roll,
    )
    if ship.has_roll:
        missing.append(
            "The vessel file has the oscillation as [model.roll]: simulate, score, durations, indices and diagnose "
            "follow it; estimate and plans need a vessel file without that table, and say so."
        )
    extended, depths = _depths(extended, model, ship)
    return extended, (*missing, *depths)


def _depths(extended: VesselModel, known: VesselModel, ship: Extended) -> tuple[VesselModel, tuple[str, ...]]:
    """The model with the dependence on depth that was found, and how far it holds."""
    growth = {key.split(":")[1]: value for key, value in ship.effects.items() if key.startswith("shallow:")}
    if not growth:
        return extended, ()
    deeper, error = in_shallow_water(extended, growth, reach=ship.shoalest, known=known)
    rough = f"; its factors are polynomials, at most {100 * error:.1g} % off." if error > 1e-4 else "."
    return deeper, (
        f"The dependence on depth holds for draught over depth up to {ship.shoalest:.2f}, the shallowest in the data"
        + rough,
    )


def _lean(model: VesselModel, ship: Extended) -> tuple[Term, float] | None:
    """The yaw moment of ahead thrust as a term of its own."""
    lean = ship.get("asymmetry")
    if not lean:
        return None
    for term, expression, value in zip(model.terms, model.expressions, model.parameters.tolist(), strict=True):
        if expression.signals == ("tau_psi",):
            name = _unused("N_tau_x", model)
            gain = (value + ship.get(f"theta:{term.name}")) * (1 + ship.get("gain")) / (1 + ship.get("inertia:r"))
            return Term("r", name, "tau_x"), lean * gain
    speeds = [name for name in model.inputs if name.rstrip("0123456789") == "n"]
    expression_text = " + ".join(f"abs({name})*{name}" for name in speeds)
    return Term("r", _unused("N_thrust", model), expression_text), lean * model.time_scale_s


def _unused(name: str, model: VesselModel) -> str:
    return name if name not in model.names else f"{name}_found"


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
    if kind == "change" and rest.startswith("theta:"):
        return f"{rest[6:]}_change", 1.0, 0.0, ""
    fixed = {
        "current": (f"{rest}_mps", "m/s"), "wind": (f"{rest}_mps", "m/s"),
        "offset": (f"angle_offset_{rest}_rad", "rad"),
        "lag": (f"lag_{rest}_s", "s"), "delay": (f"delay_{rest}_s", "s"), "deadband": (f"deadband_{rest}", ""),
        "lever": (f"{rest}_m", "m"), "late": (f"{rest}_delay_s", "s"), "heading_bias": ("heading_bias_rad", "rad"),
        "shallow": (f"{rest}_growth", ""), "asymmetry": ("thrust_offset_m", "m"), "term": (rest, ""),
    }  # fmt: skip
    if key == "wind:toward":
        return "toward_rad", 1.0, 0.0, "rad"
    if kind in fixed:
        name, unit = fixed[kind]
        return name, 1.0, 0.0, unit
    if kind in ("gain", "gyro"):
        return "factor", 1.0, 1.0, ""
    if kind == "inertia":
        return f"inertia_factor_{rest}", 1.0, 1.0, ""
    if key == "change:time":
        return "time_s", 1.0, 0.0, "s"
    if kind == "change":
        return f"{rest}_factor", 1.0, 1.0, ""
    unit = {"roll:period": "s", "roll:yaw": "rad/m"}.get(key, "")
    return {"roll:period": "roll_period_s", "roll:damping": "roll_damping_ratio"}.get(key, ROLL[key]), 1.0, 0.0, unit
