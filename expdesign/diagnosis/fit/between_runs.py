"""How runs differ: the spread of estimates from run to run, in standard errors and p-values.

A fit's covariance assumes noise of one spectrum and size. Real runs also differ in weather, loading and model error, so
that estimates from single runs scatter by more. Cochran's statistic measures it for every direction of the model. Of
few runs it is a poor estimate. So those of single directions are shrunk towards what all directions of the catalogue
have in common, as far as the directions agree, and tests use the F distribution with the degrees of freedom of both.
Where runs do not differ, covariances and chi-squared tests stay as they are.

Sources: W. G. Cochran, Biometrics 10 (1954), 101-129; R. DerSimonian and N. Laird, Controlled Clinical Trials 7 (1986),
177-188, for the variance between runs; R. M. Bell and D. F. McCaffrey, Survey Methodology 28 (2002), 169-181, for the
degrees of freedom that estimated parameters take; G. K. Smyth, Statistical Applications in Genetics and Molecular
Biology 3 (2004), article 3, for the shrinkage.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit.fit import Fit
from expdesign.diagnosis.fit.linear_model import window_information
from expdesign.values import Array

FEWEST, MOST_FREEDOM = 0.3, 1e5
"""Degrees of freedom from which a spread tells anything, and which count as any number."""
LEAST_SHARE = 1e-9
"""Of the information, for a run to tell anything."""
NORMAL_95 = float(scipy.special.ndtri(0.975))


@dataclass(frozen=True, kw_only=True, eq=False)
class Spread:
    """How estimates in some directions differ between runs."""

    ratio: Array  # (k,) of their variance over that of noise alone
    freedom: Array  # (k,) degrees of freedom of that ratio
    # (k,) how much more of the variance between runs is left in an estimate than with equal runs: one where they are
    # equal, as many as there are degrees of freedom where one run tells all
    uneven: Array


def spread_between_runs(score: Array, information: Array, leverage: Array, *, estimated: bool) -> Spread:
    """Spread of estimates in k directions over g runs.

    Args:
        score: (g, k) of each run.
        information: (g, k) of each run, the variance of its score under noise alone.
        leverage: (g, k) share of that variance which the estimated effects take away.
        estimated: whether the directions are of estimated effects, so that all scores are relative to the estimate.
    """
    whole = information.sum(axis=0)
    share = information / np.where(whole > 0, whole, 1.0)
    if not estimated:
        score, leverage = score - share * score.sum(axis=0), leverage + share
    known = share > LEAST_SHARE
    ratio = np.where(known, score**2 / np.where(known, information, 1.0), 0.0).sum(axis=0)
    freedom = np.where(known, np.clip(1.0 - leverage, 0.0, 1.0), 0.0).sum(axis=0)
    most, largest = max(len(score) - 1, 1), (share**2).sum(axis=0)
    return Spread(
        ratio=np.where(freedom > FEWEST, ratio / np.maximum(freedom, FEWEST), 1.0),
        freedom=np.where(freedom > FEWEST, freedom, 0.0),
        uneven=np.clip(most * largest / np.maximum(1.0 - largest, LEAST_SHARE), 1.0, most),
    )


@dataclass(frozen=True, kw_only=True)
class Dispersion:
    """What is known of the spread between runs in every direction: its ratio, and the degrees of freedom of that."""

    ratio: float = 1.0
    freedom: float = math.inf

    @staticmethod
    def of(spread: Spread) -> Dispersion:
        """What many directions have in common, by Smyth's method of moments."""
        known = spread.freedom > FEWEST
        if known.sum() < 2:
            return Dispersion(freedom=0.0)
        ratio, own = np.maximum(spread.ratio[known], LEAST_SHARE), spread.freedom[known]
        logs = np.log(ratio) - scipy.special.digamma(own / 2) + np.log(own / 2)
        apart = float(logs.var(ddof=1) - scipy.special.polygamma(1, own / 2).mean())
        if apart <= scipy.special.polygamma(1, MOST_FREEDOM):
            return Dispersion(ratio=float(ratio @ own / own.sum()))
        freedom = 2.0 * _inverse_trigamma(apart)
        scale = math.exp(float(logs.mean()) + float(scipy.special.digamma(freedom / 2)) - math.log(freedom / 2))
        return Dispersion(ratio=scale, freedom=freedom)

    def beside(self, spread: Spread) -> tuple[Array, Array]:
        """(k,) factors of the variances of estimates, at least one, and their degrees of freedom."""
        freedom = self.freedom + spread.freedom
        own = np.divide(spread.freedom, freedom, out=np.zeros_like(freedom), where=freedom > 0)  # zero beside infinity
        ratio = self.ratio + own * (spread.ratio - self.ratio)
        factor = 1.0 + np.maximum(ratio - 1.0, 0.0) * spread.uneven
        return factor, np.where(factor > 1.0, freedom, np.inf)

    @property
    def alone(self) -> tuple[float, float]:
        """Factor and degrees of freedom of an estimate whose own spread is not known."""
        return max(self.ratio, 1.0), self.freedom if self.ratio > 1.0 else math.inf


NOISE_ALONE = Dispersion()
"""Runs that do not differ."""


def _inverse_trigamma(value: float) -> float:
    return float(scipy.optimize.brentq(lambda x: float(scipy.special.polygamma(1, x)) - value, 1e-4, MOST_FREEDOM))


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


def few_runs_factor(freedom: Array | float) -> Array:
    """By how much an interval of 95 % is wider with so many degrees of freedom."""
    return np.asarray(scipy.special.stdtrit(np.maximum(freedom, 1.0), 0.975) / NORMAL_95)


def _spread_of_estimates(found: Fit, run: Array) -> tuple[Spread, Array]:
    """Of every estimated effect, and its covariance under noise alone."""
    A, s = (sum_by_run(item, run) for item in window_information(found.grams, found.sensitivities, found.noise))
    covariance = np.linalg.pinv(A.sum(axis=0) + found.precision, rcond=1e-14, hermitian=True)
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
    inverse = np.linalg.pinv(own.sum(axis=0) + precision, rcond=1e-14, hermitian=True)
    B = inverse @ both.sum(axis=0)  # (c, m) what of each direction the effects imitate
    known = both - own @ B
    information = each - np.einsum("cm,gcm->gm", B, both + known)
    information = np.maximum(information, 0.0)
    leverage = np.einsum("gcm,cd,gdm->gm", known, inverse, known) / np.maximum(information, 1e-300)
    return spread_between_runs(s[1] - s[0] @ B, information, leverage, estimated=False)
