"""Escape check: whether a ship that sails arcs can leave its start and reach its goal, before anything is placed.

A berth in a basin narrower than the ship's turns has no such path, so the search for legs would be in vain.
"""

from __future__ import annotations

import heapq

import numpy as np

from expdesign.errors import NoPlan
from expdesign.plan.legs.water import LegWater
from expdesign.values import Array

ESCAPED_RADII = 2.5  # turning radii from a place at which a ship has escaped from it
ESCAPE_ARC_RAD = 0.35  # turn of one arc of the escape check; straights are as long
ESCAPE_CELL, ESCAPE_COURSES = 0.25, 12  # cells of its search: their size in turning radii, and courses to half a circle
ESCAPE_ARCS = 6000  # checked at most


def escapes(pose: Array, water: LegWater, *, backwards: bool = False) -> bool:
    """Whether arcs of the ship's turning radius and straights lead from a pose (3,) out of its surroundings.

    Best-first search over arcs, farthest from the pose first, with one arc to each cell of position and course. It ends
    with "no" after finitely many arcs, which a sampling planner does not; too coarse cells may miss a path.

    Args:
        pose: where the ship is.
        water: what the hull keeps to, and who sails.
        backwards: the path leads to the pose.
    """
    radius, start = water.ship.turning_radius_m, np.add(pose, (0.0, 0.0, np.pi * backwards))
    queue: list[tuple[float, int, Array]] = [(0.0, 0, start)]
    seen, count = set[tuple[int, ...]](), 0
    while queue and count < ESCAPE_ARCS:
        _, _, place = heapq.heappop(queue)
        for bend in (0.0, 1.0, -1.0):
            arc = _arc(place, bend / radius, ESCAPE_ARC_RAD * radius, water.vessel.length_m)
            key = _cell(arc[-1], radius)
            if key in seen:
                continue
            seen.add(key)
            count += 1
            if not water.holds(arc):
                continue
            away = float(np.hypot(*(arc[-1] - start)[:2]))
            if away > ESCAPED_RADII * radius:
                return True
            heapq.heappush(queue, (-away, count, arc[-1]))
    return False


def _arc(pose: Array, curvature: float, length_m: float, hull_m: float) -> Array:
    """(k, 3) poses along an arc or a straight from a pose (3,)."""
    along = np.linspace(0.0, length_m, int(np.ceil(3 * length_m / hull_m)) + 1)
    half = curvature * along / 2
    chord = along * np.sinc(half / np.pi)
    course = pose[2] + half
    return np.column_stack([pose[0] + chord * np.cos(course), pose[1] + chord * np.sin(course), pose[2] + 2 * half])


def _cell(pose: Array, radius: float) -> tuple[int, ...]:
    share, courses = ESCAPE_CELL, ESCAPE_COURSES
    course = round(float(pose[2]) / np.pi * courses) % (2 * courses)
    return round(float(pose[0]) / (share * radius)), round(float(pose[1]) / (share * radius)), course


def check_ends(start: Array, goal: Array, water: LegWater) -> None:
    """Raise NoPlan where a ship that sails arcs cannot depart from its start, or reach its goal.

    Args:
        start, goal: (3,) poses.
        water: as of the plan.
    """
    for name, pose, backwards, to in (("start", start, False, "from"), ("goal", goal, True, "to")):
        if not escapes(pose, water, backwards=backwards):
            lat, lon = water.area.frame.to_degrees(pose[:2])
            raise NoPlan(
                f"no path was found {to} the {name}, near {lat:.5f}, {lon:.5f} and heading "
                f"{np.degrees(pose[2]) % 360.0:.0f} degrees, on turns of {water.ship.turning_radius_m:.3g} m radius, "
                f"which vessel {water.vessel.name!r} sails at {water.ship.transit_speed_mps:.3g} m/s, with "
                f"{water.clearance_m:g} m of clearance",
                what="berth",
                which=name,
                place=pose[:2],
            )
