"""The unmeasured force and the load from stretch to stretch, by a Kalman filter.

Every component of the force, of the current or of an acceleration, is the sum of two Gauss-Markov processes: one that
varies within minutes and one that varies within hours. Accelerations are those of wind and waves, which keep their
direction when the ship turns: over all directions they are correlated by the cosine of the turn, and beyond a quarter
not at all. The load is what a ship carries: changes of inertia and hull
that last from port to port. A change of the ship is taken for such a force or load in part.

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

    variance: Array  # (..., 2 q) of the quick processes, then of the slow ones; then (..., l) zeros for the load
    time_s: Array  # (..., 2 q + l) their correlation times [s]; infinite for the load
    turning: Array = field(default_factory=lambda: np.zeros(1))  # (2 q + l,) one for those that a turn changes

    def memory(self, gap_s: float, turn_rad: float = 0.0) -> Array:
        """(..., 2 q + l) autocorrelation over a time and a turn; one that is not known (nan) is none."""
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

    mean: Array  # (..., n), n = 2 q + l
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
    m = changes
    force = np.concatenate([np.tile(np.arange(m, len(products) - 1), 2), loads])
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


def surprise(products: Array, changes: int, known: Known, loads: NDArray[np.int64] = NO_LOADS) -> Array:
    """(q,) squared errors of the prediction of a stretch's force, in standard deviations: one on average.

    Args:
        products: (c, c) of the stretch.
        changes: m, as for `judged`; loads: too.
        known: before the stretch.
    """
    own = slice(changes, len(products) - 1)
    columns = np.concatenate([np.tile(np.arange(changes, len(products) - 1), 2), loads])
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
    changes = np.arange(stretches.changes)
    force = force.with_load(len(changes))
    known, total = Known.nothing(force), np.zeros(force.variance.shape[:-1])
    known.covariance[..., -len(changes) + changes, -len(changes) + changes] = 1.0
    for index, products in enumerate(stretches.products):
        if index:
            known = after_gap(known, force, *stretches.since(index))
        one = judged(products, len(changes), known, changes)
        total = total + one.deviance
        known = after_stretch(known, one)
    return np.asarray(total)
