"""Concave measures of an information matrix, each a function of the covariance V = L^T M^-1 L of what L picks out.

M is (d, d), L is (d, k). All values are logarithms of positively homogeneous, concave functions of M, so that a gain of
0.01 reads as one per cent of information per degree. Whatever is concave in M is concave in time fractions.

Source: F. Pukelsheim, Optimal Design of Experiments (2006), chapters 3, 6 and 7 (information functions, subgradients).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.optimize import brentq

from expdesign.values import Array, seal


@dataclass(frozen=True, eq=False)
class Local:
    """Second-order picture of a function of fractions: value, slope (c,), minus the Hessian (c, c)."""

    value: float
    slope: Array
    curvature: Array


class Measure(Protocol):
    """What a criterion makes of an information matrix.

    Attributes:
        L: (d, k) what is picked out.
        degree: homogeneity of exp(value): information twice as long is worth `degree` x log 2 more.
    """

    @property
    def L(self) -> Array: ...  # noqa: D102, N802

    @property
    def degree(self) -> int: ...  # noqa: D102

    def values(self, M: Array) -> Array:
        """(...) values of matrices (..., d, d) that are positive definite."""
        ...

    def smooth(self, M: Array, blur: float) -> float:
        """The value, with corners rounded off as much as `blur` says; the same where there are none."""
        ...

    def local(self, M: Array, parts: Array, blur: float) -> Local:
        """`smooth` as a function of the weights of parts (c, d, d) in M."""
        ...

    def tangent(self, M: Array, blur: float) -> tuple[float, Array]:
        """(a, G): for every M' the value is at most a + trace(G (M' - M)); trace(G M) is `degree`."""
        ...

    def transformed(self, T: Array) -> Measure:
        """The same measure for matrices T M T^T."""
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
    """(c, c) inner products of (c, ...)."""
    flat = parts.reshape(len(parts), -1)
    return np.asarray(flat @ flat.T)


@dataclass(frozen=True, eq=False)
class LogDet:
    """-log det V: D for all parameters, D_s for some of them."""

    L: Array

    def __post_init__(self) -> None:
        seal(self, L="d k")

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
        rest = np.linalg.qr(self.L, mode="complete")[0][:, k:]  # what L does not see, eliminated by its own block
        return np.asarray(value - np.linalg.slogdet(rest.T @ M @ rest)[1])

    def smooth(self, M: Array, blur: float) -> float:
        """As `Measure`."""
        return float(self.values(M))

    def local(self, M: Array, parts: Array, blur: float) -> Local:
        """As `Measure`."""
        T = root(M)
        white = T @ parts @ T.T
        if self.L.shape[0] == self.L.shape[1]:
            return Local(self.smooth(M, blur), np.trace(white, axis1=1, axis2=2), gram(white))
        basis = np.linalg.qr(T @ self.L)[0]
        seen = white @ basis
        inner = basis.T @ seen
        return Local(self.smooth(M, blur), np.trace(inner, axis1=1, axis2=2), 2 * gram(seen) - gram(inner))

    def tangent(self, M: Array, blur: float) -> tuple[float, Array]:
        """As `Measure`."""
        T = root(M)
        basis = T.T @ np.linalg.qr(T @ self.L)[0]
        return self.smooth(M, blur), basis @ basis.T

    def transformed(self, T: Array) -> LogDet:
        """As `Measure`."""
        return replace(self, L=T @ self.L)


@dataclass(frozen=True, eq=False)
class LogTrace:
    """-log trace V: A for scaled parameters, V for outcomes."""

    L: Array

    def __post_init__(self) -> None:
        seal(self, L="d k")

    @property
    def degree(self) -> int:
        """1."""
        return 1

    def values(self, M: Array) -> Array:
        """As `Measure`."""
        return np.asarray(-np.log(np.trace(covariance(self.L, M), axis1=-2, axis2=-1)))

    def smooth(self, M: Array, blur: float) -> float:
        """As `Measure`."""
        return float(self.values(M))

    def local(self, M: Array, parts: Array, blur: float) -> Local:
        """As `Measure`."""
        T = root(M)
        seen = T @ self.L
        weight = float(np.sum(seen**2))
        seen = seen / np.sqrt(weight)
        moved = (T @ parts @ T.T) @ seen
        slope = np.einsum("dk,cdk->c", seen, moved)
        return Local(-np.log(weight), slope, 2 * gram(moved) - np.outer(slope, slope))

    def tangent(self, M: Array, blur: float) -> tuple[float, Array]:
        """As `Measure`."""
        T = root(M)
        seen = T @ self.L
        weight = float(np.sum(seen**2))
        back = T.T @ seen
        return -float(np.log(weight)), back @ back.T / weight

    def transformed(self, T: Array) -> LogTrace:
        """As `Measure`."""
        return replace(self, L=T @ self.L)


@dataclass(frozen=True, eq=False)
class LogSmallest:
    """-log of the largest eigenvalue of V: E.

    The corner where eigenvalues meet is rounded by max over t of log t + blur log det(M - t L L^T), which is concave
    and gives the mixture of eigenvectors that the certificate needs: for any Z >= 0 with trace(L^T Z L) = 1,
    1 / lambda_max(V) <= trace(Z M).
    """

    L: Array

    def __post_init__(self) -> None:
        seal(self, L="d k")

    @property
    def degree(self) -> int:
        """1."""
        return 1

    def values(self, M: Array) -> Array:
        """As `Measure`."""
        return np.asarray(-np.log(np.linalg.eigvalsh(covariance(self.L, M))[..., -1]))

    def _level(self, M: Array, blur: float) -> tuple[float, Array]:
        """The best t, and M - t L L^T."""
        eigenvalues = np.linalg.eigvalsh(covariance(self.L, M))
        shares = eigenvalues / eigenvalues[-1]

        def excess(z: float) -> float:  # zero at t = (1 - z) / lambda_max
            return blur * float(np.sum((1.0 - z) * shares / ((1.0 - shares) + z * shares))) - 1.0

        low, high = blur / (1.0 + blur), blur * len(shares) / (1.0 + blur * len(shares))
        inside = excess(low) > 0.0 > excess(high)
        z = float(brentq(excess, low, high, xtol=1e-300)) if inside else low
        t = (1.0 - z) / float(eigenvalues[-1])
        return t, M - t * self.L @ self.L.T

    def smooth(self, M: Array, blur: float) -> float:
        """As `Measure`."""
        t, S = self._level(M, blur)
        return float(np.log(t) + blur * np.linalg.slogdet(S)[1])

    def local(self, M: Array, parts: Array, blur: float) -> Local:
        """As `Measure`."""
        t, S = self._level(M, blur)
        T = root(S)
        white = T @ parts @ T.T
        seen = T @ self.L
        J = seen @ seen.T
        slope = blur * np.trace(white, axis1=1, axis2=2)
        tilt = blur * np.einsum("ij,cji->c", J, white)
        stiffness = 1 / t**2 + blur * float(np.sum(J**2))
        value = float(np.log(t) + blur * np.linalg.slogdet(S)[1])
        return Local(value, slope, blur * gram(white) - np.outer(tilt, tilt) / stiffness)

    def tangent(self, M: Array, blur: float) -> tuple[float, Array]:
        """As `Measure`."""
        _, S = self._level(M, blur)
        T = root(S)
        mixture = T.T @ T
        mixture /= np.trace(self.L.T @ mixture @ self.L)
        bound = float(np.trace(mixture @ M))
        return float(np.log(bound)), mixture / bound

    def transformed(self, T: Array) -> LogSmallest:
        """As `Measure`."""
        return replace(self, L=T @ self.L)
