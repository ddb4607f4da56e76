"""Independent verification from the chart, the vessel, the commands and the track alone, and what the track informs.

It shares the equations of motion and the hull's outline with the planner, but none of its grids, margins or paths. It
imports nothing of the planner but its values. Transits inform too, so information is that of the whole trajectory.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import shapely

from expdesign.conventions import wrap_angle
from expdesign.dictionary import Primitive
from expdesign.durations import Collected, DurationDesign, DurationProblem, bordered_moments
from expdesign.errors import NotInformative
from expdesign.information import moments, regressor_rows
from expdesign.information.disturbed import beside_current, bordered_by_current, current_rows
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.plan.resimulation import resimulated
from expdesign.plan.values import Leg, SailedTrial, UnderWay, Verification
from expdesign.sea_area import SeaArea
from expdesign.signals import AUXILIARY, Commands, Trajectory
from expdesign.simulation import Environment, delivered, to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel
from expdesign.vessel.vessel import hull_polygons

ENTRY_TOLERANCE = 0.02  # largest deviation of a run's entry velocity, relative to the vessel's speed in the plan
# share by which legs may exceed their stated speed, or that of their faster end: plans limit it at some samples
SPEED_TOLERANCE = 0.03


def verify_plan(
    vessel: Vessel,
    area: SeaArea,
    environment: Environment,
    sailed: SailedTrial,
    *,
    clearance_m: float,
    transit_mps: float,
    primitives: Mapping[str, Primitive],
    repeats: Mapping[str, int],
    start: Array,
    goal: Array,
    under_way: UnderWay | None = None,
) -> Verification:
    """Re-simulate the commands ten times finer and check motion, hull, limits, speeds, runs, entries and ends.

    The hull is checked on the track and on the re-simulated motion.

    Args:
        vessel, environment: the nominal model and the forecast's means.
        clearance_m: required distance from hull to forbidden water.
        transit_mps: stated speed of legs through water.
        repeats: how often each is to be run.
        start, goal: (3,) poses where the ship is to begin, and to end at rest through the water.
        under_way: motion at the start and commands standing there; None for rest and zeros.
    """
    commands, trajectory, legs = sailed.commands, sailed.trajectory, sailed.legs
    misfit = _legs_problems(commands, legs, primitives)
    anew = resimulated(vessel, environment, sailed, transit_mps=transit_mps)
    again = anew.motion
    clearance = np.minimum(*(hull_clearance(area, track, vessel.hull_b) for track in (trajectory, again)))
    worst = int(np.argmin(clearance))
    standing = np.zeros(len(vessel.limits)) if under_way is None else under_way.inputs
    excess, excess_signal = _limit_excess(vessel, commands, standing)
    begin = None if under_way is None else under_way.velocity
    heel = None if again.auxiliary is None else np.abs(again.auxiliary[:, AUXILIARY.index("roll_rad")])
    problems = [
        *anew.problems(vessel.length_m),
        *_end_problems(vessel, environment, trajectory, (start, goal), begin),
        *_end_problems(vessel, environment, again, (start, goal), begin, "re-simulated "),
        *_if(
            bool(clearance[worst] < clearance_m - 1e-6),
            f"the hull is {clearance[worst]:.2f} m from forbidden water, required {clearance_m:g} m, "
            f"at {worst * commands.sample_time_s:.0f} s, {_place(area, trajectory.pose[worst])}",
        ),
        *_if(excess > 1e-6, f"{excess_signal} by {excess:.2g} of its range"),
        *_standing_problems(vessel, commands, standing),
        *_engine_problems(vessel, commands),
        *_heel_problems(vessel, heel, legs, commands.sample_time_s),
        *_repeat_problems(legs, repeats),
        *(() if misfit else _speed_problems(environment, trajectory, legs, transit_mps)),
        *(() if misfit else _speed_problems(environment, again, legs, transit_mps, "re-simulated ")),
        *(misfit or _run_problems(vessel, commands, legs, primitives)),
        *(() if misfit else _entry_problems(environment, trajectory, legs, primitives)),
    ]
    return Verification(
        clearance_min_m=float(clearance[worst]),
        clearance_time_s=worst * commands.sample_time_s,
        reproduction_error_m=float(anew.off_m.max()),
        stretch_s=None if anew.stretch is None else anew.stretch * commands.sample_time_s,
        limit_excess=excess,
        problems=tuple(problems),
        heel_max_rad=None if heel is None else float(heel.max()),
    )


def _heel_problems(vessel: Vessel, heel: Array | None, legs: Sequence[Leg], step_s: float) -> tuple[str, ...]:
    """A heel beyond what the vessel file allows."""
    if heel is None or vessel.pendulum is None:
        return ()
    worst, most = int(np.argmax(heel)), vessel.pendulum.heel_max_rad
    leg = next((leg for leg in legs if leg.first <= worst < leg.last), legs[-1])
    return _if(
        bool(heel[worst] > most + 1e-9),
        f"she heels by {np.degrees(heel[worst]):.1f} deg at {worst * step_s:.0f} s, in {leg.name}, more "
        f"than heel_max_deg of [roll], {np.degrees(most):.3g} deg",
    )


def hull_clearance(area: SeaArea, trajectory: Trajectory, hull_b: Array) -> Array:
    """(k,) distance from the hull to forbidden water [m].

    Each sample's polygon spans the hull at this sample and the next, and what its corners swing out between them is
    taken off, so nothing is passed between samples. Where the hull lies in forbidden water: minus the side of a square
    as large as the part that does.
    """
    hulls = hull_polygons(trajectory.pose, hull_b)
    corners = shapely.get_coordinates(hulls).reshape(len(hulls), -1, 2)
    spans = shapely.convex_hull(shapely.linestrings(np.concatenate([corners[:-1], corners[1:]], axis=1)))
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
    return clearance - _swing(trajectory.pose, hull_b)


def _swing(pose: Array, hull_b: Array) -> Array:
    """(k,) how far at most the arc of a corner leaves its chord between a sample and the next [m]."""
    turned = np.abs(np.diff(pose[:, 2], append=pose[-1, 2]))
    return np.asarray(np.hypot(*hull_b.T).max() * (1 - np.cos(np.minimum(turned, np.pi) / 2)))


def _pieces(line: shapely.Geometry) -> np.ndarray:
    """A closed boundary as its segments."""
    points = shapely.get_coordinates(line)
    return np.asarray(shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1)))


def _end_problems(
    vessel: Vessel,
    environment: Environment,
    trajectory: Trajectory,
    ends: tuple[Array, Array],
    begin: Array | None,
    which: str = "",
) -> list[str]:
    """Deviations of the plan's ends from start and goal, at rest through the water or, at the start, as under way."""
    problems = []
    fastest = np.hypot(*trajectory.velocity[:, :2].T).max(), np.abs(trajectory.velocity[:, 2]).max()
    slow, steady = ENTRY_TOLERANCE * np.array(fastest) + 1e-9
    for name, pose, index in zip(("start", "goal"), ends, (0, -1), strict=True):
        place, velocity = trajectory.pose[index], trajectory.velocity[index]
        off_m = float(np.hypot(*(place - pose)[:2]))
        turned = abs(float(wrap_angle(place[2] - pose[2])))
        u_c, v_c = to_body(environment.current_to, place[2], NUMPY)
        wanted, words = np.array([u_c, v_c, 0.0]), "through the water and turning at"
        if name == "start" and begin is not None:
            wanted, words = begin, "off the speed asked for and turning by"
        moving, turning = float(np.hypot(*(velocity - wanted)[:2])), abs(float(velocity[2] - wanted[2]))
        if off_m > vessel.length_m / 30 or turned > ENTRY_TOLERANCE or moving > slow or turning > steady:
            problems.append(
                f"the {which}plan is {off_m:.2f} m and {turned:.3f} rad off the {name}, at {moving:.3f} m/s {words} "
                f"{turning:.4f} rad/s"
            )
    return problems


def _limit_excess(vessel: Vessel, commands: Commands, standing: Array) -> tuple[float, str]:
    """The largest violation of a limit or a rate relative to the signal's range, and which; (m,) stood before."""
    worst, which = 0.0, ""
    signals = zip(commands.names, vessel.limits, vessel.rates.tolist(), commands.values.T, standing, strict=True)
    for name, limit, rate, values, before in signals:
        span = limit.high - limit.low if np.isfinite(limit.high - limit.low) else 2 * np.pi
        beyond = max(float((values - limit.high).max()), float((limit.low - values).max()))
        steps = np.abs(np.diff([np.clip(before, limit.low, limit.high), *values]))
        faster = float(steps.max()) - rate * commands.sample_time_s
        for excess, what in ((beyond, "limit"), (faster, "rate")):
            if excess / span > worst:
                worst, which = excess / span, f"{name} passes its {what}"
    return worst, which


def _standing_problems(vessel: Vessel, commands: Commands, standing: Array) -> list[str]:
    """Actuators that answer late deliver what stood before the plan; its files do so by a first row that repeats it."""
    late = np.array([not response.follows for response in vessel.responses])
    changed = np.abs(commands.values[0] - standing) > 1e-9
    return [
        f"{name} is commanded {first:.3g} at once, expected {before:.3g} for a sample, as it answers late"
        for name, first, before, wrong in zip(commands.names, commands.values[0], standing, late & changed, strict=True)
        if wrong
    ]


def _engine_problems(vessel: Vessel, commands: Commands) -> list[str]:
    """Engines and forces that are not stopped at the goal; the start is covered by their rates."""
    last_values = zip(commands.names, vessel.limits, vessel.angles, commands.values[-1], strict=True)
    return [
        f"{name} is commanded {last:.3g} at the goal, expected 0"
        for name, limit, turns, last in last_values
        if not turns and abs(last) > 1e-6 * max(abs(limit.low), abs(limit.high))
    ]


def _repeat_problems(legs: Sequence[Leg], repeats: Mapping[str, int]) -> list[str]:
    done = Counter(leg.name for leg in legs if leg.kind == "primitive")
    return [
        f"{name!r} is run {done[name]} times, the durations ask for {repeats.get(name, 0)}"
        for name in sorted({*done, *repeats})
        if done[name] != repeats.get(name, 0)
    ]


def _legs_problems(commands: Commands, legs: Sequence[Leg], primitives: Mapping[str, Primitive]) -> list[str]:
    """Gaps between legs, and runs that the dictionary does not have."""
    problems = []
    if [0, *(leg.last for leg in legs)] != [*(leg.first for leg in legs), len(commands)]:
        problems.append("the legs do not follow each other without gaps from the first sample to the last")
    for leg in legs:
        if leg.kind == "primitive" and leg.name not in primitives:
            problems.append(f"the dictionary has no {leg.name!r}")
        elif leg.kind == "primitive" and leg.last - leg.first != len(primitives[leg.name].commands):
            lasts, asked = leg.last - leg.first, len(primitives[leg.name].commands)
            problems.append(f"{leg.name!r} at sample {leg.first} lasts {lasts} samples, the dictionary's {asked}")
    return problems


def _run_problems(
    vessel: Vessel, commands: Commands, legs: Sequence[Leg], primitives: Mapping[str, Primitive]
) -> list[str]:
    """Runs whose commands differ from the dictionary's, except by whole turns of angles without limits."""
    unlimited = [not np.isfinite([limit.low, limit.high]).any() for limit in vessel.limits]
    turning = [name.startswith("a") and free for name, free in zip(commands.names, unlimited, strict=True)]
    problems = []
    for leg in legs:
        if leg.kind == "primitive":
            apart = commands.values[leg.first : leg.last] - primitives[leg.name].commands.values
            turns = 2 * np.pi * np.round(apart[0] / (2 * np.pi)) * turning
            if np.abs(apart - turns).max() > 1e-9:
                problems.append(f"the commands of {leg.name!r} at sample {leg.first} are not the dictionary's")
    return problems


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


def _speed_problems(
    environment: Environment, trajectory: Trajectory, legs: Sequence[Leg], transit_mps: float, which: str = ""
) -> list[str]:
    """Legs faster through water than stated; those that begin or end faster may be as fast as that."""
    north, east = environment.current_to
    heading, (u, v, _) = trajectory.pose[:, 2], trajectory.velocity.T
    c, s = np.cos(heading), np.sin(heading)
    speed = np.hypot(u * c - v * s - north, u * s + v * c - east)
    problems = []
    for leg in legs:
        sailed = speed[leg.first : leg.last + 1]
        allowed = max(transit_mps, sailed[0], sailed[-1])
        if leg.kind != "primitive" and sailed.max() > (1.0 + SPEED_TOLERANCE) * allowed:
            at_s = (leg.first + int(sailed.argmax())) * trajectory.sample_time_s
            problems.append(
                f"the {which}leg to {leg.name!r} goes {sailed.max():.3g} m/s through the water at {at_s:.0f} s, "
                f"stated {allowed:.3g} m/s"
            )
    return problems


def _place(area: SeaArea, pose: Array) -> str:
    lat, lon = area.frame.to_degrees(pose[:2])
    return f"near {lat:.5f}, {lon:.5f}"


def _if(wrong: bool, sentence: str) -> tuple[str, ...]:
    return (sentence,) if wrong else ()


def realised_efficiencies(
    vessel: Vessel,
    design: DurationDesign,
    environment: Environment,
    sailed: SailedTrial,
) -> tuple[float | None, float | None]:
    """Efficiencies of the runs as they are placed, and of the whole trial, against the optimum in the time asked for.

    By the design's criterion and the nominal model, of the information collected, not per second. What the runs lose
    against the design's whole runs is due to their places: headings in wind, and entries that a leg reached within its
    tolerance. What the whole trial has more is due to its legs; above 1 where they add more than rounding and places
    take. A steady current that the forecast leaves unknown is estimated too; the optimum is for runs of any heading,
    whose information is then the same. None where the design has nuisance regressors, recorded primitives, or samples
    of each equation's own: their information is not that of the track.
    """
    problem = replace(design.problem, robust="nominal", sampled=np.zeros((0, 0, 0, 0)))
    known = set(problem.parameters) <= set(vessel.model.names) and problem.excitation == "free"
    if not known or not problem.symmetric:
        return None, None
    collected, share = Collected.of(problem), sailed.commands.sample_time_s / problem.total_s
    legs = track_information(vessel, problem, environment, sailed)
    runs = legs[[leg.kind == "primitive" for leg in sailed.legs]].sum(axis=0)
    placed, realised = (
        collected.efficiency_of(share * about_ship(problem, matrix), design.fractions)
        for matrix in (runs, legs.sum(axis=0))
    )
    return placed, realised


def track_information(vessel: Vessel, problem: DurationProblem, environment: Environment, sailed: SailedTrial) -> Array:
    """(legs, d, d) information of each leg of a trial: sums over its samples, bordered as B_q.

    Where the forecast leaves a steady current unknown, it is (legs, d + 2, d + 2), about the current, too. `about_ship`
    reduces a sum of them to the ship's parameters.
    """
    names, mean = problem.parameters, problem.mean_subtraction
    commands = delivered(vessel, sailed.commands)
    rows = regressor_rows(vessel.model, sailed.trajectory, commands, environment)
    parts = [slice(leg.first, leg.last) for leg in sailed.legs]
    matrices = [(part.stop - part.start) * _bordered(vessel, rows[part], names, mean) for part in parts]
    if environment.current_std_mps:
        J = current_rows(vessel, sailed.trajectory, commands, environment)
        matrices = [
            bordered_by_current(vessel, M, rows[part], J[part], names, mean)
            for M, part in zip(matrices, parts, strict=True)
        ]
    return np.array(matrices)


def about_ship(problem: DurationProblem, information: Array) -> Array:
    """(d, d) information about the ship in information (d, d), or (d + 2, d + 2) with an unknown current."""
    if len(information) == problem.dimension:
        return information
    return beside_current(information, len(problem.parameters))


def track_covariance(
    vessel: Vessel, design: DurationDesign, environment: Environment, sailed: SailedTrial
) -> Array | None:
    """(p, p) inverse information of a whole trial about the parameters, means left out, in units of the noise.

    None where the design has nuisance regressors or samples of each equation's own, or the track does not determine
    every parameter.
    """
    problem = design.problem
    p = len(problem.parameters)
    if not set(problem.parameters) <= set(vessel.model.names) or problem.excitation != "free":
        return None
    M = about_ship(problem, track_information(vessel, problem, environment, sailed).sum(axis=0))
    scale = np.sqrt(np.maximum(np.diag(M), 0.0))
    if not (scale > 0).all() or np.linalg.matrix_rank(M / np.outer(scale, scale)) < len(M):
        return None
    return np.asarray((np.linalg.inv(M / np.outer(scale, scale)) / np.outer(scale, scale))[:p, :p])


def part_of_track(sailed: SailedTrial, first: int = 0, last: int | None = None) -> TrialPart:
    """Some of its samples, all by default, as one batch of data."""
    commands, motion = sailed.commands, sailed.trajectory
    begin = np.zeros(len(commands.names)) if sailed.standing is None else sailed.standing
    return TrialPart(
        commands=Commands(
            sample_time_s=commands.sample_time_s, names=commands.names, values=commands.values[first:last]
        ),
        velocity=motion.velocity[first],
        heading_rad=float(motion.pose[first, 2]),
        standing=commands.values[first - 1] if first else begin,
    )


def expected_errors(
    vessel: Vessel, problem: DurationProblem, environment: Environment, sailed: SailedTrial
) -> Array | None:
    """(p, p) covariance of estimates from the whole track as one batch, in the parameters' units.

    By first-order propagation of the sensors' noise, see `information.expected`. None where the track does not
    determine every parameter.
    """
    try:
        return expected_covariance(
            vessel,
            [part_of_track(sailed)],
            problem.parameters,
            environment=environment,
            mean_subtraction=problem.mean_subtraction,
            unknown_current=environment.current_std_mps > 0,
        )
    except NotInformative:
        return None


def _bordered(vessel: Vessel, rows: Array, parameters: Sequence[str], mean_subtraction: str) -> Array:
    X, Y = moments(vessel.model, rows, parameters)
    return bordered_moments(X, Y, Y, Y @ Y.T, mean_subtraction)
