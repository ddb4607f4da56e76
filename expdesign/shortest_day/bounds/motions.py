"""The motions that a bound holds for: velocities through water and inputs within limits, on any heading.

A motion may take any velocity with any input at any time. What cannot follow from each other in a real motion counts
as possible, so the class is wider than what the ship can do, and a bound for it holds for the ship.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from expdesign.errors import InputError
from expdesign.simulation import to_body
from expdesign.values import Array, sealed
from expdesign.vessel import NUMPY, Actuator, Operators, VesselModel, direct_terms, force_matrix, stem
from expdesign.vessel.structures import FORCE_SIGNALS, SHOAL

FEWEST_SIDES, MOST_SIDES = 4, 24  # of the polygon that holds the force of an azimuth; several azimuths share the most


# Affine arithmetic: what an expression can be over many boxes at once, with the correlation of its parts kept.
#
# A quantity over a box is c + sum_i g_i s_i + e with all s_i in [-1, 1] and |e| at most a stated error. Sums are exact;
# products, moduli, sines and cosines keep their linear part and add the rest to the error, which falls with the square
# of the size of the box. The rounding of numbers is not counted.
#
# Source: J. L. D. Comba and J. Stolfi, Affine arithmetic and its applications to computer graphics, SIBGRAPI (1993),
# 9-18; L. H. de Figueiredo and J. Stolfi, Affine arithmetic: concepts and applications, Numer. Algorithms 37 (2004),
# 147-158.


@dataclass(frozen=True, eq=False)
class Affine:
    """A quantity over each of b boxes with d sides."""

    centre: Array  # (b,)
    slopes: Array  # (d, b)
    error: Array  # (b,) not negative

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

VELOCITIES = ("u", "v", "r")
AIR = ("u_q", "v_q")


@sealed(low="d", high="d", air_to="2", forces="f 3")
class Motions:
    """All motions of a model within limits.

    A point is (u, v, r) through water, the heading where the air matters, and the inputs where terms read them or are
    not affine in the forces they give. In all other models the regressors are affine in the force, and the most that a
    convex function of them can be is at a corner of a polytope that holds all forces.
    """

    model: VesselModel  # gives the terms
    parameters: tuple[str, ...]  # names of the p parameters counted
    # low, high: (d,) limits of a point
    low: Array
    high: Array
    air_to: Array  # (2,) mean wind less mean current, north and east [m/s]
    forces: Array  # (f, 3) corners of a polytope of generalised forces; one of zeros where inputs are in the point

    @staticmethod
    def within(model: VesselModel, parameters: Sequence[str], velocities: Array, *, air_to: Array) -> Motions:
        """Within velocities (3, 2) through water and the limits of the actuators.

        Raises:
            InputError: an actuator has no limits.
        """
        limits = [velocities]
        if _feels_air(model, air_to):
            limits.append(np.array([[-np.pi, np.pi]]))
        if direct := bool(direct_terms(model)) or not _affine_in_force(model):
            limits.append(_input_limits(model))
        forces = np.zeros((1, 3)) if direct else _force_corners(model.actuators)
        low, high = np.concatenate(limits).T
        return Motions(
            model=model, parameters=tuple(parameters), low=low, high=high, air_to=np.array(air_to), forces=forces
        )

    @property
    def equations(self) -> Array:
        """(p + n, p + n) 1 for columns of the same equation, the means' columns last."""
        equation = {term.name: term.equation for term in self.model.terms}
        of = np.array([*(equation[name] for name in self.parameters), *self.model.outputs])
        return np.asarray(of[:, None] == of, dtype=float)

    def rows(self, points: Array) -> Array:
        """(4, b, p + n) regressors and a 1 for each mean, at points (b, d): without force, and by unit forces."""
        base, gains = self.regressors(tuple(points.T), NUMPY)
        rows = np.zeros((4, len(points), len(self.parameters) + len(self.model.outputs)))
        for column, values in enumerate(zip(base, *gains, strict=True)):
            for row, value in zip(rows[:, :, column], values, strict=True):
                row[:] = value
        rows[0, :, len(self.parameters) :] = 1.0
        return rows

    def affine_rows(self, centres: Array, halves: Array) -> tuple[Array, Array]:
        """Over boxes: at the centre and by half of each side (b, 4, 1 + d, p + n), and errors (4, b, p + n)."""
        base, gains = self.regressors(over_boxes(centres, halves), AFFINE)
        (b, d), columns = centres.shape, len(self.parameters) + len(self.model.outputs)
        rows, error = np.zeros((b, 4, 1 + d, columns)), np.zeros((4, b, columns))
        for column, values in enumerate(zip(base, *gains, strict=True)):
            for row, value in enumerate(values):
                if isinstance(value, Affine):
                    rows[:, row, 0, column], error[row, :, column] = value.centre, value.error
                    rows[:, row, 1:, column] = value.slopes.T
                else:
                    rows[:, row, 0, column] = value
        rows[:, 0, 0, len(self.parameters) :] = 1.0
        return rows, error

    def regressors(self, point: tuple[Any, ...], ops: Operators) -> tuple[list[Any], list[list[Any]]]:
        """p regressors without force, and what each unit of force adds to them."""
        table = self._signals(point, ops)
        chosen = [self.model.expressions[self.model.names.index(name)] for name in self.parameters]
        base = [expression.evaluate(table, ops) for expression in chosen]
        if len(self.forces) == 1:
            return base, [[0.0] * len(base)] * 3
        gains = []
        for name in FORCE_SIGNALS:
            unit = {**table, name: 1.0}
            gains.append(
                [
                    expression.evaluate(unit, ops) - without if name in expression.signals else 0.0
                    for expression, without in zip(chosen, base, strict=True)
                ]
            )
        return base, gains

    def _signals(self, point: tuple[Any, ...], ops: Operators) -> dict[str, Any]:
        """All signals of a point; without force where inputs are not in it."""
        (u, v, r), rest = point[:3], list(point[3:])
        air = to_body(self.air_to, rest.pop(0), ops) if _feels_air(self.model, self.air_to) else (0.0, 0.0)
        inputs = rest or [0.0] * len(self.model.inputs)
        return dict(self.model.signals((u, v, r), (u - air[0], v - air[1]), inputs, ops))


def _feels_air(model: VesselModel, air_to: Array) -> bool:
    """Whether the heading matters: the air moves over the water and a term reads it."""
    return bool(np.any(air_to)) and any(set(AIR) & set(expression.signals) for expression in model.expressions)


def _affine_in_force(model: VesselModel) -> bool:
    """Whether every term is affine in the generalised force: affine arithmetic finds no error there."""
    some = dict(zip((*VELOCITIES, *AIR), (0.3, -0.7, 1.1, -1.3, 0.9), strict=True))
    forces = over_boxes(np.zeros((1, 3)), np.ones((1, 3)))
    table = {**some, SHOAL: 0.0, **dict(zip(FORCE_SIGNALS, forces, strict=True))}
    values = (expression.evaluate(table, AFFINE) for expression in model.expressions)
    return not any(isinstance(value, Affine) and value.error.any() for value in values)


def _input_limits(model: VesselModel) -> Array:
    """(m, 2) of what actuators deliver."""
    rows = []
    for actuator in model.actuators:
        for signal, limit, response in zip(actuator.signals, actuator.limits, actuator.responses, strict=True):
            low, high = limit.low + response.offset, limit.high + response.offset
            if stem(signal) == "a" and not np.isfinite([low, high]).all():
                low, high = -np.pi, np.pi
            if not np.isfinite([low, high]).all():
                raise InputError(f"{signal} has no limits, expected some in the vessel file")
            rows.append((min(low, 0.0), max(high, 0.0)))
    return np.array(rows).reshape(-1, 2)


def _force_corners(actuators: Sequence[Actuator]) -> Array:
    """(f, 3) corners of a polytope that holds the generalised forces of all inputs within limits.

    The forces of an azimuth lie in a disc, which a regular polygon holds.
    """
    azimuths = sum(actuator.kind == "azimuth" for actuator in actuators)
    sides = max(FEWEST_SIDES, MOST_SIDES // max(azimuths, 1))
    angles = 2 * np.pi * np.arange(sides) / sides
    polygon = np.stack([np.cos(angles), np.sin(angles)], axis=1) / np.cos(np.pi / sides)
    unit_forces, column, corners = force_matrix(tuple(actuators)), 0, np.zeros((1, 3))
    for actuator in actuators:
        if actuator.kind == "rudder":
            column += 1
            continue
        driving = actuator.limits if actuator.kind == "force" else actuator.limits[:1]
        ranges = [(min(limit.low, 0.0), max(limit.high, 0.0)) for limit in driving]
        if not np.isfinite(ranges).all():
            raise InputError(f"{actuator.signals[0]} has no limits, expected some in the vessel file")
        own = np.array(list(itertools.product(*ranges)))
        if actuator.kind == "azimuth":
            own = np.abs(ranges).max() * polygon
        share = own @ unit_forces[:, column : column + own.shape[1]].T
        column += own.shape[1]
        corners = np.unique((corners[:, None] + share).reshape(-1, 3), axis=0)
    return corners[_outermost(corners)]


def _outermost(points: Array) -> NDArray[np.intp]:
    """Places of the points (n, 3) whose convex hull holds all, where they span space; else of all."""
    if np.linalg.matrix_rank(points - points.mean(axis=0)) < 3:
        return np.arange(len(points))
    return np.sort(ConvexHull(points).vertices)
