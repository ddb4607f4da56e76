"""A route: waypoints, how far from the straight legs between them the track may be, and the allowed water around.

A route says where the ship goes and when. It cannot say how a zig-zag is steered: that is what the command file is for.
How well it fits the track is measured for every leg, after rounding to file decimals: a chart system sails a leg as a
rhumb line or a great circle, the plan's frame is a transverse Mercator projection, and the three differ by less.

The fence is a geofence for autopilots, few polygons that are never larger than the allowed water. It holds for the
ship's centre: it lies at least half a beam inside.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np
import pyproj
import shapely

from expdesign.conventions import METRES_PER_NAUTICAL_MILE
from expdesign.errors import InputError
from expdesign.sea_area import LocalFrame, eroded
from expdesign.values import Array

FENCE_MARGIN = 0.1  # room around the track, as a share of its extent, that the fence may cover
FENCE_HALVINGS = 12  # of the slack by which the fence is simplified, until it keeps to the water
DECIMALS = 7


@dataclass(frozen=True, kw_only=True)
class Fence:
    """One polygon to stay in and some to stay out of; rings are open, (latitude, longitude) [deg]."""

    inside: tuple[tuple[float, float], ...]  # ring, counter-clockwise as seen on a chart
    outside: tuple[tuple[tuple[float, float], ...], ...]  # rings of what is forbidden within it, clockwise


def build_fence(
    points: Array, *, water: shapely.Geometry, beam_m: float, clearance_m: float, frame: LocalFrame
) -> Fence | None:
    """The fence around a track, or None where the track touches the fence's own margin.

    Args:
        points: (k, 2) track, north and east [m].
        water: allowed water in (east, north).
        clearance_m: that the plan keeps; it is what the fence may be simplified by.
    """
    line = shapely.LineString(points[:, ::-1])
    west, south, east, north = line.bounds
    margin = FENCE_MARGIN * max(east - west, north - south) + 4 * (clearance_m + beam_m)
    near = shapely.intersection(water, shapely.box(west - margin, south - margin, east + margin, north + margin))
    slack = max(clearance_m, 0.1) / 2
    for _ in range(FENCE_HALVINGS):
        found = _simplified(near, line, inset_m=beam_m / 2 + slack, slack_m=slack)
        if found is not None:
            degrees = _in_degrees(found, frame)
            if _holds(degrees, near, line, frame):
                return degrees
        slack /= 2
    return None


def _simplified(
    water: shapely.Geometry, line: shapely.LineString, *, inset_m: float, slack_m: float
) -> shapely.Polygon | None:
    inner = shapely.simplify(eroded(water, inset_m, join_style="mitre"), slack_m, preserve_topology=True)
    parts = [part for part in shapely.get_parts(inner) if part.geom_type == "Polygon" and part.covers(line)]
    return shapely.orient_polygons(parts[0]) if parts else None


def _in_degrees(polygon: shapely.Polygon, frame: LocalFrame) -> Fence:
    def ring(line: shapely.LinearRing) -> tuple[tuple[float, float], ...]:
        corners = np.array(line.coords)[:-1, ::-1]
        return tuple((lat, lon) for lat, lon in frame.to_degrees(corners).round(DECIMALS).tolist())

    return Fence(inside=ring(polygon.exterior), outside=tuple(ring(hole) for hole in polygon.interiors))


def fence_polygon(fence: Fence, frame: LocalFrame) -> shapely.Polygon:
    """The fence as written, in (east, north) of a frame."""
    rings = [frame.to_metres(np.array(ring))[:, ::-1] for ring in (fence.inside, *fence.outside)]
    return shapely.Polygon(rings[0], rings[1:])


def _holds(fence: Fence, water: shapely.Geometry, line: shapely.LineString, frame: LocalFrame) -> bool:
    polygon = fence_polygon(fence, frame)
    return bool(polygon.is_valid and water.covers(polygon) and polygon.covers(line))


COMPARED_POINTS = 17  # points on each leg where a route is compared with the track


@dataclass(frozen=True, kw_only=True)
class RouteFit:
    """Accuracy of a route."""

    cross_track_m: float  # largest distance of the track from the leg sailed at that time, straight in the plan's frame
    loxodrome_m: float  # largest deviation of a rhumb line between two waypoints from that straight line
    orthodrome_m: float  # the same for a great circle (the geodesic)
    in_water: bool | None  # whether every leg lies in the allowed water; None when the chart was not at hand

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
    share = np.linspace(0, 1, COMPARED_POINTS)
    lon, lat = mercator(x[0] + share * (x[1] - x[0]), y[0] + share * (y[1] - y[0]), inverse=True)
    inner = geod.npts(ends[0, 1], ends[0, 0], ends[1, 1], ends[1, 0], COMPARED_POINTS)
    curves = (np.stack([lat, lon], axis=1), np.array([(lat, lon) for lon, lat in inner]))
    rhumb, circle = (float(shapely.distance(shapely.points(frame.to_metres(c)), straight).max()) for c in curves)
    return rhumb, circle


def _unwrapped(places_deg: Array) -> Array:
    """Two places with longitudes that do not jump at the antimeridian."""
    jump = np.round((places_deg[1, 1] - places_deg[0, 1]) / 360.0) * 360.0
    return np.asarray(places_deg - np.array([[0.0, 0.0], [0.0, jump]]))


ROUTE_NAME = "route"  # stem of the file names; ECDIS expect it as the name inside the file too
DEGREE_DECIMALS = 7
"""Resolution of all files, 11 mm, as autopilots store it. Routes are checked after rounding to it."""
XTD_STEP_M = METRES_PER_NAUTICAL_MILE / 10_000
LARGEST_XTD_M = 10 * METRES_PER_NAUTICAL_MILE


@dataclass(frozen=True, kw_only=True)
class Waypoint:
    """A point of the route, with the chord that leads to it."""

    name: str  # unique in the route
    # lat_deg, lon_deg: WGS84; longitude in [-180, 180)
    lat_deg: float
    lon_deg: float
    # north_m, east_m: the same place in the plan's frame [m]
    north_m: float
    east_m: float
    time_s: float  # arrival, from the start of the plan [s]
    stay_s: float  # time spent here before going on [s]
    speed_mps: float  # over ground along the chord to here, its length by its time [m/s]; 0 at the first waypoint
    leg: int  # index of the plan's leg that the chord belongs to; of the first leg at the first waypoint
    leg_kind: str  # "primitive" or "reposition"
    leg_name: str  # of the primitive, or what the repositioning leads to
    # xtd_port_m, xtd_starboard_m: cross-track distances of the chord to here, within which the track stays [m]; of the
    # first chord at the first waypoint
    xtd_port_m: float
    xtd_starboard_m: float
    held: str = ""  # what is run around this waypoint while the ship stays; "" for nothing

    def __post_init__(self) -> None:
        if not (-90 <= self.lat_deg <= 90 and -180 <= self.lon_deg < 180):
            raise InputError(f"waypoint {self.name} is at {self.lat_deg}, {self.lon_deg}: not a latitude and longitude")


@dataclass(frozen=True, kw_only=True)
class Route:
    """Waypoints in time order."""

    name: str  # stem of the file name
    # scenario, vessel: names
    scenario: str
    vessel: str
    waypoints: tuple[Waypoint, ...]  # two or more
    xtd_m: float  # largest cross-track distance of any leg, to either side [m]
    frame: LocalFrame  # relates north/east metres to latitude and longitude
    fit: RouteFit  # deviation of the legs, as written, from the track
    fence: Fence | None = None  # allowed water around the track, or None when the chart is not at hand
    departure: datetime | None = None  # UTC time of the first waypoint, or None when not fixed

    def __post_init__(self) -> None:
        if len(self.waypoints) < 2:
            raise InputError(f"the route has {len(self.waypoints)} distinct waypoints, expected 2 or more")
        names = [waypoint.name for waypoint in self.waypoints]
        if len(set(names)) < len(names):
            raise InputError("waypoint names of the route are not unique")
        if not 0 < self.xtd_m < LARGEST_XTD_M:
            raise InputError(f"cross-track distance is {self.xtd_m:g} m, expected more than 0 and less than 10 NM")
        if self.departure is not None and self.departure.tzinfo is None:
            raise InputError(f"departure {self.departure.isoformat()} has no time zone, expected e.g. Z for UTC")

    @property
    def length_m(self) -> float:
        """Length of the chords together [m]."""
        places = np.array([(point.north_m, point.east_m) for point in self.waypoints])
        return float(np.hypot(*np.diff(places, axis=0).T).sum())

    @property
    def speed_mps(self) -> float:
        """Mean speed while under way [m/s]."""
        under_way = self.waypoints[-1].time_s - sum(point.stay_s for point in self.waypoints[:-1])
        return self.length_m / under_way

    def utc(self, time_s: float) -> str | None:
        """Time of day in UTC as in XML, e.g. 2026-05-01T08:00:00Z, or None when the departure is not fixed."""
        if self.departure is None:
            return None
        moment = datetime.fromtimestamp(round(self.departure.timestamp() + time_s), UTC)
        return moment.strftime("%Y-%m-%dT%H:%M:%SZ")
