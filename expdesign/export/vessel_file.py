"""A vessel as a vessel file, so that what was estimated can go on being used."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence

from expdesign.errors import InputError
from expdesign.vessel import KINDS, STRUCTURES, Actuator, Sensors, Vessel, VesselModel

LIMIT_KEYS = {
    "n": ("speed_min_rps", "speed_max_rps", "speed_rate_rps2"),
    "a": ("angle_min_rad", "angle_max_rad", "angle_rate_radps"),
    "rudder": ("angle_min_rad", "angle_max_rad", "angle_rate_radps"),
    "tau_x": ("x_min", "x_max", "x_rate"),
    "tau_y": ("y_min", "y_max", "y_rate"),
    "tau_psi": ("psi_min", "psi_max", "psi_rate"),
}
"""Signal stem -> keys of its lower limit, upper limit and rate."""

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def vessel_toml(vessel: Vessel, *, comments: Sequence[str] = ()) -> str:
    """The vessel file of a vessel; reading it back gives the same vessel, to the last bit.

    Args:
        vessel: what to write. Limits that are infinite are left out.
        comments: lines to go first.

    Raises:
        InputError: the model's sample time is not the vessel's, which a file cannot say.
    """
    if vessel.model.sample_time_s != vessel.sample_time_s:
        raise InputError(
            f"vessel {vessel.name!r} has sample time {vessel.sample_time_s:g} s and its model "
            f"{vessel.model.sample_time_s:g} s, expected the same in a vessel file"
        )
    particulars = {name: getattr(vessel, name) for name in ("name", "length_m", "beam_m", "draught_m", "sample_time_s")}
    lines = [f"# {line}".rstrip() for comment in comments for line in comment.splitlines()]
    lines += _table("[vessel]", particulars)
    for actuator in vessel.actuators:
        lines += ["", *_table("[[actuators]]", _actuator(actuator))]
    lines += _model(vessel.model)
    if vessel.sensors != Sensors():
        lines += ["", *_table("[sensors]", vars(vessel.sensors))]
    return "\n".join(lines) + "\n"


def _actuator(actuator: Actuator) -> dict[str, str | float]:
    entries: dict[str, str | float] = {
        "kind": actuator.kind,
        "forward_m": actuator.forward_m,
        "starboard_m": actuator.starboard_m,
    }
    for stem, limit in zip(KINDS[actuator.kind], actuator.limits, strict=True):
        values = zip(LIMIT_KEYS[stem], (limit.low, limit.high, limit.rate), strict=True)
        entries |= {key: value for key, value in values if math.isfinite(value)}
    return entries


def _model(model: VesselModel) -> Iterator[str]:
    structure = next((name for name, terms in STRUCTURES.items() if terms == model.terms), "custom")
    yield from ("", *_table("[model]", {"structure": structure, "form": model.form}))
    if structure == "custom":
        for term in model.terms:
            yield from ("", *_table("[[model.terms]]", vars(term)))
    values, stds = model.parameters.tolist(), model.parameter_std.tolist()
    yield from ("", *_table("[model.parameters]", dict(zip(model.names, values, strict=True))))
    known = {name: std for name, std in zip(model.names, stds, strict=True) if std > 0}
    if known:
        yield from ("", *_table("[model.parameter_std]", known))


def _table(head: str, entries: Mapping[str, str | float]) -> list[str]:
    return [head, *(f"{_key(name)} = {_value(value)}" for name, value in entries.items())]


def _key(name: str) -> str:
    return name if BARE_KEY.fullmatch(name) else _value(name)


def _value(value: str | float) -> str:
    """JSON's strings and floats are TOML's, but for the control character it does not escape."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(float(value))
