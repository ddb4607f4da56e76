"""Actuators: the signals each one takes, its limits, and the generalised force it gives.

`tau_x`, `tau_y` and `tau_psi` are in propeller speed units (rps, rps m), as in the thesis: the thrust gain belongs to
the model's parameters X_mu, Y_mu, N_mu. Angles are 0 for thrust ahead and grow from bow towards starboard.

A rudder has no generalised force of its own here: what it gives depends on the water that the hull and the propeller
send past it, which is a matter of the model. A vessel with propeller and rudder therefore has a custom structure whose
terms read its signals, e.g. ``u*abs(u)*sin(rudder1)`` for the ship's own speed and ``abs(n1)*n1*sin(rudder1)`` for the
slipstream; a propeller alone also adds its speed to tau_x.

Source: F. Ljungberg, doctoral thesis, Linköping University, (3.47)-(3.55).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from expdesign.errors import InputError
from expdesign.values import frozen_set
from expdesign.vessel.quantities import Response, rows_of
from expdesign.vessel.structures import Operators, Signals

KINDS: dict[str, tuple[str, ...]] = {
    "azimuth": ("n", "a"),
    "tunnel": ("n",),
    "propeller": ("n",),
    "rudder": ("rudder",),
    "force": ("tau_x", "tau_y", "tau_psi"),
    "depth": ("h",),
}
"""Kind of actuator -> stems of its signals; all but `force` end in the actuator's number, e.g. n2, a2, rudder1.

`depth` stands in no vessel file: it is how recorded depth reaches the terms that read it, beside the recorded inputs.
"""

UNITS = {"n": "rps", "a": "rad", "rudder": "rad"}  # signal stem -> unit in column names; generalised forces have none

SIGNALS = {
    "n": ("speed", "_rps", "_rps2"),
    "a": ("angle", "_rad", "_radps"),
    "rudder": ("angle", "_rad", "_radps"),
    "tau_x": ("x", "", ""),
    "tau_y": ("y", "", ""),
    "tau_psi": ("psi", "", ""),
}
"""Signal stem -> word for it, its unit and the unit of its rate, as in keys of vessel files."""

RATE_UNITS = {name: unit.strip("_") for name, (_, _, unit) in SIGNALS.items()}  # signal stem -> unit of its slew rate


def limit_keys(stem: str) -> tuple[str, str]:
    """Keys in vessel files of a signal's lower and upper limit."""
    name, unit, _ = SIGNALS[stem]
    return f"{name}_min{unit}", f"{name}_max{unit}"


def response_keys(stem: str) -> dict[str, str]:
    """Field of `Response` -> key in vessel files, for a signal."""
    name, unit, rate = SIGNALS[stem]
    return {row.key: row.stated_as.format(name=name, unit=unit, rate=rate) for row in rows_of(Response)}


@dataclass(frozen=True, kw_only=True)
class Limit:
    """Bounds of one actuator signal."""

    # low, high: [unit of the signal], low < high; infinite where there is none
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise InputError(f"limits are [{self.low:g}, {self.high:g}], expected low below high")


IDEAL = Response()  # the command is delivered unchanged and at once


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """One actuator."""

    kind: str  # a key of `KINDS`
    number: int  # distinguishes actuators of one kind in signal names, from 1
    # forward_m, starboard_m: place in the b-frame [m]
    forward_m: float = 0.0
    starboard_m: float = 0.0
    limits: tuple[Limit, ...]  # one `Limit` for each signal of the kind, in order
    responses: tuple[Response, ...] = ()  # one `Response` for each signal likewise; ideal ones when left out

    def __post_init__(self) -> None:
        if not self.responses:
            frozen_set(self, "responses", (IDEAL,) * len(KINDS[self.kind]))
        if len(self.responses) != len(KINDS[self.kind]):
            raise InputError(f"{self.kind} has {len(self.responses)} responses, expected {len(KINDS[self.kind])}")

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of its commands, e.g. ("n1", "a1")."""
        stems = KINDS[self.kind]
        return stems if self.kind in ("force", "depth") else tuple(f"{stem}{self.number}" for stem in stems)

    def force(self, signals: Signals, ops: Operators) -> tuple[Any, Any, Any]:
        """Its share of (tau_x, tau_y, tau_psi); zero for rudders, whose force is a model term of its own."""
        if self.kind == "force":
            return signals["tau_x"], signals["tau_y"], signals["tau_psi"]
        command = [signals[name] for name in self.signals]
        if self.kind == "azimuth":
            speed, angle = command
            ahead, side = speed * ops.cos(angle), speed * ops.sin(angle)
            return ahead, side, self.forward_m * side - self.starboard_m * ahead
        if self.kind == "tunnel":
            return 0.0, command[0], self.forward_m * command[0]
        if self.kind == "propeller":
            return command[0], 0.0, -self.starboard_m * command[0]
        return 0.0, 0.0, 0.0


def stem(signal: str) -> str:
    """Stem of a signal, without the number of its actuator: n of n1, rudder of rudder2, tau_x of tau_x."""
    return signal.rstrip("0123456789")


def column_name(signal: str) -> str:
    """File column of an actuator signal: n1 -> n1_rps, a1 -> a1_rad, tau_x -> tau_x."""
    unit = UNITS.get(stem(signal))
    return f"{signal}_{unit}" if unit else signal


def generalised_force(actuators: tuple[Actuator, ...], signals: Signals, ops: Operators) -> tuple[Any, Any, Any]:
    """(tau_x, tau_y, tau_psi) of all actuators together."""
    totals: list[Any] = [0.0, 0.0, 0.0]
    for actuator in actuators:
        totals = [total + part for total, part in zip(totals, actuator.force(signals, ops), strict=True)]
    return totals[0], totals[1], totals[2]
