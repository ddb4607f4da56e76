"""Standard deviations of what a vessel file states of water, air, actuators and sensors: read and written alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from expdesign.diagnosis.model import RESPONSES, Effects, ExtendedModel, group_columns
from expdesign.vessel import Environment, Vessel

SEARCHED = ("deadband",)
"""Kinds of effects that are found by trying values; fits have no derivative by them, so their values count as known."""


def stated_std(vessel: Vessel, inputs: tuple[str, ...], derived: tuple[str, ...], stated: Effects) -> dict[str, float]:
    """Standard deviation of every stated effect that has one.

    Args:
        vessel: its file.
        inputs: of the model.
        derived: velocities that come from the pose.
        stated: effects.
    """
    weather = vessel.environment
    flows = {"current": weather.current_std_mps, "wind": weather.wind_std_mps}
    found = {}
    for key in stated:
        kind = key.split(":")[0]
        given = (vessel.std.get(name, 0.0) for name in _file_keys(key, inputs, derived))
        found[key] = flows[kind] if kind in flows else max(given, default=0.0) * _slope(key, stated[key])
    return {key: std for key, std in found.items() if std > 0 and key.split(":")[0] not in SEARCHED}


def found_std(vessel: Vessel, ship: ExtendedModel, std: Mapping[str, float], known: Sequence[str]) -> dict[str, float]:
    """`Vessel.std` with the standard errors of effects; `known` are the keys that the vessel's file may have."""
    named = {
        name: value / _slope(key, ship.get(key))
        for key, value in std.items()
        for name in _file_keys(key, ship.model.inputs, ship.derived)
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


def _file_keys(key: str, inputs: tuple[str, ...], derived: tuple[str, ...]) -> tuple[str, ...]:
    """Keys of `Vessel.std` that an effect belongs to."""
    kind, _, rest = key.partition(":")
    if kind in RESPONSES:
        return tuple(f"{inputs[column]}_{RESPONSES[kind]}" for column in group_columns(rest, inputs))
    from_pose = "u" in derived
    place = "position" if from_pose else "velocity"
    late = {"u": "velocity", "v": "velocity", "r": "yaw_rate", "psi": "heading", "position": "position"}
    if kind == "late":
        return (f"{late[rest]}_delay_s",)
    if kind == "lever":
        return (f"{place}_{rest}_m",)
    names = {"heading_bias": "heading_bias_rad" if from_pose else "velocity_angle_rad", "log": "velocity_scale",
             "gyro": "yaw_rate_scale"}  # fmt: skip
    return (names[kind],) if kind in names else ()
