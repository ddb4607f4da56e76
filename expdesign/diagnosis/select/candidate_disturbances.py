"""Disturbances of a candidate along a simulated path, per unit of each of its effects."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from scipy.linalg.lapack import dtbtrs

from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.fit import difference_step, effect_disturbances
from expdesign.diagnosis.motion import Disturbance, LinearisedMotion, disturbance_of
from expdesign.values import Array


def candidate_disturbances(
    linear: LinearisedMotion, candidate: Candidate
) -> Iterator[tuple[object, Callable[[], Disturbance]]]:
    """(tag, function) of every disturbance of a candidate; candidates share those with the same tag."""
    ship = linear.motion.ship
    fixed = tuple(sorted(candidate.fixed.items()))
    if "roll:period" in candidate.fixed:
        for key in candidate.free:
            yield (key, fixed), partial(_roll_disturbance, linear, candidate, key)
    elif candidate.finite:
        whole = ship.with_effects({**candidate.fixed, **candidate.free})
        yield (tuple(sorted(candidate.free.items())), fixed), partial(disturbance_of, linear, whole, 1.0)
    else:
        for key in candidate.free:
            yield (key, fixed), partial(_smooth_disturbance, linear, candidate, key)


def _smooth_disturbance(linear: LinearisedMotion, candidate: Candidate, key: str) -> Disturbance:
    """Per unit of one effect; beside fixed effects that the path lacks by a finite difference."""
    if not candidate.fixed:
        return effect_disturbances(linear, [key])[0]
    ship = linear.motion.ship
    size = difference_step(ship, key)
    return disturbance_of(linear, ship.with_effects({**candidate.fixed, key: ship.get(key) + size}), size)


def _roll_disturbance(linear: LinearisedMotion, candidate: Candidate, key: str) -> Disturbance:
    """Acceleration by a roll angle that the simulated path itself excites."""
    motion = linear.motion
    rates = linear.mean_rates
    middle = (motion.states[:, :-1] + motion.states[:, 1:]) / 2
    side = rates[..., 1] + middle[..., 0] * middle[..., 2]
    w0, damping = 2 * np.pi / candidate.fixed["roll:period"], candidate.fixed["roll:damping"]
    roll = _oscillator_response(side, w0, damping, motion.windows.step_s)
    force = np.zeros((*side.shape, motion.states.shape[-1]))
    force[..., 1 if key == "roll:sway" else 2] = roll
    return Disturbance(force=force, sensor=None)


def _oscillator_response(drive: Array, w0: float, damping: float, step_s: float) -> Array:
    """(w, k) mean over each step of x in x'' + 2 damping w0 x' + w0^2 x = w0^2 drive, the drive (w, k) held."""
    step = np.array([[0.0, 1.0, 0.0], [-(w0**2), -2 * damping * w0, w0**2], [0.0, 0.0, 0.0]]) * step_s
    transition, power = np.eye(3), np.eye(3)
    for order in range(1, 16):
        power = power @ step / order
        transition = transition + power
    (keep, of_rate), (of_roll, keep_rate) = transition[:2, :2]
    near, far = transition[0, 2], of_rate * transition[1, 2] - keep_rate * transition[0, 2]
    behind = np.array([1.0, -keep - keep_rate, keep * keep_rate - of_rate * of_roll])
    first = drive[:, :1]  # where the angle begins, at rest
    forced = np.pad(near * (drive - first), ((0, 0), (1, 0)))
    forced[:, 2:] += far * (drive - first)[:, :-1]
    angle = _recursion(behind, forced) + first
    return np.asarray((angle[:, :-1] + angle[:, 1:]) / 2)


def _recursion(coefficients: Array, forced: Array) -> Array:
    """(w, k) x with coefficients . (x_k, x_k-1, ...) = forced_k, the first coefficient one, zero before the first."""
    band = np.repeat(coefficients[:, None], forced.shape[1], axis=1)
    return np.asarray(dtbtrs(band, forced.T, uplo="L", diag="U")[0].T)
