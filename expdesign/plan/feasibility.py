"""Whether a run has a place in the water at all, and whether a ship under way gets out of its start.

Places are sought by branch and bound over places and headings. The tests are those of the search for places, with a
slack for the places and headings between those looked at: where none passes with the slack, none passes anywhere, and
the search would be in vain.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from expdesign.errors import NoPlan, NoRoom
from expdesign.plan.legs import LegTask, LegWater
from expdesign.plan.local_planner import LocalPlanner, RunSpace, moved
from expdesign.plan.search import have_room
from expdesign.plan.values import PlanProblem, WorkBudget
from expdesign.values import Array

# places and headings at which a run is tried first, before boxes round them are halved
FIRST_PLACES, FIRST_HEADINGS = 2000, 24
FIRST_TRIES = 500  # poses drawn among these and tried before all others: in wide water one of them has room
BOXES = 400_000  # of places and headings at most; with more of them it stays open whether the run has a place
LEAST_SLACK_CELLS = 3.0  # slack in cells of the clearance grid at which that stays open, too
# distances in hull lengths, and bearings off the course, at which a ship that starts under way is tried to stop
STOP_HULLS = (16.0, 8.0, 4.0, 2.0)
STOP_BENDS_RAD = (0.0, 0.6, -0.6, 1.2, -1.2)
LOOKUPS = 200_000  # clearances looked up at a time
LEG_S = 40.0  # work budget of one leg [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """Where a run has room."""

    pose: Array | None = None  # (3,) a start pose with room for the run, or None where none was found
    impossible: bool = False  # whether there surely is none


def place_of(space: RunSpace, index: int) -> Fit:
    """A place for one of the space's runs, taken by itself: legs to and from it are not looked at."""
    run = space.footprints[index]
    points = np.vstack([run.discs, (0.0, 0.0), run.displacement[:2]])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    reach_m = float(np.hypot(*(points - middle).T).max())
    half_m, half_rad, whole = _first_half_m(space), np.pi / FIRST_HEADINGS, True
    boxes = _first_boxes(space, half_m)
    outline = _outline(run.discs)
    back = np.array([-middle[0], -middle[1], 0.0])
    spread = moved(np.random.default_rng(0).choice(boxes, min(FIRST_TRIES, len(boxes)), replace=False), back)
    found = _first_clear(space, index, spread)
    while found is None:
        slack_m = np.sqrt(2.0) * (half_m + space.field.cell_m) + reach_m * half_rad
        poses = moved(boxes, back)
        for some in (outline, np.arange(len(run.discs))):
            part = replace(run, discs=run.discs[some], times_s=run.times_s[some], room_m=run.room_m[some] - slack_m)
            looser = replace(space, footprints=(part,), leg_margin_m=space.leg_margin_m - slack_m)
            kept = np.concatenate([np.zeros(0, dtype=bool), *(clear for _, clear in _clear(looser, 0, poses))])
            boxes, poses = boxes[kept], poses[kept]
        if not len(boxes):
            return Fit(impossible=whole)
        found = _first_clear(space, index, poses)
        if found is not None or slack_m < LEAST_SLACK_CELLS * space.field.cell_m:
            break
        most = BOXES // 8
        whole, boxes = whole and len(boxes) <= most, boxes[:: -(-len(boxes) // most)]
        half_m, half_rad = half_m / 2, half_rad / 2
        boxes = np.concatenate([boxes + np.multiply(step, (half_m, half_m, half_rad)) for step in _CORNERS])
    return Fit(pose=found)


_CORNERS = tuple((north, east, turn) for north in (-1, 1) for east in (-1, 1) for turn in (-1, 1))


def _first_half_m(space: RunSpace) -> float:
    """Half the side of the boxes of places looked at first [m]."""
    rows, columns = space.field.clearance_m.shape
    return space.field.cell_m * max(1.0, math.sqrt(rows * columns / FIRST_PLACES) / 2)


def _first_boxes(space: RunSpace, half_m: float) -> Array:
    """(n, 3) middles of boxes of places and headings that cover the grid."""
    low = space.field.origin
    north, east = (
        np.arange(first + half_m, first + count * space.field.cell_m + half_m, 2 * half_m)
        for first, count in zip(low, space.field.clearance_m.shape, strict=True)
    )
    turn = (np.arange(FIRST_HEADINGS) + 0.5) * 2 * np.pi / FIRST_HEADINGS
    return np.stack(np.meshgrid(north, east, turn, indexing="ij"), axis=-1).reshape(-1, 3)


def _outline(discs: Array) -> np.ndarray:
    """Indices of the discs (n, 2) that reach farthest in eight directions: they rule most places out."""
    angles = np.arange(8) * np.pi / 4
    return np.unique((discs @ np.stack([np.cos(angles), np.sin(angles)])).argmax(axis=0))


def _clear(space: RunSpace, index: int, poses: Array) -> Iterator[tuple[Array, np.ndarray]]:
    """Poses (n, 3), some at a time, and whether a run from them keeps its margins."""
    at_once = max(1, LOOKUPS // len(space.footprints[index].discs))
    for first in range(0, len(poses), at_once):
        some = poses[first : first + at_once]
        yield some, have_room(space, np.full(len(some), index), some)


def _first_clear(space: RunSpace, index: int, poses: Array) -> Array | None:
    """The first of the poses (n, 3) from which a run keeps its margins."""
    return next((some[clear][0] for some, clear in _clear(space, index, poses) if clear.any()), None)


def without_room(space: RunSpace, *, strict: bool = False) -> NoRoom | None:
    """The refusal where a run surely has no place; with `strict` also where none was found. None where all have one."""
    fits = [place_of(space, index) for index in range(len(space.footprints))]
    lacking = [fit.impossible or (strict and fit.pose is None) for fit in fits]
    names = tuple(run.name for run, lacks in zip(space.footprints, lacking, strict=True) if lacks)
    if not names:
        return None
    run = max((item for item in space.footprints if item.name in names), key=lambda item: _size_m(item.discs))
    row, column = np.unravel_index(int(space.field.clearance_m.argmax()), space.field.clearance_m.shape)
    widest = space.field.origin + space.field.cell_m * np.array([row, column])
    lat, lon = space.frame.to_degrees(widest)
    others = f", nor do {', '.join(map(repr, sorted(set(names) - {run.name})))}" if len(names) > 1 else ""
    error = NoRoom(
        f"no room for {run.name!r}: {run.needs}; it fits nowhere in the water that can be reached, at any "
        f"heading{others}; the shore is farthest near {lat:.5f}, {lon:.5f}, {space.field.clearance_m.max():.4g} m",
        what="room",
        which=run.name,
        place=widest,
    )
    error.lacking = names
    return error


def without_way_out(problem: PlanProblem, water: LegWater, planner: LocalPlanner) -> NoPlan | None:
    """The refusal where a ship that starts under way was not found to stop anywhere near; None where it can.

    Stops are tried ahead and to both sides, the farthest first; nothing is proved.
    """
    if problem.under_way is None:
        return None
    rest = np.zeros(len(problem.vessel.limits))
    for end in _stops(problem):
        task = LegTask(
            start=problem.begin,
            end=problem.at_rest(end),
            start_inputs=problem.standing,
            end_inputs=rest,
            seed=problem.seed,
            before=problem.standing[None],
            budget=WorkBudget(most_s=LEG_S),
        )
        if water.holds(end[None]) and planner.leg(task, water) is not None:
            return None
    lat, lon = problem.area.frame.to_degrees(problem.start[:2])
    u, v, r = problem.under_way.velocity.tolist()
    return NoPlan(
        f"the ship was not found to come to a stop in safe water from its start near {lat:.5f}, {lon:.5f} at "
        f"start.u_mps = {u:.3g}, start.v_mps = {v:.3g}, start.r_radps = {r:.3g}",
        what="start",
        which="start",
        place=problem.start[:2],
        remedy="not tried: a slower start, one farther from the shore, or replan --stopped",
    )


def _stops(problem: PlanProblem) -> Iterator[Array]:
    """(3,) poses to stop at, the farthest first; headed as the ship would be on an arc that leads there."""
    course = problem.start[2] + float(np.arctan2(*problem.begin[4:2:-1]))
    for hulls in STOP_HULLS:
        for bend in STOP_BENDS_RAD:
            step = hulls * problem.vessel.length_m * np.array([np.cos(course + bend), np.sin(course + bend)])
            yield np.array([*(problem.start[:2] + step), problem.start[2] + 2 * bend])


def _size_m(discs: Array) -> float:
    north, east = np.ptp(discs, axis=0).tolist()
    return math.hypot(north, east)
