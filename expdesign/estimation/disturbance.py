"""Reading the mean current out of the nuisance parameters of surge and sway.

The linear damping X_u (u - u_c) leaves -X_u times the mean current with cos psi (north) and sin psi (east), and
Y_v (v - v_c) leaves Y_v times it with sin psi (north) and -cos psi (east). Each ratio is too large by 1 / E cos(heading
noise), for which there is a correction. Where both equations tell the current, the readings are fused by their
covariance.

Source: F. Ljungberg, doctoral thesis, Linköping University, (5.34)-(5.35), (7.61); for sway derived alike.
"""

from __future__ import annotations

import numpy as np

from expdesign.errors import InputError
from expdesign.estimation.regression import STEADY_CURRENT
from expdesign.estimation.values import Estimate
from expdesign.values import Array

READINGS = (
    ("X_u", (("u: cos psi", -1.0), ("u: sin psi", -1.0))),
    ("Y_v", (("v: sin psi", 1.0), ("v: cos psi", -1.0))),
)
"""Damping, then the nuisance parameters that are it times the current to north and to east, with their signs."""


def tells_current(estimate: Estimate) -> bool:
    """Whether an estimate has the current itself, or what one of the readings needs."""
    names = {*estimate.names, *estimate.nuisance_names}
    return set(STEADY_CURRENT) <= names or any(_needs(reading) <= names for reading in READINGS)


def mean_current(estimate: Estimate, *, heading_std_rad: float = 0.0) -> tuple[Array, Array]:
    """(2,) mean current to north/east [m/s] and its covariance (2, 2), to first order.

    Args:
        estimate: of a method with a steady current, or of an augmented one with X_u or Y_v among its parameters.
        heading_std_rad: of white Gaussian heading noise, to correct for.

    Raises:
        InputError: the estimate has no disturbance parameters.
    """
    names = (*estimate.names, *estimate.nuisance_names)
    if not tells_current(estimate):
        lacking = next(name for name in ("X_u", "u: cos psi", "u: sin psi") if name not in names)
        raise InputError(f"method {estimate.method!r} does not estimate the current: it has no {lacking!r}")
    joint = np.concatenate([estimate.values, estimate.nuisance_values])
    if set(STEADY_CURRENT) <= set(names):
        places = [names.index(name) for name in STEADY_CURRENT]
        return joint[places], estimate.joint_covariance[np.ix_(places, places)]
    factor = float(np.exp(-0.5 * heading_std_rad**2))
    readings, slopes = [], []
    for damping, columns in (reading for reading in READINGS if _needs(reading) <= set(names)):
        place = names.index(damping)
        for column, sign in columns:
            other = names.index(column)
            slope = np.zeros(len(names))
            slope[other] = sign * factor / joint[place]
            readings.append(slope[other] * joint[other])
            slope[place] = -readings[-1] / joint[place]
            slopes.append(slope)
    J = np.array(slopes)
    return _fused(np.array(readings), J @ estimate.joint_covariance @ J.T)


def _needs(reading: tuple[str, tuple[tuple[str, float], ...]]) -> set[str]:
    damping, columns = reading
    return {damping, *(name for name, _ in columns)}


def _fused(readings: Array, covariance: Array) -> tuple[Array, Array]:
    """(2,) and (2, 2) from readings (2 m,) of north and east in turn, by generalised least squares."""
    if len(readings) == 2:
        return readings, covariance
    H = np.tile(np.eye(2), (len(readings) // 2, 1))
    size = np.sqrt(np.diag(covariance))
    size = np.where(size > 0, size, size.max() or 1.0)
    weights = np.linalg.pinv(covariance / np.outer(size, size), rcond=1e-10, hermitian=True) / np.outer(size, size)
    information = H.T @ weights @ H
    if not np.linalg.cond(information) < 1e12:
        return readings[:2], covariance[:2, :2]
    fused = np.linalg.inv(information)
    gain = fused @ H.T @ weights
    return np.asarray(gain @ readings), np.asarray(gain @ covariance @ gain.T)
