"""How well a route of waypoints fits the track: exact distances after rounding to file decimals.

A chart system sails a leg as a rhumb line or a great circle, the plan's frame is a transverse Mercator projection: the
three differ by less than the figures below, which are measured for every leg and not estimated.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pyproj
import shapely

from expdesign.export.tuning import TUNING
from expdesign.sea_area import LocalFrame
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True)
class RouteFit:
    """Accuracy of a route.

    Attributes:
        cross_track_m: largest distance of the track from the leg sailed at that time, straight in the plan's frame.
        loxodrome_m: largest deviation of a rhumb line between two waypoints from that straight line.
        orthodrome_m: the same for a great circle (the geodesic).
        in_water: whether every leg lies in the allowed water; None when the chart was not at hand.
    """

    cross_track_m: float
    loxodrome_m: float
    orthodrome_m: float
    in_water: bool | None

    @property
    def largest_m(self) -> float:
        """Bound on the distance of the track from the leg, for a rhumb line or a great circle [m]."""
        return self.cross_track_m + self.curved_m

    @property
    def curved_m(self) -> float:
        """Bound on the distance of a rhumb line or a great circle from the straight leg [m]."""
        return max(self.loxodrome_m, self.orthodrome_m)


def fit_route(
    points: Array,
    groups: list[tuple[int, int]],
    places_deg: Array,
    *,
    frame: LocalFrame,
    water: shapely.Geometry | None,
) -> RouteFit:
    """Measure a route.

    Args:
        points: (k, 2) track, north and east [m].
        groups: (arrival, departure) samples of each waypoint.
        places_deg: (n, 2) latitude and longitude of the waypoints as written.
        frame: the plan's.
        water: where legs may go, in (east, north), or None.
    """
    places = frame.to_metres(places_deg)
    across = 0.0
    for (one, two), (start, end) in zip(pairwise(groups), pairwise(places), strict=True):
        samples = shapely.points(points[one[0] : two[1] + 1])
        across = max(across, float(shapely.distance(samples, shapely.LineString([start, end])).max()))
    rhumb, circle = zip(*(_deviations(one, two, frame) for one, two in pairwise(places_deg)), strict=True)
    lines = shapely.linestrings(np.stack([places[:-1, ::-1], places[1:, ::-1]], axis=1))
    return RouteFit(
        cross_track_m=across,
        loxodrome_m=max(rhumb),
        orthodrome_m=max(circle),
        in_water=None if water is None else bool(shapely.covers(water, lines).all()),
    )


def _deviations(start_deg: Array, end_deg: Array, frame: LocalFrame) -> tuple[float, float]:
    """Deviation of the rhumb line and the geodesic between two places from the straight line in the frame [m]."""
    ends = _unwrapped(np.stack([start_deg, end_deg]))
    straight = shapely.LineString(frame.to_metres(ends))
    mercator, geod = pyproj.Proj(proj="merc", ellps="WGS84", lon_0=float(ends[0, 1])), pyproj.Geod(ellps="WGS84")
    x, y = mercator(ends[:, 1], ends[:, 0])
    share = np.linspace(0, 1, TUNING.compared_points)
    lon, lat = mercator(x[0] + share * (x[1] - x[0]), y[0] + share * (y[1] - y[0]), inverse=True)
    inner = geod.npts(ends[0, 1], ends[0, 0], ends[1, 1], ends[1, 0], TUNING.compared_points)
    curves = (np.stack([lat, lon], axis=1), np.array([(lat, lon) for lon, lat in inner]))
    rhumb, circle = (float(shapely.distance(shapely.points(frame.to_metres(c)), straight).max()) for c in curves)
    return rhumb, circle


def _unwrapped(places_deg: Array) -> Array:
    """Two places with longitudes that do not jump at the antimeridian."""
    jump = np.round((places_deg[1, 1] - places_deg[0, 1]) / 360.0) * 360.0
    return np.asarray(places_deg - np.array([[0.0, 0.0], [0.0, jump]]))
