"""From a curved track to few straight legs: chords, the corridor beside them, and the samples that waypoints stand at.

A corridor says how far to port and to starboard of a leg the ship may be, as seen when sailing it; beyond its ends it
is round. A waypoint stands at one sample, or at a stop: an area that the ship stays in for a while. The legs between
them are the cheapest path through a graph: each leg costs one, and more the wider its corridor, the shorter the leg,
and the more it mixes runs with each other or with the way to them. Corridors are held against the water where the path
uses them, and the path is sought again without those that leave it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely

from expdesign.errors import NoPlan
from expdesign.plan.values import Leg
from expdesign.values import Array

WAYPOINT_SPACING = 2.0  # least distance between waypoints of the route for the bridge, in ship lengths
STOP_RADIUS = 2.5  # farthest that the ship goes from a waypoint it stays at, in ship lengths
CORRIDOR_HALVINGS = 6  # of the step from the corridor that is needed to the one that is wanted
MOST_MIXED_RUNS = 2  # runs in one leg
STOP_COST = 1.5  # of each ship length that the ship goes from a waypoint it stays at, in legs
MIXED_COST = 10.0  # of each run in a leg beyond the first, in legs
DIVIDED_COST = 5.0  # of a waypoint inside a run, in legs
WIDE_WAY_COST, WIDE_RUN_COST = 1.0, 0.3  # of each ship length of cross-track distance, in legs
WAY_IN_RUN_COST = 0.4  # of each ship length between runs that is sailed in the leg of a run, in legs
NEAR_COST = 50.0  # of two waypoints that are too near to each other, in legs
DRY_COST = 1000.0  # of a corridor that leaves the water, in legs


def cut_into_chords(
    points: Array, *, boundaries: Sequence[int], tolerance_m: float, water: shapely.MultiPolygon | None
) -> list[int]:
    """Indices of the samples that the chords connect.

    Between two of them every sample lies within the tolerance of the chord, the track does not run back along it by
    more than the tolerance, and the chord stays in the water.

    Args:
        points: (k, 2) north, east [m], in time order.
        boundaries: indices to keep, the first and the last sample among them.
        tolerance_m: largest cross-track error [m].
        water: where chords may go, in (east, north), or None for anywhere.

    Raises:
        NoPlan: the track itself leaves the water.

    Source: D. H. Douglas and T. K. Peucker (1973), with a test for reversals and one for water.
    """
    kept = set(boundaries)
    waiting = list(pairwise(boundaries))[::-1]
    while waiting:
        first, last = waiting.pop()
        split = _split(points, first, last, tolerance_m, water)
        if split is not None:
            kept.add(split)
            waiting += [(split, last), (first, split)]
    return sorted(kept)


def _split(points: Array, first: int, last: int, tolerance_m: float, water: shapely.MultiPolygon | None) -> int | None:
    """Where the chord must be broken, or None when it is acceptable."""
    off, back = _off_and_back(points[first : last + 1])
    if last - first > 1 and off.max() > tolerance_m:
        return first + int(off.argmax())
    if last - first > 1 and back[1] > tolerance_m:
        return first + back[0]
    if chord_in_water(points[first], points[last], water):
        return None
    if last - first == 1:
        north, east = points[first]
        raise NoPlan(f"the track leaves the allowed water near north {north:.0f} m, east {east:.0f} m")
    inner = int(off[1:-1].argmax()) + 1
    return first + (inner if off[inner] > 0 else (last - first) // 2)


def _off_and_back(points: Array) -> tuple[Array, tuple[int, float]]:
    """(k,) distances to the chord, and the sample before the largest backward motion along it with its size [m]."""
    chord = points[-1] - points[0]
    length = float(np.hypot(*chord))
    from_start = points - points[0]
    if length == 0.0:
        return np.hypot(*from_start.T), (0, 0.0)
    along = from_start @ chord / length
    nearest = np.outer(np.clip(along, 0.0, length) / length, chord)
    reached = np.maximum.accumulate(along)
    worst = int((reached - along).argmax())
    return np.hypot(*(from_start - nearest).T), (int(along[: worst + 1].argmax()), float(reached[worst] - along[worst]))


def chord_in_water(start: Array, end: Array, water: shapely.MultiPolygon | None) -> bool:
    """Whether the straight line between two points (2,) north, east stays in the water."""
    return water is None or bool(water.covers(shapely.LineString([start[::-1], end[::-1]])))


def merge_standing(
    points: Array, ends: Sequence[int], *, distance_m: float, water: shapely.MultiPolygon | None
) -> list[tuple[int, int]]:
    """Chord ends that nearly coincide become one point with an arrival and a departure sample.

    Turning on the spot and lying still are no legs of a route. A point is kept where leaving it out would send the
    next chord out of the water.

    Args:
        points: (k, 2) north, east [m].
        ends: samples that chords connect.
        distance_m: points nearer than this to the first of their group join it [m].
        water: where chords may go, in (east, north), or None for anywhere.

    Returns:
        (arrival, departure) samples of each remaining point; its place is that of the arrival.
    """
    groups = [(ends[0], ends[0])]
    for number, sample in enumerate(ends[1:], start=1):
        place = groups[-1][0]
        near = float(np.hypot(*(points[sample] - points[place]))) < distance_m
        following = points[ends[min(number + 1, len(ends) - 1)]]
        if near and chord_in_water(points[place], following, water):
            groups[-1] = (place, sample)
        else:
            groups.append((sample, sample))
    return groups


Sides = tuple[float, float]
"""Widths to port and to starboard [m]."""


def sides_needed(points: Array, start: Array, end: Array) -> Sides:
    """Largest distances of points (k, 2) north, east from the leg, to port and to starboard [m]."""
    along = end - start
    length = float(np.hypot(*along))
    from_start = points - start
    if length == 0.0:
        away = float(np.hypot(*from_start.T).max(initial=0.0))
        return away, away
    share = np.clip(from_start @ along / length**2, 0.0, 1.0)
    away = np.hypot(*(from_start - np.outer(share, along)).T)
    to_starboard = along[0] * from_start[:, 1] - along[1] * from_start[:, 0] >= 0.0
    port = float(away[~to_starboard].max(initial=0.0))
    return port, float(away[to_starboard].max(initial=0.0))


def corridor(start: Array, end: Array, sides: Sides) -> shapely.Geometry:
    """Everything that is within the sides of a leg, in (east, north).

    Its rounded ends are drawn by polygons around the arcs, so that it is never smaller than what it stands for.
    """
    line = shapely.LineString([start[::-1], end[::-1]])
    parts = []
    for side, sign in zip(sides, (-1.0, 1.0), strict=True):
        if side > 0.0:
            around = line.buffer(side / np.cos(np.pi / 64), quad_segs=16)
            parts.append(shapely.intersection(around, _half(start, end, sign, 4.0 * (side + line.length))))
    return shapely.union_all([line, *parts])


def _half(start: Array, end: Array, sign: float, size: float) -> shapely.Polygon:
    """A rectangle on one side of a leg; -1 is port."""
    along = (end - start) / max(float(np.hypot(*(end - start))), 1e-9)
    across = sign * np.array([-along[1], along[0]])
    middle = (start + end) / 2
    corners = [middle - size * along, middle + size * along]
    corners += [corners[1] + size * across, corners[0] + size * across]
    return shapely.Polygon([corner[::-1] for corner in corners])


def corridor_in_water(
    start: Array, end: Array, sides: Sides, *, water: shapely.Geometry | None, half_beam_m: float
) -> bool:
    """Whether a ship of this beam whose centre is in the corridor of a leg, heading along it, is in the water."""
    if water is None:
        return True
    wide = (sides[0] + half_beam_m, sides[1] + half_beam_m)
    return bool(water.covers(corridor(start, end, wide)))


def widened(
    start: Array,
    end: Array,
    needed: Sides,
    *,
    wanted: Sides,
    water: shapely.Geometry | None,
    half_beam_m: float,
) -> Sides:
    """The needed sides, each widened to what is wanted or to what the water allows."""
    sides = list(needed)
    for index in (0, 1):
        low, high = sides[index], wanted[index]
        if low >= high:
            continue
        for _ in range(CORRIDOR_HALVINGS):
            sides[index] = high
            if corridor_in_water(start, end, (sides[0], sides[1]), water=water, half_beam_m=half_beam_m):
                low = high
                break
            high = low + (high - low) / 2
        sides[index] = low
    return sides[0], sides[1]


Stop = tuple[int, int]
"""Samples of arrival and departure; the waypoint is where the ship is on arrival."""
Fits = Callable[[Stop, Stop, Sides], bool]
"""Whether the corridor of the leg between two stops keeps to the water."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Passage:
    """A track whose waypoints are to be chosen."""

    points: Array  # (k, 2) north, east [m]
    legs: Sequence[Leg]  # of the plan
    length_m: float  # of the ship
    sailed_m: Array = field(init=False)

    def __post_init__(self) -> None:
        steps = np.hypot(*np.diff(self.points, axis=0).T)
        object.__setattr__(self, "sailed_m", np.concatenate([[0.0], np.cumsum(steps)]))

    @property
    def spacing_m(self) -> float:
        """Least distance between neighbouring waypoints [m]."""
        return WAYPOINT_SPACING * self.length_m

    def sides(self, one: Stop, two: Stop) -> Sides:
        """What the corridor between two stops must hold: the track from one to the other, and both stops [m]."""
        return sides_needed(self.points[one[0] : two[1] + 1], self.points[one[0]], self.points[two[0]])

    def cost(self, one: Stop, two: Stop) -> float:
        """Cost of a leg and of the stop that it leaves; infinite where it would hold more runs than can be mixed."""
        runs = [leg for leg in self.legs if leg.kind == "primitive" and leg.first < two[0] and leg.last > one[1]]
        if len(runs) > MOST_MIXED_RUNS:
            return np.inf
        transit_m = self.sailed_m[two[0]] - self.sailed_m[one[1]]
        for run in runs:
            transit_m -= self.sailed_m[min(run.last, two[0])] - self.sailed_m[max(run.first, one[1])]
        cost = 1.0 + STOP_COST * self.radius_m(one) / self.length_m + MIXED_COST * max(len(runs) - 1, 0)
        cost += DIVIDED_COST * sum(run.first < two[0] < run.last for run in runs)
        wide = WIDE_RUN_COST if runs else WIDE_WAY_COST
        cost += wide * max(self.sides(one, two)) / self.length_m
        cost += WAY_IN_RUN_COST * transit_m / self.length_m if runs else 0.0
        near = float(np.hypot(*(self.points[two[0]] - self.points[one[0]]))) < self.spacing_m
        return float(cost + NEAR_COST * near)

    def radius_m(self, stop: Stop) -> float:
        """How far the ship goes from its place on arrival [m]."""
        return float(np.hypot(*(self.points[stop[0] : stop[1] + 1] - self.points[stop[0]]).T).max())


def choose_stops(passage: Passage, samples: Sequence[int], *, fits: Fits) -> list[Stop]:
    """The stops of the cheapest path from the first sample to the last.

    Args:
        samples: where waypoints may be, ascending; between neighbours a straight leg is near enough to the track.
        fits: held against the legs of a path; a leg between neighbours stays even where it does not fit.
    """
    stops = _stops(passage, samples)
    order = {sample: number for number, sample in enumerate(samples)}
    costs = {
        (i, j): cost
        for j, two in enumerate(stops)
        for i, one in enumerate(stops)
        if one[1] < two[0] and np.isfinite(cost := passage.cost(one, two))
    }
    tried: set[tuple[int, int]] = set()
    while True:
        path = _cheapest(stops, costs, last=samples[-1])
        new = [edge for edge in pairwise(path) if edge not in tried]
        tried.update(new)
        wrong = [(i, j) for i, j in new if not fits(stops[i], stops[j], passage.sides(stops[i], stops[j]))]
        for i, j in wrong:
            apart = order[stops[j][0]] - order[stops[i][1]]
            costs[i, j] += DRY_COST * (apart > 1 or stops[i][0] < stops[i][1] or stops[j][0] < stops[j][1])
        if not wrong:
            return [stops[number] for number in path]


def _stops(passage: Passage, samples: Sequence[int]) -> list[Stop]:
    """Every sample, and every beginning of a leg of the plan as a stop for as long as the ship is near.

    The last waypoint is where the track ends, so that no stop lasts until then.
    """
    ends = [leg.first for leg in passage.legs]
    stops = [(sample, sample) for sample in samples]
    for number, arrival in enumerate(ends):
        for departure in ends[number + 1 :]:
            if passage.radius_m((arrival, departure)) > STOP_RADIUS * passage.length_m:
                break
            stops.append((arrival, departure))
    return sorted(stops)


def _cheapest(stops: Sequence[Stop], costs: dict[tuple[int, int], float], *, last: int) -> list[int]:
    """Numbers of the stops of the cheapest path from the first sample to the last."""
    best = {number: (0.0, -1) for number, stop in enumerate(stops) if stop[0] == stops[0][0]}
    for (i, j), cost in costs.items():
        if i in best and (j not in best or best[i][0] + cost < best[j][0]):
            best[j] = (best[i][0] + cost, i)
    path = [min((number for number in best if stops[number][1] == last), key=lambda number: best[number][0])]
    while best[path[-1]][1] >= 0:
        path.append(best[path[-1]][1])
    return path[::-1]
