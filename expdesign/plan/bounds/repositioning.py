"""A bound on repositioning time that holds for every plan with the same runs.

Class of plans: the hull keeps the clearance everywhere; legs go no faster through water than a stated speed and turn no
faster than a stated rate, or 2 % beyond those at their ends; each run is sailed as simulated with the nominal vessel in
the forecast's means; the ship ends at rest with its engines stopped, rudders and thrusters at any angle, and starts so
or under way as stated.

In a steady current the least time of a leg along a straight line is that of Zermelo's navigation problem. It grows with
the length and obeys the triangle inequality, so the fastest path round the islands bends at their corners only and a
visibility graph finds it. Let W be where amidships may be. A run whose chord stays within d of its path has its chord
inside W grown by d. So the legs, the chords of such runs and the paths of all others lead from start to goal through
that water. The time of the fastest path is therefore at most the time of the legs plus the time that legs would need
for those chords and paths at their best headings. This holds for every d; the best d counts.

On small charts the most that each run can save is also bounded over all places where its hull has room
(`expdesign.plan.bounds.branch_and_bound`): the least time to the goal falls by no more than that in a run, and in a leg
by no more than the leg takes.

Speeds and commands at the ends of legs cost time besides: a leg that begins or ends slower than the fastest leg loses
distance while it changes speed, and actuators move no faster than their rates. The order of the runs is free; the
cheapest order counts.

All of this is proved but for two quantities, which are estimated and given a margin: the largest accelerations, over
random motions and commands (`expdesign.plan.control.acceleration_limits`), and, where wind makes a difference, the
displacement and the end speed of runs, over headings all round (`expdesign.plan.bounds.displacement`).

Source: E. Zermelo, Über das Navigationsproblem bei ruhender oder veränderlicher Windverteilung, ZAMM 11 (1931),
114-124.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy
import shapely

from expdesign.dictionary import Primitive
from expdesign.plan.bounds.branch_and_bound import QUAD_SEGMENTS, time_saved_s
from expdesign.plan.bounds.displacement import Displacement, Headway, differs_by_heading, displacement_of, exit_motion
from expdesign.plan.chart import build_visibility_graph, simplified
from expdesign.plan.control import LegEnd, least_loss, leg_end
from expdesign.plan.legs import BEYOND_ENDS, leg_speed_mps, through_water
from expdesign.plan.values import UnderWay
from expdesign.sea_area import SeaArea
from expdesign.simulation import Environment
from expdesign.values import Array
from expdesign.vessel import Vessel

ORDER_STATES = 20_000  # combinations of remaining runs up to which all orders are enumerated


def cheapest_orders(pairs: Array, home: Array, counts: Sequence[int]) -> Array | None:
    """(combinations, q) least cost over all orders of the remaining runs, by the last run; None for too many.

    Args:
        pairs: (q, q) cost from one to the next.
        home: (q,) cost after the last.
        counts: of each run.
    """
    sizes = np.array(counts) + 1
    if np.prod(sizes.astype(float)) > ORDER_STATES:
        return None
    base = place_values(counts)
    table = np.zeros((int(np.prod(sizes)), len(home)))
    table[0] = home
    for code in range(1, len(table)):
        some = np.flatnonzero(code // base % sizes)
        table[code] = (pairs[:, some] + table[code - base[some], some]).min(axis=1)
    return table


def place_values(counts: Sequence[int]) -> np.ndarray:
    """(q,) what one of each run adds to the index of a combination."""
    return np.asarray(np.r_[1, np.cumprod(np.array(counts) + 1)[:-1]].astype(int))


def reposition_bound_s(
    vessel: Vessel,
    area: SeaArea,
    environment: Environment,
    *,
    clearance_m: float,
    primitives: tuple[Primitive, ...],
    repeats: Mapping[str, int],
    ends: tuple[Array, Array],
    transit_mps: float,
    yaw_rate_radps: float,
    under_way: UnderWay | None = None,
) -> float:
    """Least repositioning time of any plan of the class that the module describes [s].

    Args:
        clearance_m: distance of the hull from anything forbidden.
        ends: start and goal, (3,) or (2,).
        transit_mps, yaw_rate_radps: of legs through water; those whose ends are faster, by `leg_speed_mps`, or turn
            faster go a little beyond.
        under_way: motion at the start and commands standing there; None for rest.
    """
    runs = [item for item in primitives if repeats.get(item.name, 0)]
    exits = [exit_motion(vessel, item, environment) for item in runs]
    entries = [item.entry_velocity for item in runs]
    begin, standing = _begin(vessel, environment, under_way, ends[0])
    speed_mps = leg_speed_mps(transit_mps, [begin, *entries, *(np.array([most, 0.0]) for _, most, _ in exits)])
    turns = [*(abs(float(entry[2])) for entry in (begin, *entries)), *(turn for _, _, turn in exits)]
    yaw_rate_radps = max([yaw_rate_radps, *(BEYOND_ENDS * turn for turn in turns)])
    headway = Headway(speed_mps=speed_mps, current_to=environment.current_to)
    displacements = {item.name: displacement_of(vessel, item, environment, headway) for item in runs}
    counts = {item.name: repeats[item.name] for item in runs}
    path_s = time_to_sail_s(
        area, clearance_m + vessel.beam_m / 2, displacements, counts, ends, headway, vessel.length_m / 30
    )
    if not differs_by_heading(vessel, environment):
        water = area.safe_water(clearance_m + vessel.beam_m / 2)
        found = time_saved_s(runs, displacements, counts, water, ends, headway, vessel, known_s=path_s)
        if found is not None:
            path_s = max(path_s, found[0] - sum(counts[name] * most_s for name, most_s in found[1].items()))
    firsts, lasts = _leg_ends(vessel, environment, runs, exits, (begin, standing), speed_mps, yaw_rate_radps)
    losses = least_loss(firsts, lasts, vessel)
    lost_m, least_s = (least_losses(losses[..., k], list(counts.values())) for k in (0, 1))
    return float(max(0.0, least_s, path_s + lost_m / (speed_mps + headway.current_mps)))


def time_to_sail_s(
    area: SeaArea,
    margin_m: float,
    displacements: Mapping[str, Displacement],
    repeats: Mapping[str, int],
    ends: tuple[Array, Array],
    headway: Headway,
    tolerance_m: float,
) -> float:
    """Least time of all legs together [s]; negative where runs can displace the ship farther than it has to go."""
    water, best = area.safe_water(margin_m), -np.inf
    start, goal = (end[:2] for end in ends)
    for grown_m in sorted({0.0, *(item.deviation_m for item in displacements.values())}):
        displaced_s = sum(
            count
            * (
                displacements[name].chord_s
                if displacements[name].deviation_m <= grown_m
                else displacements[name].path_s
            )
            for name, count in repeats.items()
        )
        more = _grown(water, grown_m) if grown_m else water
        simple = simplified(more, grow=True, tolerance_m=tolerance_m + 0.002 * grown_m)
        path_s = float(headway.seconds(goal - start))
        if _holds_ends(simple, ends):  # nothing more is known of the way of an end outside the water
            path_s = build_visibility_graph(simple).least_cost(start, goal, headway.seconds)
        if np.isfinite(path_s):  # or else the ends are not connected, and there is no plan to bound
            best = max(best, path_s - displaced_s)
    return float(best) if np.isfinite(best) else 0.0


def _grown(water: shapely.Geometry, distance_m: float) -> shapely.Geometry:
    """A superset of the water grown by a distance: the chords of arcs are nearer than their ends."""
    return shapely.buffer(water, distance_m / np.cos(np.pi / (4 * QUAD_SEGMENTS)) + 1e-6, quad_segs=QUAD_SEGMENTS)


def _holds_ends(water: shapely.Geometry, ends: tuple[Array, Array]) -> bool:
    return bool(shapely.covers(water, shapely.points([end[1::-1] for end in ends])).all())


def _leg_ends(
    vessel: Vessel,
    environment: Environment,
    runs: list[Primitive],
    exits: list[tuple[float, float, float]],
    begin: tuple[Array, Array],
    top_mps: float,
    yaw_rate_radps: float,
) -> tuple[list[LegEnd], list[LegEnd]]:
    """Where legs begin, the start first, and where they end, the goal last."""

    def end(velocity: Array, inputs: Array | None) -> LegEnd:
        speed = float(np.hypot(*velocity[:2]))
        return leg_end(vessel, environment, speed, inputs, top_mps=top_mps, yaw_rate_radps=yaw_rate_radps)

    rest = end(np.zeros(3), np.where(vessel.angles, np.nan, 0.0))
    firsts = [
        replace(end(item.exit_velocity, item.commands.values[-1]), slowest_mps=least, fastest_mps=most)
        for item, (least, most, _) in zip(runs, exits, strict=True)
    ]
    start = end(*begin) if begin[0].any() or begin[1].any() else rest
    return [start, *firsts], [*(end(item.entry_velocity, item.commands.values[0]) for item in runs), rest]


def _begin(vessel: Vessel, environment: Environment, under_way: UnderWay | None, start: Array) -> tuple[Array, Array]:
    """(3,) velocity through water at the start, and (m,) commands standing there."""
    if under_way is None:
        return np.zeros(3), np.zeros(len(vessel.limits))
    return through_water(environment, np.r_[start, under_way.velocity]), under_way.inputs


def least_losses(losses: Array, counts: Sequence[int]) -> float:
    """Least loss of all legs together, over all orders of the runs, or over all assignments where those are many.

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
        return float(every[scipy.optimize.linear_sum_assignment(every)].sum())
    one_less = len(table) - 1 - place_values(counts)
    return float((losses[0, :-1] + table[one_less, np.arange(len(counts))]).min())
