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
STRIDE = 1.5  # from mass to mass, on the way to the ends
LEAST_SHARE = 0.01  # of a typical load, below which there may be none


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
    here, highest = float(theta[place]), float(problem.bounds[1][place])
    lowest = LEAST_SHARE * float(problem.scale[place])
    if not (0 < std < math.inf and least > 0 and lowest < here < highest):
        return None
    enough = CHI2_95 * (std / least) ** 2
    best = _cost(problem, weighted, theta, gone)
    found: dict[float, Array] = {here: np.array(theta)}
    known: dict[float, float] = {here: -enough}

    def excess(mass: float) -> float:
        if mass in known:  # a second search, begun elsewhere, may end elsewhere
            return known[mass]
        nearest = min(found, key=lambda other: float(abs(math.log(other / mass))))
        found[mass], _, left = solved(
            problem, weighted, _with_mass(found[nearest], mass), [*held, "m"], beside=gone, within=1e-8
        )
        known[mass] = float(left @ left) - best - enough
        return known[mass]

    ends = []
    for factor, open_end in ((1.0 / STRIDE, 0.0), (STRIDE, math.inf)):
        near = far = here
        while excess(far) <= 0 and lowest < far * factor < highest:
            near, far = far, far * factor
        ends.append(open_end if excess(far) <= 0 else float(scipy.optimize.brentq(excess, near, far, rtol=1e-3)))
    return ends[0], ends[1]


def _with_mass(theta: Array, mass: float) -> Array:
    """Parameters (9,) with another mass where the load's moment about the axis of rotation stays.

    That moment is what the data tell best. From the height of another mass a search may end beside the profile, which
    then seems to rise at once.
    """
    found = np.array(theta)
    m, axis, z = (PARAMETERS.index(name) for name in ("m", "z_f", "z_m"))
    found[z] = (theta[z] + theta[axis]) * theta[m] / mass - theta[axis]
    found[m] = mass
    return found


def _cost(problem: RollProblem, weighted: Sequence[Weighted], theta: Array, gone: Array) -> float:
    left = residuals_of(problem, weighted, theta)
    return float(left @ left - np.sum((gone.T @ left) ** 2))
