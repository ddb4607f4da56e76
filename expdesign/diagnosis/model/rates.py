"""Equations of motion of an extended model."""

from __future__ import annotations

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.model.extended import Extended
from expdesign.diagnosis.model.surroundings import Surroundings
from expdesign.diagnosis.model.terms import ahead_force
from expdesign.values import Array
from expdesign.vessel import NUMPY
from expdesign.vessel.structures import SHOAL


def rates(ship: Extended, state: tuple[Array, ...], around: Surroundings) -> tuple[Array, ...]:
    """d/dt of (u, v, r) or (u, v, r, roll, roll rate)."""
    u, v, r = state[:3]
    totals = _accelerations(ship, u, v, r, around)
    if ship.roll is None:
        return tuple(totals)
    return ship.roll.rates(tuple(totals), u * r, state[3:])


def _accelerations(ship: Extended, u: Array, v: Array, r: Array, around: Surroundings) -> list[Array]:
    """d/dt (u, v, r) without roll."""
    signals: dict[str, Array] = {**around, "u": u, "v": v, "r": r}
    if "u_c" in around:
        signals["u"], signals["v"] = u - around["u_c"], v - around["v_c"]
    if "u_w" in around:
        signals["u_q"], signals["v_q"] = u - around["u_w"], v - around["v_w"]
    lean = ship.get("asymmetry")
    if lean:
        signals["tau_psi"] = signals["tau_psi"] + lean * ahead_force(signals, ship.model)
    totals = {name: np.zeros_like(u) for name in OUTPUTS}
    steady = dict(totals)
    for part in ship.parts:
        value = part.factor * part.evaluate(signals, NUMPY)
        if part.after:
            value = value + part.after_factor(around) * part.evaluate(signals, NUMPY)
        if part.damping and SHOAL in around:
            value = value * (1 + ship.get("shallow:damping") * around[SHOAL])
        into = steady if part.coriolis else totals
        into[part.equation] = into[part.equation] + value
    if lean and not any(part.reads_turn for part in ship.parts):
        totals["r"] = totals["r"] + lean * ahead_force(signals, ship.model)
    heavier = 1.0 if SHOAL not in around else 1 + ship.get("shallow:inertia") * around[SHOAL]
    return [totals[n] / ((1 + ship.get(f"inertia:{n}")) * heavier) + steady[n] for n in OUTPUTS]
