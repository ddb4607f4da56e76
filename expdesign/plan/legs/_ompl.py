"""The only module that uses OMPL: short paths in the plane, and shortest Dubins curves, free and among obstacles.

OMPL's (x, y, yaw) are taken as (north, east, heading): both turn from the first axis towards the second.

The state space of ships that turn on the spot is the plane: they point along their path, so a motion is a straight line
that keeps the clearance of such a hull. In SE(2), with turns on the spot at sampled headings, the same search took
three times as long and gave paths one per cent longer. BIT* is among the planners whose paths are right in Dubins'
space, where motions have a direction. A roadmap for many legs would keep the ends of those asked for before, so that a
leg would depend on their order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from expdesign.conventions import whole_turns
from expdesign.plan.legs.tuning import LEGS
from expdesign.plan.work_budget import WorkBudget
from expdesign.values import Array

ou.setLogLevel(ou.LogLevel.LOG_NONE)

PLANE, DUBINS = "ompl BITstar in R2", "ompl BITstar in Dubins"
"""What found a path, by its state space."""

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
    budget: WorkBudget | None = None,
) -> Array | None:
    """(k, 3) poses along a short Dubins path on which the swept hull is clear, or None when none is found.

    Its motions are checked by the hull they sweep, so every path it returns is clear as a whole, up to the spacing of
    poses.

    Args:
        start, end: (3,) poses.
        radius_m: turning radius.
        spacing_m: between returned poses, and between those of the checks.
        low, high: (2,) north/east box to search.
        holds: check of a whole motion; it is also asked about poses outside the box.
        seed: of the sampler.
        budget: counts the work.
    """
    space = ob.DubinsStateSpace(radius_m)
    space.setBounds(_bounds(low, high))

    def clear(first: ob.State, last: ob.State) -> bool:
        return holds(np.array(_curve(space, first, last, spacing_m)))

    ends = _state(space, start), _state(space, end)
    slices = (LEGS.search_slices, LEGS.search_iterations, LEGS.improving_slices)
    path = _search(space, ends, clear, seed=seed, slices=slices, budget=budget)
    if path is None:
        return None
    parts = [_curve(space, a, b, spacing_m) for a, b in pairwise(path.getStates())]
    return _continuous([parts[0][0], *(row for part in parts for row in part[1:])], start[2])


def search_plane(
    start: Array,
    end: Array,
    *,
    most_m: float,
    step_m: float,
    clear: Holds,
    seed: int,
    budget: WorkBudget | None = None,
) -> Array | None:
    """(k, 2) points of a short path between two points (2,), or None when none is found.

    The axes of the search point along and across the line between the ends, so the path turns with the chart.

    Args:
        start, end: (2,) north/east.
        most_m: length of paths to look for at most; the box of the ellipse round them is searched.
        step_m: by which bends are moved to shorten the path.
        clear: (2, 2) ends of a straight line -> whether it is clear.
        seed: of the sampler.
        budget: counts the work.
    """
    space = ob.RealVectorStateSpace(2)
    away_m = float(np.hypot(*(end - start)))
    ahead = (end - start) / away_m if away_m > 0 else np.array([1.0, 0.0])
    axes = np.array([ahead, [-ahead[1], ahead[0]]])
    spare_m, across_m = max(most_m - away_m, 0.0) / 2, np.sqrt(max(most_m**2 - away_m**2, 0.0)) / 2
    space.setBounds(_bounds(np.array([-spare_m, -across_m]), np.array([away_m + spare_m, across_m])))

    def points(states: Sequence[ob.State]) -> Array:
        return np.asarray(start + np.array([[state[0], state[1]] for state in states]) @ axes)

    def straight(first: ob.State, last: ob.State) -> bool:
        return clear(points((first, last)))

    ends = _point(space, np.zeros(2)), _point(space, np.array([away_m, 0.0]))
    slices = (LEGS.plane_slices, LEGS.plane_iterations, LEGS.plane_slices)
    path = _search(space, ends, straight, seed=seed, slices=slices, budget=budget, step_m=step_m)
    return None if path is None else points(path.getStates())


def _search(
    space: ob.StateSpace,
    ends: tuple[ob.State, ob.State],
    clear: Callable[[ob.State, ob.State], bool],
    *,
    seed: int,
    slices: tuple[int, int, int],
    budget: WorkBudget | None,
    step_m: float = 0.0,
) -> og.PathGeometric | None:
    """A path by BIT*, pulled taut, its bends moved by `step_m` if that is not zero; or None.

    BIT* is counted in iterations, not seconds, so the same seed gives the same path on any machine. It draws another
    batch of samples whenever no motion is left to try, and each batch costs more than the one before: a search that
    draws very many has no way on from one of its ends, and is given up. The planner reports a solution only between
    calls of solve, so it is called in slices and continues where it was: so many, of so many iterations, and so many
    more after the first solution.
    """
    ou.RNG.setSeed(seed)
    setup = og.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda state: True)  # every state of a path ends a motion, which is checked
    motions = _Motions(information, clear)
    information.setMotionValidator(motions)
    setup.setStartAndGoalStates(*ends)
    planner = og.BITstar(information)
    setup.setPlanner(planner)
    most, iterations, improving = slices
    solved = 0
    for _ in range(most):
        setup.solve(ob.PlannerTerminationCondition(_after(iterations, planner)))
        solved += bool(setup.haveExactSolutionPath())
        if solved > improving or _batches(planner) > LEGS.search_batches:
            break
    path = setup.getSolutionPath() if solved else None
    if path is not None:
        _shorten(og.PathSimplifier(information), path, step_m)
    if budget is not None:
        budget.searched(motions.checked)
    return path


def _shorten(simplifier: og.PathSimplifier, path: og.PathGeometric, step_m: float) -> None:
    """Pull a path taut: shortcuts, long ones first, bends moved, and bends left out that are not needed."""
    tries = LEGS.shortcut_tries if step_m else LEGS.curve_tries
    misses = int(LEGS.shortcut_misses * tries)
    simplifier.reduceVertices(path, tries, misses, 1.0)
    for _ in range(LEGS.shortening_rounds):
        for share in LEGS.shortcuts:
            simplifier.partialShortcutPath(path, tries, misses, share)
        if step_m:
            simplifier.perturbPath(path, step_m, tries, misses)
        simplifier.reduceVertices(path, tries, misses, LEGS.shortcuts[-2])


class _Motions(ob.MotionValidator):  # type: ignore[misc]
    """Motions that are valid as a whole; OMPL calls this class instead of checking points."""

    def __init__(self, information: ob.SpaceInformation, clear: Callable[[ob.State, ob.State], bool]) -> None:
        super().__init__(information)
        self._clear, self.checked = clear, 0

    def checkMotion(self, first: ob.State, last: ob.State, *_: object) -> bool:  # noqa: N802
        """Whether the motion from one state to another is clear."""
        self.checked += 1
        return self._clear(first, last)


def _bounds(low: Array, high: Array) -> ob.RealVectorBounds:
    bounds = ob.RealVectorBounds(2)
    for axis in range(2):
        bounds.setLow(axis, float(low[axis]))
        bounds.setHigh(axis, float(high[axis]))
    return bounds


def _point(space: ob.RealVectorStateSpace, point: Array) -> ob.State:
    state = space.allocState()
    state[0], state[1] = map(float, point)
    return state


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
