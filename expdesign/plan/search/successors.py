"""How a partial plan can go on, and whether that is clear.

Agile vessels turn where they are and go straight, or along the way to the goal, to a run with any heading. Others sail
an arc and a straight, or a stretch of the way to the goal; those with a helm take the time that their speeds need.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.conventions import wrap_angle
from expdesign.plan.legs import HelmTimes, LegTimes, joints, moved
from expdesign.plan.search.state import PartialPlans, SearchSpace
from expdesign.values import Array

TURNS = np.deg2rad([0, 15, -15, 30, -30, 50, -50, 75, -75, 105, -105, 140, -140, 180, -180])
STRAIGHTS = np.array([0.0, 1.0, 2.0, 3.0, 4.5, 6.0])
"""Straight after a turn, beyond the run-up, in hull lengths."""
WAYS = np.array([5.0, 12.0, 25.0, 50.0, 100.0])
"""Stretches of the shortest way to the goal, in hull lengths; the whole way is always tried too."""
AGILE_WAYS = np.array([1.5, 2.5, 4.0, 7.0, 12.0, 25.0, 50.0, 100.0])
"""The same for agile vessels."""
AGILE_STRAIGHTS = np.array([1.5, 2.5, 6.0])
"""Straight legs of agile vessels besides the best joints, beyond the run-up, in hull lengths."""
COURSES = np.arange(6) * np.pi / 3
"""Courses of straight legs of agile vessels, from the heading that the run before ends with."""
HEADINGS = np.arange(16) * np.pi / 8
"""Headings of runs, from that heading or from the direction of the way."""
WAY_OFFSETS = np.deg2rad([0, 30, -30, 60, -60, 90, -90, 135, -135, 180])


@dataclass(frozen=True, kw_only=True, eq=False)
class Options:
    """Ways to go on, one per row.

    Attributes:
        parent: (n,) index of the partial plan.
        primitive: (n,) index of the run to do next.
        start: (n, 3) where it begins.
        leg_s: (n,) time to get there.
        turn: (n,) angle of the arc that leads there, before a straight; nan for others.
        straight: (n,) whether a straight line leads there.
    """

    parent: np.ndarray
    primitive: np.ndarray
    start: Array
    leg_s: Array
    turn: Array
    straight: np.ndarray

    def __getitem__(self, rows: np.ndarray) -> Options:
        return Options(**{name: column[rows] for name, column in vars(self).items()})


def joined(parts: Sequence[Options]) -> Options:
    """All rows of several sets of options."""
    return Options(**{name: np.concatenate([vars(part)[name] for part in parts]) for name in vars(parts[0])})


def continuations(space: SearchSpace, beam: PartialPlans, q: int) -> list[Options]:
    """Every way to begin primitive q after each partial plan."""
    able = np.flatnonzero(beam.left[:, q] > 0)
    runup = np.array([_run_up(space, int(last), q) for last in beam.last[able]])
    if space.times is not None:
        times, more_m = space.times, runup - space.hull_m
        return [
            _joints(space, times, beam, able, q, more_m),
            _straights(space, times, beam, able, q, more_m),
            _ways(space, times, beam, able, q),
        ]
    if space.helm_times is not None:
        return [_helmed(space, space.helm_times, beam, able, q, runup)]
    change_s = np.abs(beam.exit_mps[able] - space.stamps[q].entry_mps) / space.ship.acceleration_mps2
    return [_arcs(space, beam, able, q, runup, change_s), _transits(space, beam, able, q, change_s)]


def _helmed(
    space: SearchSpace, times: HelmTimes, beam: PartialPlans, able: np.ndarray, q: int, runup: Array
) -> Options:
    """Arcs and stretches of the way of ships with a helm, in the time that changes of speed and turns take."""
    no_s, entry_mps = np.zeros(len(able)), space.stamps[q].entry_mps
    found = joined([_arcs(space, beam, able, q, runup, no_s), _transits(space, beam, able, q, no_s)])
    ways_m, leg_s = found.leg_s * times.speed_mps, np.zeros(len(found.leg_s))
    for (last, exit_mps), where in _alike(beam, found.parent).items():
        froms, tos = beam.pose[found.parent[where]], found.start[where]
        leg_s[where] = np.maximum(
            times.between_s(froms, tos, space.off(last), exit_mps, entry_mps, current_to=space.current_to),
            np.where(np.isnan(found.turn[where]), times.seconds(ways_m[where], exit_mps, entry_mps), 0.0),
        )
    return replace(found, leg_s=leg_s)


def _run_up(space: SearchSpace, last: int, q: int) -> float:
    """Straight before a run [m]: one hull length to settle, or the ship's own run-up, more after failures."""
    before = space.stamps[last].name if last >= 0 else ""
    more_m = space.hull_m * space.run_up.get((before, space.stamps[q].name), 0.0)
    return max(space.hull_m, space.ship.run_up_m) + more_m


def _departures(space: SearchSpace, beam: PartialPlans) -> tuple[Array, Array]:
    """(b, 3) places from which ships go on, with courses for headings, and (b,) how long it takes to come to that."""
    if space.recoveries is None:
        return beam.pose, np.zeros(len(beam.pose))
    steps = np.array([space.off(int(last)) for last in beam.last])
    return moved(beam.pose, steps[:, :3]), steps[:, 3]


def _arcs(space: SearchSpace, beam: PartialPlans, able: np.ndarray, q: int, runup: Array, change_s: Array) -> Options:
    turn, extra = (grid.ravel() for grid in np.meshgrid(TURNS, STRAIGHTS * space.hull_m))
    departures, checked_s = _departures(space, beam)
    pose = np.repeat(departures[able], len(turn), axis=0)
    turns, straight = np.tile(turn, len(able)), np.tile(extra, len(able)) + np.repeat(runup, len(turn))
    length = space.ship.turning_radius_m * np.abs(turns) + straight
    leg_s = length / space.ship.transit_speed_mps + np.repeat(change_s + checked_s[able], len(turn))
    start = _arc_end(pose, turns, straight, space.ship.turning_radius_m)
    parent = np.repeat(able, len(turn))
    return _options(q, parent, start, leg_s, turn=turns)


def _options(
    q: int, parent: np.ndarray, start: Array, leg_s: Array, *, turn: Array | None = None, straight: bool = False
) -> Options:
    n = len(parent)
    turn = np.full(n, np.nan) if turn is None else turn
    return Options(
        parent=parent, primitive=np.full(n, q), start=start, leg_s=leg_s, turn=turn, straight=np.full(n, straight)
    )


def _joints(
    space: SearchSpace, times: LegTimes, beam: PartialPlans, able: np.ndarray, q: int, more_m: Array
) -> Options:
    """Runs near the end of the one before, placed and headed as suits the joint."""
    parents, steps, seconds = [np.zeros(0, dtype=int)], [np.zeros((0, 3))], [np.zeros(0)]
    entry = np.array(space.stamps[q].entry_mps)
    for (last, exit_mps), where in _alike(beam, able).items():
        tried = space.tried.get((space.stamps[last].name if last >= 0 else "", space.stamps[q].name))
        found, longer = joints(times, exit_mps, float(entry), short=tried is None), float(more_m[where[0]])
        step, leg_s = found.step, found.seconds + space.more_s(last, q)
        if tried is not None:
            step, leg_s = np.vstack([step, tried.step]), np.r_[leg_s, tried.seconds]
        if longer:  # straight before the run
            step = step + longer * np.column_stack([np.cos(step[:, 2]), np.sin(step[:, 2]), 0 * leg_s])
            leg_s = times.step_s(step, np.array(exit_mps), entry) + space.more_s(last, q)
        parents.append(np.repeat(able[where], len(leg_s)))
        steps.append(np.tile(step, (len(where), 1)))
        seconds.append(np.tile(leg_s, len(where)))
    return _stepped(space, beam, q, *(np.concatenate(part) for part in (parents, steps, seconds)))


def _alike(beam: PartialPlans, able: np.ndarray) -> dict[tuple[int, float], np.ndarray]:
    """Rows of `able` by the run that was last and its speed at the end."""
    keys = [(int(last), float(speed)) for last, speed in zip(beam.last[able], beam.exit_mps[able], strict=True)]
    return {key: np.flatnonzero([other == key for other in keys]) for key in dict.fromkeys(keys)}


def _stepped(space: SearchSpace, beam: PartialPlans, q: int, parent: np.ndarray, step: Array, leg_s: Array) -> Options:
    """Options at steps through water (n, 3) from where partial plans end."""
    start = moved(beam.pose[parent], step)
    start[:, :2] += leg_s[:, None] * space.current_to
    return _options(q, parent, start, leg_s, straight=True)


def _straights(
    space: SearchSpace, times: LegTimes, beam: PartialPlans, able: np.ndarray, q: int, more_m: Array
) -> Options:
    course, length, heading = (
        grid.ravel() for grid in np.meshgrid(COURSES, AGILE_STRAIGHTS * space.hull_m, HEADINGS, indexing="ij")
    )
    parent = np.repeat(able, len(course))
    course, heading = np.tile(course, len(able)), np.tile(heading, len(able))
    length = np.tile(length, len(able)) + np.repeat(more_m, len(parent) // max(len(able), 1))
    step = np.column_stack([length * np.cos(course), length * np.sin(course), heading])
    leg_s = times.step_s(step, beam.exit_mps[parent], np.array(space.stamps[q].entry_mps))
    leg_s += np.array([space.more_s(int(last), q) for last in beam.last])[parent]
    return _stepped(space, beam, q, parent, step, leg_s)


def _ways(space: SearchSpace, times: LegTimes, beam: PartialPlans, able: np.ndarray, q: int) -> Options:
    """Runs at points of the way to the goal, with any heading."""
    parents, starts, seconds = [np.zeros(0, dtype=int)], [np.zeros((0, 3))], [np.zeros(0)]
    entry = np.array(space.stamps[q].entry_mps)
    for index in able:
        pose = beam.pose[index]
        points, along = _way_points(space, pose, AGILE_WAYS)
        if not len(points):
            continue
        direction = np.arctan2(points[:, 3], points[:, 2])
        near = along < 10 * space.hull_m
        to_point = np.arctan2(*(points[:, :2] - pose[:2]).T[::-1])
        first = pose[2] - np.where(near, to_point, direction[0])
        heading = direction[:, None] + HEADINGS
        helped_m = (points[:, :2] - pose[:2]) @ space.current_to / times.speed_mps
        leg_s = times.seconds(
            np.maximum(along - helped_m, 0.0)[:, None],
            first[:, None],
            heading - np.where(near, to_point, direction)[:, None],
            heading - pose[2],
            beam.exit_mps[index],
            entry,
        ) + space.more_s(int(beam.last[index]), q)
        placed = np.repeat(points[:, :2], len(HEADINGS), axis=0)
        starts.append(np.column_stack([placed, heading.ravel()]))
        seconds.append(leg_s.ravel())
        parents.append(np.full(len(placed), index))
    return _options(q, np.concatenate(parents), np.concatenate(starts), np.concatenate(seconds))


def _arc_end(pose: Array, turn: Array, straight: Array, radius: float) -> Array:
    """Poses after an arc and a straight; the b-frame end of an arc is R (sin |turn|, +-(1 - cos turn))."""
    forward = radius * np.sin(np.abs(turn)) + straight * np.cos(turn)
    starboard = np.sign(turn) * radius * (1 - np.cos(turn)) + straight * np.sin(turn)
    return moved(pose, np.stack([forward, starboard, turn], axis=1))


def _transits(space: SearchSpace, beam: PartialPlans, able: np.ndarray, q: int, change_s: Array) -> Options:
    parents, starts, times = [], [], []
    departures, checked_s = _departures(space, beam)
    for index, wait in zip(able, change_s + checked_s[able], strict=True):
        points, along = _way_points(space, departures[index], WAYS)
        if not len(points):
            continue
        heading = np.arctan2(points[:, 3], points[:, 2])
        first = np.abs(wrap_angle(heading[:1] - departures[index, 2]))
        for offset in WAY_OFFSETS:
            turned = 0.0 if space.helm_times is not None else abs(offset) + first  # theirs are told by their curves
            length = along + space.ship.turning_radius_m * turned
            starts.append(np.column_stack([points[:, :2], heading + offset]))
            times.append(length / space.ship.transit_speed_mps + wait)
            parents.append(np.full(len(points), index))
    return _options(
        q,
        np.concatenate([np.zeros(0, dtype=int), *parents]),
        np.concatenate([np.zeros((0, 3)), *starts]),
        np.concatenate([np.zeros(0), *times]),
    )


def _way_points(space: SearchSpace, pose: Array, stretches: Array) -> tuple[Array, Array]:
    """Rows (north, east, direction north, direction east) along the way to the goal, and their distances along it."""
    way = space.goal_way.way(pose[:2])
    steps = np.hypot(*np.diff(way, axis=0).T)
    way, steps = way[np.r_[True, steps > 1e-6]], steps[steps > 1e-6]
    if not len(steps):
        return np.zeros((0, 4)), np.zeros(0)
    along = np.r_[0.0, np.cumsum(steps)]
    wished = np.r_[stretches * space.hull_m, along[-1]]
    wished = wished[wished <= along[-1]]
    piece = np.clip(np.searchsorted(along, wished, side="left") - 1, 0, len(steps) - 1)
    places = np.stack([np.interp(wished, along, column) for column in way.T], axis=1)
    return np.column_stack([places, np.diff(way, axis=0)[piece] / steps[piece, None]]), wished


def run_ends(space: SearchSpace, primitive: np.ndarray, start: Array) -> Array:
    """(n, 3) poses at the ends of runs (n,) of the space's primitives that begin at poses (n, 3)."""
    steps = np.array([item.displacement for item in space.stamps])[primitive]
    end = moved(start, steps)
    end[:, :2] += space.current_to * np.array([item.duration_s for item in space.stamps])[primitive][:, None]
    return end


def clear_options(space: SearchSpace, plans: PartialPlans, options: Options) -> np.ndarray:
    """(n,) whether legs, runs and their ends keep their margins on the grid."""
    start, turn = options.start, options.turn
    clear = _ends_clear(space, options.primitive, start)
    arcs = np.flatnonzero(clear & ~np.isnan(turn))
    clear[arcs] = _arcs_clear(space, _departures(space, plans)[0][options.parent[arcs]], turn[arcs], start[arcs])
    lines = np.flatnonzero(clear & options.straight)
    clear[lines] = _lines_clear(space, plans.pose[options.parent[lines]], start[lines])
    left = np.flatnonzero(clear)
    clear[left] = _hulls_clear(space, options.primitive[left], start[left])
    return clear


def runs_clear(space: SearchSpace, primitive: np.ndarray, start: Array) -> np.ndarray:
    """(n,) whether runs (n,) from poses (n, 3) and their ends keep their margins on the grid."""
    return np.asarray(_ends_clear(space, primitive, start) & _hulls_clear(space, primitive, start))


def _ends_clear(space: SearchSpace, primitive: np.ndarray, start: Array) -> np.ndarray:
    clear = space.field.at(start[:, :2]) >= space.leg_margin_m
    for bad in space.refused:
        near = np.hypot(*(start[:, :2] - bad[:2]).T) < space.hull_m / 2
        clear &= ~(near & (np.abs(wrap_angle(start[:, 2] - bad[2])) < 0.2))
    return np.asarray(clear & (space.field.at(run_ends(space, primitive, start)[:, :2]) >= space.leg_margin_m))


def _hulls_clear(space: SearchSpace, primitive: np.ndarray, start: Array) -> np.ndarray:
    clear = np.ones(len(start), dtype=bool)
    for q in np.unique(primitive):
        some = np.flatnonzero(primitive == q)
        item = space.stamps[q]
        c, s = np.cos(start[some, 2])[:, None], np.sin(start[some, 2])[:, None]
        north = start[some, :1] + c * item.discs[:, 0] - s * item.discs[:, 1] + space.current_to[0] * item.times_s
        east = start[some, 1:2] + s * item.discs[:, 0] + c * item.discs[:, 1] + space.current_to[1] * item.times_s
        clear[some] = (space.field.at(np.stack([north, east], axis=-1)) >= item.room_m).all(axis=1)
    return clear


def _arcs_clear(space: SearchSpace, pose: Array, turn: Array, start: Array) -> np.ndarray:
    """Whether arc-and-straight legs from poses to run starts keep the leg margin at points along them."""
    radius = space.ship.turning_radius_m
    corner = _arc_end(pose, turn, np.zeros(len(turn)), radius)
    shares = np.linspace(0.1, 1.0, 10)
    clear = np.ones(len(turn), dtype=bool)
    for share in shares:
        on_arc = _arc_end(pose, share * turn, np.zeros(len(turn)), radius)[:, :2]
        on_line = corner[:, :2] + share * (start[:, :2] - corner[:, :2])
        clear &= np.minimum(space.field.at(on_arc), space.field.at(on_line)) >= space.leg_margin_m
    return clear


def _lines_clear(space: SearchSpace, pose: Array, start: Array) -> np.ndarray:
    """Whether straight lines between poses keep the leg margin at points along them, their own ends apart."""
    clear = np.ones(len(pose), dtype=bool)
    for share in np.linspace(0.2, 1.0, 9):
        clear &= space.field.at((1 - share) * pose[:, :2] + share * start[:, :2]) >= space.leg_margin_m
    return clear
