"""A bound on repositioning time that holds for every plan with the same runs.

Class of plans: the hull keeps the clearance everywhere; legs go no faster through water than a stated speed; each run
is sailed as simulated with the nominal vessel in the forecast's means; the ship starts and ends at rest.

In a steady current the least time of a leg along a straight line is that of Zermelo's navigation problem. It grows with
the length and obeys the triangle inequality, so the fastest way round the islands bends at their corners only and a
visibility graph finds it. Let W be where amidships may be. A run whose chord stays within d of its path has its chord
inside W grown by d, so the legs together with the chords of such runs, and with the paths of all others, lead from
start to goal through that water: the time of the fastest way is no more than that of the legs, and what legs would
need for those chords and paths at the headings that suit them best. This is so whatever d is; the best d counts.

Speeds and commands at the ends of legs cost time besides: a leg that begins or ends slower than the fastest leg loses
distance while it changes speed, and actuators move no faster than their rates. Which leg joins which runs is left to
the plan; the cheapest order counts.

Source: E. Zermelo, Über das Navigationsproblem bei ruhender oder veränderlicher Windverteilung, ZAMM 11 (1931),
114-124.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.optimize import linear_sum_assignment

from expdesign.dictionary import Primitive
from expdesign.plan.area import SeaArea
from expdesign.plan.cheapest_orders import cheapest_orders, place_values
from expdesign.plan.speed_changes import LegEnd, least_loss, leg_end
from expdesign.plan.ways import build_ways, simplified
from expdesign.simulation import Environment, simulate_many
from expdesign.values import Array, seal
from expdesign.vessel import Vessel

HEADINGS = 72
"""Headings at which runs are simulated where wind makes a difference."""
SPARE = 1.02
"""What headings between these may give more."""


@dataclass(frozen=True, kw_only=True)
class Carry:
    """What a run can contribute to the way, at the heading that suits it best.

    Attributes:
        chord_s: time that a leg needs from its start to its end [s].
        path_s: the same along its path [s].
        stray_m: no point of the chord is farther than this from the path [m].
    """

    chord_s: float
    path_s: float
    stray_m: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Headway:
    """The fastest leg.

    Attributes:
        speed_mps: through water.
        current_to: (2,) of the water [m/s], slower than that.
    """

    speed_mps: float
    current_to: Array

    def __post_init__(self) -> None:
        seal(self, current_to="2")

    @property
    def current_mps(self) -> float:
        """Speed of the water."""
        return float(np.hypot(*self.current_to))

    def seconds(self, ground: Array) -> Array:
        """(...,) least time of straight legs (..., 2) over ground [s]."""
        along = ground @ self.current_to
        spare = self.speed_mps**2 - self.current_mps**2
        return np.asarray((np.sqrt(along**2 + spare * (ground**2).sum(axis=-1)) - along) / spare)

    def most_s(self, water_m: Array, lasting_s: Array | float) -> Array:
        """(...,) that of what moves by a length through water in a time, at the heading for which it is most [s].

        A leg of time t makes good d when p.d <= t for all slownesses p with V |p| + c.p = 1. Of l through water and
        c T that is at most |p| l + (1 - V |p|) T, so the ends 1 / (V + c) and 1 / (V - c) of |p| decide.
        """
        behind = self.speed_mps * lasting_s - water_m
        slowness = 1.0 / (self.speed_mps + np.where(behind >= 0, 1.0, -1.0) * self.current_mps)
        return np.asarray(lasting_s - slowness * behind)


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
    headway = Headway(speed_mps=speed_mps, current_to=environment.current_to)
    runs = [item for item in primitives if repeats.get(item.name, 0)]
    carries = {item.name: carry(vessel, item, environment, headway) for item in runs}
    counts = {item.name: repeats[item.name] for item in runs}
    way_s = time_to_sail_s(area, clearance_m + vessel.beam_m / 2, carries, counts, ends, headway, vessel.length_m / 30)
    firsts, lasts = _leg_ends(vessel, environment, runs, speed_mps, yaw_rate_radps)
    losses = np.array([[least_loss(first, last, vessel) for last in lasts] for first in firsts])
    lost_m, least_s = (joint_losses(losses[..., k], list(counts.values())) for k in (0, 1))
    return float(max(0.0, least_s, way_s + lost_m / (speed_mps + headway.current_mps)))


def time_to_sail_s(
    area: SeaArea,
    margin_m: float,
    carries: Mapping[str, Carry],
    repeats: Mapping[str, int],
    ends: tuple[Array, Array],
    headway: Headway,
    tolerance_m: float,
) -> float:
    """Time that legs cannot do without [s]; negative where runs can carry the ship farther than it has to go."""
    water, best = area.safe_water(margin_m), -np.inf
    start, goal = (end[:2] for end in ends)
    for grown_m in sorted({0.0, *(item.stray_m for item in carries.values())}):
        carried = sum(
            count * (carries[name].chord_s if carries[name].stray_m <= grown_m else carries[name].path_s)
            for name, count in repeats.items()
        )
        more = shapely.buffer(water, grown_m + 1e-6, quad_segs=32) if grown_m else water
        simple = simplified(more, grow=True, tolerance_m=tolerance_m + 0.002 * grown_m)
        way_s = build_ways(simple).least(start, goal, headway.seconds)
        if not np.isfinite(way_s):  # the ends lie outside the water that a plan needs: there is none to be bounded
            continue
        # an end outside the water is joined to it by a line that the true way need not follow
        straight_s = float(headway.seconds(goal - start))
        best = max(best, (way_s if _holds_ends(simple, ends) else straight_s) - carried)
    return float(best) if np.isfinite(best) else 0.0


def _holds_ends(water: shapely.Geometry, ends: tuple[Array, Array]) -> bool:
    return bool(shapely.covers(water, shapely.points([end[1::-1] for end in ends])).all())


def carry(vessel: Vessel, primitive: Primitive, environment: Environment, headway: Headway) -> Carry:
    """How far a run carries the ship at most, and how far it bends."""
    track = primitive.trajectory.pose[:, :2]
    if environment.wind_to.any() and _feels_wind(vessel):
        return _carry_in_weather(_in_weather(vessel, primitive, environment), headway)
    steps = np.hypot(*np.diff(track, axis=0).T)
    chord = float(np.hypot(*(track[-1] - track[0])))
    drift_m, lasting_s = headway.current_mps * primitive.duration_s, primitive.duration_s
    return Carry(
        chord_s=float(headway.most_s(np.array(chord), lasting_s)),
        path_s=float(headway.most_s(steps, lasting_s / len(steps)).sum()),
        stray_m=min(_stray_m(track) + drift_m, _stray_adrift_m(track, drift_m)) if drift_m else _stray_m(track),
    )


def _carry_in_weather(tracks: list[Array], headway: Headway) -> Carry:
    """The same from tracks (k, 2) over ground at headings all round."""
    chords = [float(headway.seconds(track[-1] - track[0])) for track in tracks]
    paths = [float(headway.seconds(np.diff(track, axis=0)).sum()) for track in tracks]
    return Carry(
        chord_s=SPARE * max(chords), path_s=SPARE * max(paths), stray_m=SPARE * max(_stray_m(track) for track in tracks)
    )


def _stray_adrift_m(track: Array, drift_m: float) -> float:
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


def _stray_m(track: Array) -> float:
    """Largest distance of the chord's points from a track (k, 2)."""
    points = track[0] + np.linspace(0, 1, 201)[:, None] * (track[-1] - track[0])
    apart = shapely.distance(shapely.points(points), shapely.linestrings(track))
    return float(apart.max()) + float(np.hypot(*(track[-1] - track[0]))) / 400


def _leg_ends(
    vessel: Vessel, environment: Environment, runs: list[Primitive], top_mps: float, yaw_rate_radps: float
) -> tuple[list[LegEnd], list[LegEnd]]:
    """Where legs begin, the start first, and where they end, the goal last."""

    def end(velocity: Array, inputs: Array | None) -> LegEnd:
        speed = float(np.hypot(*velocity[:2]))
        return leg_end(vessel, environment, speed, inputs, top_mps=top_mps, yaw_rate_radps=yaw_rate_radps)

    rest = end(np.zeros(3), None)
    firsts = [end(item.exit_velocity, item.commands.values[-1]) for item in runs]
    return [rest, *firsts], [*(end(item.entry_velocity, item.commands.values[0]) for item in runs), rest]


def joint_losses(losses: Array, counts: Sequence[int]) -> float:
    """What legs lose at least together, over all orders of the runs, or over all assignments where those are many.

    Args:
        losses: (q + 1, q + 1) of a leg; rows by the run before, the start first, columns by the run after, the goal
            last.
        counts: (q,) of each run, one at least.
    """
    if not len(counts):
        return float(losses[0, 0])
    table = cheapest_orders(losses[1:, :-1], losses[1:, -1], counts)
    if table is None:
        every = np.repeat(np.repeat(losses, [1, *counts], axis=0), [*counts, 1], axis=1)
        return float(every[linear_sum_assignment(every)].sum())
    one_less = len(table) - 1 - place_values(counts)
    return float((losses[0, :-1] + table[one_less, np.arange(len(counts))]).min())
