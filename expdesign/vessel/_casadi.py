"""The vessel's only use of CasADi: steps of Newton's method for commands, compiled, for many ships at a call.

How functions of one ship are called for many, and the operators of terms, are here for the rooms above, too.

Parameters are inputs, so models of one structure share the functions. Secants differ in one share each: what the others
give, and what depends on the motion alone, is worked out once.

Source: J. A. E. Andersson et al., CasADi, Mathematical Programming Computation 11 (2019), 1-36.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from expdesign.values import Array
from expdesign.vessel.actuators import Actuator
from expdesign.vessel.model import Inertia, VesselModel
from expdesign.vessel.structures import Operators, Term

CASADI = Operators(ca.fabs, ca.sin, ca.cos)
SHIPS = tuple(1 << power for power in reversed(range(8)))  # number of ships in one function
DAMPING = 1e-12  # of directions in which nothing pushes, in squares of the mean push
LIMITED = 1e-12  # share by which limits must change a command to count

Structure = tuple[tuple[Term, ...], str, float, tuple[Actuator, ...], Inertia | None]
"""Terms, form, sample time, actuators and coupled inertia of a model: everything but the values of its parameters."""
Ranges = tuple[tuple[float, float, float], ...]
"""Scale, least and largest share of each."""


class CompiledSteps:
    """Steps of Newton's method with secants, for ships side by side."""

    def __init__(self, pushes: dict[int, ca.Function], shares: dict[int, ca.Function], parameters: Array) -> None:
        self._pushes, self._shares, self._parameters = pushes, shares, np.array(parameters, dtype=float)

    def push(self, motion: Array, shares: Array, width: float) -> tuple[Array, Array]:
        """Accelerations (n, 3) at motions (n, 3) for shares (n, c), and what a unit of each adds (n, c, 3)."""
        found, push = np.empty(motion.shape), np.empty((*shares.shape, 3))
        fill(self._pushes, (motion, shares), ([width], self._parameters), (found, push))
        return found, push

    def smallest(self, push: Array, wanted: Array, near: Array) -> Array:
        """(n, c) shares within limits, nearest to some (n, c), whose pushes (n, c, 3) give what is wanted (n, 3).

        Those that a limit changes are set to it, and the others give what is missing, until no more are.
        """
        shares = np.ascontiguousarray(near, dtype=float)
        free, over, open_ = np.ones(shares.shape), np.empty(len(shares)), np.arange(len(shares))
        for _ in range(shares.shape[1]):
            moved, left = np.empty((len(open_), shares.shape[1])), np.empty((len(open_), shares.shape[1]))
            over = np.empty(len(open_))
            fill(self._shares, (push[open_], wanted[open_], shares[open_], free[open_]), (), (moved, left, over))
            shares[open_], free[open_] = moved, left
            open_ = open_[over > 0]
            if not len(open_):
                break
        return shares


def fill(functions: dict[int, Any], rows: Sequence[Array], shared: Sequence[Any], results: Sequence[Array]) -> None:
    """Write results (n, ...) of functions of so many ships each, for rows (n, ...) of every ship and what all share."""
    given = [np.ascontiguousarray(table, dtype=float) for table in rows]
    same, done = [np.array(table, dtype=float) for table in shared], 0
    for size, function in functions.items():
        while done + size <= len(results[0]):
            buffer, run = function.buffer()
            for place, table in enumerate(given):
                buffer.set_arg(place, table[done:].data)
            for place, table in enumerate(same):
                buffer.set_arg(len(given) + place, table.data)
            for place, table in enumerate(results):
                buffer.set_res(place, table[done:].data)
            run()
            done += size


def compiled_steps(model: VesselModel, actuators: tuple[Actuator, ...], ranges: Ranges) -> CompiledSteps:
    """The steps of a model, whose actuators count as others where angles are chosen for these."""
    structure = model.terms, model.form, model.sample_time_s, model.actuators, model.inertia
    vectors = tuple(one.kind == "azimuth" for one in actuators)
    return CompiledSteps(*_functions(structure, vectors, ranges), model.parameters)


@lru_cache(maxsize=16)
def _functions(
    structure: Structure, vectors: tuple[bool, ...], ranges: Ranges
) -> tuple[dict[int, Any], dict[int, Any]]:
    """Number of ships, largest first -> (motion, shares, width, parameters) -> accelerations and pushes.

    Besides, the same -> what `_redistributed` makes.
    """
    terms, form, sample_time_s, actuators, inertia = structure
    zeros = np.zeros(len(terms))
    model = VesselModel(
        terms=terms,
        parameters=zeros,
        parameter_std=zeros,
        form=form,
        sample_time_s=sample_time_s,
        actuators=actuators,
        inertia=inertia,
    )
    places = _places(actuators, vectors)
    motion, tried = ca.SX.sym("motion", 3), ca.SX.sym("tried", len(ranges))
    width, theta = ca.SX.sym("width"), ca.SX.sym("theta", len(terms))
    moving, values = ca.vertsplit(motion), ca.vertsplit(theta)
    scale, low, high = (ca.DM(column) for column in np.array(ranges).T)

    def accelerations(shares: ca.SX) -> ca.SX:
        inputs = list[Any]()
        for vector, place in places:
            own = ca.vertsplit((shares * scale)[place])
            inputs += [ca.hypot(*own), ca.atan2(own[1], own[0])] if vector else own
        found: ca.SX = ca.vertcat(*model.accelerations(moving, moving[:2], inputs, CASADI, values))
        return found

    units = ca.horzsplit(ca.SX.eye(len(ranges)))
    secants = [accelerations(tried + width * x) - accelerations(tried - width * x) for x in units]
    pushes = ca.Function(
        "push",
        [motion, tried, width, theta],
        ca.cse([accelerations(tried), ca.densify(ca.horzcat(*secants) / (2.0 * width))]),
    )
    return for_ships(pushes, own=2), for_ships(_redistributed(places, low, high), own=4)


def for_ships(one: ca.Function, *, own: int) -> dict[int, Any]:
    """The function for several ships: the first arguments are each ship's own, the others all share."""
    alike = [place >= own for place in range(one.n_in())]
    return {count: one.map(count, alike, [False] * one.n_out()) for count in SHIPS}


def _places(actuators: tuple[Actuator, ...], vectors: tuple[bool, ...]) -> list[tuple[bool, slice]]:
    """Whether the shares of each actuator are a vector, and where they are."""
    widths = [2 if vector else len(one.limits) for one, vector in zip(actuators, vectors, strict=True)]
    ends = np.cumsum(widths).tolist()
    return [(vector, slice(end - width, end)) for vector, width, end in zip(vectors, widths, ends, strict=True)]


def _redistributed(places: list[tuple[bool, slice]], low: ca.DM, high: ca.DM) -> ca.Function:
    """(push, wanted, shares, free) -> shares within limits, which of them are still free, and whether some were set."""
    count = low.numel()
    push, wanted = ca.SX.sym("push", 3, count), ca.SX.sym("wanted", 3)
    shares, free = ca.SX.sym("shares", count), ca.SX.sym("free", count)
    damping = DAMPING * (ca.sumsqr(push) + 1e-30) * ca.SX.eye(3)
    mobile = push @ ca.diag(free)
    moved = shares + mobile.T @ _solved(mobile @ mobile.T + damping, wanted - push @ shares)
    inside = ca.fmin(ca.fmax(moved, low), high)
    for vector, place in places:
        if vector:
            inside[place] = inside[place] / ca.fmax(1.0, ca.norm_2(inside[place]))
    over = ca.fabs(inside - moved) > LIMITED
    for vector, place in places:
        if vector:
            over[place] = ca.repmat(ca.fmax(*ca.vertsplit(over[place])), 2)
    results = [inside, free * (1 - over), ca.mmax(over * free)]
    return ca.Function("redistributed", [push, wanted, shares, free], ca.cse([ca.densify(x) for x in results]))


def _solved(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """(3,) solution for a symmetric positive matrix (3, 3), by Cholesky's factors without roots."""
    a, b, c, d, e, f = matrix[0, 0], matrix[1, 0], matrix[2, 0], matrix[1, 1], matrix[2, 1], matrix[2, 2]
    l1, l2 = b / a, c / a
    d1 = d - l1 * b
    e1 = e - l1 * c
    l3 = e1 / d1
    d2 = f - l2 * c - l3 * e1
    y0 = right[0]
    y1 = right[1] - l1 * y0
    y2 = right[2] - l2 * y0 - l3 * y1
    x2 = y2 / d2
    x1 = y1 / d1 - l3 * x2
    return ca.vertcat(y0 / a - l1 * x1 - l2 * x2, x1, x2)
