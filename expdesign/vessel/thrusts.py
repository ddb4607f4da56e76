"""Commands for desired accelerations by the terms themselves, for models that force alone does not turn round.

Terms such as ``n1*abs(n1)``, ``u*abs(n1)`` or ``u*abs(u)*sin(rudder1)`` make the accelerations neither linear in the
commands nor functions of one generalised force. Newton's method finds the smallest commands that give the desired
accelerations, with secants, as n*abs(n) has no slope at rest. Its variables are shares of the largest commands, for an
azimuth thruster those of the vector of its speed ahead and to starboard. Commands beyond their limits are set to these,
and the others give what is missing, as far as they can.

Source: J. C. Virnig and D. S. Bodden, Multivariable control allocation and control law conditioning when control
effectors limit, AIAA Guidance, Navigation and Control Conference (1994): the redistributed pseudo-inverse.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from expdesign.values import Array, readonly
from expdesign.vessel.actuators import Actuator
from expdesign.vessel.model import VesselModel
from expdesign.vessel.structures import NUMPY

if TYPE_CHECKING:
    from expdesign.vessel._casadi import CompiledSteps

SECANTS = (0.05, 0.05, 0.02, 0.01, *([1e-3] * 8), *([1e-4] * 18))
"""Half widths of the secants of each iteration, as shares: wide ones see past thrust that vanishes."""
NEAR_SECANTS = (0.02, 0.01, 1e-3, 1e-3)  # the same from commands a sample before
EASED = 0.9  # share of the commands a sample before that is kept where others give as much
STARTS = (1.0, 2.0, 0.0)
"""Shares of the commands that would do at rest, from which the search begins anew where it has found no answer."""
SHORTER = 0.3  # share of a step that is tried where the whole step leaves more missing
SOLVED = 1e-11  # acceleration that may be missing, in those of full thrust
COARSE = 1e-2  # acceleration, in those of full thrust, from which on two iterations do
CLEARLY = 0.3  # share of what is missing near those commands that must be missing elsewhere for commands to jump there
STILL = 1e-8  # change of shares that makes no difference
REST_WIDTH = 0.5  # half width of secants at rest
LEAST_PUSH = 1e-3  # smallest push at rest in any direction, in the largest, with which a ship is pushed everywhere


@dataclass(frozen=True, kw_only=True, eq=False)
class Thrusts:
    """The actuators of a model as c thrusts, each a share of its largest; a vector of two for an azimuth thruster."""

    model: VesselModel
    actuators: tuple[Actuator, ...]  # those that angles are chosen for: without astern where that is not a half turn
    full: tuple[float, ...]  # largest size of each actuator's first signal
    weights: Array  # (3,) of accelerations where not all can be had

    @cached_property
    def scale(self) -> Array:
        """(c,) largest commands."""
        return np.repeat(self.full, [_width(actuator) for actuator in self.actuators])

    def shares(self, inputs: Array) -> Array:
        """(..., c) of commands (..., m)."""
        values = np.array(inputs, dtype=float)
        for actuator, place in self.each:
            if actuator.kind == "azimuth":
                speed, angle = np.moveaxis(inputs[..., place], -1, 0)
                values[..., place] = np.stack([speed * np.cos(angle), speed * np.sin(angle)], axis=-1)
        return values / self.scale

    def accelerations(self, motion: Array, shares: Array) -> Array:
        """(..., 3) at motions (..., 3) through calm water and air, for shares (..., c)."""
        inputs = list[Array]()
        for actuator, place in self.each:
            own = np.moveaxis((shares * self.scale)[..., place], -1, 0)
            inputs += [np.hypot(*own), np.arctan2(own[1], own[0])] if actuator.kind == "azimuth" else [*own]
        moving = tuple(np.moveaxis(motion, -1, 0))
        found = self.model.accelerations(moving, moving[:2], inputs, NUMPY)
        return np.stack([part + np.zeros(shares.shape[:-1]) for part in found], axis=-1)

    def within(self, shares: Array) -> Array:
        """The shares (..., c) that limits leave; an azimuth's angles are limited where it turns."""
        inside = np.clip(shares, *self._bounds)
        for actuator, place in self.each:
            if actuator.kind == "azimuth":
                size = np.linalg.norm(inside[..., place], axis=-1, keepdims=True)
                inside[..., place] /= np.maximum(1.0, size)
        return inside

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        """(c,) least and largest shares."""
        rows = []
        for actuator, size in zip(self.actuators, self.full, strict=True):
            vector = [(-size, size)] * 2
            rows += vector if actuator.kind == "azimuth" else [(each.low, each.high) for each in actuator.limits]
        low, high = np.array(rows).T / self.scale
        return low, high

    def push(self, motion: Array, shares: Array, width: float) -> tuple[Array, Array]:
        """Accelerations (..., 3), and what a unit of each share adds (..., 3, c), by secants of some half width."""
        c = shares.shape[-1]
        offsets = width * np.concatenate([np.zeros((1, c)), np.eye(c), -np.eye(c)])
        spread = shares + offsets.reshape(-1, *[1] * (shares.ndim - 1), c)
        found = self.accelerations(motion, spread)
        return found[0], np.moveaxis(found[1 : c + 1] - found[c + 1 :], 0, -1) / (2.0 * width)

    @cached_property
    def steps(self) -> CompiledSteps:
        """Newton's steps."""
        from expdesign.vessel._casadi import compiled_steps  # CasADi is loaded when commands are sought

        ranges = tuple(zip(*(column.tolist() for column in (self.scale, *self._bounds)), strict=True))
        return compiled_steps(self.model, self.actuators, ranges)

    @cached_property
    def each(self) -> list[tuple[Actuator, slice]]:
        """Where the shares of each actuator are."""
        ends = np.cumsum([_width(actuator) for actuator in self.actuators]).tolist()
        places = [slice(end - _width(actuator), end) for actuator, end in zip(self.actuators, ends, strict=True)]
        return list(zip(self.actuators, places, strict=True))


def _width(actuator: Actuator) -> int:
    return 2 if actuator.kind == "azimuth" else len(actuator.limits)


@lru_cache(maxsize=16)
def thrusts(model: VesselModel) -> Thrusts:
    """The thrusts of a model."""
    actuators = tuple(_turned_ahead(model, actuator) for actuator in model.actuators)
    full = [max(abs(each.low), abs(each.high)) for each in (actuator.limits[0] for actuator in actuators)]
    finite = tuple(size if math.isfinite(size) else 1.0 for size in full)
    arm = max(math.hypot(actuator.forward_m, actuator.starboard_m) for actuator in actuators) or 1.0
    return Thrusts(model=model, actuators=actuators, full=finite, weights=np.array([1.0, 1.0, arm]))


@lru_cache(maxsize=16)
def _without_sway(model: VesselModel) -> Thrusts:
    """The thrusts of a model whose sway is left to itself."""
    how = thrusts(model)
    return replace(how, weights=how.weights * (1.0, 0.0, 1.0))


def _answer(model: VesselModel, motion: tuple[float, float, float], commands: dict[str, float]) -> Array:
    """(3,) accelerations for some commands, the others zero."""
    inputs = [commands.get(name, 0.0) for name in model.inputs]
    return np.array([float(part) for part in model.accelerations(motion, motion[:2], inputs, NUMPY)])


def _turned_ahead(model: VesselModel, actuator: Actuator) -> Actuator:
    """An azimuth thruster without its astern where that gives something else than ahead after half a turn."""
    if actuator.kind != "azimuth" or actuator.limits[0].low >= 0 or actuator.limits[0].high <= 0:
        return actuator
    speed, angle = actuator.signals
    motion = (0.7, -0.3, 0.2)
    ahead = _answer(model, motion, {speed: 0.4 * actuator.limits[0].high, angle: 0.8})
    astern = _answer(model, motion, {speed: -0.4 * actuator.limits[0].high, angle: 0.8 + math.pi})
    if np.allclose(ahead, astern, rtol=1e-9, atol=1e-300):
        return actuator
    return replace(actuator, limits=(replace(actuator.limits[0], low=0.0), actuator.limits[1]))


@lru_cache(maxsize=16)
def push_at_rest(model: VesselModel) -> Array:
    """(3, c) accelerations by full thrusts at rest, yaw at the farthest actuator."""
    how = thrusts(model)
    columns = sum(_width(actuator) for actuator in how.actuators)
    _, push = how.push(np.zeros(3), np.zeros(columns), REST_WIDTH)
    return readonly(push * how.weights[:, None])


def pushed_everywhere(model: VesselModel, least: float) -> bool:
    """Whether the actuators push in every direction at rest, in the weakest by a share of the strongest."""
    sizes = np.linalg.svd(push_at_rest(model), compute_uv=False)
    return bool(len(sizes) == 3 and sizes[2] > least * sizes[0])


def required_thrust(
    model: VesselModel,
    velocity: Array,
    acceleration: Array,
    *,
    sway: bool = True,
    near: Array | None = None,
    tolerance: float = 1e-4,
) -> Array:
    """(..., c) small thrusts that give an acceleration (..., 3) at a velocity (..., 3).

    The speed of propellers, that of azimuth thrusters ahead and to starboard, the angle of rudders.

    Args:
        velocity, acceleration: through calm water and air.
        sway: whether sway counts; without, it is left to itself.
        near: (..., m) commands a sample before, that others are sought near to.
        tolerance: acceleration that may be missing with these, in those of full thrust.
    """
    how, rest = thrusts(model), push_at_rest(model)
    shape = np.broadcast_shapes(velocity.shape, acceleration.shape)[:-1]
    motion, desired = (np.broadcast_to(x, (*shape, 3)).reshape(-1, 3) for x in (velocity, acceleration))
    how = how if sway else _without_sway(model)
    enough = (SOLVED if near is None else tolerance) * max(float(np.abs(rest).sum(axis=1).max()), 1e-300)
    best, left = np.zeros((len(motion), rest.shape[1])), np.full(len(motion), np.inf)
    starts: Sequence[float] = STARTS
    widths: Sequence[float] = SECANTS
    most: Array | float = enough
    if near is not None:
        before = how.within(how.shares(np.broadcast_to(near, (*shape, near.shape[-1])).reshape(len(motion), -1)))
        widths = NEAR_SECANTS if tolerance < COARSE else NEAR_SECANTS[:2]
        best, left, missed = _searched(how, motion, desired, before, enough, widths, eased=EASED)
        starts, most = STARTS[:1], np.maximum(enough, missed / 2)
    for share in starts:
        open_ = np.flatnonzero(left > most)
        if not len(open_):
            break
        start = how.within(share * _like_at_rest(how, motion[open_], desired[open_]))
        found, missing, _ = _searched(how, motion[open_], desired[open_], start, enough, widths)
        better = missing < CLEARLY * left[open_] if near is not None else missing < left[open_]
        best[open_[better]], left[open_[better]] = found[better], missing[better]
    return np.asarray((best * how.scale).reshape(*shape, -1))


def _like_at_rest(how: Thrusts, motion: Array, desired: Array) -> Array:
    """(n, c) commands that would do at rest, by thrust that grows with the square of the speed."""
    push = push_at_rest(how.model).T
    missing = (desired - how.accelerations(motion, np.zeros((len(motion), len(push))))) * how.weights
    shares = how.steps.smallest(
        np.broadcast_to(push, (len(motion), *push.shape)), missing, np.zeros((len(motion), len(push)))
    )
    for _, place in how.each:
        size = np.linalg.norm(shares[:, place], axis=-1, keepdims=True)
        shares[:, place] *= np.sqrt(REST_WIDTH / np.maximum(size, 1e-6))
    return shares


def _searched(
    how: Thrusts,
    motion: Array,
    desired: Array,
    best: Array,
    enough: float,
    widths: Sequence[float],
    *,
    eased: float = 1.0,
) -> tuple[Array, Array, Array]:
    """Shares (n, c) found from others, at first from a share of them.

    Besides, what of the accelerations is missing (n,), and what was missing at first.
    """
    open_, left, step = np.arange(len(motion)), np.full(len(motion), np.inf), np.zeros_like(best)
    first: Array | None = None
    for width in widths:
        tried = best[open_] + step[open_]
        found, push = how.steps.push(motion[open_], tried, width)
        missing = (desired[open_] - found) * how.weights
        size = np.linalg.norm(missing, axis=-1)
        better = (size < left[open_]) | (size <= enough)
        rows, push, tried = open_[better], push[better] * how.weights, tried[better]
        step[open_[~better]] *= SHORTER
        first = size if first is None else first
        aimed = how.steps.smallest(push, missing[better] + (tried[:, None] @ push)[:, 0], eased * tried)
        eased = 1.0
        best[rows], left[rows], step[rows] = tried, size[better], aimed - tried
        open_ = open_[(left[open_] > enough) & (np.abs(step[open_]).max(axis=-1) > STILL)]
        if not len(open_):
            break
    return best, left, left if first is None else first
