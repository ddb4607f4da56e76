"""Reading the mean current out of the nuisance parameters of surge.

The linear damping X_u (u - u_c) leaves -X_u times the mean current with cos psi (north) and sin psi (east), so the
current is minus their parameters over X_u, too large by 1 / E cos(heading noise), for which there is a correction.

Source: F. Ljungberg, doctoral thesis, Linköping University, (5.34)-(5.35).
"""

from __future__ import annotations

import numpy as np

from expdesign.errors import InputError
from expdesign.estimation.values import Estimate
from expdesign.values import Array

DAMPING = "X_u"
COLUMNS = ("u: cos psi", "u: sin psi")


def mean_current(estimate: Estimate, *, heading_std_rad: float = 0.0) -> tuple[Array, Array]:
    """(2,) mean current to north/east [m/s] and its covariance (2, 2), to first order.

    Args:
        estimate: of an augmented method, with X_u among its parameters.
        heading_std_rad: of white Gaussian heading noise, to correct for.

    Raises:
        InputError: the estimate has no disturbance parameters.
    """
    names = (*estimate.names, *estimate.nuisance_names)
    lacking = [name for name in (DAMPING, *COLUMNS) if name not in names]
    if lacking:
        raise InputError(f"method {estimate.method!r} does not estimate the current: it has no {lacking[0]!r}")
    joint = np.concatenate([estimate.values, estimate.nuisance_values])
    places = [names.index(name) for name in (DAMPING, *COLUMNS)]
    damping, *rho = joint[places]
    factor = float(np.exp(-0.5 * heading_std_rad**2))
    current = -factor * np.array(rho) / damping
    slopes = np.zeros((2, 3))
    slopes[:, 0] = -current / damping
    slopes[[0, 1], [1, 2]] = -factor / damping
    return current, slopes @ estimate.joint_covariance[np.ix_(places, places)] @ slopes.T
