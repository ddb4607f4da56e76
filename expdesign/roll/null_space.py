"""What load cases cannot tell apart: directions of parameters with units, and what would cure them.

Two questions are kept apart. The equations may leave a direction open whatever the data are: then all coefficients of
all cases stay as they are along it. Or the data may show a direction too faintly. The relative sensitivity

    S = d log coefficients / d log parameters

of all cases together answers the first: its singular values do not depend on units. The estimate's own information, in
relative changes, answers the second: 1 over a singular value is the relative standard deviation along it.

With z_s counted from the body origin, three cases (none, known, unknown load) have rank 8 of 9: by the known load,
(A2_c - A2_n) / (S1_c - S1_n) = z_c - z_s is known already, so that it gives one equation and not two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.roll.estimate import UNSEEN, RollEstimate
from expdesign.roll.model import PARAMETERS, UNITS, named, relative_sensitivity
from expdesign.roll.problem import RollProblem
from expdesign.values import Array, sealed
from expdesign.vessel.roll import Body, Load

OPEN_SIZES = 5.0  # change along an open direction that is counted with, in sizes of the parameter that it moves most
FAINT_STD = 1.0  # relative standard deviation along a direction from which data are said not to determine it
SMALL_SHARE = 0.01  # of a direction's largest relative change, below which a parameter is not named


@dataclass(frozen=True, kw_only=True, eq=False)
class Direction:
    """A combination of parameters."""

    # parameter -> change in its own unit, scaled so that the one that changes most by its size changes by a tenth;
    # those that hardly change are left out
    change: dict[str, float]
    size: float  # singular value; for what data show, the relative standard deviation along it is 1 / size

    def __str__(self) -> str:
        return ", ".join(f"{name} {value:+.3g} {UNITS[name]}" for name, value in self.change.items())


@dataclass(frozen=True, kw_only=True)
class Cure:
    """Something more that could be known, measured or loaded."""

    what: str  # in words
    smallest: float  # singular value of the relative sensitivity with it
    rank: int  # of the parameters with it


@sealed(singular_values="p")
class NullSpace:
    """The report."""

    free: tuple[str, ...]  # parameters
    singular_values: Array  # (p,) of the relative sensitivity, falling
    rank: int  # how many of them are not rounding
    # directions that the equations leave open, along which the parameters in `RollEstimate.held` were held
    open: tuple[Direction, ...]
    # parameters that an open direction moves by more than their standard deviation while the one that it moves most
    # changes by a few times its size
    undetermined: tuple[str, ...]
    faint: tuple[Direction, ...]  # directions that these data show too faintly
    cures: tuple[Cure, ...]  # the best first; none where nothing is open or faint


def null_space(estimate: RollEstimate) -> NullSpace:
    """The report on an estimate."""
    problem, theta = estimate.problem, _sizes(estimate)
    loads = [case.load for case in problem.cases]
    sizes, rows = _singular(relative_sensitivity(theta, problem.body, loads, problem.free))
    rank = _rank(sizes)
    open_ = tuple(direction(problem.free, theta, row, 0.0) for row in rows[rank:])
    faint = _faint(problem, theta, estimate.sensed, rows[rank:])
    found = cures(problem.body, theta, loads, problem.free) if open_ or faint else ()
    return NullSpace(
        free=problem.free, singular_values=sizes, rank=rank, open=open_, faint=faint,
        undetermined=_undetermined(estimate, theta, rows[rank:]),
        cures=tuple(found),
    )  # fmt: skip


def _sizes(estimate: RollEstimate) -> Array:
    """Parameters (9,), those near zero at a hundredth of their typical size."""
    least = 0.01 * estimate.problem.scale
    theta = np.array(estimate.theta)
    small = np.abs(theta) < least
    small &= np.isin(PARAMETERS, estimate.problem.free)
    theta[small] = least[small]
    return theta


def _singular(matrix: Array) -> tuple[Array, Array]:
    """Singular values, one for each column, and right singular vectors in rows."""
    _, sizes, rows = np.linalg.svd(matrix, full_matrices=True)
    return np.concatenate([sizes, np.zeros(matrix.shape[1] - len(sizes))]), rows


def _rank(sizes: Array) -> int:
    return int(np.sum(sizes > UNSEEN * sizes[0]))


def direction(free: Sequence[str], theta: Array, relative: Array, size: float) -> Direction:
    """The direction of relative changes (p,) of the free parameters, at parameters (9,)."""
    values = theta[[PARAMETERS.index(name) for name in free]]
    largest = int(np.argmax(np.abs(relative)))
    moved = relative / relative[largest] * 0.1
    if moved[0] * values[0] < 0:
        moved = -moved
    named_ = {
        name: float(change * value)
        for name, change, value in zip(free, moved, values, strict=True)
        if abs(change) > SMALL_SHARE * 0.1
    }
    return Direction(change=named_, size=size)


def _undetermined(estimate: RollEstimate, theta: Array, open_rows: Array) -> tuple[str, ...]:
    moves = np.abs(open_rows / np.abs(open_rows).max(axis=1, keepdims=True)) * np.abs(theta[estimate.problem.places])
    moves *= OPEN_SIZES
    return tuple(name for name, move in zip(estimate.std, moves.T, strict=True) if (move > estimate.std[name]).any())


def _faint(problem: RollProblem, theta: Array, sensed: Array, open_rows: Array) -> tuple[Direction, ...]:
    """Directions across the open ones, along which the data leave a relative standard deviation of 1 or more."""
    relative = sensed * theta[problem.places]
    across = relative - relative @ open_rows.T @ open_rows
    sizes, rows = _singular(across)
    kept = len(problem.free) - len(open_rows)
    return tuple(
        direction(problem.free, theta, row, float(size))
        for size, row in zip(sizes[:kept], rows[:kept], strict=True)
        if size < 1.0 / FAINT_STD
    )


def open_directions(
    body: Body, theta: Array, loads: Sequence[Load | None], free: Sequence[str]
) -> tuple[Array, tuple[Direction, ...]]:
    """Singular values (p,) of the relative sensitivity, falling, and the directions that the equations leave open.

    Args:
        theta: (9,) parameters, the free ones not zero.
        loads: of the cases; None for the unknown one.
    """
    sizes, rows = _singular(relative_sensitivity(theta, body, loads, free))
    return sizes, tuple(direction(free, theta, row, 0.0) for row in rows[_rank(sizes) :])


def cures(body: Body, theta: Array, loads: Sequence[Load | None], free: Sequence[str]) -> list[Cure]:
    """What one more piece of knowledge, another sensor, or one more load would do, the best first.

    Arguments are as in `open_directions`.
    """
    result = []
    for name in free:
        others = [other for other in free if other != name]
        if others and name not in ("m", "z_m"):
            result.append(_cure(f"know {name}", theta, body, loads, others, known=1))
    if not body.sensor_from_axis:
        fixed = replace(body, z_s=body.sensor(named(theta)["z_f"]), sensor_from_axis=True)
        text = "measure how far the accelerometer is from the rotation axis"
        result.append(_cure(text, theta, fixed, loads, free))
    for load, text in _further_loads(body, loads):
        result.append(_cure(text, theta, body, [*loads, load], free))
    return sorted(result, key=lambda cure: (-cure.rank, -cure.smallest))


def _cure(
    what: str, theta: Array, body: Body, loads: Sequence[Load | None], free: Sequence[str], known: int = 0
) -> Cure:
    sizes, _ = _singular(relative_sensitivity(theta, body, loads, free))
    return Cure(what=what, smallest=float(sizes[-1]), rank=_rank(sizes) + known)


def _further_loads(body: Body, loads: Sequence[Load | None]) -> list[tuple[Load, str]]:
    """One more known load: where there was one, near the rotation axis, and as far below it."""
    known = [load for load in loads if load is not None and load.mass_kg > 0]
    mass = max((load.mass_kg for load in known), default=0.02 * body.mass_kg)
    axis, top = body.z_g, min((load.z_m for load in known), default=body.z_s)
    places = {
        "at the same height" if known else "high up": top,
        "at half that height": (top + axis) / 2,
        "near the centre of mass": axis,
        "as far below the centre of mass": 2 * axis - top,
    }
    return [
        (
            Load(mass_kg=factor * mass, z_m=place),
            f"a run with a known load of {factor * mass:.3g} kg {words}, {abs(place):.3g} m "
            f"{'above' if place <= 0 else 'below'} the body origin",
        )
        for words, place in places.items()
        for factor in (1.0, 2.0)
    ]
