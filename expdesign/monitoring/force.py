"""The unmeasured force and the load from stretch to stretch, by a Kalman filter.

Every component of the force, of the current or of an acceleration, is the sum of two Gauss-Markov processes: one that
varies within minutes and one that varies within hours. Accelerations within minutes are those of gusts and waves,
which keep their direction when the ship turns: over all directions they are correlated by the cosine of the turn, and
beyond a quarter not at all. A wind is a third process, of hours: it keeps its direction on the earth, and pushes along
each axis of the ship as the cosine and the sine of her heading. The load is what a ship carries: changes of inertia
and hull that last from port to port. A change of the ship is taken for such a force or load in part.

Source: R. E. Kalman, Journal of Basic Engineering 82 (1960), 35-45; A. S. Willsky and H. L. Jones, IEEE Transactions on
Automatic Control 21 (1976), 108-112, for the sensitivity of a filter to a jump.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from expdesign.monitoring.evidence import Stretches
from expdesign.values import Array

NO_LOADS = np.array([], dtype=np.int64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Force:
    """Covariance of the unmeasured force over time, and of a load."""

    # (..., n) of the quick processes of currents and accelerations, then of the slow ones, then of winds; then zeros
    # for the load
    variance: Array
    time_s: Array  # (..., n) their correlation times [s]; infinite for the load
    turning: Array = field(default_factory=lambda: np.zeros(1))  # (n,) one for those that a turn changes

    def memory(self, gap_s: float, turn_rad: float = 0.0) -> Array:
        """(..., n) autocorrelation over a time and a turn; one that is not known (nan) is none."""
        kept = max(math.cos(turn_rad), 0.0) if math.isfinite(turn_rad) else 1.0
        return np.asarray(np.exp(-gap_s / self.time_s) * np.where(self.turning, kept, 1.0))

    def with_load(self, count: int) -> Force:
        """The force with so many components of a load, known to be zero."""
        variance, time_s = np.broadcast_arrays(self.variance, self.time_s)
        load = np.zeros((*variance.shape[:-1], count))
        return Force(
            variance=np.concatenate([variance, load], axis=-1),
            time_s=np.concatenate([time_s, load + np.inf], axis=-1),
            turning=np.append(np.broadcast_to(self.turning, variance.shape[-1:]), np.zeros(count)),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Known:
    """What is known of force and load at the beginning of a stretch: normal with this mean and covariance."""

    mean: Array  # (..., n)
    covariance: Array  # (..., n, n)

    @classmethod
    def nothing(cls, force: Force) -> Known:
        """What is known of the force before the first stretch."""
        covariance = force.variance[..., :, None] * np.eye(force.variance.shape[-1])
        return cls(mean=np.zeros(force.variance.shape), covariance=covariance)

    def repeated(self, count: int) -> Known:
        """The same so many times."""
        return Known(mean=np.tile(self.mean, (count, 1)), covariance=np.tile(self.covariance, (count, 1, 1)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Judged:
    """A stretch under what was known of the force before it."""

    score: Array  # (..., m) of every change, were the filter unaware of it until now
    information: Array  # (..., m, m)
    by_force: Array  # (..., m, n) inner products of the changes' sensitivities with the force's
    # force_score, force_information: (..., n) and (..., n, n)
    force_score: Array
    force_information: Array
    quadratic: Array  # (...) squared prediction error, in standard deviations
    # (..., n, n) whose determinant is that of the prediction error's covariance, but for a factor that does not depend
    # on the force
    grown: Array
    gain: Array  # (..., n, n) covariance of the force after the stretch
    towards: Array  # (..., n) by which its mean moves
    seen: tuple[Array, Array]  # (n, m) and (n, n), the products of the data alone

    @property
    def deviance(self) -> Array:
        """(...) twice the negative log-likelihood of the stretch without a change, but for a constant."""
        return np.asarray(self.quadratic + np.linalg.slogdet(self.grown)[1])


def judged(products: Array, changes: int, known: Known, loads: NDArray[np.int64] = NO_LOADS) -> Judged:
    """A stretch with products (c, c) of `Stretches`, under one or several (...) states of knowledge.

    The load is that of the changes with these numbers (l,), in their sizes.
    """
    m, force = changes, _columns(products, changes, known, loads)
    XX, XF, Xe = products[:m, :m], products[:m, force], products[:m, -1]
    FF, Fe, ee = products[np.ix_(force, force)], products[force, -1], products[-1, -1]
    grown = np.eye(len(force)) + known.covariance @ FF
    after = np.asarray(np.linalg.solve(grown, known.covariance), dtype=float)
    after = (after + np.swapaxes(after, -1, -2)) / 2.0
    missed = Fe - np.einsum("ij,...j->...i", FF, known.mean)
    towards = np.einsum("...ij,...j->...i", after, missed)
    own = np.einsum("ij,...j->...i", XF, known.mean)
    rest = np.eye(len(force)) - after @ FF  # what the stretch itself does not tell of the force
    error = ee - 2.0 * known.mean @ Fe + np.einsum("...i,ij,...j->...", known.mean, FF, known.mean)
    return Judged(
        score=Xe - own - np.einsum("ij,...j->...i", XF, towards),
        information=XX - XF @ after @ XF.T,
        by_force=XF @ rest,
        force_score=missed - np.einsum("ij,...j->...i", FF, towards),
        force_information=FF @ rest,
        quadratic=error - np.einsum("...i,...i->...", missed, towards),
        grown=grown,
        gain=after,
        towards=towards,
        seen=(XF.T, FF),
    )


def _columns(products: Array, changes: int, known: Known, loads: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) columns of the products by which force and load act: those that are not of winds, twice."""
    q = len(products) - 1 - changes
    winds = 2 * q + len(loads) - known.mean.shape[-1]
    once = np.arange(changes, changes + winds)
    both = np.arange(changes + winds, changes + q)
    return np.concatenate([both, both, once, loads])


def beside(one: Judged, taken: Array) -> tuple[Array, Array, Array]:
    """Score (..., m) and information (..., m, m) of changes that were there before a stretch, and what is taken after.

    Args:
        taken: (..., n, m) what the filter has taken of each change for the force and the load before it.

    Source: P. de Jong, Annals of Statistics 19 (1991), 1073-1083, for a regression beside a filter.
    """
    turned = np.swapaxes(taken, -1, -2)
    score = one.score - np.einsum("...nm,...n->...m", taken, one.force_score)
    cross = one.by_force @ taken
    information = one.information - cross - np.swapaxes(cross, -1, -2) + turned @ one.force_information @ taken
    return score, information, taken + one.gain @ (one.seen[0] - one.seen[1] @ taken)


def surprise(products: Array, changes: int, known: Known, loads: NDArray[np.int64] = NO_LOADS) -> Array:
    """(q,) squared errors of the prediction of a stretch's force, in standard deviations: one on average.

    Args:
        products: (c, c) of the stretch.
        changes: m, as for `judged`; loads: too.
        known: before the stretch.
    """
    own, columns = slice(changes, len(products) - 1), _columns(products, changes, known, loads)
    across = products[own, columns]
    missed = products[own, -1] - across @ known.mean
    variance = np.diag(products[own, own]) + np.einsum("qi,ij,qj->q", across, known.covariance, across)
    return np.asarray(missed**2 / np.maximum(variance, 1e-300))


def after_gap(known: Known, force: Force, gap_s: float, turn_rad: float = 0.0) -> Known:
    """Later and after a turn, without data."""
    keep = force.memory(gap_s, turn_rad)
    fresh = force.variance * (1.0 - keep**2)
    covariance = keep[..., :, None] * known.covariance * keep[..., None, :]
    return Known(mean=keep * known.mean, covariance=covariance + fresh[..., :, None] * np.eye(fresh.shape[-1]))


def after_stretch(known: Known, one: Judged) -> Known:
    """The force's estimate, updated with a stretch."""
    return Known(mean=known.mean + one.towards, covariance=one.gain)


def likelihood(stretches: Stretches, force: Force) -> Array:
    """(...) twice the negative log-likelihood of stretches, but for a constant, under one or several forces.

    How the ship differs from her model is unknown, normal with one size of each change, and lasts throughout: fitted
    beforehand, it takes what a slow force does, and the force seems weaker than it is.

    Source: D. A. Harville, Journal of the American Statistical Association 72 (1977), 320-338.
    """
    known, total = Known.nothing(force), np.zeros(force.variance.shape[:-1])
    *batch, n = force.variance.shape
    m = stretches.changes
    taken, score, information = np.zeros((*batch, n, m)), np.zeros((*batch, m)), np.tile(np.eye(m), (*batch, 1, 1))
    for index, products in enumerate(stretches.products):
        if index:
            gap = stretches.since(index)
            known, taken = after_gap(known, force, *gap), force.memory(*gap)[..., None] * taken
        one = judged(products, m, known)
        more, told, taken = beside(one, taken)
        score, information, total = score + more, information + told, total + one.deviance
        known = after_stretch(known, one)
    explained = np.einsum("...m,...m->...", score, np.linalg.solve(information, score[..., None])[..., 0])
    return np.asarray(total - explained + np.linalg.slogdet(information)[1])
