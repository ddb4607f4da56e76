"""Calibration and state as plain values for a file, and back, to the last bit."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from expdesign.monitoring.calibration import Calibration
from expdesign.monitoring.changes import Change
from expdesign.monitoring.force import Force, Known
from expdesign.monitoring.noise import Noise
from expdesign.monitoring.state import Alarm, Budget, Call, Load, State, Sums

COUNTED = ("judged_s", "left_out_s", "beyond_s", "undecided_s", "brief", "by_weather", "shoal_s", "shoalest")
"""Numbers of a state that are added up."""


def saved(value: Any) -> Any:
    """Numbers, texts, lists and tables of a value of this room; infinite numbers as texts."""
    if isinstance(value, np.ndarray):
        return saved(value.tolist())
    if isinstance(value, list | tuple):
        return [saved(item) for item in value]
    if hasattr(value, "__dataclass_fields__"):
        return {field.name: saved(getattr(value, field.name)) for field in fields(value)}
    return str(value) if isinstance(value, float) and not np.isfinite(value) else value


def restored_calibration(table: dict[str, Any]) -> Calibration:
    """A calibration, read from what `saved` made of it."""
    arrays = {name: _array(values) for name, values in table.items() if isinstance(values, list)}
    rest = {name: table[name] for name in ("stretches", "stretch_s", "misfit_limit", "shoal_limit")}
    force, seas = (Force(**_arrays(table[name])) for name in ("force", "seas"))
    return Calibration(force=force, seas=seas, **arrays, **rest)


def restored_state(table: dict[str, Any]) -> State:
    """A state, read from what `saved` made of it."""
    alarm, pending = table["alarm"], table["pending"]
    return State(
        until_s=table["until_s"],
        heading=float(table["heading"]),
        known=Known(**_arrays(table["known"])),
        ratios=_array(table["ratios"]),
        peaks=_array(table["peaks"]),
        sums=Sums(**_arrays(table["sums"])),
        shift=_array(table["shift"]),
        before=_array(table["before"]),
        whole=Sums(**_arrays(table["whole"])),
        load=Load(**{**table["load"], "taken": _array(table["load"]["taken"])}),
        budget=Budget(**_arrays(table["budget"])),
        rough=Known(**_arrays(table["rough"])),
        rougher=_array(table["rougher"]),
        weather=_array(table["weather"]),
        beyond_of_s=_array(table["beyond_of_s"]),
        calls=tuple(
            Call(**{**call, "value": _array(call["value"]), "std": _array(call["std"])}) for call in table["calls"]
        ),
        alarm=None if alarm is None else restored_alarm(alarm),
        pending=None if pending is None else Sums(**_arrays(pending)),
        **{name: table[name] for name in COUNTED},
    )


def restored_alarm(table: dict[str, Any]) -> Alarm:
    """An alarm, read from what `saved` made of it."""
    pushes = tuple((axis, gain) for axis, gain in table.get("pushes", ()))
    return Alarm(**{**table, "as_likely": tuple(table["as_likely"]), "pushes": pushes})


def restored_noise(table: dict[str, Any]) -> Noise:
    """Noise, read from what `saved` made of it."""
    return Noise(**{name: _array(value) if isinstance(value, list) else value for name, value in table.items()})


def restored_changes(tables: list[dict[str, Any]]) -> tuple[Change, ...]:
    """Watched changes, read from what `saved` made of them."""
    return tuple(Change(**{**table, "unit": tuple(table["unit"])}) for table in tables)


def _arrays(table: dict[str, Any]) -> dict[str, Any]:
    return {name: _array(values) for name, values in table.items()}


def _array(values: Any) -> Any:
    return np.array(values, dtype=float)
