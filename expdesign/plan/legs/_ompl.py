"""The only module that uses OMPL: roadmaps of the plane, and shortest Dubins curves, free and among obstacles.

OMPL's (x, y, yaw) are taken as (north, east, heading): both turn from the first axis towards the second.

Ships that turn on the spot point along their path, so their state space is the plane: a motion is a straight line that
keeps the clearance of such a hull. In SE(2), with turns at sampled headings, a search took three times as long for
paths one per cent longer. All legs of a plan share a roadmap, which their ends do not become part of: a path depends on
its ends and the water only, in whichever order and process it is asked for. Ships with a radius of turn sail Dubins
curves, and search with BIT* where the shortest is not clear: roadmaps ignore that motions have a direction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
import scipy
import shapely
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from expdesign.conventions import whole_turns
from expdesign.plan.chart import KEPT_GRAPHS, Corners, Roadmap, opened, shore_corners, simplified
from expdesign.values import Array

# iterations of the path planner between looks for a solution, and how often at most
SEARCH_ITERATIONS, SEARCH_SLICES = 1500, 4
SEARCH_BATCHES = 100  # batches of samples after which it gives up
IMPROVING_SLICES = 1  # spent on a shorter path after the first solution
ROADMAP_PLACES = 500  # drawn for a roadmap besides the shores' corners, in `ROADMAP_TRIES` tries at most
ROADMAP_TRIES = 50_000
# shares of a path that shortcuts span, tried one after the other, `SHORTCUT_TRIES` of each at most, and no more after
# `SHORTCUT_MISSES` without a gain
SHORTCUTS = (1.0, 0.3, 0.1, 0.03)
SHORTCUT_TRIES = 200
SHORTCUT_MISSES = 60


ou.setLogLevel(ou.LogLevel.LOG_NONE)

PLANE, CURVE, DUBINS = "ompl PRMstar in R2", "ompl Dubins curve", "ompl BITstar in Dubins"
"""What finds paths, and in which space."""

Holds = Callable[[Array], bool]
"""(k, 3) poses -> whether the hull may sweep from each to the next."""


@lru_cache(maxsize=KEPT_GRAPHS)
def roadmap_of(water: shapely.MultiPolygon, tolerance_m: float, corners: Corners) -> Roadmap:
    """A roadmap by PRM* of the water that `visibility_graph_of` takes.

    It grows with n log n of the corners, the graph with their square: with 750 corners it takes 0.45 s and the graph
    0.13 s, with 4,500 3 s and 10 s. Its paths, pulled taut, are mostly the shortest: between random places of seven
    charts at most 0.8 % longer.
    """
    simple = simplified(water, grow=False, tolerance_m=tolerance_m, corners=corners)
    bends, wet = shore_corners(simple)[0], opened(simple)
    if not len(bends):
        return Roadmap(water=wet, corners=bends, lengths=scipy.sparse.csr_matrix((0, 0)))
    data = _roadmap_data(_plane(wet), bends)
    count = data.numVertices()
    places = _places([data.getVertex(k).getState() for k in range(count)])
    pairs = [(k, other) for k in range(count) for other in data.getEdges(k) if other > k]  # listed in both directions
    tail, head = np.array(pairs, dtype=int).reshape(-1, 2).T
    away = np.hypot(*(places[tail] - places[head]).T)
    lengths = scipy.sparse.coo_matrix((away, (tail, head)), shape=(count, count)).tocsr()
    return Roadmap(water=wet, corners=places, lengths=lengths)


def _roadmap_data(information: ob.SpaceInformation, bends: Array) -> ob.PlannerData:
    """Places that PRM* joined to their neighbours: corners (n, 2), where short paths bend, and some that it draws.

    Neighbours of a corner are mostly on its own shore, so that paths over corners alone were up to 8 % longer than the
    shortest; over drawn places alone up to 25 %. Places are counted, not seconds: a roadmap is the same on any machine.
    """
    query, planner = ob.ProblemDefinition(information), og.PRMstar(information)
    for bend in bends:  # PRM takes given places only as starts and goals of a query
        query.addStartState(_place(information, bend))
    query.setGoalState(_place(information, bends[0]))
    planner.setProblemDefinition(query)
    planner.setup()
    planner.solve(ob.plannerAlwaysTerminatingCondition())
    tries = iter(range(ROADMAP_TRIES))
    most = planner.milestoneCount() + ROADMAP_PLACES
    enough = ob.PlannerTerminationCondition(lambda: planner.milestoneCount() >= most or next(tries, None) is None)
    planner.growRoadmapPtc(enough)
    data = ob.PlannerData(information)
    planner.getPlannerData(data)
    data.decoupleFromPlanner()  # whose states would go with it
    return data


def shortened(path: Array, water: shapely.MultiPolygon) -> Array:
    """(k, 2) a path of straight lines through a water, pulled taut by OMPL's shortcuts, long ones first."""
    information = _plane(water)
    simplifier, taut = og.PathSimplifier(information), og.PathGeometric(information)
    for point in path:
        taut.append(_place(information, point))
    tries, misses = SHORTCUT_TRIES, SHORTCUT_MISSES
    simplifier.reduceVertices(taut, tries, misses, 1.0)
    for share in SHORTCUTS:
        simplifier.partialShortcutPath(taut, tries, misses, share)
    simplifier.reduceVertices(taut, tries, misses, 1.0)
    return _places(taut.getStates())


def _plane(water: shapely.MultiPolygon) -> ob.SpaceInformation:
    """The plane, with straight lines through a prepared water for motions, and the same samples every time."""
    ou.RNG.setSeed(1)
    space = ob.RealVectorStateSpace(2)
    west, south, east, north = water.bounds
    space.setBounds(_bounds((south, west), (north, east)))
    information = ob.SpaceInformation(space)

    def clear(first: ob.State, last: ob.State) -> bool:
        line = shapely.linestrings(((first[1], first[0]), (last[1], last[0])))
        return bool(shapely.covers(water, line))

    information.setStateValidityChecker(lambda state: bool(shapely.intersects_xy(water, state[1], state[0])))
    information.setMotionValidator(_Motions(information, clear))
    information.setup()
    return information


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
    """
    ou.RNG.setSeed(seed)
    space = ob.DubinsStateSpace(radius_m)
    space.setBounds(_bounds(low, high))

    def clear(first: ob.State, last: ob.State) -> bool:
        return holds(np.array(_curve(space, first, last, spacing_m)))

    setup = og.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda state: True)  # every pose of a path ends a motion, which is checked
    information.setMotionValidator(_Motions(information, clear))
    setup.setStartAndGoalStates(_state(space, start), _state(space, end))
    planner = og.BITstar(information)
    setup.setPlanner(planner)
    # the planner reports a solution only between calls of solve, so it is called in slices and continues where it was
    solved = 0
    for _ in range(SEARCH_SLICES):
        setup.solve(ob.PlannerTerminationCondition(_after(SEARCH_ITERATIONS, planner)))
        solved += bool(setup.haveExactSolutionPath())
        if solved > IMPROVING_SLICES or _batches(planner) > SEARCH_BATCHES:
            break
    if not solved:
        return None
    states = setup.getSolutionPath().getStates()
    parts = [_curve(space, a, b, spacing_m) for a, b in pairwise(states)]
    return _continuous([parts[0][0], *(row for part in parts for row in part[1:])], start[2])


class _Motions(ob.MotionValidator):  # type: ignore[misc]
    """Motions that are clear as a whole; OMPL calls this class instead of checking points."""

    def __init__(self, information: ob.SpaceInformation, clear: Callable[[ob.State, ob.State], bool]) -> None:
        super().__init__(information)
        self._clear = clear

    def checkMotion(self, first: ob.State, last: ob.State, *_: object) -> bool:  # noqa: N802
        """Whether the motion from one state to another is clear."""
        return self._clear(first, last)


def _bounds(low: Sequence[float] | Array, high: Sequence[float] | Array) -> ob.RealVectorBounds:
    bounds = ob.RealVectorBounds(2)
    for axis in range(2):
        bounds.setLow(axis, float(low[axis]))
        bounds.setHigh(axis, float(high[axis]))
    return bounds


def _place(information: ob.SpaceInformation, point: Array) -> ob.State:
    state = information.getStateSpace().allocState()
    state[0], state[1] = map(float, point)
    return state


def _places(states: Sequence[ob.State]) -> Array:
    """(k, 2) of states in the plane."""
    return np.array([(state[0], state[1]) for state in states])


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
    return lambda: next(count, None) is None or _batches(planner) > SEARCH_BATCHES


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
