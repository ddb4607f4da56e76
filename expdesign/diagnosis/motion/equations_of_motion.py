"""Equations of motion of an extended model, one integrator step of them, and its derivatives by the state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.linalg.lapack import dtbtrs

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.model import ExtendedModel, ScaledTerm, ahead_force
from expdesign.diagnosis.motion.inputs import ExogenousInputs
from expdesign.simulation.motion import rates_over_ground, rk4_step
from expdesign.simulation.program import evaluation
from expdesign.values import Array
from expdesign.vessel.structures import SHOAL

DIFFERENCE = 1e-5  # step of finite differences of the rates by the state
# of all windows whose rates are differentiated at once, at most: small arrays cost their number, large ones leave the
# processor's cache
SAMPLES_AT_ONCE = 16_000
ROLL_ANGLE_RAD = 0.25  # of a roll oscillation in one part of an integrator step, at most
MOST_ROLL_PARTS = 16  # parts of an integrator step for roll
FARTHEST = 1e3  # state whose rates are taken, at most [m/s, rad/s]


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
        if SHOAL in exogenous:
            terms[place] *= _varying(ship, part, exogenous)
    rows = terms.reshape(len(terms), u.size)
    rates = [(own @ rows[first : first + len(own)]).reshape(u.shape) for first, own in factors]
    if ship.changes and SHOAL not in exogenous:
        rates = [
            rate + (change @ rows[first : first + len(change)]).reshape(u.shape) * exogenous["after"]
            for rate, change, (first, _) in zip(rates, ship.changes, factors, strict=True)
        ]
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


def runge_kutta_step(
    ship: ExtendedModel, x: tuple[Array, ...], exogenous: ExogenousInputs, h: float
) -> tuple[tuple[Array, ...], Array]:
    """The state after one step, and the change of heading; fast roll is integrated in parts of the step."""
    parts = parts_of_step(ship, h)
    state = (*x, np.zeros_like(x[2]))
    end = exogenous.at_fraction(-0.5)
    for part in range(parts):
        begin, middle, end = end, *(exogenous.at_fraction((part + share) / parts - 0.5) for share in (0.5, 1.0))
        later = partial(_rates_ahead, ship, middle), partial(_rates_ahead, ship, end)
        state = rk4_step(partial(_rates, ship, begin), state, h / parts, later)
    return state[:-1], state[-1]


def parts_of_step(ship: ExtendedModel, h: float) -> int:
    """How many parts a step has, so that roll turns little in each."""
    turn = 0.0 if ship.roll is None else 2 * math.pi * h / ship.roll.period_s
    return min(max(1, math.ceil(turn / ROLL_ANGLE_RAD)), MOST_ROLL_PARTS)


def _rates(ship: ExtendedModel, exogenous: ExogenousInputs, state: tuple[Array, ...]) -> tuple[Array, ...]:
    """d/dt of a state and of the heading after it."""
    return (*state_rates(ship, state[:-1], exogenous), state[2])


def _rates_ahead(ship: ExtendedModel, exogenous: ExogenousInputs, state: tuple[Array, ...]) -> tuple[Array, ...]:
    """The same within a step, where a motion that runs away must not overflow."""
    x = tuple(np.minimum(np.maximum(part, -FARTHEST), FARTHEST) for part in state[:-1])
    return (*state_rates(ship, x, exogenous), x[2])


def state_jacobian(ship: ExtendedModel, states: Array, exogenous: ExogenousInputs) -> Array:
    """(..., n, n) derivatives of the rates, by central differences; as many at once as keep memory small."""
    n = ship.states
    columns = np.moveaxis(states, -1, 0)[:, None]
    moves = DIFFERENCE * np.concatenate([np.eye(n), -np.eye(n)]).reshape(2 * n, n, *[1] * (states.ndim - 1))
    at_once = max(1, SAMPLES_AT_ONCE // max(1, states[..., 0].size))
    rates = np.empty((2 * n, n, *states.shape[:-1]))
    for low in range(0, 2 * n, at_once):
        part = moves[low : low + at_once]
        moved = tuple(column + part[:, axis] for axis, column in enumerate(columns))
        for column, rate in enumerate(state_rates(ship, moved, exogenous)):
            rates[low : low + at_once, column] = rate
    jacobian = (rates[:n] - rates[n:]) / (2 * DIFFERENCE)
    return np.ascontiguousarray(np.moveaxis(jacobian, (0, 1), (-1, -2)))


def transition_matrices(jacobian: Array, h: float, parts: int = 1) -> tuple[Array, Array]:
    """Transition over a step, and the effect of a constant acceleration over it, to fourth order.

    Of a step with parts they are put together from those of equal parts, at least as many, by doubling.
    """
    doublings = math.ceil(math.log2(parts))
    part_s = h / 2**doublings
    A = jacobian * part_s
    eye = np.eye(A.shape[-1])
    A2 = A @ A
    A3 = A2 @ A
    transition, forcing = eye + A + A2 / 2 + A3 / 6 + A3 @ A / 24, part_s * (eye + A / 2 + A2 / 6 + A3 / 24)
    for _ in range(doublings):
        transition, forcing = transition @ transition, forcing + transition @ forcing
    return transition, forcing


def propagated(transition: Array, first: Array, missed: Array) -> Array:
    """(w, k, n) changes of the states by gaps at the start (w, n) and between steps (w, k - 1, n).

    All steps of all windows are one lower triangular band matrix. Where a motion overflows, so may those of other
    windows.
    """
    w, n = first.shape
    band = np.zeros((w, missed.shape[1] + 1, n, 2 * n))  # (column, diagonal) of the matrix, from the main one down
    for column in range(n):
        band[:, :-1, column, n - column : 2 * n - column] = -transition[..., column]
    gaps = np.concatenate([first[:, None], missed], axis=1)
    found, _ = dtbtrs(band.reshape(-1, 2 * n).T, gaps.reshape(-1, 1), uplo="L", diag="U")
    return np.asarray(found.reshape(gaps.shape))


def stacked_rates(ship: ExtendedModel, states: Array, exogenous: ExogenousInputs) -> Array:
    """(..., n) rates of states (..., n)."""
    found = state_rates(ship, tuple(np.moveaxis(states, -1, 0)), exogenous)
    result = np.empty(states.shape)
    for column, part in enumerate(found):
        result[..., column] = part
    return result
