"""Equations of motion of an extended model."""

from __future__ import annotations

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.model import ExtendedModel, ahead_force
from expdesign.diagnosis.motion.exogenous_inputs import ExogenousInputs
from expdesign.values import Array
from expdesign.vessel import NUMPY
from expdesign.vessel.structures import SHOAL


def state_rates(ship: ExtendedModel, state: tuple[Array, ...], exogenous: ExogenousInputs) -> tuple[Array, ...]:
    """d/dt of (u, v, r) or (u, v, r, roll, roll rate)."""
    u, v, r = state[:3]
    totals = _accelerations(ship, u, v, r, exogenous)
    if ship.roll is None:
        return tuple(totals)
    return ship.roll.rates(tuple(totals), u * r, state[3:])


def _accelerations(ship: ExtendedModel, u: Array, v: Array, r: Array, exogenous: ExogenousInputs) -> list[Array]:
    """d/dt (u, v, r) without roll."""
    signals: dict[str, Array] = {**exogenous, "u": u, "v": v, "r": r}
    if "u_c" in exogenous:
        signals["u"], signals["v"] = u - exogenous["u_c"], v - exogenous["v_c"]
    if "u_w" in exogenous:
        signals["u_q"], signals["v_q"] = u - exogenous["u_w"], v - exogenous["v_w"]
    lean = ship.get("asymmetry")
    if lean:
        signals["tau_psi"] = signals["tau_psi"] + lean * ahead_force(signals, ship.model)
    totals = {name: np.zeros_like(u) for name in OUTPUTS}
    steady = dict(totals)
    for part in ship.scaled_terms:
        value = part.factor * part.evaluate(signals, NUMPY)
        if part.after:
            value = value + part.after_factor(exogenous) * part.evaluate(signals, NUMPY)
        if part.damping and SHOAL in exogenous:
            value = value * (1 + ship.get("shallow:damping") * exogenous[SHOAL])
        into = steady if part.coriolis else totals
        into[part.equation] = into[part.equation] + value
    if lean and not any(part.reads_turn for part in ship.scaled_terms):
        totals["r"] = totals["r"] + lean * ahead_force(signals, ship.model)
    heavier = 1.0 if SHOAL not in exogenous else 1 + ship.get("shallow:inertia") * exogenous[SHOAL]
    return [totals[n] / ((1 + ship.get(f"inertia:{n}")) * heavier) + steady[n] for n in OUTPUTS]
