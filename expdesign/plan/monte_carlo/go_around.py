"""Go-around paths of ships that sail arcs: from wherever they are to the beginning of a run-up.

The shortest Dubins curve where the water has room for it; else one through places from which such curves lead on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from expdesign.plan.chart import polyline_length
from expdesign.plan.legs import dubins_curve
from expdesign.values import Array

RINGS = (2.0, 4.0, 7.0, 11.0)
"""Distances of places looked at from the goal, in turning radii."""
BEARINGS, COURSES = 12, 8
"""Bearings and courses of places on each."""
TRIES = 60
"""Places tried for each ship, from those that promise the shortest way on."""
CURVES, ONWARD = 3, 6
"""Curves in a way on from a place at most, and places tried for its next."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GoAroundPaths:
    """All ways to a pose.

    Attributes:
        goal: (3,) place and course.
        radius_m: of the ship's turns.
        spacing_m: between points of ways.
        holds: whether a way (k, 2) stays in the water.
    """

    goal: Array
    radius_m: float
    spacing_m: float
    holds: Callable[[Array], bool]

    def find(self, pose: Array) -> Array | None:
        """A way (k, 2) from a pose (3,), or None where none was found."""
        direct = self._curve(pose, self.goal)
        return direct if self.holds(direct) else self._through(pose, self._known, TRIES)

    def _through(self, pose: Array, known: _Known, tries: int) -> Array | None:
        """A way through a place from which a way on is known, of some that promise the shortest, or None."""
        first_m = np.hypot(*(known.places[:, :2] - pose[:2]).T)
        for index in np.argsort(first_m + known.left_m, kind="stable")[:tries].tolist():
            first = self._curve(pose, known.places[index])
            if self.holds(first):
                return np.concatenate([first, known.ways[index][1:]])
        return None

    def _curve(self, start: Array, end: Array) -> Array:
        return dubins_curve(start, end, radius_m=self.radius_m, spacing_m=self.spacing_m)[:, :2]

    @cached_property
    def _known(self) -> _Known:
        """Places from which ways to the goal are known: those of one curve first, then through these."""
        places = [place for place in self._around() if self.holds(np.stack([place[:2], place[:2] + 1e-3]))]
        found: list[tuple[Array, Array]] = []
        known = _known(found)
        for _ in range(CURVES):
            through = [
                (place, self._through(place, known, ONWARD) if found else self._direct(place)) for place in places
            ]
            places = [place for place, way in through if way is None]
            found += [(place, way) for place, way in through if way is not None]
            known = _known(found)
        return known

    def _direct(self, place: Array) -> Array | None:
        way = self._curve(place, self.goal)
        return way if self.holds(way) else None

    def _around(self) -> list[Array]:
        """(3,) poses all round the goal."""
        bearings, courses = (2 * np.pi * np.arange(count) / count for count in (BEARINGS, COURSES))
        north, east, heading = self.goal
        return [
            np.array(
                [
                    north + ring * self.radius_m * np.cos(heading + bearing),
                    east + ring * self.radius_m * np.sin(heading + bearing),
                    heading + course,
                ]
            )
            for ring, bearing, course in product(RINGS, bearings, courses)
        ]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Known:
    """Places (k, 3) and the ways on from each."""

    places: Array
    ways: tuple[Array, ...]
    left_m: Array


def _known(found: list[tuple[Array, Array]]) -> _Known:
    return _Known(
        places=np.array([place for place, _ in found]).reshape(-1, 3),
        ways=tuple(way for _, way in found),
        left_m=np.array([polyline_length(way) for _, way in found]),
    )
