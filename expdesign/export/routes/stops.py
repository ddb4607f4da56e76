"""Few waypoints for the bridge: which samples of the track they stand at.

A waypoint stands at one sample, or at a stop: an area that the ship stays in for a while. The legs between them are the
cheapest path through a graph: each leg costs one, and more the wider its corridor, the shorter the leg, and the more it
mixes runs with each other or with the way to them. Corridors are held against the water where the path uses them, and
the path is sought again without those that leave it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from expdesign.export.routes.corridor import Sides, sides_needed
from expdesign.export.tuning import TUNING
from expdesign.plan.values import Leg
from expdesign.values import Array

Stop = tuple[int, int]
"""Samples of arrival and departure; the waypoint is where the ship is on arrival."""
Fits = Callable[[Stop, Stop, Sides], bool]
"""Whether the corridor of the leg between two stops keeps to the water."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Passage:
    """A track whose waypoints are to be chosen.

    Attributes:
        points: (k, 2) north, east [m].
        legs: of the plan.
        length_m: of the ship.
    """

    points: Array
    legs: Sequence[Leg]
    length_m: float
    sailed_m: Array = field(init=False)

    def __post_init__(self) -> None:
        steps = np.hypot(*np.diff(self.points, axis=0).T)
        object.__setattr__(self, "sailed_m", np.concatenate([[0.0], np.cumsum(steps)]))

    @property
    def spacing_m(self) -> float:
        """Least distance between neighbouring waypoints [m]."""
        return TUNING.waypoint_spacing * self.length_m

    def sides(self, one: Stop, two: Stop) -> Sides:
        """What the corridor between two stops must hold: the track from one to the other, and both stops [m]."""
        return sides_needed(self.points[one[0] : two[1] + 1], self.points[one[0]], self.points[two[0]])

    def cost(self, one: Stop, two: Stop) -> float:
        """Cost of a leg and of the stop that it leaves; infinite where it would hold more runs than can be mixed."""
        runs = [leg for leg in self.legs if leg.kind == "primitive" and leg.first < two[0] and leg.last > one[1]]
        if len(runs) > TUNING.most_mixed_runs:
            return np.inf
        transit_m = self.sailed_m[two[0]] - self.sailed_m[one[1]]
        for run in runs:
            transit_m -= self.sailed_m[min(run.last, two[0])] - self.sailed_m[max(run.first, one[1])]
        cost = 1.0 + TUNING.stop_cost * self.radius_m(one) / self.length_m + TUNING.mixed_cost * max(len(runs) - 1, 0)
        cost += TUNING.divided_cost * sum(run.first < two[0] < run.last for run in runs)
        wide = TUNING.wide_run_cost if runs else TUNING.wide_way_cost
        cost += wide * max(self.sides(one, two)) / self.length_m
        cost += TUNING.way_in_run_cost * transit_m / self.length_m if runs else 0.0
        near = float(np.hypot(*(self.points[two[0]] - self.points[one[0]]))) < self.spacing_m
        return float(cost + TUNING.near_cost * near)

    def radius_m(self, stop: Stop) -> float:
        """How far the ship goes from its place on arrival [m]."""
        return float(np.hypot(*(self.points[stop[0] : stop[1] + 1] - self.points[stop[0]]).T).max())


def choose_stops(passage: Passage, samples: Sequence[int], *, fits: Fits) -> list[Stop]:
    """The stops of the cheapest path from the first sample to the last.

    Args:
        passage: the track.
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
            costs[i, j] += TUNING.dry_cost * (apart > 1 or stops[i][0] < stops[i][1] or stops[j][0] < stops[j][1])
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
            if passage.radius_m((arrival, departure)) > TUNING.stop_radius * passage.length_m:
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
