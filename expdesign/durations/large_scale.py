"""D-optimal fractions of very many candidates: Newton's method on a working set, and passes over all candidates.

    maximise log det (B_prior + sum_q w_q R_q^T R_q)    over w >= 0, sum w = 1

A candidate is its r regressor rows R_q, (r, d), never a dense matrix. The fractions of a working set are found by
Newton's method for log det + mu sum log w_q with a falling mu. One pass over all candidates then gives every
sensitivity d_q = trace(M^-1 B_q). Candidates with d_q above the dimension join the working set until none is left. By
the equivalence theorem no other design has a log det higher by more than max d_q - sum w_q d_q.

Source: J. Kiefer and J. Wolfowitz, The equivalence of two extremum problems, Canad. J. Math. 12 (1960), 363-366;
S. Boyd and L. Vandenberghe, Convex Optimization (2004), 11.3 (barrier method); working set: C. L. Atwood, Sequences
converging to D-optimal designs of experiments, Ann. Statist. 1 (1973), 342-352.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.durations.criteria import whitening
from expdesign.durations.measures import ONE_THREAD, gram, root
from expdesign.values import Array, sealed

SMALLEST_SET = 50  # least size of a working set, and about as many as may join it at a time
SET_PER_DIMENSION = 4  # the same per dimension of the information matrix
FIRST_GAP = 1e-2  # to which the first working set is solved
SHARPER = 1e-2  # ratio of the gaps of successive working sets
CENTRING_STEPS = 60  # most Newton steps for one barrier weight
MOST_SETS = 60  # working sets
BARRIER_FRACTION = 1e-7  # fractions below this are removed from the solution of the barrier method
INDEFINITE = 1e-9  # eigenvalues below minus this are not rounding
REGULAR_SET = 1e-8  # least eigenvalue of a first working set
Indices = NDArray[np.intp]


@sealed(fractions="q")
class LargeDesign:
    """A D-optimal approximate design."""

    fractions: Array  # (q,) of the candidates, sum 1
    gap: float  # upper bound on the log det of any design less that of this one
    dimension: int  # d

    @property
    def gap_relative(self) -> float:
        """The gap over the dimension."""
        return self.gap / self.dimension


def rows_of(matrices: Array) -> Array | None:
    """(q, r, d) rows R_q with R_q^T R_q = B_q of (q, d, d), or None where one is not positive semidefinite."""
    values, vectors = np.linalg.eigh(matrices)
    if (values[:, 0] < -INDEFINITE * np.maximum(values[:, -1], 0.0)).any():
        return None
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, :, None] * np.swapaxes(vectors, 1, 2))


def d_optimal(rows: Array, *, prior: Array | None = None, tolerance: float = 1e-7) -> LargeDesign:
    """The D-optimal fractions of candidates.

    Args:
        rows: (q, r, d) regressor rows of each candidate; (q, d) for one row each.
        prior: (d, d) prior information; none when not given.
        tolerance: desired gap per dimension; rounding may leave a larger one.

    Raises:
        NotInformative: the information of all candidates together is singular to working precision.
    """
    pool = _Pool.of(rows[:, None, :] if rows.ndim == 2 else rows, prior)
    chosen = _first_set(pool)
    w, aim = np.full(len(chosen), 1.0 / len(chosen)), max(FIRST_GAP, tolerance)
    best = _evaluated(pool, chosen, w)
    for _ in range(MOST_SETS):
        w = _solved(pool, chosen, w, aim)
        found = _evaluated(pool, chosen, w)
        best = min(best, found, key=lambda item: item[0].gap)
        _, sensitivities = found
        least = (1 + aim) * pool.dimension
        joining = np.setdiff1d(np.flatnonzero(sensitivities > least), chosen)
        if not len(joining) and aim <= tolerance:
            break
        if len(joining):
            joining = joining[np.argsort(-sensitivities[joining], kind="stable")[: set_size(pool.dimension)]]
            kept = (sensitivities[chosen] > (1 - max(10 * aim, 1e-3)) * pool.dimension) | (w > BARRIER_FRACTION)
            chosen, w = np.r_[chosen[kept], joining], np.r_[w[kept], np.zeros(len(joining))]
        aim = max(SHARPER * aim, tolerance)
    return _trimmed(pool, best[0], tolerance)


@dataclass(frozen=True, eq=False)
class _Pool:
    """All candidates."""

    rows: Array  # (q, r, d)
    T: Array  # (d, d) whitening: equal fractions have the information T^-1 T^-T
    prior: Array  # (d, d) whitened

    @staticmethod
    def of(rows: Array, prior: Array | None) -> _Pool:
        count, d = len(rows), rows.shape[2]
        flat = rows.reshape(-1, d)
        known = np.zeros((d, d)) if prior is None else prior
        total = sum((some.T @ np.copy(some) for some in _chunks(flat)), np.zeros((d, d)))
        T = whitening(total[None] / count, known)
        return _Pool(rows, T, T @ known @ T.T)

    @property
    def dimension(self) -> int:
        """Size d of the information matrix."""
        return int(self.rows.shape[2])

    def parts(self, chosen: Indices) -> Array:
        """(c, d, d) whitened matrices of some candidates."""
        white = self.rows[chosen] @ self.T.T
        return np.asarray(np.swapaxes(white, 1, 2) @ white)

    def sensitivities(self, M: Array) -> Array:
        """(q,) trace(M^-1 B_q) of every candidate for a whitened M (d, d)."""
        count, r, d = self.rows.shape
        flat, A = self.rows.reshape(-1, d), (root(M) @ self.T).T
        squares = [np.einsum("ij,ij->i", white, white) for white in (some @ A for some in _chunks(flat))]
        return np.asarray(np.concatenate(squares).reshape(count, r).sum(axis=1))


def _chunks(flat: Array) -> Iterator[Array]:
    """Rows of (c, d), so many at a time that their product with (d, d) takes one thread and stays in the cache."""
    length = max(1, ONE_THREAD // flat.shape[1] ** 2)
    return (flat[first : first + length] for first in range(0, len(flat), length))


def set_size(dimension: int) -> int:
    """Of a first working set, and the most that join it at a time."""
    return max(SMALLEST_SET, SET_PER_DIMENSION * dimension)


def _first_set(pool: _Pool) -> Indices:
    """Candidates of largest sensitivity at equal fractions, completed until their information is regular."""
    count, d = len(pool.rows), pool.dimension
    size = set_size(d)
    if count <= 2 * size:
        return np.arange(count)
    leverage = pool.sensitivities(np.eye(d))
    chosen = np.argpartition(-leverage, size)[:size]
    for _ in range(d):
        values, vectors = np.linalg.eigh(pool.prior + pool.parts(chosen).mean(axis=0))
        if values[0] > REGULAR_SET * values[-1]:
            return np.sort(chosen)
        dark = vectors[:, values <= REGULAR_SET * values[-1]]
        within = pool.sensitivities(np.eye(d) + 1e12 * (np.eye(d) - dark @ dark.T))
        chosen = np.union1d(chosen, np.argsort(-within, kind="stable")[:d])
    return np.arange(count)


def _evaluated(pool: _Pool, chosen: Indices, w: Array) -> tuple[LargeDesign, Array]:
    """The design that gives fractions (c,) to the chosen candidates, and all sensitivities (q,) there."""
    fractions = np.zeros(len(pool.rows))
    fractions[chosen] = w
    sensitivities = pool.sensitivities(pool.prior + np.tensordot(w, pool.parts(chosen), axes=1))
    gap = max(float(sensitivities.max() - w @ sensitivities[chosen]), 0.0)
    return LargeDesign(fractions=fractions, gap=gap, dimension=pool.dimension), sensitivities


def _solved(pool: _Pool, chosen: Indices, w: Array, tolerance: float) -> Array:
    """The best fractions (c,) of the chosen candidates, to a gap of `tolerance` per dimension."""
    parts, count = pool.parts(chosen), len(chosen)
    if count == 1:
        return np.ones(1)
    w = 0.5 * w / w.sum() + 0.5 / count
    barrier = pool.dimension / count
    while count * barrier > tolerance / 2 * pool.dimension:
        barrier /= 10
        w = _centred(pool, parts, w, barrier)
    return w


def _centred(pool: _Pool, parts: Array, w: Array, barrier: float) -> Array:
    """The maximum (c,) of log det + barrier sum log w by Newton's method in relative steps of w.

    The function is self-concordant: where the decrement is small against the barrier, full steps are safe. Farther away
    the step is halved until the merit rises.
    """
    for _ in range(CENTRING_STEPS):
        T = root(pool.prior + np.tensordot(w, parts, axes=1))
        white = T @ parts @ T.T
        slope = w * np.trace(white, axis1=1, axis2=2) + barrier
        curvature = w[:, None] * gram(white) * w + barrier * np.eye(len(w))
        free, price = scipy.linalg.cho_solve(scipy.linalg.cho_factor(curvature), np.stack([slope, w], axis=1)).T
        relative = free - (w @ free) / (w @ price) * price
        decrement = float(relative @ curvature @ relative)
        length = min(1.0, 0.99 / max(float(-relative.min()), 1e-300))
        if decrement > 0.05 * barrier:
            value = _merit(pool, parts, w, barrier)
            while not _merit(pool, parts, w * (1 + length * relative), barrier) >= value + 0.1 * length * decrement:
                length /= 2
                if length < 1e-10:
                    return w
        w = w * (1 + length * relative)
        w = w / w.sum()
        if decrement < 1e-6 * barrier:
            break
    return w


def _merit(pool: _Pool, parts: Array, w: Array, barrier: float) -> float:
    sign, value = np.linalg.slogdet(pool.prior + np.tensordot(w, parts, axes=1))
    return float(value + barrier * np.log(w).sum()) if sign > 0 and w.min() > 0 else -np.inf


def _trimmed(pool: _Pool, design: LargeDesign, tolerance: float) -> LargeDesign:
    """The design without the fractions that only the barrier keeps above zero, unless that widens the gap."""
    kept = np.flatnonzero(design.fractions > BARRIER_FRACTION)
    w = design.fractions[kept] / design.fractions[kept].sum()
    try:
        if len(kept) > 1:
            w = _centred(pool, pool.parts(kept), w, tolerance * pool.dimension / (10 * len(kept)))
        trimmed, _ = _evaluated(pool, kept, w)
    except np.linalg.LinAlgError:
        return design
    return trimmed if trimmed.gap <= max(design.gap, tolerance * pool.dimension) else design
