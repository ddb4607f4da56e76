"""Independent verification: from the chart, the vessel, the commands and the track, not from how the plan was made.

It shares the equations of motion and the hull's outline with the planner, but none of its grids, margins or paths.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import shapely

from expdesign.conventions import wrap_angle
from expdesign.dictionary import Primitive
from expdesign.plan.area import SeaArea
from expdesign.plan.footprint import hull_polygons
from expdesign.plan.values import Leg, Verification
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Environment, simulate, to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel

FINE_SUBSTEPS = 10
"""Integrator steps per sample of the re-simulation."""
ENTRY_TOLERANCE = 0.02
"""Largest deviation of a run's entry velocity, relative to the vessel's speed in the plan."""


def verify_plan(
    vessel: Vessel,
    area: SeaArea,
    environment: Environment,
    *,
    commands: Commands,
    trajectory: Trajectory,
    legs: Sequence[Leg],
    clearance_m: float,
    primitives: Mapping[str, Primitive],
    repeats: Mapping[str, int],
    start: Array,
    goal: Array,
) -> Verification:
    """Re-simulate the commands ten times finer and check motion, hull, limits, runs, entry states, start and goal.

    The hull is checked on the track and on the re-simulated motion.

    Args:
        vessel, environment: the nominal model and the forecast's means.
        area: allowed water.
        commands, trajectory, legs: the plan.
        clearance_m: promised distance from hull to forbidden water.
        primitives: the dictionary by name.
        repeats: how often each is to be run.
        start, goal: (3,) poses where the ship is to begin and end at rest through the water.
    """
    again = simulate(
        vessel,
        commands,
        pose=trajectory.pose[0],
        velocity=trajectory.velocity[0],
        environment=environment,
        substeps=FINE_SUBSTEPS,
    )
    clearance = np.minimum(*(hull_clearance(area, track, vessel.hull_b) for track in (trajectory, again)))
    worst = int(np.argmin(clearance))
    excess, excess_signal = _limit_excess(vessel, commands)
    problems = [
        *_motion_problems(vessel, trajectory, again),
        *_end_problems(vessel, environment, trajectory, start, goal),
        *_if(
            bool(clearance[worst] < clearance_m - 1e-6),
            f"the hull is {clearance[worst]:.2f} m from forbidden water, promised {clearance_m:g} m, "
            f"at {worst * commands.sample_time_s:.0f} s, {_place(area, trajectory.pose[worst])}",
        ),
        *_if(excess > 1e-6, f"{excess_signal} passes its limit or rate by {excess:.2g} of its range"),
        *_run_problems(commands, legs, primitives, repeats),
        *_entry_problems(environment, trajectory, legs, primitives),
    ]
    return Verification(
        clearance_min_m=float(clearance[worst]),
        clearance_time_s=worst * commands.sample_time_s,
        reproduction_error_m=float(np.hypot(*(again.pose - trajectory.pose)[:, :2].T).max()),
        limit_excess=excess,
        problems=tuple(problems),
    )


def hull_clearance(area: SeaArea, trajectory: Trajectory, hull_b: Array) -> Array:
    """(k,) distance from the hull to forbidden water [m], negative by the hull's share outside times its length.

    Each sample's polygon spans the hull at this sample and the next, so nothing is passed between samples.
    """
    hulls = hull_polygons(trajectory.pose, hull_b)
    corners = shapely.get_coordinates(hulls).reshape(len(hulls), -1, 2)
    spans = shapely.convex_hull(shapely.multipoints(np.concatenate([corners[:-1], corners[1:]], axis=1)))
    spans = np.append(spans, hulls[-1])
    water = area.water
    shapely.prepare(water)
    inside = shapely.contains_properly(water, spans)
    shore = shapely.get_parts(shapely.boundary(water))
    pieces = np.concatenate([_pieces(line) for line in shore])
    tree = shapely.STRtree(pieces)
    (which, _), distances = tree.query_nearest(spans, return_distance=True, all_matches=False)
    clearance: Array = np.empty(len(spans))
    clearance[which] = distances
    outside = ~inside
    clearance[outside] = -np.sqrt(shapely.area(shapely.difference(spans[outside], water)))
    return clearance


def _pieces(line: shapely.Geometry) -> np.ndarray:
    """A closed boundary as its segments."""
    points = shapely.get_coordinates(line)
    return np.asarray(shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1)))


def _motion_problems(vessel: Vessel, trajectory: Trajectory, again: Trajectory) -> list[str]:
    """Where the track is not the motion that the commands give."""
    sailed, speed = _sailed(trajectory), np.abs(again.velocity).max(axis=0) + 1e-9
    found = (
        ("m", np.hypot(*(again.pose - trajectory.pose)[:, :2].T), np.maximum(vessel.length_m / 30, 0.001 * sailed)),
        ("rad of heading", np.abs(again.pose - trajectory.pose)[:, 2], np.full(len(sailed), 0.02)),
        ("of the largest speed", (np.abs(again.velocity - trajectory.velocity) / speed).max(axis=1), 0.02 + 0 * sailed),
    )
    problems = []
    for what, apart, allowed in found:
        worst = int(np.argmax(apart - allowed))
        if apart[worst] > allowed[worst]:
            problems.append(
                f"the re-simulated commands are {apart[worst]:.3g} {what} off the track at "
                f"{worst * trajectory.sample_time_s:.0f} s, allowed {allowed[worst]:.3g}"
            )
    return problems


def _end_problems(
    vessel: Vessel, environment: Environment, trajectory: Trajectory, start: Array, goal: Array
) -> list[str]:
    """How the plan's ends differ from start and goal, at rest through the water."""
    problems = []
    for name, pose, index in (("start", start, 0), ("goal", goal, -1)):
        place, velocity = trajectory.pose[index], trajectory.velocity[index]
        off_m = float(np.hypot(*(place - pose)[:2]))
        turned = abs(float(wrap_angle(place[2] - pose[2])))
        u_c, v_c = to_body(environment.current_to, place[2], NUMPY)
        moving = float(np.hypot(velocity[0] - u_c, velocity[1] - v_c))
        slow = ENTRY_TOLERANCE * float(np.hypot(*trajectory.velocity[:, :2].T).max())
        if off_m > vessel.length_m / 30 or turned > ENTRY_TOLERANCE or moving > slow:
            problems.append(
                f"the plan is {off_m:.2f} m and {turned:.3f} rad off the {name}, at {moving:.3f} m/s through the water"
            )
    return problems


def _sailed(trajectory: Trajectory) -> Array:
    return np.asarray(np.r_[0.0, np.cumsum(np.hypot(*np.diff(trajectory.pose[:, :2], axis=0).T))])


def _limit_excess(vessel: Vessel, commands: Commands) -> tuple[float, str]:
    """The largest violation of a limit or a rate relative to the signal's range, and the signal."""
    worst, where = 0.0, ""
    for name, limit, values in zip(commands.names, vessel.limits, commands.values.T, strict=True):
        span = limit.high - limit.low if np.isfinite(limit.high - limit.low) else 2 * np.pi
        over = max(float((values - limit.high).max()), float((limit.low - values).max()))
        first = [] if name.startswith("a") else [0.0]  # everything but an angle begins at rest
        steps = np.abs(np.diff([*first, *values])).max(initial=0.0) - limit.rate * commands.sample_time_s
        relative = max(over, float(steps)) / span
        if relative > worst:
            worst, where = relative, name
    return worst, where


def _run_problems(
    commands: Commands, legs: Sequence[Leg], primitives: Mapping[str, Primitive], repeats: Mapping[str, int]
) -> list[str]:
    problems = []
    done = Counter(leg.name for leg in legs if leg.kind == "primitive")
    for name in {*done, *repeats}:
        if done[name] != repeats.get(name, 0):
            problems.append(f"{name!r} is run {done[name]} times, the durations ask for {repeats.get(name, 0)}")
    for leg in legs:
        if leg.kind == "primitive":
            apart = commands.values[leg.first : leg.last] - primitives[leg.name].commands.values
            turns = 2 * np.pi * np.round(apart[0] / (2 * np.pi)) * [name.startswith("a") for name in commands.names]
            if np.abs(apart - turns).max() > 1e-9:
                problems.append(f"the commands of {leg.name!r} at sample {leg.first} are not the dictionary's")
    if [leg.first for leg in legs[1:]] != [leg.last for leg in legs[:-1]] or legs[-1].last != len(commands):
        problems.append("the legs do not follow each other without gaps")
    return sorted(problems)


def _entry_problems(
    environment: Environment, trajectory: Trajectory, legs: Sequence[Leg], primitives: Mapping[str, Primitive]
) -> list[str]:
    problems = []
    scale = np.abs(trajectory.velocity).max(axis=0) + 1e-9
    for leg in legs:
        if leg.kind == "primitive":
            u_c, v_c = to_body(environment.current_to, trajectory.pose[leg.first, 2], NUMPY)
            off = trajectory.velocity[leg.first] - [u_c, v_c, 0.0] - primitives[leg.name].entry_velocity
            if (np.abs(off) > ENTRY_TOLERANCE * scale).any():
                share = np.abs(off / scale).max()
                problems.append(f"{leg.name!r} at sample {leg.first} begins {share:.1%} off its entry")
    return problems


def _place(area: SeaArea, pose: Array) -> str:
    lat, lon = area.frame.to_degrees(pose[:2])
    return f"near {lat:.5f}, {lon:.5f}"


def _if(wrong: bool, sentence: str) -> tuple[str, ...]:
    return (sentence,) if wrong else ()
