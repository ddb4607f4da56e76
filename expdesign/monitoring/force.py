"""The unmeasured force from stretch to stretch, by a Kalman filter.

Every component, of the current or of an acceleration, is the sum of two Gauss-Markov processes: one that varies within
minutes and one that varies within hours. A change of the ship is taken for such a force in part; `sensitivity` follows
by how much.

Source: R. E. Kalman, Journal of Basic Engineering 82 (1960), 35-45; A. S. Willsky and H. L. Jones, IEEE Transactions on
Automatic Control 21 (1976), 108-112, for the sensitivity of a filter to a jump.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.monitoring.evidence import Stretches
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Force:
    """Covariance of the unmeasured force over time.

    Attributes:
        variance: (..., 2 q) of the quick processes, then of the slow ones.
        time_s: (..., 2 q) their correlation times [s].
    """

    variance: Array
    time_s: Array

    def memory(self, gap_s: float) -> Array:
        """(..., 2 q) autocorrelation over a time."""
        return np.asarray(np.exp(-gap_s / self.time_s))


@dataclass(frozen=True, kw_only=True, eq=False)
class Known:
    """What is known of the force at the beginning of a stretch: normal with this mean and covariance.

    Attributes:
        mean: (..., 2 q).
        covariance: (..., 2 q, 2 q).
    """

    mean: Array
    covariance: Array

    @classmethod
    def nothing(cls, force: Force) -> Known:
        """Before the first stretch."""
        covariance = force.variance[..., :, None] * np.eye(force.variance.shape[-1])
        return cls(mean=np.zeros(force.variance.shape), covariance=covariance)


@dataclass(frozen=True, kw_only=True, eq=False)
class Judged:
    """A stretch under what was known of the force before it.

    Attributes:
        score: (..., m) of every change, were the filter unaware of it until now.
        information: (..., m, m).
        by_force: (..., m, 2 q) inner products of the changes' sensitivities with the force's.
        force_score, force_information: (..., 2 q) and (..., 2 q, 2 q).
        quadratic: (...) squared prediction error, in standard deviations; log_det: of its covariance, but for terms
            that do not depend on the force.
        gain: (..., 2 q, 2 q) covariance of the force after the stretch.
        towards: (..., 2 q) by which its mean moves.
        seen: (2 q, m) and (2 q, 2 q), the products of the data alone.
    """

    score: Array
    information: Array
    by_force: Array
    force_score: Array
    force_information: Array
    quadratic: Array
    log_det: Array
    gain: Array
    towards: Array
    seen: tuple[Array, Array]


def judged(products: Array, changes: int, known: Known) -> Judged:
    """A stretch with products (c, c) of `Stretches`, under one or several (...) states of knowledge."""
    m, q = changes, len(products) - changes - 1
    force = np.tile(np.arange(m, m + q), 2)
    XX, XF, Xe = products[:m, :m], products[:m, force], products[:m, -1]
    FF, Fe, ee = products[np.ix_(force, force)], products[force, -1], products[-1, -1]
    precision = np.linalg.inv(known.covariance)
    after = np.asarray(np.linalg.inv(precision + FF), dtype=float)
    missed = Fe - np.einsum("ij,...j->...i", FF, known.mean)
    towards = np.einsum("...ij,...j->...i", after, missed)
    own = np.einsum("ij,...j->...i", XF, known.mean)
    rest = np.eye(2 * q) - after @ FF  # what the stretch itself does not tell of the force
    error = ee - 2.0 * known.mean @ Fe + np.einsum("...i,ij,...j->...", known.mean, FF, known.mean)
    return Judged(
        score=Xe - own - np.einsum("ij,...j->...i", XF, towards),
        information=XX - XF @ after @ XF.T,
        by_force=XF @ rest,
        force_score=missed - np.einsum("ij,...j->...i", FF, towards),
        force_information=FF @ rest,
        quadratic=error - np.einsum("...i,...i->...", missed, towards),
        log_det=np.linalg.slogdet(precision + FF)[1] - np.linalg.slogdet(precision)[1],
        gain=after,
        towards=towards,
        seen=(XF.T, FF),
    )


def after_gap(known: Known, force: Force, gap_s: float) -> Known:
    """Later, without data."""
    keep = force.memory(gap_s)
    fresh = force.variance * (1.0 - keep**2)
    covariance = keep[..., :, None] * known.covariance * keep[..., None, :]
    return Known(mean=keep * known.mean, covariance=covariance + fresh[..., :, None] * np.eye(fresh.shape[-1]))


def after_stretch(known: Known, one: Judged) -> Known:
    """With what the stretch tells of the force."""
    return Known(mean=known.mean + one.towards, covariance=one.gain)


def likelihood(stretches: Stretches, force: Force) -> Array:
    """(...) twice the negative log-likelihood of stretches, but for a constant, under one or several forces."""
    known, total = Known.nothing(force), np.zeros(force.variance.shape[:-1])
    for index, products in enumerate(stretches.products):
        if index:
            known = after_gap(known, force, float(stretches.time_s[index] - stretches.time_s[index - 1]))
        one = judged(products, stretches.changes, known)
        total = total + one.quadratic + one.log_det
        known = after_stretch(known, one)
    return np.asarray(total)
