"""Names and units of effects in results."""

from __future__ import annotations

from collections.abc import Iterable

from expdesign.diagnosis.model import ROLL, ExtendedModel, ahead_force_text, group_columns, turns_by_force
from expdesign.vessel import VesselModel, column_name


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
    if key in NAMES:
        return NAMES[key][0], 1.0, 0.0, NAMES[key][1]
    if kind == "deadband":
        unit = _input_unit(rest, model)
        return f"deadband_{rest}_{unit}" if unit else f"deadband_{rest}", 1.0, 0.0, unit
    if kind == "slew":
        unit = _input_unit(rest, model)
        return f"slew_{rest}_s_per_{unit or 'unit'}", 1.0, 0.0, f"s/{unit}" if unit else "s"
    if key == "asymmetry":
        return _lean_name(model)
    if kind in PATTERNS:
        name, offset, unit = PATTERNS[kind]
        return name.format(rest), 1.0, offset, unit
    return ROLL[key], 1.0, 0.0, "rad/m" if key == "roll:yaw" else ""


NAMES = {
    "wind:toward": ("toward_rad", "rad"), "change:time": ("time_s", "s"),
    "roll:period": ("roll_period_s", "s"), "roll:damping": ("roll_damping_ratio", ""),
}  # fmt: skip
"""Effect -> name in results and unit."""
PATTERNS = {
    "current": ("{}_mps", 0.0, "m/s"), "wind": ("{}_mps", 0.0, "m/s"), "offset": ("angle_offset_{}_rad", 0.0, "rad"),
    "lag": ("lag_{}_s", 0.0, "s"), "delay": ("delay_{}_s", 0.0, "s"), "lever": ("{}_m", 0.0, "m"),
    "late": ("{}_delay_s", 0.0, "s"), "shallow": ("{}_growth", 0.0, ""), "term": ("{}", 0.0, ""),
    "gain": ("factor", 1.0, ""), "gyro": ("factor", 1.0, ""), "log": ("factor", 1.0, ""),
    "inertia": ("inertia_factor_{}", 1.0, ""), "change": ("{}_factor", 1.0, ""), "scale": ("angle_factor_{}", 1.0, ""),
}  # fmt: skip
"""Kind of effect -> name in results with {} for the rest of its key, value without the effect, unit."""


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
