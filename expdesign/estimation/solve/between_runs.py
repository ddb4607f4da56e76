"""How runs differ: the spread of what single runs say of an estimate, and standard deviations that count it.

A covariance from the noise alone is that of a model whose structure is the ship's. Where the ship has other terms, each
run draws the estimate to its own best values, and runs differ by more than noise explains. With the shares H(g) of a
run g in the equations, which sum to one, and its share z(g) = sum W eps in the error of an estimate with covariance
P = L L', Cochran's statistic of the directions L^-1 z tells whether they do (1 %). If so the variance of every
direction grows by what the runs show. Of few runs that is a poor estimate. So those of single directions are shrunk
towards what all have in common, as far as the directions agree, and count Student's distribution with the degrees
of freedom of both. Where runs do not differ, the covariance stays as it is.

Sources: W. G. Cochran, Biometrics 10 (1954), 101-129; R. DerSimonian and N. Laird, Controlled Clinical Trials 7 (1986),
177-188, for the variance between runs; R. M. Bell and D. F. McCaffrey, Survey Methodology 28 (2002), 169-181, for the
degrees of freedom that estimated parameters take; G. K. Smyth, Statistical Applications in Genetics and Molecular
Biology 3 (2004), article 3, for the shrinkage.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
import scipy

from expdesign.estimation.regression import Integers, batch_slices
from expdesign.values import Array

DIFFERING_LEVEL = 0.01  # of Cochran's test, from which runs differ
FEWEST, MOST_FREEDOM = 0.3, 1e5  # degrees of freedom from which a spread tells anything, and which count as any number
LEAST_SHARE = 1e-9  # of the information, for a run to tell anything
NORMAL_95 = NormalDist().inv_cdf(0.975)


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


def _inverse_trigamma(value: float) -> float:
    return float(scipy.optimize.brentq(lambda x: float(scipy.special.polygamma(1, x)) - value, 1e-4, MOST_FREEDOM))


def few_runs_factor(freedom: Array | float) -> Array:
    """By how much an interval of 95 % is wider with so many degrees of freedom."""
    return np.asarray(scipy.special.stdtrit(np.maximum(freedom, 1.0), 0.975) / NORMAL_95)


@dataclass(frozen=True, eq=False)
class Shares:
    """What each of g runs has to do with an estimate."""

    scores: Array  # (g, p) its part of the estimate's error, sum W eps
    of: Array  # (g, p, p) its share of the equations, sum W Phi'

    @staticmethod
    def by_batch(batch: Integers, W: Array, Phi: Array, residuals: Array) -> Shares:
        """Of the batches (k,) of rows, from weights (k, n, p), regressors (k, n, p) and residuals (k, n)."""
        rows = batch_slices(batch)
        return Shares(
            np.array([np.einsum("knp,kn->p", W[own], residuals[own]) for own in rows]),
            np.array([np.einsum("knp,knq->pq", W[own], Phi[own], optimize=True) for own in rows]),
        )

    def widened(self, P: Array) -> tuple[Array, float]:
        """(p, p) the covariance of the estimate that counts how runs differ, and the ratio of variances; 1 if not."""
        if len(self.scores) < 2:
            return P, 1.0
        size = np.sqrt(np.diag(P))
        size = np.where(size > 0, size, 1.0)
        values, vectors = np.linalg.eigh(P / np.outer(size, size))
        kept = values > LEAST_SHARE * values[-1]
        root, back = vectors[:, kept] * np.sqrt(values[kept]), (vectors[:, kept] / np.sqrt(values[kept])).T
        M = back @ (self.of * size / size[:, None]) @ root  # (g, k, k)
        information = np.clip(np.einsum("gkk->gk", M), 0.0, 1.0)
        leverage = np.einsum("gkl,gkl->gk", M, M) / np.maximum(information, LEAST_SHARE)
        spread = spread_between_runs((self.scores / size) @ back.T, information, leverage, estimated=True)
        freedom = float(spread.freedom.sum())
        statistic = float(spread.ratio @ spread.freedom)
        if not freedom or scipy.special.chdtrc(freedom, statistic) > DIFFERING_LEVEL:
            return P, 1.0
        factor, degrees = Dispersion.of(spread).beside(spread)
        more = root * np.sqrt(np.maximum(factor * few_runs_factor(degrees) ** 2 - 1.0, 0.0))
        return P + (more @ more.T) * np.outer(size, size), statistic / freedom


def differing_note(ratio: float) -> str:
    """A warning that runs differ."""
    return (
        f"Runs differ by {math.sqrt(ratio):.2g} times what noise explains: the model lacks something that acts in some "
        "of them. The standard deviations count it, as far as the runs show it."
    )
