"""The only door to OMPL: shortest Dubins curves, free and among obstacles.

OMPL's (x, y, yaw) are taken as (north, east, heading): both turn from the first axis towards the second.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from expdesign.conventions import whole_turns
from expdesign.values import Array

ou.setLogLevel(ou.LogLevel.LOG_NONE)

SLICE = 300
"""Iterations between looks for a solution."""

Clear = Callable[[float, float], bool]
"""(north, east) -> whether the centre line may pass there."""


def dubins_curve(start: Array, end: Array, *, radius_m: float, spacing_m: float) -> Array:
    """(k, 3) poses along the shortest Dubins curve between two poses (3,), obstacles ignored."""
    space = ob.DubinsStateSpace(radius_m)
    states = [_state(space, start), _state(space, end)]
    length = space.distance(*states)
    middle = space.allocState()
    rows = []
    for share in np.linspace(0.0, 1.0, max(2, int(np.ceil(length / spacing_m)) + 1)):
        space.interpolate(*states, float(share), middle)
        rows.append((middle.getX(), middle.getY(), middle.getYaw()))
    return _continuous(rows, start[2])


def search_dubins(
    start: Array,
    end: Array,
    *,
    radius_m: float,
    spacing_m: float,
    low: Array,
    high: Array,
    clear: Clear,
    seed: int,
    slices: int = 12,
    improving: int = 2,
) -> Array | None:
    """(k, 3) poses along a short Dubins path that the checker accepts, or None when none is found.

    SORRT* is counted in iterations, not seconds, so the same seed gives the same path on any machine.

    Args:
        start, end: (3,) poses.
        radius_m: turning radius.
        spacing_m: between returned poses, and of the checks.
        low, high: (2,) north/east box to search.
        clear: point check; it is also asked about points outside the box.
        seed: of the sampler.
        slices: of `SLICE` iterations, at most.
        improving: slices spent after the first solution.
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
    setup.setStateValidityChecker(lambda state: clear(state.getX(), state.getY()))
    information.setStateValidityCheckingResolution(spacing_m / space.getMaximumExtent())
    setup.setStartAndGoalStates(_state(space, start), _state(space, end))
    setup.setPlanner(og.SORRTstar(information))
    # the planner reports a solution only between calls of solve, so it is called in slices and goes on where it was
    solved = 0
    for _ in range(slices):
        setup.solve(ob.PlannerTerminationCondition(_after(SLICE)))
        solved += bool(setup.haveExactSolutionPath())
        if solved > improving:
            break
    if not solved:
        return None
    path = setup.getSolutionPath()
    path.interpolate(max(2, int(np.ceil(path.length() / spacing_m)) + 1))
    return _continuous([(s.getX(), s.getY(), s.getYaw()) for s in path.getStates()], start[2])


def _after(iterations: int) -> Callable[[], bool]:
    """A condition that becomes true after being asked a number of times."""
    count = iter(range(iterations))
    return lambda: next(count, None) is None


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
