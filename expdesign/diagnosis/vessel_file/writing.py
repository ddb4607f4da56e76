"""From a vessel to a model with effects, and back: everything found becomes part of a vessel file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from expdesign.diagnosis.model import RESPONSES, ExtendedModel, group_columns, mean_wind, response_effect
from expdesign.diagnosis.vessel_file.found_terms import found_model
from expdesign.diagnosis.vessel_file.stated_std import found_std, with_std
from expdesign.values import Array
from expdesign.vessel import Actuator, Response, Sensors, Vessel, VesselModel, std_keys


def extend(
    vessel: Vessel,
    ship: ExtendedModel,
    std: Mapping[str, float],
    estimated: tuple[Sequence[str], Array] = ((), np.zeros((0, 0))),
) -> tuple[Vessel, tuple[str, ...]]:
    """The vessel with the effects of `ship`, and notes on those that it cannot hold, one sentence each.

    Args:
        vessel: the model in use.
        ship: with effects found.
        std: standard errors of effects.
        estimated: effects, and the covariance (c, c) of their estimates.
    """
    model, missing = found_model(vessel.model, ship, std)
    model = _correlated(model, *estimated)
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
    weather = with_std(weather, std)
    return (
        replace(
            vessel,
            model=replace(model, actuators=actuators),
            sensors=_sensors(vessel.sensors, ship),
            environment=weather,
            pendulum=None if model.roll is not None else vessel.pendulum,
            std=found_std(vessel, ship, std, std_keys(actuators)),
        ),
        (*missing, *more),
    )


def _correlated(model: VesselModel, keys: Sequence[str], covariance: Array) -> VesselModel:
    """The model with the correlations of what was estimated in place of its prior ones; its stds stay."""
    places = [place for place, key in enumerate(keys) if key.startswith(("theta:", "term:"))]
    if not places:
        return model
    names = [keys[place].split(":", 1)[1] for place in places]
    found = model.with_covariance(names, covariance[np.ix_(places, places)]).parameter_correlation
    return replace(model, parameter_correlation=found)


def _has(ship: ExtendedModel, prefix: str) -> bool:
    return any(key.startswith(prefix) for key in ship.effects)


def _actuators(actuators: tuple[Actuator, ...], ship: ExtendedModel) -> tuple[tuple[Actuator, ...], tuple[str, ...]]:
    own = tuple(name for actuator in actuators for name in actuator.signals)
    recorded = ship.model.inputs
    changes: dict[str, dict[str, float]] = {}
    lost = []
    for key in dict.fromkeys((*ship.stated, *ship.effects)):
        kind, _, group = key.partition(":")
        if kind not in RESPONSES:
            continue
        for index in group_columns(group, recorded):
            if recorded[index] in own:
                row = changes.setdefault(recorded[index], {})
                row[kind] = row.get(kind, 0.0) + ship.get(key)
            else:
                lost.append(
                    f"{kind} of {recorded[index]} is not in the vessel file, whose actuators take other signals."
                )
    result = []
    for actuator in actuators:
        responses = tuple(
            _changed(response, changes.get(signal, {}))
            for signal, response in zip(actuator.signals, actuator.responses, strict=True)
        )
        result.append(replace(actuator, responses=responses))
    return tuple(result), tuple(dict.fromkeys(lost))


def _changed(response: Response, effects: Mapping[str, float]) -> Response:
    """A response with other effects; those that played no role in the data stay as they are stated."""
    return replace(response, **{RESPONSES[kind]: response_effect(kind, value) for kind, value in effects.items()})


def _sensors(sensors: Sensors, ship: ExtendedModel) -> Sensors:
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
    angle_rad, scale = 0.0 - get("heading_bias"), 1.0 + get("log")
    return replace(sensors, velocity_angle_rad=angle_rad, velocity_scale=scale, velocity=velocity)
