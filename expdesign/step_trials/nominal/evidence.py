"""What the steps say about a vessel model: plateaus with their errors, and time constants."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from expdesign.errors import NotInformative
from expdesign.step_trials.samples import Delays, StepSample
from expdesign.values import Array
from expdesign.vessel import VesselModel

SHORTEST_S = 1e-3  # time constants below this, and negative ones, count as this [s]
LEAST_LOG_STD = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class States:
    """Motions that are compared with a model; n rows."""

    state: Array  # (n, 2) U and r
    sway: Array  # (n,) v, nan where it is not known
    inputs: Array  # (n, m)

    def through_water(self, course: Array, to_mps: Array) -> States:
        """The evidence in water that moves to north and east (n, 2), at mean headings' cosines and sines (n, 2)."""
        ahead = (course * to_mps).sum(axis=1)
        starboard = course[:, 0] * to_mps[:, 1] - course[:, 1] * to_mps[:, 0]
        return replace(self, state=self.state - np.stack([ahead, 0.0 * ahead], axis=1), sway=self.sway - starboard)

    def motion(self, sway: Array) -> Array:
        """(n, 3) u, v, r."""
        surge = np.sqrt(np.maximum(self.state[:, 0] ** 2 - sway**2, 0.0))
        return np.stack([surge, sway, self.state[:, 1]], axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What the steps say about a model with three degrees of freedom."""

    steady: States  # the plateaus, over ground
    course: Array  # (n, 2) mean cosine and sine of their headings
    record: npt.NDArray[np.int64]  # (n,) number of the record that each is in
    steady_std: Array  # (n, 3) errors of U, v and r; infinite where v is not known
    middle: States  # of the steps that count
    output: Array  # (k,) 0 where the throttle was stepped, 2 where the rudder was
    before: Array  # (k, m) inputs before the step
    change: Array  # (k,) of U or r
    time_constant_s: Array  # (k,) as measured
    log_std: Array  # (k,) its relative standard error
    # (2,) of the dead times of throttle and rudder; a dead time too long makes all time constants of its command too
    # short by as much
    delay_std_s: Array

    @property
    def records(self) -> int:
        """Number of records, at least one."""
        return int(self.record.max(initial=0)) + 1

    def without_sway(self) -> Evidence:
        """The evidence as if sway had not been measured."""
        unknown = [replace(part, sway=np.full(len(part.sway), np.nan)) for part in (self.steady, self.middle)]
        std = self.steady_std * [1.0, np.inf, 1.0]
        return replace(self, steady=unknown[0], middle=unknown[1], steady_std=std)


def evidence(samples: Sequence[StepSample], delays: Delays) -> Evidence:
    """Evidence of all plateaus and of the steps that count."""
    held = [(one, one.plateau) for one in samples if one.plateau is not None and np.isfinite(one.plateau.std).all()]
    plateaus = [part for _, part in held]
    sway_std = [part.sway_std if math.isfinite(part.sway_std) else math.inf for part in plateaus]
    std = np.array([[part.std[0], wide, part.std[1]] for part, wide in zip(plateaus, sway_std, strict=True)])
    steps = [(one, *middle) for one in samples if (middle := _middle(one)) is not None]
    return Evidence(
        steady=States(
            state=np.array([part.state for part in plateaus]),
            sway=np.array([part.sway for part in plateaus]),
            inputs=np.array([part.inputs for part in plateaus]),
        ),
        course=np.array([part.course for part in plateaus]),
        record=np.array([one.hold.batch for one, _ in held], dtype=np.int64),
        steady_std=np.maximum(std, 1e-9),
        middle=States(
            state=np.array([one.middle[0] for one, *_ in steps if one.middle is not None]),
            sway=np.array([one.middle[1] for one, *_ in steps if one.middle is not None]),
            inputs=np.array([one.plateau.inputs for one, *_ in steps if one.plateau is not None]),
        ),
        output=np.array([2 * (one.hold.channel or 0) for one, *_ in steps]),
        before=np.array([one.before.inputs for one, *_ in steps if one.before is not None]),
        change=np.array([_change(one) for one, *_ in steps]),
        time_constant_s=np.array([constant for _, constant, _ in steps]),
        log_std=np.array([max(error, LEAST_LOG_STD) for *_, error in steps]),
        delay_std_s=np.array([std if math.isfinite(std) else 0.0 for _, std in delays]),
    )


def _middle(one: StepSample) -> tuple[float, float] | None:
    """Time constant of a step that counts [s], and its relative standard error."""
    if not one.counts or one.response is None or one.middle is None:
        return None
    constant = one.response.time_constant_s
    return constant, one.response.time_constant_std_s / constant


def _change(one: StepSample) -> float:
    assert one.plateau is not None
    assert one.before is not None
    return float((one.plateau.state - one.before.state)[one.hold.channel or 0])


HALVINGS = 24
DRIFT, MOST_DRIFT = 0.999, 0.99  # sine of the largest drift angle that is sought, and from which there counts as none
NUDGE = 1e-4  # step of a velocity, for derivatives [m/s, rad/s]
LARGEST_ERROR = 1e3  # largest error of a steady state, in standard errors; beyond it the model has none near by


def compared(
    model: VesselModel, theta: Array, known: Evidence, late_s: Array, form: Array, to_mps: Array
) -> tuple[Array, ...]:
    """Distances in standard errors: of the plateaus in U, v and r, of the steps of throttle and rudder.

    Args:
        theta: (p,) parameters to compare.
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
