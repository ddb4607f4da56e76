"""Distances of a vessel model from what the steps say, in standard errors."""

from __future__ import annotations

import numpy as np

from expdesign.errors import NotInformative
from expdesign.step_trials.nominal.evidence import SHORTEST_S, Evidence, States
from expdesign.values import Array
from expdesign.vessel import VesselModel

HALVINGS = 24
DRIFT, MOST_DRIFT = 0.999, 0.99
"""Sine of the largest drift angle that is sought, and from which there counts as none."""
NUDGE = 1e-4
"""Step of a velocity, for derivatives [m/s, rad/s]."""
LARGEST_ERROR = 1e3
"""Largest error of a steady state, in standard errors; beyond it the model has none near by."""


def compared(
    model: VesselModel, theta: Array, known: Evidence, late_s: Array, form: Array, to_mps: Array
) -> tuple[Array, ...]:
    """Distances in standard errors: of the plateaus in U, v and r, of the steps of throttle and rudder.

    Args:
        model: the vessel's.
        theta: (p,) parameters to compare.
        known: from the steps.
        late_s: (2,) errors of the dead times of throttle and rudder [s].
        form: (2,) relative errors of all time constants of throttle and rudder.
        to_mps: (records, 2) steady currents to north and east.
    """
    steady = known.steady.through_water(known.course, to_mps[known.record])
    errors = _steady_errors(model, theta, steady) / known.steady_std
    errors = LARGEST_ERROR * np.tanh(errors / LARGEST_ERROR)
    drift = np.isfinite(known.steady_std[:, 1])
    constants = np.maximum(known.time_constant_s + late_s[known.output // 2], SHORTEST_S)
    times = (_log_times(model, theta, known) - np.log(constants) - form[known.output // 2]) / known.log_std
    return errors[:, 0], errors[drift, 1], errors[:, 2], times[known.output == 0], times[known.output == 2]


def _log_times(model: VesselModel, theta: Array, known: Evidence) -> Array:
    """(k,) logarithms of the model's time constants [s]."""
    motion, inputs = known.middle.motion(_sway(model, theta, known.middle)), known.middle.inputs
    rates = _rates(model, theta, motion, inputs)
    half_way = known.change / 2 / np.where(rates[:, 0] == 0, np.inf, rates[:, 0])
    turning = _turning_times(model, theta, motion, rates, known)
    return np.log(np.maximum(np.where(known.output == 0, half_way, turning), SHORTEST_S))


def _turning_times(model: VesselModel, theta: Array, motion: Array, rates: Array, known: Evidence) -> Array:
    """(k,) areas between the step response of yaw and its plateau, over the plateau [s].

    For d/dt x = A x + B tau the area is -A^-1 x+, with the plateau x+ = -A^-1 B tau.
    """
    states = ["uvr".index(name) for name in model.outputs if name != "u"]
    rows = range(len(motion))
    inverse = -np.linalg.pinv(
        _slopes(model, theta, motion, known.middle.inputs)[np.ix_(rows, states, states)], rcond=1e-9
    )
    pushed = rates - _rates(model, theta, motion, known.before)
    plateau = np.einsum("nij,nj->ni", inverse, pushed[:, states])
    area, place = np.einsum("nij,nj->ni", inverse, plateau), states.index(2)
    return np.asarray(area[:, place] / np.where(plateau[:, place] == 0, np.inf, plateau[:, place]))


def _steady_errors(model: VesselModel, theta: Array, states: States) -> Array:
    """(n, 3) U, v, r of the model's steady state less the measured ones, by one Newton step."""
    motion = states.motion(_sway(model, theta, states))
    has = ["uvr".index(name) for name in model.outputs]
    rates = _rates(model, theta, motion, states.inputs)
    step = np.zeros_like(motion)
    inverse = np.linalg.pinv(
        _slopes(model, theta, motion, states.inputs)[np.ix_(range(len(motion)), has, has)], rcond=1e-9
    )
    step[:, has] = -np.einsum("nij,nj->ni", inverse, rates[:, has])
    speed = np.maximum(states.state[:, 0], 1e-6)
    step[:, 0] = (motion[:, 0] * step[:, 0] + motion[:, 1] * step[:, 1]) / speed
    return step


def _slopes(model: VesselModel, theta: Array, motion: Array, inputs: Array) -> Array:
    """(n, 3, 3) derivatives of the accelerations by u, v, r."""
    rates = _rates(model, theta, motion, inputs)
    return np.stack(
        [(_rates(model, theta, motion + step, inputs) - rates) / NUDGE for step in NUDGE * np.eye(3)], axis=-1
    )


def _sway(model: VesselModel, theta: Array, states: States) -> Array:
    """(n,) v, measured or else steady."""
    if np.isfinite(states.sway).all():
        return states.sway
    return np.where(np.isfinite(states.sway), states.sway, steady_sway(model, theta, states))


def steady_sway(model: VesselModel, theta: Array, states: States) -> Array:
    """(n,) v at which sway is steady, by bisection between -U and U; one of these where there is none."""
    low, high = (side * DRIFT * np.maximum(states.state[:, 0], 1e-6) for side in (-1, 1))
    if "v" not in model.outputs:
        return np.zeros(len(low))
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        grows = _rates(model, theta, states.motion(middle), states.inputs)[:, 1] > 0
        low, high = np.where(grows, middle, low), np.where(grows, high, middle)
    return np.asarray((low + high) / 2)


def check_sway(model: VesselModel, states: States) -> None:
    """Raise NotInformative where sway is not measured and has no steady drift at the vessel file's values."""
    if "v" in model.outputs and not np.isfinite(states.sway).all():
        drift = np.abs(steady_sway(model, model.parameters, states)) / np.maximum(states.state[:, 0], 1e-6)
        if np.any(drift > MOST_DRIFT):
            raise NotInformative(
                "the sway equation of the vessel file has no steady drift in some of the turns: state more damping "
                "of sway"
            )


def _rates(model: VesselModel, theta: Array, motion: Array, inputs: Array) -> Array:
    """(n, 3) accelerations at motions (n, 3)."""
    columns = tuple(motion.T)
    rates = model.accelerations(columns, columns[:2], tuple(inputs.T), parameters=theta)
    return np.stack(np.broadcast_arrays(*rates, columns[0])[:3], axis=1)
