"""Optimality criteria of time fractions: a measure of one model's information, its average, or the least over models.

A new criterion is one entry of `CRITERIA`. A new measure is also a class like `LogDet` and one expression in the convex
solver.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.durations.measures import LogDet, LogSmallest, LogTrace, Measure, SmoothMeasure
from expdesign.errors import InputError, NotInformative, UnknownName
from expdesign.values import Array, sealed

SINGULAR = 1e-13  # eigenvalues below this are rounding


@sealed(unit="a", noise="b", gradients="o g")
class Aim:
    """A criterion with its settings.

    The noise of an equation is the standard deviation of its one-step residual; M / noise^2 is information in the units
    of the parameters. D and D_s do not depend on it, because each parameter stands in one equation. A, E and V compare
    parameters of different equations and need it.
    """

    criterion: str = "D"  # name in `CRITERIA`
    interest: tuple[str, ...] = ()  # parameters of interest, without those of disturbances; empty for all
    # (p,) unit of the error of each parameter in A and E, e.g. |theta|; empty when not stated, zero where unknown.
    unit: Array = field(default_factory=lambda: np.zeros(0))
    # (p,) residual noise of each parameter's equation; empty when not stated, zero where unknown
    noise: Array = field(default_factory=lambda: np.zeros(0))
    outcomes: tuple[str, ...] = ()  # names of the predicted outcomes
    # (o, p) derivative of each outcome by the parameters, in the outcome's unit of error
    gradients: Array = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True, kw_only=True)
class Picked:
    """The arguments of a criterion."""

    aim: Aim  # the criterion's settings
    parameters: tuple[str, ...]  # p names
    dimension: int  # d, size of the information matrix: parameters, then means

    def columns(self, names: tuple[str, ...]) -> Array:
        """(d, k) unit columns of named parameters.

        Raises:
            UnknownName: no such parameter.
        """
        for name in names:
            if name not in self.parameters:
                raise UnknownName("parameter of interest", name, known=self.parameters)
        return np.eye(self.dimension)[:, [self.parameters.index(name) for name in names]]

    @property
    def interest(self) -> tuple[str, ...]:
        """Names of the parameters of interest."""
        return self.aim.interest or self.parameters

    def scaled_columns(self, criterion: str) -> Array:
        """(d, k) columns of the parameters of interest, each times its noise over its unit of error.

        Raises:
            InputError: a unit or a noise is not stated.
        """
        unit = self._stated(self.aim.unit, criterion, "a unit other than zero", self.interest)
        noise = self.noise(criterion, self.interest)
        return self.columns(self.interest) * (noise / unit)

    def noise(self, criterion: str, names: tuple[str, ...]) -> Array:
        """(k,) residual noise of the equations of named parameters.

        Raises:
            InputError: it is not stated.
        """
        return self._stated(self.aim.noise, criterion, "the sensors' noise in its equation", names)

    def _stated(self, values: Array, criterion: str, what: str, names: tuple[str, ...]) -> Array:
        known: Mapping[str, float] = dict(zip(self.parameters, values.tolist(), strict=False))
        missing = [name for name in names if not known.get(name, 0.0) > 0.0]
        if missing:
            raise InputError(f"criterion {criterion} needs {what} for {', '.join(missing)}")
        return np.array([known[name] for name in names])


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """A design criterion."""

    name: str  # as in scenario files
    title: str  # the quantity that it minimises
    measure: Callable[[Picked], Measure]  # of the information matrix; raises InputError when the aim lacks a setting


def of_other_parameters(picked: Picked) -> Measure:
    """Criterion T has no measure of the model's parameters: see `concave.least_of_floors`.

    Raises:
        InputError: always.
    """
    raise InputError("criterion T needs causes in design.reveal or design.tell_apart")


def prediction_columns(picked: Picked) -> Array:
    """(d, o) derivatives of the outcomes by the parameters, times the residual noise of their equations.

    Raises:
        InputError: the outcomes are not stated, or no estimated parameter affects them.
    """
    aim, p = picked.aim, len(picked.parameters)
    if not aim.gradients.size:
        raise InputError("criterion V needs outcomes to predict")
    if aim.gradients.shape[1] != p:
        raise InputError(f"gradients of outcomes have {aim.gradients.shape[1]} columns for {p} parameters")
    moved = tuple(name for name, column in zip(picked.parameters, aim.gradients.T, strict=True) if column.any())
    if not moved:
        raise InputError(f"no estimated parameter affects {', '.join(aim.outcomes)}")
    L = np.zeros((picked.dimension, len(aim.gradients)))
    index = [picked.parameters.index(name) for name in moved]
    L[index] = (aim.gradients[:, index] * picked.noise("V", moved)).T
    return L


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
    regular = eigenvalues[:, 0] > SINGULAR * eigenvalues[:, -1]
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
    seen = vectors[:, eigenvalues > SINGULAR * max(eigenvalues[-1], 0.0)]
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


CRITERIA = (
    # D includes the means: their part of the determinant is constant when fractions sum to one.
    Criterion(
        name="D",
        title="volume of the confidence region of all parameters",
        measure=lambda picked: LogDet(np.eye(picked.dimension)),
    ),
    Criterion(
        name="D_s",
        title="volume of the confidence region of the parameters of interest",
        measure=lambda picked: LogDet(picked.columns(picked.interest)),
    ),
    Criterion(
        name="A",
        title="mean square relative error of the parameters",
        measure=lambda picked: LogTrace(picked.scaled_columns("A")),
    ),
    Criterion(
        name="E",
        title="worst relative error of any combination of parameters",
        measure=lambda picked: LogSmallest(picked.scaled_columns("E")),
    ),
    Criterion(
        name="V",
        title="mean square error of the predicted outcomes",
        measure=lambda picked: LogTrace(prediction_columns(picked)),
    ),
    Criterion(
        name="T",
        title="worst shortfall of what reveals, or tells apart, the causes asked for",
        measure=of_other_parameters,
    ),
)


def criterion(name: str) -> Criterion:
    """A criterion by name.

    Raises:
        UnknownName: there is none.
    """
    for candidate in CRITERIA:
        if candidate.name == name:
            return candidate
    raise UnknownName("criterion", name, known=[candidate.name for candidate in CRITERIA])
