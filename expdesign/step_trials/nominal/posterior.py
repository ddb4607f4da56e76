"""The parameters that what the steps say leaves most likely, with their covariance."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
import scipy

from expdesign.step_trials.nominal.distances import check_sway, compared
from expdesign.step_trials.nominal.evidence import Evidence
from expdesign.values import Array
from expdesign.vessel import VesselModel

MOST_STEPS = 60
"""Largest number of Gauss-Newton steps between two enlargements of errors."""
TIMES = 4
"""Errors of both dead times, and of both kinds of time constants by their definition."""
FARTHEST = 5.0
"""Largest value of each of these errors, in standard deviations: steps far beyond have no effect."""
CURRENT_STD_MPS = 0.2
"""Standard deviation of a steady current to north and to east, a current of its own in each record."""
ROUNDS = 4
"""Largest number of enlargements of errors."""
FORM_STD = 0.03
"""Relative error of what one time constant says about a response of another form; chosen from simulations."""


def posterior(model: VesselModel, known: Evidence, *, rounds: int = ROUNDS) -> tuple[Array, Array]:
    """(p,) parameters and (p, p) covariance, by Gauss and Newton from the vessel file's values.

    Errors of the two dead times, and of both kinds of time constants by their definition, are estimated beside the
    parameters, and a steady current in each record: speeds over less than a whole turn contain it. Where sway is not
    measured its parameters are considered, not estimated: they stay, and their stated errors count as errors of the
    data, in weights and covariance (S. F. Schmidt, Advances in Control Systems 3, 1966).

    Args:
        model: the vessel's, with what is known before.
        known: from the steps.
        rounds: of weights and parameters in turn.

    Raises:
        NotInformative: sway has no steady drift at the vessel file's values.
    """
    check_sway(model, known.steady)
    free, considered = _free(model, known)
    root = np.linalg.cholesky(model.parameter_covariance[np.ix_(free, free)])
    beside = TIMES + 2 * known.records
    estimated = len(free) - considered + beside

    def parts(z: Array) -> tuple[Array, ...]:
        theta = model.parameters.copy()
        theta[free] += root @ z[beside:]
        own = FARTHEST * np.tanh(z[:beside] / FARTHEST)
        late_s, form = known.delay_std_s * own[:2], FORM_STD * own[2:TIMES]
        return compared(model, theta, known, late_s, form, CURRENT_STD_MPS * own[TIMES:].reshape(-1, 2))

    def with_considered(z: Array) -> Array:
        return np.append(z, np.zeros(considered))

    z = np.zeros(estimated)
    if np.isfinite(known.steady.sway).all():
        begun, _ = posterior(model, known.without_sway(), rounds=1)
        z[beside:] = np.linalg.solve(root, (begun - model.parameters)[free])
    enlarged, slopes = np.ones(5), _considered_slopes(parts, with_considered(z), considered)

    def whitening(z: Array) -> Array:
        return _whitening(np.repeat(enlarged, list(map(len, parts(with_considered(z))))), slopes)

    for _ in range(rounds):
        white = whitening(z)
        found = scipy.optimize.least_squares(
            lambda z, white=white: np.append(white @ np.concatenate(parts(with_considered(z))), z),
            z, x_scale="jac", max_nfev=MOST_STEPS,
        )  # fmt: skip
        z = found.x
        slopes = _considered_slopes(parts, with_considered(z), considered)
        enlarged = _enlarged(parts(with_considered(z)), estimated)
    left = _schmidt(np.linalg.solve(white, found.jac[: len(white)]), whitening(z), slopes)
    value, covariance = model.parameters.copy(), np.zeros((len(model.names),) * 2)
    value[free] += root @ with_considered(z)[beside:]
    covariance[np.ix_(free, free)] = root @ left[beside:, beside:] @ root.T
    return value, covariance


def _free(model: VesselModel, known: Evidence) -> tuple[npt.NDArray[np.intp], int]:
    """Indices of the parameters that are not known, and how many at their end are considered."""
    uncertain = model.parameter_std > 0
    unseen = not np.isfinite(known.steady.sway).all()
    sways = np.array([term.equation == "v" for term in model.terms]) & uncertain & unseen
    return np.concatenate([np.flatnonzero(uncertain & ~sways), np.flatnonzero(sways)]), int(sways.sum())


def _considered_slopes(parts: Callable[[Array], Sequence[Array]], z: Array, considered: int) -> Array:
    """(n, considered) change of all distances with each considered parameter, half a standard deviation each way."""
    steps = 0.5 * np.eye(len(z))[len(z) - considered :]
    columns = [np.concatenate(parts(z + step)) - np.concatenate(parts(z - step)) for step in steps]
    return np.stack(columns, axis=1) if columns else np.zeros((sum(map(len, parts(z))), 0))


def _whitening(errors: Array, slopes: Array) -> Array:
    """(n, n) what gives distances unit covariance, for errors (n,) of their own and unit ones along slopes (n, c)."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(np.diag(errors**2) + slopes @ slopes.T)))


def _schmidt(jacobian: Array, white: Array, slopes: Array) -> Array:
    """(p + c, p + c) covariance of estimated and considered parameters, both of unit covariance before.

    Args:
        jacobian: (n, p) derivatives of distances by the estimated ones.
        white: (n, n) as of `_whitening`, with these slopes.
        slopes: (n, c) derivatives by the considered ones.
    """
    scaled = white @ jacobian
    gain = np.linalg.inv(scaled.T @ scaled + np.eye(scaled.shape[1]))
    cross = -gain @ scaled.T @ white @ slopes
    return np.block([[gain, cross], [cross.T, np.eye(slopes.shape[1])]])


def _enlarged(parts: Sequence[Array], parameters: int) -> Array:
    """Factor by which the errors of each part are too small, never less than 1.

    What considered parameters add is not taken off: it is far from linear in them, and parameters would come out
    several standard deviations wrong.
    """
    count = sum(map(len, parts))
    freedom = count / max(count - parameters, 1)
    return np.array([max(1.0, math.sqrt(freedom * np.mean(part**2))) if len(part) else 1.0 for part in parts])
