"""The only module that uses OMPL: shortest Dubins curves, free and among obstacles.

OMPL's (x, y, yaw) are taken as (north, east, heading): both turn from the first axis towards the second.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from expdesign.conventions import whole_turns
from expdesign.plan.legs.tuning import LEGS
from expdesign.values import Array

ou.setLogLevel(ou.LogLevel.LOG_NONE)

Holds = Callable[[Array], bool]
"""(k, 3) poses -> whether the hull may sweep from each to the next."""


def dubins_curve(start: Array, end: Array, *, radius_m: float, spacing_m: float) -> Array:
    """(k, 3) poses along the shortest Dubins curve between two poses (3,), obstacles ignored."""
    space = ob.DubinsStateSpace(radius_m)
    return _continuous(_curve(space, _state(space, start), _state(space, end), spacing_m), start[2])


def search_dubins(
    start: Array,
    end: Array,
    *,
    radius_m: float,
    spacing_m: float,
    low: Array,
    high: Array,
    holds: Holds,
    seed: int,
) -> Array | None:
    """(k, 3) poses along a short Dubins path on which the swept hull is clear, or None when none is found.

    BIT* is counted in iterations, not seconds, so the same seed gives the same path on any machine. It draws another
    batch of samples whenever no motion is left to try, and each batch costs more than the one before: a search that
    draws very many has no way on from one of its ends, and is given up. Its motions are checked by the hull they sweep,
    so every path it returns is clear as a whole, up to the spacing of poses.

    Args:
        start, end: (3,) poses.
        radius_m: turning radius.
        spacing_m: between returned poses, and between those of the checks.
        low, high: (2,) north/east box to search.
        holds: check of a whole motion; it is also asked about poses outside the box.
        seed: of the sampler.
    """
    ou.RNG.setSeed(seed)
    space = ob.DubinsStateSpace(radius_m)
    bounds = ob.RealVectorBounds(2)
    for axis in range(2):
        bounds.setLow(axis, float(low[axis]))
        bounds.setHigh(axis, float(high[axis]))
    space.setBounds(bounds)
    setup = og.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda state: True)  # every pose of a path ends a motion, which is checked
    information.setMotionValidator(_SweptHull(information, space, holds, spacing_m))
    setup.setStartAndGoalStates(_state(space, start), _state(space, end))
    planner = og.BITstar(information)
    setup.setPlanner(planner)
    # the planner reports a solution only between calls of solve, so it is called in slices and continues where it was
    solved = 0
    for _ in range(LEGS.search_slices):
        setup.solve(ob.PlannerTerminationCondition(_after(LEGS.search_iterations, planner)))
        solved += bool(setup.haveExactSolutionPath())
        if solved > LEGS.improving_slices or _batches(planner) > LEGS.search_batches:
            break
    if not solved:
        return None
    states = setup.getSolutionPath().getStates()
    parts = [_curve(space, a, b, spacing_m) for a, b in pairwise(states)]
    return _continuous([parts[0][0], *(row for part in parts for row in part[1:])], start[2])


class _SweptHull(ob.MotionValidator):  # type: ignore[misc]
    """Motions are valid where the hull that they sweep is clear; OMPL calls this class instead of checking points."""

    def __init__(
        self, information: ob.SpaceInformation, space: ob.DubinsStateSpace, holds: Holds, spacing_m: float
    ) -> None:
        super().__init__(information)
        self._space, self._holds, self._spacing_m = space, holds, spacing_m

    def checkMotion(self, first: ob.State, last: ob.State, *_: object) -> bool:  # noqa: N802
        """Whether the Dubins curve from one state to another is clear."""
        return self._holds(np.array(_curve(self._space, first, last, self._spacing_m)))


def _curve(
    space: ob.DubinsStateSpace, first: ob.State, last: ob.State, spacing_m: float
) -> list[tuple[float, float, float]]:
    """Poses along the Dubins curve between two states, evenly spaced."""
    count, middle, rows = max(2, int(np.ceil(space.distance(first, last) / spacing_m)) + 1), space.allocState(), []
    for share in np.linspace(0.0, 1.0, count).tolist():
        space.interpolate(first, last, share, middle)
        rows.append((middle.getX(), middle.getY(), middle.getYaw()))
    return rows


def _after(iterations: int, planner: og.BITstar) -> Callable[[], bool]:
    """A condition that becomes true after being asked a number of times, or when too many batches were drawn."""
    count = iter(range(iterations))
    return lambda: next(count, None) is None or _batches(planner) > LEGS.search_batches


def _batches(planner: og.BITstar) -> int:
    """Batches of samples that the planner has drawn."""
    return int(planner.numBatches())


def _state(space: ob.DubinsStateSpace, pose: Array) -> ob.State:
    state = space.allocState()
    state.setX(float(pose[0]))
    state.setY(float(pose[1]))
    state.setYaw(float((pose[2] + np.pi) % (2 * np.pi) - np.pi))
    return state


def _continuous(rows: list[tuple[float, float, float]], heading_rad: float) -> Array:
    """Poses with a heading that does not jump and begins at the given turn of the circle."""
    poses = np.array(rows)
    poses[:, 2] = np.unwrap(poses[:, 2])
    poses[:, 2] += whole_turns(heading_rad - poses[0, 2])
    return poses
