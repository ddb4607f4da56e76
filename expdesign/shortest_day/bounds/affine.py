"""Affine arithmetic: what an expression can be over many boxes at once, with the correlation of its parts kept.

A quantity over a box is c + sum_i g_i s_i + e with all s_i in [-1, 1] and |e| at most a stated error. Sums are exact;
products, moduli, sines and cosines keep their linear part and add the rest to the error, which falls with the square of
the size of the box. The rounding of numbers is not counted.

Source: J. L. D. Comba and J. Stolfi, Affine arithmetic and its applications to computer graphics, SIBGRAPI (1993),
9-18; L. H. de Figueiredo and J. Stolfi, Affine arithmetic: concepts and applications, Numer. Algorithms 37 (2004),
147-158.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from expdesign.values import Array
from expdesign.vessel import Operators


@dataclass(frozen=True, eq=False)
class Affine:
    """A quantity over each of b boxes with d sides.

    Attributes:
        centre: (b,).
        slopes: (d, b).
        error: (b,) not negative.
    """

    centre: Array
    slopes: Array
    error: Array

    __array_ufunc__ = None  # an array on the left leaves the operation to this class

    @property
    def radius(self) -> Array:
        """(b,) largest distance from the centre."""
        return np.asarray(np.abs(self.slopes).sum(axis=0) + self.error)

    def __neg__(self) -> Affine:
        return Affine(-self.centre, -self.slopes, self.error)

    def __add__(self, other: Affine | Array | float) -> Affine:
        if isinstance(other, Affine):
            return Affine(self.centre + other.centre, self.slopes + other.slopes, self.error + other.error)
        return Affine(self.centre + other, self.slopes, self.error)

    __radd__ = __add__

    def __sub__(self, other: Affine | Array | float) -> Affine:
        return self + (-other)

    def __rsub__(self, other: Affine | Array | float) -> Affine:
        return -self + other

    def __mul__(self, other: Affine | Array | float) -> Affine:
        if not isinstance(other, Affine):
            return Affine(self.centre * other, self.slopes * other, self.error * np.abs(other))
        a, b = self.centre, other.centre
        rest = np.abs(a) * other.error + np.abs(b) * self.error + self.radius * other.radius
        return Affine(a * b, a * other.slopes + b * self.slopes, rest)

    __rmul__ = __mul__


def over_boxes(centres: Array, halves: Array) -> tuple[Affine, ...]:
    """The d coordinates of boxes with centres and half sides (b, d)."""
    slopes = np.zeros((centres.shape[1], *centres.T.shape))
    for side, half in enumerate(halves.T):
        slopes[side, side] = half
    none = np.zeros(len(centres))
    return tuple(Affine(centre, slope, none) for centre, slope in zip(centres.T, slopes, strict=True))


def _abs(value: Any) -> Any:
    """The chord over the range where zero is inside; |x| is below it by up to -2 l h / (h - l)."""
    if not isinstance(value, Affine):
        return np.abs(value)
    low, high = value.centre - value.radius, value.centre + value.radius
    inside = (low < 0) & (high > 0)
    width = np.where(inside, high - low, 1.0)
    slope = np.where(inside, (high + low) / width, np.where(high <= 0, -1.0, 1.0))
    lift = np.where(inside, -low * high / width, 0.0)
    chord = value * slope
    return Affine(chord.centre + lift, chord.slopes, chord.error + lift)


def _sin(value: Any) -> Any:
    """The tangent at the centre; the second derivative is at most 1."""
    if not isinstance(value, Affine):
        return np.sin(value)
    tangent = (value - value.centre) * np.cos(value.centre)
    return Affine(np.sin(value.centre), tangent.slopes, tangent.error + value.radius**2 / 2)


def _cos(value: Any) -> Any:
    return _sin(value + np.pi / 2)


AFFINE = Operators(_abs, _sin, _cos)
