"""The model turned round: which force holds a motion, and which commands give that force."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.values import Array, readonly
from expdesign.vessel.actuators import Actuator
from expdesign.vessel.model import VesselModel
from expdesign.vessel.structures import FORCE_SIGNALS, MOTION_SIGNALS, NUMPY, SHOAL, Expression, Term
from expdesign.vessel.thrusts import LEAST_PUSH, required_thrust, thrusts
from expdesign.vessel.thrusts import pushed_everywhere as pushed_everywhere_at_rest


def required_push(
    model: VesselModel,
    velocity: Array,
    acceleration: Array,
    *,
    sway: bool = True,
    near: Array | None = None,
    tolerance: float = 1e-4,
) -> Array:
    """What gives an acceleration (..., 3) at a velocity (..., 3) in calm water and air, for `commands_for`.

    The generalised force (..., 3) where the model is affine in it, the thrusts of all actuators (..., c) elsewhere.
    Directions that it cannot push (no equation, no gain) get the least-squares answer.

    Args:
        velocity, acceleration: through the water.
        sway: whether sway counts; without, models not by force leave it to itself.
        near: (..., m) commands a sample before, near to which models not by force seek others; None for any.
        tolerance: acceleration that may be missing with these, in those of full thrust.
    """
    if not by_force(model):
        return required_thrust(model, velocity, acceleration, sway=sway, near=near, tolerance=tolerance)
    if model.inertia is not None:
        sway, yaw = model.inertia.uncoupled(acceleration[..., 1], acceleration[..., 2])
        acceleration = np.stack(np.broadcast_arrays(acceleration[..., 0], sway, yaw), axis=-1)
    still = _rates(model, velocity, np.zeros(3))
    if _same_push_at_any_speed(model):  # one small inverse instead of one for every velocity
        return np.asarray((acceleration - still) @ _inverse_at_rest(model).T, dtype=float)
    gain = np.stack([_rates(model, velocity, unit) - still for unit in np.eye(3)], axis=-1)  # (..., outputs, forces)
    return np.asarray((np.linalg.pinv(gain) @ (acceleration - still)[..., None])[..., 0], dtype=float)


def _rates(model: VesselModel, velocity: Array, force: Array) -> Array:
    """d/dt (u, v, r) (..., 3) at a velocity (..., 3) by a generalised force (3,), without coupled inertia."""
    motion = {name: velocity[..., column] for column, name in enumerate(OUTPUTS)}
    signals = motion | {"u_q": motion["u"], "v_q": motion["v"], SHOAL: 0.0}
    signals |= dict(zip(FORCE_SIGNALS, force.tolist(), strict=True))
    totals = np.zeros((3, *velocity.shape[:-1]))
    for term, expression, value in _acting(model):
        totals[OUTPUTS.index(term.equation)] += value * expression.evaluate(signals, NUMPY)
    return _columns(totals / model.time_scale_s)


def _columns(rows: Array) -> Array:
    """Rows (m, ...) as columns (..., m), in place."""
    return rows.transpose(*range(1, rows.ndim), 0)


@lru_cache(maxsize=16)
def _same_push_at_any_speed(model: VesselModel) -> bool:
    """Whether no term multiplies a force by a motion."""
    forces = {*FORCE_SIGNALS}
    return not any(forces & {*x.signals} and {*x.signals} - forces for _, x, _ in _acting(model))


@lru_cache(maxsize=16)
def _acting(model: VesselModel) -> tuple[tuple[Term, Expression, float], ...]:
    """Terms with their expressions and parameters, those left out that do nothing."""
    rows = zip(model.terms, model.expressions, model.parameters.tolist(), strict=True)
    return tuple((term, expression, value) for term, expression, value in rows if value != 0.0)


@lru_cache(maxsize=16)
def _inverse_at_rest(model: VesselModel) -> Array:
    """(3, 3) force for unit accelerations of (u, v, r) at rest."""
    still = _rates(model, np.zeros(3), np.zeros(3))
    return readonly(np.linalg.pinv(np.stack([_rates(model, np.zeros(3), unit) - still for unit in np.eye(3)], axis=-1)))


@lru_cache(maxsize=16)
def by_force(model: VesselModel) -> bool:
    """Whether the accelerations are affine in the generalised force, and no term reads an actuator signal itself."""
    if direct_terms(model):
        return False
    motion = dict(zip(MOTION_SIGNALS, (0.7, -0.3, 0.2, 0.5, -0.4, 0.1), strict=True))

    def values(size: float) -> Array:
        table = motion | {name: size * (1.0 + place) for place, name in enumerate(FORCE_SIGNALS)}
        return np.array([float(value * x.evaluate(table, NUMPY)) for _, x, value in _acting(model)])

    zero, one, other = values(0.0), values(1.0), values(-2.0)
    return bool(np.allclose(other - zero, -2.0 * (one - zero), rtol=1e-9, atol=1e-12 * np.abs(one).max(initial=0.0)))


def pushed_everywhere(model: VesselModel, least: float = LEAST_PUSH) -> bool:
    """Whether the actuators push ahead, sideways and round at once, at rest.

    In models not by force, the weakest push is at least a share of the strongest.
    """
    if by_force(model):
        return bool(np.linalg.matrix_rank(force_matrix(model.actuators)) == 3)
    return pushed_everywhere_at_rest(model, least)


@lru_cache(maxsize=16)
def direct_terms(model: VesselModel) -> tuple[str, ...]:
    """Terms that read actuator signals themselves instead of the generalised force they give, as "X_n reads n1"."""
    seen = {*MOTION_SIGNALS, *FORCE_SIGNALS}
    read = [(term.name, sorted(set(x.signals) - seen)) for term, x in zip(model.terms, model.expressions, strict=True)]
    return tuple(f"{name} reads {', '.join(signals)}" for name, signals in read if signals)


def force_matrix(actuators: tuple[Actuator, ...]) -> Array:
    """(3, c) generalised force of unit commands.

    Two columns (ahead, starboard) per azimuth, one per tunnel, propeller or rudder, the identity for plain forces.
    """
    columns: list[tuple[float, float, float]] = []
    for actuator in actuators:
        x, y = actuator.forward_m, actuator.starboard_m
        if actuator.kind == "force":
            columns += [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
        elif actuator.kind == "azimuth":
            columns += [(1.0, 0.0, -y), (0.0, 1.0, x)]
        elif actuator.kind == "tunnel":
            columns.append((0.0, 1.0, x))
        elif actuator.kind == "propeller":
            columns.append((1.0, 0.0, -y))
        elif actuator.kind == "rudder":  # what it gives is a matter of the model
            columns.append((0.0, 0.0, 0.0))
    return np.array(columns).T if columns else np.zeros((3, 0))


@lru_cache(maxsize=16)
def _inverse_force_matrix(actuators: tuple[Actuator, ...]) -> Array:
    """(c, 3) smallest unit commands for generalised forces."""
    return readonly(np.linalg.pinv(force_matrix(actuators)))


def commands_for(
    model: VesselModel,
    push: Array,
    *,
    sample_time_s: float,
    before: Array | None = None,
    near: Array | None = None,
) -> Array:
    """Commands (..., k, m) for what `required_push` gives (..., k, 3 or c): smallest thrusts, then limits and rates.

    An azimuth turns the shorter way, reversing its propeller where that is nearer and gives as much; near zero thrust
    it keeps its angle. A saturated thruster is not relieved by the others. Rudders stay amidships.

    Args:
        sample_time_s: time between rows [s].
        before: (..., m) commands standing before the first row, from which rates count; None for no rate limit there.
        near: (..., m) commands to whose angles azimuths keep as near as they can; None for those of the row before.
    """
    desired, actuators = _thrusts(model, push)
    bounds = _bounds(model.actuators, sample_time_s)
    rows, last = [], before
    for row in np.moveaxis(desired, -2, 0):
        last = _reached(bounds, _desired_commands(actuators, row, last if near is None else near), last)
        rows.append(last)
    return np.stack(rows, axis=-2)


def _thrusts(model: VesselModel, push: Array) -> tuple[Array, tuple[Actuator, ...]]:
    """Thrusts (..., c) for pushes, and the actuators that angles are chosen for."""
    if by_force(model):
        return push @ _inverse_force_matrix(model.actuators).T, model.actuators
    return push, thrusts(model).actuators


def within_limits(actuators: tuple[Actuator, ...], values: Array, *, sample_time_s: float, before: Array) -> Array:
    """The commands (..., k, m) nearest to the desired ones within limits and rates, after commands (..., m)."""
    bounds = _bounds(actuators, sample_time_s)
    rows, last = [], before
    for row in np.moveaxis(values, -2, 0):
        last = _reached(bounds, row, last)
        rows.append(last)
    return np.stack(rows, axis=-2)


class Allocator:
    """`commands_for` and `within_limits` for n ships at once, sample by sample."""

    def __init__(self, model: VesselModel, *, sample_time_s: float) -> None:
        """Prepare the allocation to a model's actuators, in command order."""
        self._model, self._bounds = model, _bounds(model.actuators, sample_time_s)

    def commands(self, push: Array, *, near: Array) -> Array:
        """(n, m) commands within limits for what `required_push` gives (n, ...), whatever stands before.

        Azimuths keep as near as they can to the angles of `near` (n, m).
        """
        desired, actuators = _thrusts(self._model, push)
        return _reached(self._bounds, _desired_commands(actuators, desired, near), None)

    def within_limits(self, values: Array, *, before: Array) -> Array:
        """(n, m) commands nearest to the desired ones within limits and rates, one sample after others (n, m)."""
        return _reached(self._bounds, values, before)


@lru_cache(maxsize=16)
def _bounds(actuators: tuple[Actuator, ...], sample_time_s: float) -> tuple[Array, Array, Array]:
    """(m,) lowest, highest command and largest change from sample to sample."""
    limits = [limit for actuator in actuators for limit in actuator.limits]
    low, high = (np.array([getattr(limit, name) for limit in limits]) for name in ("low", "high"))
    rate = np.array([response.rate for actuator in actuators for response in actuator.responses])
    return readonly(low), readonly(high), readonly(rate * sample_time_s)


def _reached(bounds: tuple[Array, Array, Array], desired: Array, last: Array | None) -> Array:
    """Commands (..., m) nearest to the desired ones within limits, and within a sample's change from the last ones."""
    low, high, reach = bounds
    inside = np.minimum(np.maximum(desired, low), high)
    if last is None:
        return np.asarray(inside)
    return np.asarray(np.minimum(np.maximum(inside, last - reach), last + reach))


def _desired_commands(actuators: tuple[Actuator, ...], row: Array, last: Array | None) -> Array:
    """Commands (..., m) that give thrusts (..., c), by the shortest turn of azimuths; limits of speeds come later."""
    parts: list[Array] = []
    for actuator in actuators:
        place = len(parts)
        if actuator.kind == "azimuth":
            old = np.zeros(row.shape[:-1]) if last is None else last[..., place + 1]
            parts += _polar(row[..., place], row[..., place + 1], old, actuator)
        else:
            parts += [row[..., place + index] for index in range(len(actuator.limits))]
    return _columns(np.array(parts))


WAYS_ROUND = np.array([(half, turns) for half in (0.0, math.pi) for turns in (-1.0, 0.0, 1.0)]).T
"""Thrust ahead or reversed, and whole turns around the nearest angle: (2, 6)."""


def _polar(ahead: Array, side: Array, reference: Array, actuator: Actuator) -> tuple[Array, Array]:
    """Propeller speed and angle that come closest to a thrust within limits, by the shortest turn."""
    angles = actuator.limits[1]
    desired, bearing = np.sqrt(ahead * ahead + side * side), np.arctan2(side, ahead)
    turned = _turned_freely if math.isinf(angles.low) and math.isinf(angles.high) else _turned
    speed, angle = turned(desired, bearing, reference, actuator)
    still = desired < 1e-9
    return np.where(still, 0.0, speed), np.where(still, reference, angle)


def _turned_freely(desired: Array, bearing: Array, reference: Array, actuator: Actuator) -> tuple[Array, Array]:
    """Speed and angle of an azimuth without stops: ahead or reversed, whichever is nearer or gives more."""
    low, high = actuator.limits[0].low, actuator.limits[0].high
    away = (reference - bearing) / math.pi
    halves = np.rint(away)
    if low != -high:
        ahead, reversed_ = _missed(desired, desired, low, high), _missed(desired, -desired, low, high)
        even, odd = 2.0 * np.rint(away / 2.0), 2.0 * np.rint((away - 1.0) / 2.0) + 1.0
        halves = np.where(ahead < reversed_, even, np.where(reversed_ < ahead, odd, halves))
    backwards = halves != 2.0 * np.rint(halves / 2.0)
    speed = np.minimum(np.maximum(np.where(backwards, -desired, desired), low), high)
    return speed, bearing + math.pi * halves


def _missed(desired: Array, signed: Array, low: float, high: float) -> Array:
    """Share of a thrust that the limits of its speed leave out."""
    short = np.abs(signed - np.minimum(np.maximum(signed, low), high))
    return np.asarray(np.round(short / np.maximum(desired, 1e-9), 9))


def _turned(desired: Array, bearing: Array, reference: Array, actuator: Actuator) -> tuple[Array, Array]:
    """Speed and angle of an azimuth with stops."""
    speeds, angles = actuator.limits
    halves, turns = WAYS_ROUND
    base = bearing[..., None] + halves  # (..., 6)
    whole = np.round((reference[..., None] - base) / (2 * math.pi))
    base = base + 2 * math.pi * (whole + turns)
    angle = np.minimum(np.maximum(base, angles.low), angles.high)
    along = np.cos(angle - bearing[..., None])
    speed = np.minimum(np.maximum(desired[..., None] * along, speeds.low), speeds.high)
    missed = np.hypot(desired[..., None] - speed * along, speed * np.sin(angle - bearing[..., None]))
    short = np.round(missed / np.maximum(desired[..., None], 1e-9), 9)
    turn = np.where(short <= short.min(axis=-1, keepdims=True), np.abs(angle - reference[..., None]), np.inf)
    best = np.argmin(turn, axis=-1)[..., None]
    return np.take_along_axis(speed, best, -1)[..., 0], np.take_along_axis(angle, best, -1)[..., 0]
