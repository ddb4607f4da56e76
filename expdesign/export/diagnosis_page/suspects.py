"""The variable that the simulation error depends on if a cause acts, for its figure."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from expdesign.diagnosis import Diagnosis, Finding
from expdesign.diagnosis.model import ExtendedModel, ahead_force, ahead_force_text, group_columns
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.export.tuning import TUNING
from expdesign.values import Array
from expdesign.vessel import NUMPY, column_name, generalised_force
from expdesign.vessel.expressions import parse_expression
from expdesign.vessel.structures import FORCE_SIGNALS, MOTION_SIGNALS, SHOAL

DEGREES = float(np.degrees(1.0))
SQUARED = "\N{SUPERSCRIPT TWO}"
SPEEDS = {"u": ("u [m/s]", 1.0), "v": ("v [m/s]", 1.0), "r": ("r [\N{DEGREE SIGN}/s]", DEGREES)}
RATES = {
    "u": (f"rate of change of u [m/s{SQUARED}]", 1.0),
    "v": (f"rate of change of v [m/s{SQUARED}]", 1.0),
    "r": (f"rate of change of r [\N{DEGREE SIGN}/s{SQUARED}]", DEGREES),
}
FORCES = ("term", "theta", "gain", "asymmetry", "deadband", "offset", "scale", "shallow")
"""Kinds of effects that are forces."""
SHOWN_BY = {"late:psi": "r", "late:position": "u", "heading_bias": "u", "log": "u", "gyro": "r", "lever": "r"}
"""Effect, or kind of effect, of a sensor -> the velocity that it depends on."""


def is_force(found: Diagnosis, item: Finding) -> bool:
    """Whether the cause is a force without delay, which is visible in the missing acceleration."""
    kind = item.keys[0].partition(":")[0]
    return kind in FORCES and (item.cause != "wind" or found.windows.has_wind)


def has_sign(item: Finding) -> bool:
    """Whether the error changes its sign with the variable; otherwise only its size grows."""
    return not item.keys[0].startswith(("slew:", "lag:", "delay:", "roll:", "change:"))


def suspected_force(found: Diagnosis, item: Finding, at: Mapping[str, Array]) -> tuple[Array, str]:
    """The variable that a force depends on, and its label.

    Args:
        found: the diagnosis.
        item: one of its findings.
        at: (k,) variables of `Residuals` by name.
    """
    ship = extended_model(found.vessel, found.record)
    kind, _, rest = _most_significant(found, item).partition(":")
    if item.cause == "wind":
        return np.hypot(at["u_q"], at["v_q"]), "wind over deck [m/s]"
    if kind == "shallow":
        return at["depth"], "water depth [m]"
    if kind in ("deadband", "offset", "scale"):
        name = ship.model.inputs[group_columns(rest, ship.model.inputs)[0]]
        return at[name], f"{name} [{column_name(name).removeprefix(name).strip('_') or 'force'}]"
    table = signals(ship, at)
    if kind in ("gain", "asymmetry"):
        return ahead_force(table, ship.model), f"ahead force, {ahead_force_text(ship.model)}"
    known = (*ship.library.values(), *found.extended.model.terms, *ship.model.terms)  # unlisted ones are those found
    term = {one.name: one for one in known}[rest]
    names = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *ship.model.inputs)))
    values = parse_expression(term.expression, signals=names).evaluate(table, NUMPY)
    return np.broadcast_to(values, at["time"].shape), f"{term.name}: {term.expression}"


def signals(ship: ExtendedModel, at: Mapping[str, Array]) -> dict[str, Array]:
    """(k,) signals that terms read; nan where not measured."""
    nothing = np.full(at["time"].shape, np.nan)
    forces = generalised_force(ship.model.actuators, at, NUMPY)
    shoal = ship.draught_m / at["depth"] if "depth" in at else np.zeros_like(nothing)
    motion = {name: at.get(name, nothing) for name in MOTION_SIGNALS} | {SHOAL: shoal}
    table = {name: np.broadcast_to(force, nothing.shape) for name, force in zip(FORCE_SIGNALS, forces, strict=True)}
    return table | {name: at[name] for name in ship.model.inputs} | motion


def suspected(found: Diagnosis, item: Finding) -> tuple[Array, str]:
    """(w, s) values of the variable that an error depends on, at the compared samples, and their label."""
    key = item.keys[0]
    kind, _, rest = key.partition(":")
    if kind in ("slew", "lag", "delay"):
        inputs = extended_model(found.vessel, found.record).model.inputs
        return _since_change(found, group_columns(rest, inputs))
    if kind == "inertia" or key in ("late:u", "late:v", "late:r"):
        return _rate(found, rest)
    if key in SHOWN_BY or kind in SHOWN_BY:
        return _speed(found, SHOWN_BY.get(key, SHOWN_BY.get(kind, "u")))
    return _heading(found) if kind == "current" or item.cause == "wind" else _time(found)


def _most_significant(found: Diagnosis, item: Finding) -> str:
    """The estimate with the largest change in standard errors, among parameters; else the first."""
    model = found.vessel.model
    known = dict(zip(model.names, model.parameters.tolist(), strict=True))
    sizes = [abs(one.value - known.get(one.name, 0.0)) / one.std if one.std > 0 else 0.0 for one in item.estimates]
    if item.cause == "parameters" and sizes:
        return item.keys[int(np.argmax(sizes))]
    return item.keys[0]


def _since_change(found: Diagnosis, columns: list[int]) -> tuple[Array, str]:
    windows = found.windows
    inputs = windows.step_inputs[:, :: windows.steps_per_sample, columns]
    scale = np.maximum(np.std(inputs.reshape(-1, inputs.shape[-1]), axis=0), 1e-12)
    change = np.zeros(inputs.shape[:2])
    change[:, 1:] = np.abs(np.diff(inputs, axis=1) / scale).sum(axis=2)
    return _since(np.asarray(change > TUNING.changed_inputs)) * windows.sample_s, "time since the input changed [s]"


def _since(events: NDArray[np.bool_]) -> Array:
    """(w, s) samples since the last event."""
    result = np.full(events.shape, np.nan)
    for row, happened in zip(result, events, strict=True):
        last = None
        for index, now in enumerate(happened):
            last = index if now else last
            if last is not None:
                row[index] = index - last
    return result


def _rate(found: Diagnosis, output: str) -> tuple[Array, str]:
    label, factor = RATES[output]
    values = found.windows.measured[..., "uvr".index(output)]
    return np.asarray(factor * np.gradient(values, found.windows.sample_s, axis=1)), label


def _speed(found: Diagnosis, output: str) -> tuple[Array, str]:
    label, factor = SPEEDS[output]
    return np.asarray(factor * found.windows.measured[..., "uvr".index(output)]), label


def _heading(found: Diagnosis) -> tuple[Array, str]:
    heading = found.windows.heading[:, :: found.windows.steps_per_sample]
    return np.asarray(DEGREES * (heading % (2 * np.pi))), "heading [\N{DEGREE SIGN}]"


def _time(found: Diagnosis) -> tuple[Array, str]:
    return found.windows.time_s[:, :: found.windows.steps_per_sample] / 60, "time [min]"
