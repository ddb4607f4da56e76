"""How runs differ, of a fit: standard errors and p-values that count the spread of what single runs say.

A fit's covariance assumes noise of one spectrum and size. Real runs also differ in weather, loading and model error, so
that estimates from single runs scatter by more, see `estimation.solve.between_runs`. Tests use the F distribution with
the degrees of freedom of what directions have in common and of their own. Where runs do not differ, covariances and
chi-squared tests stay as they are.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import scipy

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit.fit import Fit
from expdesign.diagnosis.fit.linear_model import window_information
from expdesign.estimation.solve import MOST_FREEDOM, Dispersion, Spread, few_runs_factor, spread_between_runs
from expdesign.own_units import pseudo_inverse_of
from expdesign.values import Array

NOISE_ALONE = Dispersion()  # runs that do not differ


def tail(statistic: float, numbers: int, factor: float = 1.0, freedom: float = math.inf) -> float:
    """p-value of a chi-squared statistic whose variance is larger by a factor with so many degrees of freedom."""
    if not math.isfinite(freedom) or freedom > MOST_FREEDOM:
        return float(scipy.special.chdtrc(numbers, statistic / factor))
    return float(scipy.special.fdtrc(numbers, freedom, statistic / factor / numbers))


def of_several(p_value: float, tests: float) -> float:
    """The probability that the smallest p-value of so many independent tests is no larger.

    Source: Z. Sidak, Journal of the American Statistical Association 62 (1967), 626-633.
    """
    return 1.0 if p_value >= 1.0 else -math.expm1(tests * math.log1p(-p_value))


def runs_of(windows: Windows) -> Array:
    """(w,) the run of every window; of a single run each window is one."""
    return windows.batch if len(np.unique(windows.batch)) > 1 else np.arange(float(len(windows.batch)))


def sum_by_run(values: Array, run: Array) -> Array:
    """(g, ...) sums over the windows of every run."""
    return np.stack([values[run == name].sum(axis=0) for name in np.unique(run)])


def counting_runs(found: Fit, run: Array, known: Dispersion | None = None) -> Fit:
    """The same fit with standard errors that count how runs differ, no smaller than they are.

    They are as wide as an interval of 95 % by Student's distribution is.

    Args:
        run: (w,) number of the run of each window.
        known: of other directions; None where the effects of the fit are all there is.
    """
    if not found.keys or len(np.unique(run)) < 2:
        return found
    spread, covariance = _spread_of_estimates(found, run)
    factor, freedom = (Dispersion.of(spread) if known is None else known).beside(spread)
    wide = np.diag(covariance) * factor * few_runs_factor(freedom) ** 2
    own = np.diag(found.covariance)
    ratio = np.sqrt(np.where(own > 0, np.maximum(wide / np.where(own > 0, own, 1.0), 1.0), 1.0))
    return replace(found, covariance=found.covariance * np.outer(ratio, ratio), freedom=float(freedom.min()))


def counting_stretches(found: Fit) -> Fit:
    """The same fit of short stretches with standard errors that count how these differ, and how runs do."""
    windows = found.linear.motion.windows
    return counting_runs(counting_runs(found, np.arange(float(len(windows.batch)))), windows.batch)


def _spread_of_estimates(found: Fit, run: Array) -> tuple[Spread, Array]:
    """Of every estimated effect, and its covariance under noise alone."""
    A, s = (sum_by_run(item, run) for item in window_information(found.grams, found.sensitivities, found.noise))
    covariance = pseudo_inverse_of(A.sum(axis=0) + found.precision)
    moved = A @ covariance  # (g, c, c) each column of the covariance is the direction of an estimate
    information = np.einsum("ck,gck->gk", covariance, moved)
    taken = np.einsum("gck,cd,gdk->gk", moved, covariance, moved)
    leverage = taken / np.maximum(information, 1e-300)
    return spread_between_runs(s @ covariance, information, leverage, estimated=True), covariance


def directions_between_runs(A: tuple[Array, Array, Array], s: tuple[Array, Array], precision: Array) -> Spread:
    """Spread of m directions beside c estimated effects.

    Args:
        A: (g, c, c) information about the effects in each run, (g, c, m) about both, (g, m) about the directions.
        s: (g, c) and (g, m) scores.
        precision: (c, c) of the effects' priors.
    """
    own, both, each = A
    inverse = pseudo_inverse_of(own.sum(axis=0) + precision)
    B = inverse @ both.sum(axis=0)  # (c, m) what of each direction the effects imitate
    known = both - own @ B
    information = each - np.einsum("cm,gcm->gm", B, both + known)
    information = np.maximum(information, 0.0)
    leverage = np.einsum("gcm,cd,gdm->gm", known, inverse, known) / np.maximum(information, 1e-300)
    return spread_between_runs(s[1] - s[0] @ B, information, leverage, estimated=False)
