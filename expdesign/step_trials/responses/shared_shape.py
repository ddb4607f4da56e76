"""The dead time of the rudder, from all of its steps together.

Sway makes the yaw rate begin faster than a first order response, which makes the dead time of one too short. All
responses have one shape instead, second order with a zero, each stretched in time, as the time constants of a hull go
with length over speed (K. Nomoto et al., Int. Shipbuilding Progress 4, 1957). One step in noise cannot separate dead
time and shape. All steps together can, with a prior on hulls in general: T3 is less than T1 + T2, and the poles are
real or nearly so. The plateaus are estimated too, within their standard errors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy

from expdesign.step_trials.responses.transients import Transient, fit_first_order, second_order
from expdesign.values import Array

SHAPE = (math.log(1.5), math.log(0.6))
SHAPE_STD = (0.4, 0.5)
"""Logarithms of zeta and of T3/T0 of hulls, and their standard deviations; most hulls lie within two of these."""
MOST_STEPS, TOLERANCE = 6, 1e-5
WIDTH_S, POINTS, FINE = 0.8, 17, 801
"""Width and points of the grid of dead times around those of first order responses, and points of the finer grid."""
OWN = 3
"""Parameters of each step: logarithm of T0, errors of both plateaus in their standard errors."""
MOST_LOG = 20.0
"""Largest logarithm during the search: longer times have no effect that a hold could show."""


def shared_delay(steps: Sequence[Transient], *, most_s: float) -> tuple[float, float]:
    """Dead time [s] of responses of one shape, and its standard error, from 0 to `most_s`.

    Mean and standard deviation by the likelihood of dead times on a grid, each with the shape that fits it best: it may
    have two peaks, of which the largest alone would say too little.
    """
    first = [fit_first_order(step, delay_s=(0.0, min(most_s, float(step.time_s[-1]) / 3))) for step in steps]
    noise = [one.rms * math.sqrt(len(step.time_s) / one.independent) for one, step in zip(first, steps, strict=True)]
    constants = np.log([one.time_constant_s for one in first]) - math.log(2 * math.exp(SHAPE[0]) - math.exp(SHAPE[1]))
    own = np.stack([constants, np.zeros(len(steps)), np.zeros(len(steps))], axis=1)
    x, pattern = np.concatenate([SHAPE, own.ravel()]), _pattern(steps)
    middle = float(np.median([one.delay_s for one in first]))
    grid = np.linspace(max(0.0, middle - WIDTH_S), min(most_s, middle + WIDTH_S), POINTS)
    costs = []
    for delay in grid.tolist():
        found = scipy.optimize.least_squares(
            _residuals,
            x,
            x_scale="jac",
            jac_sparsity=pattern,
            max_nfev=MOST_STEPS,
            ftol=TOLERANCE,
            args=(delay, steps, noise),
        )
        x = found.x
        costs.append(found.cost)
    fine = np.linspace(grid[0], grid[-1], FINE)
    cost = scipy.interpolate.CubicSpline(grid, costs)(fine)
    weight = np.exp(cost.min() - cost)
    mean = float(weight @ fine / weight.sum())
    return mean, math.sqrt(float(weight @ (fine - mean) ** 2 / weight.sum()))


def _residuals(x: Array, delay: float, steps: Sequence[Transient], noise: Sequence[float]) -> Array:
    """Residuals of the shape against that of hulls, and of all steps against the shape."""
    parts = [
        _apart(step, by, delay, x[:2], x[2 + OWN * place : 2 + OWN * (place + 1)])
        for place, (step, by) in enumerate(zip(steps, noise, strict=True))
    ]
    return np.concatenate([(x[:2] - SHAPE) / SHAPE_STD, *parts])


def _apart(step: Transient, noise: float, delay: float, shape: Array, own: Array) -> Array:
    """Residuals of one step and of its plateaus, in standard deviations."""
    damping, zero, natural = np.exp(np.minimum([shape[0], shape[1], own[0]], MOST_LOG)).tolist()
    before, after = step.before + own[1] * step.before_std, step.after + own[2] * step.after_std
    done = second_order(np.array([natural, damping, zero * natural, delay]), step.time_s)
    return np.append((before + (after - before) * done - step.values) / noise, own[1:])


def _pattern(steps: Sequence[Transient]) -> scipy.sparse.lil_matrix:
    """Which parameters each residual depends on."""
    rows = 2 + sum(len(step.time_s) + 2 for step in steps)
    pattern = scipy.sparse.lil_matrix((rows, 2 + OWN * len(steps)), dtype=int)
    pattern[:, :2] = 1
    first = 2
    for place, step in enumerate(steps):
        pattern[first : first + len(step.time_s) + 2, 2 + OWN * place : 2 + OWN * (place + 1)] = 1
        first += len(step.time_s) + 2
    return pattern
