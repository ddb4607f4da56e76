"""What is maximised over time fractions: one measure, or the average or the least over several models of the ship.

Every objective gives, at any fractions, a tangent that lies above it everywhere; from it the certificate is made. For
the least of several, the tangent is a mixture of theirs.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from expdesign.durations.criteria.measures import Local, Measure
from expdesign.errors import NotInformative
from expdesign.values import Array

Indices = NDArray[np.intp]
SINGULAR = 1e-13
"""Eigenvalues below this, relative to the largest, are rounding."""
SHAKY = 1e-10
"""Below this, rounding shows in what is computed from a matrix by elimination."""
ESTIMABLE = 1e-6
"""What is to be estimated may reach out of a singular matrix's range by this share of itself."""


@dataclass(frozen=True, eq=False)
class Tangent:
    """A function that is nowhere below the objective: value + slope (v - w).

    Attributes:
        value: at the fractions w where it was made.
        slope: (q,).
        mixture: (m,) weights of the models, sum 1.
    """

    value: float
    slope: Array
    mixture: Array


@dataclass(frozen=True, eq=False)
class Piece:
    """One measure of B0 + sum_q w_q B_q.

    Attributes:
        matrices: (q, d, d) B_q, whitened.
        prior: (d, d) B0, in the same coordinates.
        measure: in the same coordinates.
        transformation: (d, d) T of the whitening, T B T^T.
    """

    matrices: Array
    prior: Array
    measure: Measure
    transformation: Array

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
        """The measure itself, -inf where B is singular."""
        return float(stacked_values(self.measure, self.matrix(w)[None])[0])

    def smooth(self, w: Array, blur: float) -> float:
        """The measure with rounded corners."""
        try:
            M = self.matrix(w)
            np.linalg.cholesky(M)
            return self.measure.smooth(M, blur)
        except np.linalg.LinAlgError:
            return -np.inf

    def local(self, w: Array, chosen: Indices, blur: float) -> Local:
        """Second-order picture in the chosen fractions."""
        return self.measure.local(self.matrix(w), self.matrices[chosen], blur)

    def tangent(self, w: Array, blur: float) -> Tangent:
        """First-order bound in all fractions."""
        value, G = self.measure.tangent(self.matrix(w), blur)
        slope = self.matrices.reshape(len(self.matrices), -1) @ G.ravel()
        return Tangent(value, slope, np.ones(1))


@dataclass(frozen=True, eq=False)
class Objective:
    """The average, or the least, of the pieces less their levels.

    Attributes:
        pieces: one for each model.
        levels: (m,) what each piece is compared with.
        worst: the least instead of the average.
    """

    pieces: tuple[Piece, ...]
    levels: Array
    worst: bool = False

    def value(self, w: Array) -> float:
        """The objective itself."""
        values = np.array([piece.value(w) for piece in self.pieces]) - self.levels
        return float(values.min() if self.worst else values.mean())

    def smooth(self, w: Array, blur: float) -> float:
        """With corners rounded off: the least of f_m is max over t of t + blur sum log(f_m - t)."""
        values = np.array([piece.smooth(w, blur) for piece in self.pieces]) - self.levels
        if not self.worst or len(values) == 1:
            return float(values.mean())
        if not np.isfinite(values).all():
            return -np.inf
        t, _ = _soft_least(values, blur)
        return float(t + blur * np.log(values - t).sum())

    def local(self, w: Array, chosen: Indices, blur: float) -> Local:
        """Second-order picture of `smooth` in the chosen fractions."""
        parts = [piece.local(w, chosen, blur) for piece in self.pieces]
        if len(parts) == 1:
            return Local(parts[0].value - float(self.levels[0]), parts[0].slope, parts[0].curvature)
        values, slopes = np.array([part.value for part in parts]) - self.levels, np.array([p.slope for p in parts])
        weights, extra = np.full(len(parts), 1.0 / len(parts)), np.zeros((len(chosen),) * 2)
        value = float(values.mean())
        if self.worst:
            t, weights = _soft_least(values, blur)
            value = float(t + blur * np.log(values - t).sum())
            squares = weights**2 / blur
            mean = squares @ slopes / squares.sum()
            centred = slopes - mean
            extra = centred.T @ (squares[:, None] * centred)
        curvature = sum((x * part.curvature for x, part in zip(weights, parts, strict=True)), extra)
        return Local(value, weights @ slopes, curvature)

    def tangent(self, w: Array, blur: float) -> Tangent:
        """A bound on the objective in all fractions."""
        parts = [piece.tangent(w, blur) for piece in self.pieces]
        weights = np.full(len(parts), 1.0 / len(parts))
        if self.worst and len(parts) > 1:
            smooth = np.array([piece.smooth(w, blur) for piece in self.pieces]) - self.levels
            _, weights = _soft_least(smooth, blur)
        value = sum(x * (part.value - level) for x, part, level in zip(weights, parts, self.levels, strict=True))
        return Tangent(float(value), weights @ np.array([part.slope for part in parts]), weights)


def _soft_least(values: Array, blur: float) -> tuple[float, Array]:
    """The t with blur sum 1 / (f_m - t) = 1, below all values, and the weights blur / (f_m - t)."""
    least, count = float(values.min()), len(values)
    above = values - least
    gap = float(
        brentq(lambda z: blur * np.sum(1.0 / (above + z)) - 1.0, 0.999 * blur, 1.001 * blur * count, xtol=1e-300)
    )
    weights = blur / (above + gap)
    return least - gap, weights / weights.sum()


def stacked_values(measure: Measure, M: Array) -> Array:
    """(c,) values of (c, d, d); where one is singular to working precision, that of what it still estimates.

    What a measure picks out can be estimated from a singular M when it lies in the range of M (F. Pukelsheim, Optimal
    Design of Experiments (2006), 3.3); else the value is -inf.
    """
    eigenvalues = np.linalg.eigvalsh(M)
    regular = eigenvalues[:, 0] > SINGULAR * eigenvalues[:, -1]
    values = np.full(len(M), -np.inf)
    if regular.any():
        values[regular] = measure.values(M[regular])
    if measure.L.shape[1] < M.shape[1]:
        shaky = eigenvalues[:, 0] < SHAKY * eigenvalues[:, -1]
        values[shaky] = [_value_within(measure, item) for item in M[shaky]]
    return values


def _value_within(measure: Measure, M: Array) -> float:
    """The value of a matrix that is nearly singular, in coordinates where rounding in its null space is harmless."""
    eigenvalues, vectors = np.linalg.eigh(M)
    seen = vectors[:, eigenvalues > SINGULAR * max(eigenvalues[-1], 0.0)]
    missing = measure.L - seen @ (seen.T @ measure.L)
    if not seen.size or (np.linalg.norm(missing, axis=0) > ESTIMABLE * np.linalg.norm(measure.L, axis=0)).any():
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
            "all primitives together do not inform about every parameter, to working precision"
        ) from None


def pieces_of(
    stacks: Iterable[Array], priors: Sequence[Array], measures: Sequence[Measure], *, within: Array | None = None
) -> tuple[Piece, ...]:
    """Pieces of several models."""
    return tuple(
        Piece.of(B, B0, measure, within=within) for B, B0, measure in zip(stacks, priors, measures, strict=True)
    )
