"""Whether the rudder answers the moment that rolls the ship, as then no instrument comes from the rudder.

Noise of the equation is independent of a rudder that was set beforehand, at earlier and at later times. A rudder that
answers roll correlates with the noise of somewhat earlier times:

    h = sum over cases of W' (y - X c(theta)),          W: changes of the rudder some time later, weighed as instruments

With the covariance of h, in which that of theta has its part, h' cov(h)^-1 h is distributed as chi-square if nothing
answers. Changes of the rudder are used, as in the equation: the rudder itself would weigh frequency zero most, where
the noise is zero and its spectrum cannot be estimated.

Source: L. Ljung, System Identification (1999), 16.6, for residuals that go with later inputs; L. P. Hansen,
Econometrica 50 (1982), 1029-1054, for the covariance of moments at an estimate.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from expdesign.roll.instruments import Weighted
from expdesign.roll.regression import Spectrum, difference, spectrum, without_start
from expdesign.roll.runs import Case
from expdesign.roll.tuning import TUNING
from expdesign.values import Array


def chance_of_answers(
    cases: Sequence[Case],
    weighted: Sequence[Weighted],
    residuals: Sequence[Sequence[Array]],
    jacobians: Sequence[Array],
    sensed: Array,
    periods: Sequence[float],
) -> float:
    """Chance that a rudder without feedback correlates with the noise as much as this one, 0 to 1.

    Args:
        cases, weighted: as the estimate has them.
        residuals: (n,) of each run of each case, whitened.
        jacobians: (5, p) of the sampled coefficients of each case.
        sensed: (q, p) derivatives of the weighted residuals.
        periods: of roll in each case [samples].
    """
    spectra = [spectrum(own) for own in residuals]
    columns = [_later(*one) for one in zip(cases, weighted, spectra, periods, strict=True)]
    moments, moved = np.zeros(TUNING.leads), np.zeros((TUNING.leads, sensed.shape[1]))
    for part, own, by, jacobian in zip(weighted, columns, residuals, jacobians, strict=True):
        for W, rows, noise in zip(own, part.rows, by, strict=True):
            moments += W.T @ noise
            moved += W.T @ rows.X @ jacobian
    power = _covariance(weighted, columns, spectra, moved @ np.linalg.pinv(sensed, rcond=1e-12))
    size = np.sqrt(np.diag(power))
    if not (size > 0).all():
        return 1.0
    powers, axes = np.linalg.eigh(power / np.outer(size, size))
    kept = powers > TUNING.repeated * powers[-1]
    seen = axes[:, kept].T @ (moments / size) / np.sqrt(powers[kept])
    return float(scipy.stats.chi2.sf(seen @ seen, np.count_nonzero(kept)))


def _later(case: Case, part: Weighted, left: Spectrum, period: float) -> list[Array]:
    """(n, l) rudder changes of each run up to a period of roll later; the last one repeats past its end."""
    first = TUNING.left_out_samples
    result = []
    for run in case.runs:
        rudder = difference(run.source)
        ahead = np.rint(period / TUNING.leads * np.arange(1, TUNING.leads + 1)).astype(int)
        places = np.minimum(np.arange(len(rudder))[:, None] + ahead, len(rudder) - 1)
        weighed = left.divided(part.noise.whitened(rudder[places])[first:])
        result.append(without_start(weighed, part.noise))
    return result


def _covariance(
    weighted: Sequence[Weighted], columns: Sequence[Sequence[Array]], spectra: Sequence[Spectrum], inverse: Array
) -> Array:
    """(l, l) covariance of the moments at the estimate, whose errors move them by `inverse` (l, q) of the residuals."""
    result, first = np.zeros((len(inverse),) * 2), 0
    for part, own, left in zip(weighted, columns, spectra, strict=True):
        by = inverse[:, first : first + len(part.top)].T
        result += left.covariance([W + basis @ by for W, basis in zip(own, part.basis, strict=True)])
        first += len(part.top)
    return result
