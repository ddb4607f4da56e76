"""A criterion over time fractions: one measure, or the average or the least over several models of the ship."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.durations.criteria.measures import Measure, SmoothMeasure
from expdesign.durations.tuning import TUNING
from expdesign.errors import NotInformative
from expdesign.values import Array

NEARLY_SINGULAR = 1e-10  # below this, elimination loses digits that matter
OUTSIDE_RANGE = 1e-6  # share of an estimated combination that may lie outside the range of a singular matrix


Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Tangent:
    """A linear upper bound of a concave function: value + slope (v - w)."""

    value: float  # at the fractions w where it is tangent
    slope: Array  # (q,)


@dataclass(frozen=True, eq=False)
class Piece:
    """The measure of one model: of B0 + sum_q w_q B_q."""

    matrices: Array  # (q, d, d) B_q, whitened
    prior: Array  # (d, d) B0, in the same coordinates
    measure: Measure  # in the same coordinates
    transformation: Array  # (d, d) T of the whitening, T B T^T

    @staticmethod
    def of(matrices: Array, prior: Array, measure: Measure, *, within: Array | None = None) -> Piece:
        """Whitened so that equal shares, or those given, have the identity; a congruence changes no design or value.

        Raises:
            NotInformative: the sum is singular to working precision.
        """
        T = whitening(matrices, prior, within)
        return Piece(congruent(T, matrices), congruent(T, prior), measure.transformed(T), T)

    def matrix(self, w: Array) -> Array:
        """(d, d) B at fractions (q,)."""
        used = np.flatnonzero(w)
        if 2 * len(used) < len(w):  # reading all matrices takes longer than adding up a few
            return np.asarray(self.prior + np.tensordot(w[used], self.matrices[used], axes=1))
        return np.asarray(self.prior + np.tensordot(w, self.matrices, axes=1))

    def value(self, w: Array) -> float:
        """The measure; -inf where its combinations are not estimable."""
        return float(stacked_values(self.measure, self.matrix(w)[None])[0])

    def tangent(self, w: Array, multiplier: Array | None = None) -> Tangent:
        """An upper bound in all fractions.

        Args:
            w: (q,) where its value is taken.
            multiplier: (d, d) any positive semidefinite matrix; the gradient at w when not given.

        Raises:
            numpy.linalg.LinAlgError: no multiplier is given and B(w) is singular.
        """
        M = self.matrix(w)
        G = self.measure.gradient(M) if multiplier is None else multiplier
        slope = self.matrices.reshape(len(self.matrices), -1) @ G.ravel()
        return Tangent(float(np.sum(G * M)) - self.measure.conjugate(G), slope)

    def curvature(self, w: Array, chosen: Indices) -> Array:
        """(c, c) minus the Hessian in the chosen fractions."""
        assert isinstance(self.measure, SmoothMeasure)
        return self.measure.curvature(self.matrix(w), self.matrices[chosen])


@dataclass(frozen=True, eq=False)
class Objective:
    """The average, or the least, of the pieces less their levels."""

    pieces: tuple[Piece, ...]  # one for each model
    levels: Array  # (m,) subtracted from each piece
    worst: bool = False  # the least instead of the average

    @property
    def degree(self) -> int:
        """Value of twice the information is higher by degree x log 2."""
        return self.pieces[0].measure.degree

    @property
    def dimension(self) -> int:
        """Size d of the information matrices."""
        return len(self.pieces[0].prior)

    def among(self, chosen: Indices) -> Objective:
        """The objective as a function of some of the fractions (c,)."""
        return replace(self, pieces=tuple(replace(item, matrices=item.matrices[chosen]) for item in self.pieces))

    def value(self, w: Array) -> float:
        """The objective at fractions (q,)."""
        values = np.array([piece.value(w) for piece in self.pieces]) - self.levels
        return float(values.min() if self.worst else values.mean())


def stacked_values(measure: Measure, M: Array) -> Array:
    """(c,) values of (c, d, d), also of singular ones.

    Combinations are estimable from a singular M when they lie in the range of M (F. Pukelsheim, Optimal Design of
    Experiments (2006), 3.3); else the value is -inf.
    """
    eigenvalues = np.linalg.eigvalsh(M)
    regular = eigenvalues[:, 0] > TUNING.singular * eigenvalues[:, -1]
    values = np.full(len(M), -np.inf)
    if regular.any():
        values[regular] = measure.values(M[regular])
    if measure.L.shape[1] < M.shape[1]:
        doubtful = eigenvalues[:, 0] < NEARLY_SINGULAR * eigenvalues[:, -1]
        values[doubtful] = [_value_within(measure, item) for item in M[doubtful]]
    return values


def _value_within(measure: Measure, M: Array) -> float:
    """The value of a nearly singular matrix, in the coordinates of its range."""
    eigenvalues, vectors = np.linalg.eigh(M)
    seen = vectors[:, eigenvalues > TUNING.singular * max(eigenvalues[-1], 0.0)]
    missing = measure.L - seen @ (seen.T @ measure.L)
    if not seen.size or (np.linalg.norm(missing, axis=0) > OUTSIDE_RANGE * np.linalg.norm(measure.L, axis=0)).any():
        return -np.inf
    return float(measure.transformed(seen.T).values(np.diag(eigenvalues[-seen.shape[1] :])))


def congruent(T: Array, matrices: Array) -> Array:
    """T B T^T of (..., d, d), symmetric to the last bit."""
    moved = T @ matrices @ T.T
    return np.asarray((moved + np.swapaxes(moved, -1, -2)) / 2)


def whitening(matrices: Array, prior: Array, shares: Array | None = None) -> Array:
    """(d, d) T that takes the prior plus the shares of (q, d, d) to the identity, in two steps for accuracy.

    Raises:
        NotInformative: that sum is singular to working precision.
    """
    mean = prior + (matrices.mean(axis=0) if shares is None else np.tensordot(shares, matrices, axes=1))
    size = np.sqrt(np.clip(np.diag(mean), 0.0, None))
    size = np.where(size > 0, size, 1.0)
    try:
        return np.linalg.inv(np.linalg.cholesky(mean / np.outer(size, size))) / size
    except np.linalg.LinAlgError:
        raise NotInformative(
            "the primitives together do not inform about every parameter, to working precision"
        ) from None


def pieces_of(
    stacks: Iterable[Array], prior: Array, measure: Measure, *, within: Array | None = None
) -> tuple[Piece, ...]:
    """One measure and prior with matrices (q, d, d) of several models."""
    return tuple(Piece.of(B, prior, measure, within=within) for B in stacks)
