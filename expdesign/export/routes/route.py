"""The plan as a route: straight chords between waypoints, near enough to the track to stay in safe water.

A route says where the ship goes and when. It cannot say how a zig-zag is steered: that is what the command file is for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
import shapely

from expdesign.conventions import METRES_PER_NAUTICAL_MILE
from expdesign.errors import InputError, NoPlan
from expdesign.export.routes.chords import cut_into_chords, merge_standing
from expdesign.export.routes.fence import Fence, build_fence, fence_polygon
from expdesign.export.routes.fit import RouteFit, fit_route
from expdesign.export.routes.planned import PlannedTrack
from expdesign.sea_area import LocalFrame, as_multipolygon
from expdesign.values import Array

ROUTE_NAME = "route"
"""Stem of the file names; ECDIS expect it as the name inside the file too."""
DEGREE_DECIMALS = 7
"""Resolution of all files, 11 mm, as autopilots store it. Routes are checked after rounding to it."""
XTD_STEP_M = METRES_PER_NAUTICAL_MILE / 10_000
LARGEST_XTD_M = 10 * METRES_PER_NAUTICAL_MILE


@dataclass(frozen=True, kw_only=True)
class Waypoint:
    """A point of the route, with the chord that leads to it.

    Attributes:
        name: unique in the route.
        lat_deg, lon_deg: WGS84; longitude in [-180, 180).
        north_m, east_m: the same place in the plan's frame [m].
        time_s: arrival, from the start of the plan [s].
        stay_s: time spent here before going on [s].
        speed_mps: over ground along the chord to here, its length by its time [m/s]; 0 at the first waypoint.
        leg: index of the plan's leg that the chord belongs to; of the first leg at the first waypoint.
        leg_kind: "primitive" or "reposition".
        leg_name: of the primitive, or what the repositioning leads to.
    """

    name: str
    lat_deg: float
    lon_deg: float
    north_m: float
    east_m: float
    time_s: float
    stay_s: float
    speed_mps: float
    leg: int
    leg_kind: str
    leg_name: str

    def __post_init__(self) -> None:
        if not (-90 <= self.lat_deg <= 90 and -180 <= self.lon_deg < 180):
            raise InputError(f"waypoint {self.name} is at {self.lat_deg}, {self.lon_deg}: not a latitude and longitude")


@dataclass(frozen=True, kw_only=True)
class Route:
    """Waypoints in time order.

    Attributes:
        name: stem of the file name.
        scenario, vessel: names.
        waypoints: two or more.
        xtd_m: cross-track distance within which the track stays, to both sides [m].
        frame: relates north/east metres to latitude and longitude.
        fit: deviation of the legs, as written, from the track.
        fence: allowed water around the track, or None when the chart is not at hand.
        departure: UTC time of the first waypoint, or None when not fixed.
    """

    name: str
    scenario: str
    vessel: str
    waypoints: tuple[Waypoint, ...]
    xtd_m: float
    frame: LocalFrame
    fit: RouteFit
    fence: Fence | None = None
    departure: datetime | None = None

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


def build_route(
    track: PlannedTrack,
    *,
    tolerance_m: float | None = None,
    safe_water: shapely.MultiPolygon | None = None,
    departure: datetime | None = None,
) -> Route:
    """Cut the track into chords; every leg of the plan begins at a waypoint unless the ship stands still.

    Args:
        track: the verified plan.
        tolerance_m: largest distance of the track from the chords [m]; by default a third of the clearance, but no
            more than half the beam.
        safe_water: where the chords may go, in (east, north), or None when the chart is not at hand; then they go
            where the track's fence lets them.
        departure: time of the first waypoint, with its time zone.

    Raises:
        InputError: no positive tolerance, or the plan stays in one place.
        NoPlan: the track itself leaves the safe water, or its legs do once rounded.
    """
    tolerance = _tolerance(track, tolerance_m)
    fence = _fence(track, safe_water)
    if safe_water is None and fence is not None:
        safe_water = as_multipolygon(fence_polygon(fence, track.frame))
    if safe_water is not None:
        shapely.prepare(safe_water)
    points = track.trajectory.pose[:, :2]
    standing_m, rounding_m = tolerance / 10, min(0.02, tolerance / 10)
    boundaries = [*(leg.first for leg in track.legs), track.legs[-1].last]
    cut_m = tolerance - standing_m - rounding_m
    ends = cut_into_chords(points, boundaries=boundaries, tolerance_m=cut_m, water=safe_water)
    groups = merge_standing(points, ends, distance_m=standing_m, water=safe_water)
    places = _written_places(track, groups)
    if len(groups) < 2:
        raise InputError(f"the route has {len(groups)} distinct waypoints, expected 2 or more")
    fit = fit_route(points, groups, places, frame=track.frame, water=safe_water)
    if fit.in_water is False:
        raise NoPlan("the route leaves the allowed water after rounding of its waypoints: give a smaller tolerance")
    return Route(
        name=ROUTE_NAME,
        scenario=track.scenario,
        vessel=track.vessel,
        waypoints=_waypoints(track, groups, places),
        xtd_m=math.ceil(max(tolerance, fit.largest_m) / XTD_STEP_M - 1e-9) * XTD_STEP_M,
        frame=track.frame,
        fit=fit,
        fence=fence,
        departure=departure,
    )


def _fence(track: PlannedTrack, water: shapely.MultiPolygon | None) -> Fence | None:
    if water is None:
        return track.fence
    return build_fence(
        track.trajectory.pose[:, :2],
        water=water,
        beam_m=track.beam_m,
        clearance_m=track.clearance_m,
        frame=track.frame,
    )


def _written_places(track: PlannedTrack, groups: list[tuple[int, int]]) -> Array:
    """(n, 2) latitude and longitude [deg] with the decimals of the files, longitude in [-180, 180)."""
    arrivals = [arrival for arrival, _ in groups]
    degrees = track.frame.to_degrees(track.trajectory.pose[arrivals, :2]).round(DEGREE_DECIMALS) + 0.0
    degrees[:, 1] = np.where(np.abs(degrees[:, 1]) >= 180.0, (degrees[:, 1] + 180.0) % 360.0 - 180.0, degrees[:, 1])
    return np.asarray(degrees)


def _tolerance(track: PlannedTrack, tolerance_m: float | None) -> float:
    value = min(max(track.clearance_m / 3, track.beam_m / 20), track.beam_m / 2) if tolerance_m is None else tolerance_m
    if not 0 < value < math.inf:
        raise InputError(
            f"tolerance of the route is {value:g} m, expected more than 0; with clearance 0 a tolerance is needed"
        )
    return value


def _waypoints(track: PlannedTrack, groups: list[tuple[int, int]], places_deg: Array) -> tuple[Waypoint, ...]:
    sample_time = track.commands.sample_time_s
    places = track.frame.to_metres(places_deg)
    leg_of = track.sample_leg
    waypoints: list[Waypoint] = []
    left = groups[0][0]
    for number, (arrival, departure) in enumerate(groups):
        index = int(leg_of[max(arrival - 1, 0)])
        sailed = math.dist(places[number], places[number - 1]) if number else 0.0
        waypoints.append(
            Waypoint(
                name=f"WP{number + 1:03d}",
                lat_deg=float(places_deg[number, 0]),
                lon_deg=float(places_deg[number, 1]),
                north_m=float(places[number, 0]),
                east_m=float(places[number, 1]),
                time_s=round(arrival * sample_time, 9),
                stay_s=round((departure - arrival) * sample_time, 9),
                speed_mps=sailed / ((arrival - left) * sample_time) if number else 0.0,
                leg=index,
                leg_kind=track.legs[index].kind,
                leg_name=track.legs[index].name,
            )
        )
        left = departure
    return tuple(waypoints)
