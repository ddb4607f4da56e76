"""A bound on repositioning time that holds for every plan with the same runs.

Class of plans: the hull keeps the clearance everywhere; legs go no faster through water than a stated speed; each run
is sailed as simulated with the nominal vessel in the forecast's means; the ship starts and ends at rest.

Let W be where amidships may be. A run whose chord stays within d of its path has its chord inside W grown by d, so the
legs together with the chords of such runs, and with the paths of all others, lead from start to goal through that
water. They are no shorter than its taut string, whatever d is; the best d counts.

Speeds at the ends of legs cost time besides: a leg that begins or ends slower than the fastest leg loses distance while
it changes speed. Which leg joins which runs is left to the plan; the cheapest assignment counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.optimize import linear_sum_assignment

from expdesign.dictionary import Primitive
from expdesign.plan.area import SeaArea
from expdesign.plan.ways import build_ways, polyline_length, simplified
from expdesign.simulation import Environment, simulate_many
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel

HEADINGS = 72
"""Headings at which runs are simulated where wind makes a difference."""
STATES = 20_000
"""States and commands among which the largest acceleration is looked for."""


@dataclass(frozen=True, kw_only=True)
class Carry:
    """What a run can contribute to the way.

    Attributes:
        chord_m: from its start to its end [m].
        path_m: length of its path [m].
        stray_m: no point of the chord is farther than this from the path [m].
    """

    chord_m: float
    path_m: float
    stray_m: float


def reposition_bound_s(
    vessel: Vessel,
    area: SeaArea,
    environment: Environment,
    *,
    clearance_m: float,
    primitives: tuple[Primitive, ...],
    repeats: Mapping[str, int],
    ends: tuple[Array, Array],
    speed_mps: float,
    yaw_rate_radps: float,
) -> float:
    """Least repositioning time of any plan of the class that the module describes [s].

    Args:
        vessel, area, environment: who, where, in what.
        clearance_m: distance of the hull from anything forbidden.
        primitives, repeats: the runs.
        ends: start and goal, (3,) or (2,).
        speed_mps, yaw_rate_radps: of the fastest leg through water.
    """
    runs = [item for item in primitives if repeats.get(item.name, 0)]
    carries = {item.name: carry(vessel, item, environment) for item in runs}
    counts = {item.name: repeats[item.name] for item in runs}
    way_m = way_to_sail_m(area, clearance_m + vessel.beam_m / 2, carries, counts, ends, vessel.length_m / 30)
    exits, entries = _joint_speeds(runs, counts)
    most = _most_acceleration(vessel, environment, speed_mps, yaw_rate_radps)
    lost_m, least_s = joint_losses(exits, entries, speed_mps=speed_mps, acceleration_mps2=most)
    current_mps = float(np.hypot(*environment.current_to))
    bound_s = (way_m + lost_m) / (speed_mps + current_mps)
    if current_mps and not (environment.wind_to.any() and _feels_wind(vessel)):
        credits = {item.name: credit(item, carries[item.name], current_mps, speed_mps) for item in runs}
        margin_m, tolerance_m = clearance_m + vessel.beam_m / 2, vessel.length_m / 30
        owed_m = way_to_sail_m(area, margin_m, credits, counts, ends, tolerance_m)
        helped_m = float(environment.current_to @ (ends[1] - ends[0])[:2]) / speed_mps
        bound_s = max(bound_s, (owed_m - helped_m) / speed_mps)
    return float(max(0.0, least_s, bound_s))


def credit(primitive: Primitive, carried: Carry, current_mps: float, speed_mps: float) -> Carry:
    """What a run carries, less what the current then no longer does for the legs.

    A leg in direction e gains at most V + c.e over ground, so it takes at least (1 - c.e / V) / V for each metre, and
    all legs together the length of their ways less c.d / V, by V, for their displacements d. These and the runs' add
    up to that from start to goal: a run is credited with its length less c.d / V, at the heading that suits it best.
    """
    steps = np.hypot(*np.diff(primitive.trajectory.pose[:, :2], axis=0).T)
    chord = np.hypot(*(primitive.trajectory.pose[-1] - primitive.trajectory.pose[0])[:2])
    drift_m, reach_m = (speed * primitive.duration_s for speed in (current_mps, speed_mps))
    share = 1.0 / len(steps)
    return Carry(
        chord_m=float(_credited(np.atleast_1d(chord), drift_m, reach_m).sum()),
        path_m=float(_credited(steps, share * drift_m, share * reach_m).sum()),
        stray_m=carried.stray_m,
    )


def _credited(length_m: Array, drift_m: float, reach_m: float) -> Array:
    """Most of |l + k| - k.(l + k) / reach for vectors l, k of these lengths: concave in the cosine between them."""
    squares, product = length_m**2 + drift_m**2, 2 * length_m * drift_m
    cosine = np.clip((reach_m**2 - squares) / np.maximum(product, 1e-300), -1.0, 1.0)
    ground = np.sqrt(np.maximum(squares + product * cosine, 0.0))
    return np.asarray(ground - drift_m / reach_m * (drift_m + length_m * cosine))


def way_to_sail_m(
    area: SeaArea,
    margin_m: float,
    carries: Mapping[str, Carry],
    repeats: Mapping[str, int],
    ends: tuple[Array, Array],
    tolerance_m: float,
) -> float:
    """Length that legs cannot do without [m]; negative where runs can carry the ship farther than it has to go."""
    water, best = area.safe_water(margin_m), -np.inf
    for grown_m in sorted({0.0, *(item.stray_m for item in carries.values())}):
        carried = sum(
            count * (carries[name].chord_m if carries[name].stray_m <= grown_m else carries[name].path_m)
            for name, count in repeats.items()
        )
        more = shapely.buffer(water, grown_m + 1e-6, quad_segs=32) if grown_m else water
        simple = simplified(more, grow=True, tolerance_m=tolerance_m + 0.002 * grown_m)
        way = build_ways(simple).shortest(ends[0][:2], ends[1][:2])
        if way is None:  # the ends lie outside the water that a plan needs: there is none to be bounded
            continue
        # an end outside the water is joined to it by a line that the true way need not follow
        straight = float(np.hypot(*(ends[1] - ends[0])[:2]))
        best = max(best, (polyline_length(way) if _holds_ends(simple, ends) else straight) - carried)
    return float(best) if np.isfinite(best) else 0.0


def _holds_ends(water: shapely.Geometry, ends: tuple[Array, Array]) -> bool:
    return bool(shapely.covers(water, shapely.points([end[1::-1] for end in ends])).all())


def carry(vessel: Vessel, primitive: Primitive, environment: Environment) -> Carry:
    """How far a run carries the ship at most, at the heading that suits it best, and how far it bends."""
    drift_m = float(np.hypot(*environment.current_to)) * primitive.duration_s
    tracks = [primitive.trajectory.pose[:, :2]]
    spare = 1.0
    if environment.wind_to.any() and _feels_wind(vessel):
        tracks, spare, drift_m = _in_weather(vessel, primitive, environment), 1.02, 0.0
    found = [_carry(track) for track in tracks]
    chord, path, stray = (spare * max(item[k] for item in found) + drift_m for k in range(3))
    if drift_m:
        stray = min(stray, _stray_adrift(tracks[0], drift_m))
    return Carry(chord_m=chord, path_m=path, stray_m=stray)


def _stray_adrift(track: Array, drift_m: float) -> float:
    """Bound on what a chord's points are away from a track (k, 2) through water that drifts any way by so much.

    The current carries the chord's point at a share of it as far as it carries the ship in that share of the time;
    between points and samples at other shares lies the drift in the time between.
    """
    share, when = np.linspace(0.0, 1.0, 201), np.linspace(0.0, 1.0, len(track))
    points = track[0] + share[:, None] * (track[-1] - track[0])
    apart = np.hypot(*np.moveaxis(points[:, None] - track, -1, 0)) + drift_m * np.abs(share[:, None] - when)
    between = (float(np.hypot(*(track[-1] - track[0]))) + drift_m) / 400
    return float(apart.min(axis=1).max()) + between


def _feels_wind(vessel: Vessel) -> bool:
    used = zip(vessel.model.expressions, vessel.model.parameters, strict=True)
    return any(value and {"u_q", "v_q"} & set(expression.signals) for expression, value in used)


def _in_weather(vessel: Vessel, primitive: Primitive, environment: Environment) -> list[Array]:
    """Tracks (k, 2) of the run at headings all round, in the forecast's mean current and wind."""
    heading = np.arange(HEADINGS) * 2 * np.pi / HEADINGS
    c, s = np.cos(heading), np.sin(heading)
    north, east = environment.current_to
    current_b = np.stack([north * c + east * s, east * c - north * s, 0 * c], axis=1)
    states = simulate_many(
        vessel,
        primitive.commands,
        pose=np.stack([0 * c, 0 * c, heading], axis=1),
        velocity=primitive.entry_velocity + current_b,
        current_to=np.tile(environment.current_to, (HEADINGS, 1)),
        wind_to=np.tile(environment.wind_to, (HEADINGS, 1)),
        parameters=np.tile(vessel.model.parameters, (HEADINGS, 1)),
        standing=primitive.entry_inputs,
    )
    return list(np.moveaxis(states[..., :2], 1, 0))


def _carry(track: Array) -> tuple[float, float, float]:
    """Chord, path and largest distance of the chord's points from the path."""
    chord = float(np.hypot(*(track[-1] - track[0])))
    points = track[0] + np.linspace(0, 1, 201)[:, None] * (track[-1] - track[0])
    apart = shapely.distance(shapely.points(points), shapely.linestrings(track))
    return chord, polyline_length(track), float(apart.max()) + chord / 400


def _joint_speeds(runs: list[Primitive], repeats: Mapping[str, int]) -> tuple[Array, Array]:
    """Speeds at which legs begin and end."""
    times = [repeats[item.name] for item in runs]
    exits = np.repeat([float(np.hypot(*item.exit_velocity[:2])) for item in runs], times)
    entries = np.repeat([float(np.hypot(*item.entry_velocity[:2])) for item in runs], times)
    return np.r_[0.0, exits], np.r_[entries, 0.0]


def joint_losses(exits: Array, entries: Array, *, speed_mps: float, acceleration_mps2: float) -> tuple[float, float]:
    """What changing speed costs at least in the cheapest assignment of legs.

    Args:
        exits, entries: (n,) speeds at which legs begin and end [m/s].
        speed_mps: of the fastest leg.
        acceleration_mps2: no speed changes faster.

    Returns:
        Distance lost against the fastest leg [m], and least time of all changes [s].
    """
    change = np.abs(exits[:, None] - entries)
    lost = change / acceleration_mps2 * (speed_mps - (exits[:, None] + entries) / 2).clip(0.0)
    totals = [matrix[linear_sum_assignment(matrix)].sum() for matrix in (lost, change / acceleration_mps2)]
    return float(totals[0]), float(totals[1])


def _most_acceleration(vessel: Vessel, environment: Environment, speed_mps: float, yaw_rate_radps: float) -> float:
    """The fastest change of speed through water in drawn motions and commands, a tenth added [m/s2]."""
    rng = np.random.default_rng(0)
    limits = [(x.low, x.high) if np.isfinite(x.high - x.low) else (-np.pi, np.pi) for x in vessel.limits]
    low, high = np.array(limits).T
    shares = rng.uniform(-0.5, 1.5, (STATES, len(limits))).clip(0.0, 1.0)  # half of them at a limit
    inputs = tuple((low + shares * (high - low)).T)
    speed = speed_mps * np.sqrt(rng.uniform(1e-6, 1, STATES))
    way, wind_from = rng.uniform(-np.pi, np.pi, (2, STATES))
    u, v, r = speed * np.cos(way), speed * np.sin(way), yaw_rate_radps * rng.uniform(-1, 1, STATES)
    wind = float(np.hypot(*(environment.wind_to - environment.current_to)))
    air = (u - wind * np.cos(wind_from), v - wind * np.sin(wind_from))
    rates = vessel.model.accelerations((u, v, r), air, inputs, NUMPY)
    return float(1.1 * np.abs(rates[0] * np.cos(way) + rates[1] * np.sin(way)).max())
