"""The interval of an unknown load's mass, by the profile of the sum of squares."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy

from expdesign.roll.instruments import Weighted
from expdesign.roll.model import PARAMETERS
from expdesign.roll.problem import RollProblem, residuals_of, solved
from expdesign.values import Array

CHI2_95 = 3.841  # of one degree of freedom


def load_interval(
    problem: RollProblem,
    weighted: Sequence[Weighted],
    theta: Array,
    sensed: Array,
    covariance: Array,
    held: Sequence[str],
    gone: Array,
) -> tuple[float, float] | None:
    """95 % interval of the unknown load's mass by the profile of the sum of squares; None where it is not sought.

    A mass is positive, and what tells it, moments over the product of mass and height, is not linear in it. Far from
    the estimate the sum of squares grows slower than its curvature there says, on one side more than on the other.

    Source: D. M. Bates and D. G. Watts, Nonlinear Regression Analysis and Its Applications (1988), 6.1.
    """
    if "m" not in problem.free or "m" in held:
        return None
    place, own = PARAMETERS.index("m"), problem.free.index("m")
    std = math.sqrt(float(covariance[own, own]))
    plain = sensed * problem.scale[problem.places]
    least = math.sqrt(max(float(np.linalg.pinv(plain.T @ plain, rcond=1e-12)[own, own]), 0.0)) * problem.scale[place]
    if not (0 < std < math.inf and least > 0):
        return None
    low, high = problem.bounds
    enough = CHI2_95 * (std / least) ** 2
    best = _cost(problem, weighted, theta, gone)
    found = {float(theta[place]): np.array(theta)}
    known: dict[float, float] = {float(theta[place]): -enough}

    def excess(mass: float) -> float:
        if mass in known:  # a second search, begun elsewhere, may end elsewhere
            return known[mass]
        nearest = found[min(found, key=lambda other: abs(other - mass))]

        begin = np.array(nearest)
        begin[place] = mass
        found[mass], _, left = solved(problem, weighted, begin, [*held, "m"], beside=gone, within=1e-8)
        known[mass] = float(left @ left) - best - enough
        return known[mass]

    ends = []
    for side, bound in ((-1.0, float(low[place])), (1.0, float(high[place]))):
        near = far = float(theta[place])
        for factor in (1.0, 2.0, 4.0, 8.0, 16.0):
            far = float(np.clip(theta[place] + side * factor * std, low[place], high[place]))
            if far == bound or excess(far) > 0:
                break
            near = far
        if (far == bound and excess(far) <= 0) or excess(far) <= 0:
            ends.append(0.0 if side < 0 else math.inf)
        else:
            ends.append(float(scipy.optimize.brentq(excess, near, far, rtol=1e-3)))
    return ends[0], ends[1]


def _cost(problem: RollProblem, weighted: Sequence[Weighted], theta: Array, gone: Array) -> float:
    left = residuals_of(problem, weighted, theta)
    return float(left @ left - np.sum((gone.T @ left) ** 2))
