"""Concave measures of an information matrix: functions of the covariance V = L^T M^-1 L of parameter combinations.

M is (d, d), L is (d, k). Every value is the logarithm of a positively homogeneous, concave function of M, so that a
gain of 0.01 per degree is one per cent of information. A function concave in M is concave in time fractions.

Each measure f has a concave conjugate f*(G) = inf over M of trace(G M) - f(M). It turns any positive semidefinite G
into an upper bound, f(M) <= trace(G M) - f*(G) for every M; with G the gradient of f the bound touches f.

Source: F. Pukelsheim, Optimal Design of Experiments (2006), chapters 3, 6 and 7 (information functions, polars,
subgradients).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol, Self, runtime_checkable

import numpy as np

from expdesign.values import Array, seal

ONE_THREAD = 260_000  # multiplications in a matrix product up to which OpenBLAS uses one thread


class Measure(Protocol):
    """A concave measure of an information matrix.

    Attributes:
        L: (d, k) parameter combinations in its columns.
        degree: homogeneity of exp(value): doubling the information raises the value by `degree` x log 2.
    """

    @property
    def L(self) -> Array: ...  # noqa: D102, N802

    @property
    def degree(self) -> int: ...  # noqa: D102

    def values(self, M: Array) -> Array:
        """(...) values of positive definite matrices (..., d, d)."""
        ...

    def gradient(self, M: Array) -> Array:
        """(d, d) a supergradient G at M; trace(G M) is `degree`."""
        ...

    def conjugate(self, G: Array) -> float:
        """f*(G) of a positive semidefinite G; -inf where G gives no bound."""
        ...

    def transformed(self, T: Array) -> Measure:
        """The measure for matrices T M T^T."""
        ...


@runtime_checkable
class SmoothMeasure(Measure, Protocol):
    """A measure with second derivatives."""

    def curvature(self, M: Array, parts: Array) -> Array:
        """(c, c) minus the Hessian in the weights of parts (c, d, d) of M."""
        ...


def covariance(L: Array, M: Array) -> Array:
    """(..., k, k) L^T M^-1 L."""
    return np.asarray(np.swapaxes(L, -1, -2) @ np.linalg.solve(M, np.broadcast_to(L, (*M.shape[:-2], *L.shape))))


def root(M: Array) -> Array:
    """T with T M T^T = I.

    Raises:
        numpy.linalg.LinAlgError: M is not positive definite.
    """
    return np.asarray(np.linalg.inv(np.linalg.cholesky(M)))


def gram(parts: Array) -> Array:
    """(c, c) inner products of (c, ...), in blocks small enough for one thread: on busy cores threads only wait."""
    flat = parts.reshape(len(parts), -1)
    other = flat.copy()  # a matrix times its own transpose has a product of its own, with threads at any size
    size = max(1, math.isqrt(ONE_THREAD // flat.shape[1]))
    products = np.empty((len(flat), len(flat)))
    for i in range(0, len(flat), size):
        for j in range(0, i + 1, size):
            block = flat[i : i + size] @ other[j : j + size].T
            products[i : i + size, j : j + size] = block
            products[j : j + size, i : i + size] = block.T
    return products


@dataclass(frozen=True, eq=False)
class _OfColumns:
    """Of the covariance V of combinations L (d, k) of the parameters."""

    L: Array

    def __post_init__(self) -> None:
        seal(self, L="d k")

    def transformed(self, T: Array) -> Self:
        """As `Measure`."""
        return replace(self, L=T @ self.L)


class LogDet(_OfColumns):
    """-log det V: D for all parameters, D_s for some of them."""

    @property
    def degree(self) -> int:
        """k."""
        return int(self.L.shape[1])

    def values(self, M: Array) -> Array:
        """As `Measure`."""
        d, k = self.L.shape
        value = np.linalg.slogdet(M)[1] - np.linalg.slogdet(self.L.T @ self.L)[1]
        if d == k:
            return np.asarray(value)
        rest = np.linalg.qr(self.L, mode="complete")[0][:, k:]  # the complement of L is eliminated
        return np.asarray(value - np.linalg.slogdet(rest.T @ M @ rest)[1])

    def gradient(self, M: Array) -> Array:
        """As `Measure`."""
        T = root(M)
        basis = T.T @ np.linalg.qr(T @ self.L)[0]
        return np.asarray(basis @ basis.T)

    def curvature(self, M: Array, parts: Array) -> Array:
        """As `SmoothMeasure`."""
        T = root(M)
        white = T @ parts @ T.T
        if self.L.shape[0] == self.L.shape[1]:
            return gram(white)
        basis = np.linalg.qr(T @ self.L)[0]
        seen = white @ basis
        return 2 * gram(seen) - gram(basis.T @ seen)

    def conjugate(self, G: Array) -> float:
        """As `Measure`: k + log det L^T G L."""
        sign, value = np.linalg.slogdet(self.L.T @ G @ self.L)
        return self.degree + float(value) if sign > 0 else -np.inf


class LogTrace(_OfColumns):
    """-log trace V: A for scaled parameters, V for outcomes."""

    @property
    def degree(self) -> int:
        """1."""
        return 1

    def values(self, M: Array) -> Array:
        """As `Measure`."""
        return np.asarray(-np.log(np.trace(covariance(self.L, M), axis1=-2, axis2=-1)))

    def gradient(self, M: Array) -> Array:
        """As `Measure`."""
        T = root(M)
        seen = T @ self.L
        back = T.T @ seen
        return np.asarray(back @ back.T / np.sum(seen**2))

    def curvature(self, M: Array, parts: Array) -> Array:
        """As `SmoothMeasure`."""
        T = root(M)
        seen = T @ self.L
        seen = seen / np.linalg.norm(seen)
        moved = (T @ parts @ T.T) @ seen
        slope = np.einsum("dk,cdk->c", seen, moved)
        return 2 * gram(moved) - np.outer(slope, slope)

    def conjugate(self, G: Array) -> float:
        """As `Measure`: 1 + 2 log of the nuclear norm of G^(1/2) L."""
        values, vectors = np.linalg.eigh(G)
        half = np.sqrt(np.maximum(values, 0.0))[:, None] * (vectors.T @ self.L)
        size = float(np.linalg.svd(half, compute_uv=False).sum())
        return 1.0 + 2.0 * float(np.log(size)) if size > 0 else -np.inf


class LogSmallest(_OfColumns):
    """-log of the largest eigenvalue of V: E. It is not differentiable where eigenvalues meet."""

    @property
    def degree(self) -> int:
        """1."""
        return 1

    def values(self, M: Array) -> Array:
        """As `Measure`."""
        return np.asarray(-np.log(np.linalg.eigvalsh(covariance(self.L, M))[..., -1]))

    def gradient(self, M: Array) -> Array:
        """As `Measure`: of the largest eigenvalue's eigenvector; where eigenvalues meet, one supergradient of many."""
        values, vectors = np.linalg.eigh(covariance(self.L, M))
        back = np.linalg.solve(M, self.L @ vectors[:, -1])
        return np.asarray(np.outer(back, back) / values[-1])

    def conjugate(self, G: Array) -> float:
        """As `Measure`: 1 + log trace(L^T G L)."""
        size = float(np.sum(self.L * (G @ self.L)))
        return 1.0 + float(np.log(size)) if size > 0 else -np.inf
