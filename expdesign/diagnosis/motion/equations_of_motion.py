"""Equations of motion of an extended model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.model import ExtendedModel, ScaledTerm, ahead_force
from expdesign.diagnosis.motion.exogenous_inputs import ExogenousInputs
from expdesign.simulation.motion import rates_over_ground
from expdesign.simulation.tape import evaluation
from expdesign.values import Array
from expdesign.vessel.structures import SHOAL


def state_rates(ship: ExtendedModel, state: tuple[Array, ...], exogenous: ExogenousInputs) -> tuple[Array, ...]:
    """d/dt of (u, v, r) or (u, v, r, roll, roll rate)."""
    u, v, r = state[:3]
    totals = _accelerations(ship, u, v, r, exogenous)
    if "u_c" in exogenous:
        totals = rates_over_ground(totals, (exogenous["u_c"], exogenous["v_c"]), r)
    if ship.roll is None:
        return totals
    return ship.roll.rates(totals, u * r, state[3:])


def rates_by_term(
    ship: ExtendedModel, parts: Sequence[ScaledTerm], state: tuple[Array, ...], exogenous: ExogenousInputs
) -> list[tuple[Array, ...]]:
    """Change of the rates by each of several terms, were it added to the model."""
    u, v, r = state[:3]
    signals = _signals(ship, u, v, r, exogenous)
    still = np.zeros_like(u)
    result = []
    regressors = evaluation([part.expression for part in parts]).values(signals)
    for part, regressor in zip(parts, regressors, strict=True):
        value = _value(ship, part, regressor, exogenous)
        value = value if part.coriolis else value / _heavier(ship, part.equation, exogenous)
        plain = _coupled(ship, [value if name == part.equation else still for name in OUTPUTS])
        result.append(plain if ship.roll is None else ship.roll.rates(plain, still, (still, still)))
    return result


def _accelerations(ship: ExtendedModel, u: Array, v: Array, r: Array, exogenous: ExogenousInputs) -> tuple[Array, ...]:
    """d/dt (u, v, r) through water, without roll."""
    signals = _signals(ship, u, v, r, exogenous)
    totals = dict.fromkeys(OUTPUTS, np.zeros_like(u))
    steady = dict(totals)
    for part, regressor in zip(ship.scaled_terms, ship.regressors.values(signals), strict=True):
        into = steady if part.coriolis else totals
        into[part.equation] = into[part.equation] + _value(ship, part, regressor, exogenous)
    lean = ship.get("asymmetry")
    if lean and not any(part.reads_turn for part in ship.scaled_terms):
        totals["r"] = totals["r"] + lean * ahead_force(signals, ship.model)
    return _coupled(ship, [totals[n] / _heavier(ship, n, exogenous) + steady[n] for n in OUTPUTS])


def _coupled(ship: ExtendedModel, rates: Sequence[Array]) -> tuple[Array, ...]:
    """d/dt (u, v, r) of the terms with coupled inertia."""
    surge, sway, yaw = rates
    return (surge, sway, yaw) if ship.model.inertia is None else (surge, *ship.model.inertia.coupled(sway, yaw))


def _signals(ship: ExtendedModel, u: Array, v: Array, r: Array, exogenous: ExogenousInputs) -> dict[str, Array]:
    """What terms read: motion through water and air, inputs and their forces."""
    signals: dict[str, Array] = {**exogenous, "u": u, "v": v, "r": r}
    if "u_c" in exogenous:
        signals["u"], signals["v"] = u - exogenous["u_c"], v - exogenous["v_c"]
    if "u_w" in exogenous:
        signals["u_q"], signals["v_q"] = u - exogenous["u_w"], v - exogenous["v_w"]
    lean = ship.get("asymmetry")
    if lean:
        signals["tau_psi"] = signals["tau_psi"] + lean * ahead_force(signals, ship.model)
    return signals


def _value(ship: ExtendedModel, part: ScaledTerm, regressor: Any, exogenous: ExogenousInputs) -> Any:
    """One term, before inertia."""
    value = (part.factor + part.after_factor(exogenous) if part.after else part.factor) * regressor
    if part.damping and SHOAL in exogenous:
        value = value * (1 + ship.get("shallow:damping") * exogenous[SHOAL])
    return value


def _heavier(ship: ExtendedModel, equation: str, exogenous: ExogenousInputs) -> Array | float:
    """Factor of inertia."""
    factor = 1 + ship.get(f"inertia:{equation}")
    return factor if SHOAL not in exogenous else factor * (1 + ship.get("shallow:inertia") * exogenous[SHOAL])
