"""The variable that the error of a simulation should depend on if a cause acts: what its picture is drawn against."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from expdesign.diagnosis import Diagnosis, Finding
from expdesign.diagnosis.extended import Extended
from expdesign.diagnosis.extension import as_extended
from expdesign.diagnosis.followed import members
from expdesign.diagnosis.parts import ahead_force, ahead_force_text
from expdesign.values import Array
from expdesign.vessel import NUMPY, Term, column_name, generalised_force
from expdesign.vessel.expressions import parse_expression
from expdesign.vessel.structures import FORCE_SIGNALS, MOTION_SIGNALS

DEGREES = float(np.degrees(1.0))
CHANGED = 0.2
"""Change of inputs, summed in units of their standard deviations, that counts as one."""
SQUARED = "\N{SUPERSCRIPT TWO}"
SPEEDS = {"u": ("u [m/s]", 1.0), "v": ("v [m/s]", 1.0), "r": ("r [\N{DEGREE SIGN}/s]", DEGREES)}
RATES = {
    "u": (f"rate of change of u [m/s{SQUARED}]", 1.0),
    "v": (f"rate of change of v [m/s{SQUARED}]", 1.0),
    "r": (f"rate of change of r [\N{DEGREE SIGN}/s{SQUARED}]", DEGREES),
}
SHOWN_BY = {"late:psi": "r", "late:position": "u", "heading_bias": "u", "gyro": "r", "lever": "r"}
"""Effect, or kind of effect, of a sensor -> the velocity by which it shows."""


def has_sign(item: Finding) -> bool:
    """The error is of one sign where the variable is; otherwise it grows there one way or the other."""
    return not item.keys[0].startswith(("lag:", "delay:", "roll:", "change:"))


def suspected(found: Diagnosis, item: Finding) -> tuple[Array, str]:
    """(w, s) values at the compared samples of what a finding depends on, and their label."""
    ship = as_extended(found.vessel, found.record)
    key = _telling(found, item)
    kind, _, rest = key.partition(":")
    if item.cause == "wind":
        return _wind(found) if found.windows.has_wind else _heading(found)
    if kind in ("term", "theta"):
        return _regressor(found, ship, _term(ship, rest))
    if kind in ("deadband", "offset"):
        name = ship.model.inputs[members(rest, ship.model.inputs)[0]]
        return signals(found, ship)[name], f"{name} [{column_name(name).removeprefix(name).strip('_') or 'force'}]"
    if kind in ("lag", "delay"):
        return _since_change(found, members(rest, ship.model.inputs))
    if kind in ("gain", "asymmetry"):
        return ahead_force(signals(found, ship), ship.model), f"ahead force, {ahead_force_text(ship.model)}"
    if kind == "inertia" or key in ("late:u", "late:v", "late:r"):
        return _rate(found, rest)
    if key in SHOWN_BY or kind in SHOWN_BY:
        return _speed(found, SHOWN_BY.get(key, SHOWN_BY.get(kind, "u")))
    if kind == "current":
        return _heading(found)
    return _depth(found) if kind == "shallow" else _time(found)


def signals(found: Diagnosis, ship: Extended) -> dict[str, Array]:
    """(w, s) measured signals that terms read, nan where one is not measured."""
    windows = found.windows
    every = slice(None, None, windows.steps_per_sample)
    u, v, r = np.moveaxis(windows.measured[..., :3], -1, 0)
    wind = windows.wind[:, every]
    inputs = windows.gather(windows.batch_inputs)[:, every]
    table = dict(zip(ship.model.inputs, np.moveaxis(inputs, -1, 0), strict=True))
    forces = [np.broadcast_to(force, u.shape) for force in generalised_force(ship.model.actuators, table, NUMPY)]
    shoal = ship.draught_m / windows.depth_m[:, every]
    motion = dict(zip(MOTION_SIGNALS, (u, v, r, u - wind[..., 0], v - wind[..., 1], shoal), strict=True))
    return dict(zip(FORCE_SIGNALS, forces, strict=True)) | table | motion


def _telling(found: Diagnosis, item: Finding) -> str:
    """Of several numbers of a finding the one that stands out most from its standard error, if they are parameters."""
    model = found.vessel.model
    known = dict(zip(model.names, model.parameters.tolist(), strict=True))
    sizes = [abs(one.value - known.get(one.name, 0.0)) / one.std if one.std > 0 else 0.0 for one in item.estimates]
    if item.cause == "parameters" and sizes:
        return item.keys[int(np.argmax(sizes))]
    return item.keys[0]


def _term(ship: Extended, name: str) -> Term:
    own = {term.name: term for term in ship.model.terms}
    return own[name] if name in own else ship.library[name]


def _regressor(found: Diagnosis, ship: Extended, term: Term) -> tuple[Array, str]:
    names = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *ship.model.inputs)))
    values = parse_expression(term.expression, signals=names).evaluate(signals(found, ship), NUMPY)
    return np.broadcast_to(values, found.windows.measured.shape[:2]), f"{term.name}: {term.expression}"


def _since_change(found: Diagnosis, columns: list[int]) -> tuple[Array, str]:
    windows = found.windows
    inputs = windows.gather(windows.batch_inputs)[:, :: windows.steps_per_sample, columns]
    scale = np.maximum(np.std(inputs.reshape(-1, inputs.shape[-1]), axis=0), 1e-12)
    change = np.zeros(inputs.shape[:2])
    change[:, 1:] = np.abs(np.diff(inputs, axis=1) / scale).sum(axis=2)
    return _since(np.asarray(change > CHANGED)) * windows.sample_s, "time since the input changed [s]"


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


def _wind(found: Diagnosis) -> tuple[Array, str]:
    windows = found.windows
    relative = windows.measured[..., :2] - windows.wind[:, :: windows.steps_per_sample]
    return np.hypot(relative[..., 0], relative[..., 1]), "wind over deck [m/s]"


def _depth(found: Diagnosis) -> tuple[Array, str]:
    return found.windows.depth_m[:, :: found.windows.steps_per_sample], "water depth [m]"


def _time(found: Diagnosis) -> tuple[Array, str]:
    return found.windows.time_s[:, :: found.windows.steps_per_sample] / 60, "time [min]"
