"""Equations of motion of an extended model."""

from __future__ import annotations

from collections.abc import Sequence

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
        value = np.broadcast_to(ship.factor(part) * regressor * _varying(ship, part, exogenous), u.shape)
        plain = _coupled(ship, [value if name == part.equation else still for name in OUTPUTS])
        result.append(plain if ship.roll is None else ship.roll.rates(plain, still, (still, still)))
    return result


def _accelerations(ship: ExtendedModel, u: Array, v: Array, r: Array, exogenous: ExogenousInputs) -> tuple[Array, ...]:
    """d/dt (u, v, r) through water, without roll."""
    signals = _signals(ship, u, v, r, exogenous)
    places, factors = ship.combined_terms
    terms = np.empty((len(places), *u.shape))
    for place, part, value in zip(places, ship.scaled_terms, ship.regressors.values(signals), strict=True):
        terms[place] = value
        if part.after or SHOAL in exogenous:
            terms[place] *= _varying(ship, part, exogenous)
    rows = terms.reshape(len(terms), u.size)
    rates = [(own @ rows[first : first + len(own)]).reshape(u.shape) for first, own in factors]
    lean = ship.get("asymmetry")
    if lean and not any(part.reads_turn for part in ship.scaled_terms):
        rates[2] += lean * ahead_force(signals, ship.model) / (1 + ship.get("inertia:r")) / _heavier(ship, exogenous)
    return _coupled(ship, rates)


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


def _varying(ship: ExtendedModel, part: ScaledTerm, exogenous: ExogenousInputs) -> Array | float:
    """What multiplies a term over time: a change of the ship, and the depth."""
    factor = 1.0 + part.after / part.factor * exogenous["after"] if part.after else 1.0
    if part.damping and SHOAL in exogenous:
        factor = factor * (1 + ship.get("shallow:damping") * exogenous[SHOAL])
    return factor if part.coriolis else factor / _heavier(ship, exogenous)


def _heavier(ship: ExtendedModel, exogenous: ExogenousInputs) -> Array | float:
    """Factor of inertia by the depth."""
    return 1 + ship.get("shallow:inertia") * exogenous[SHOAL] if SHOAL in exogenous else 1.0
