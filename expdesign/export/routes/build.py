"""From the plan's track to a route: near the track in every turn, or with few legs for the bridge."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from itertools import pairwise

import numpy as np
import shapely

from expdesign.errors import InputError, NoPlan
from expdesign.export.routes.chords import (
    Passage,
    Sides,
    Stop,
    choose_stops,
    corridor_in_water,
    cut_into_chords,
    merge_standing,
    sides_needed,
    widened,
)
from expdesign.export.routes.read_plan import PlannedTrack
from expdesign.export.routes.route import (
    DEGREE_DECIMALS,
    ROUTE_NAME,
    XTD_STEP_M,
    Fence,
    Route,
    RouteFit,
    Waypoint,
    build_fence,
    fence_polygon,
    fit_route,
)
from expdesign.sea_area import as_multipolygon
from expdesign.values import Array

CORRIDOR = 1.0  # cross-track distance where the water has room for it, in ship lengths
MARGIN = 0.5  # of it beyond the planned track where the water has room, in ship lengths
NAMED_LETTERS = 24  # of a manoeuvre's name in the name of a waypoint


def build_route(
    track: PlannedTrack,
    *,
    tolerance_m: float | None = None,
    safe_water: shapely.MultiPolygon | None = None,
    departure: datetime | None = None,
) -> Route:
    """Cut the track into chords; every leg of the plan begins at a waypoint unless the ship stands still.

    Args:
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
    fence, water = _fence_and_water(track, safe_water)
    points = track.trajectory.pose[:, :2]
    standing_m = tolerance / 10
    ends = cut_into_chords(points, boundaries=_boundaries(track), tolerance_m=_cut_m(tolerance), water=water)
    groups = merge_standing(points, ends, distance_m=standing_m, water=water)
    places, fit = _places_and_fit(track, groups, water)
    xtd_m = _rounded_up(max(tolerance, fit.largest_m))
    sides = [(xtd_m, xtd_m)] * len(groups)
    return _route(track, groups, places, sides, fit=fit, fence=fence, departure=departure)


def build_bridge_route(
    track: PlannedTrack, *, safe_water: shapely.MultiPolygon | None = None, departure: datetime | None = None
) -> Route:
    """Few legs: one for each run, or a stop where runs stay in one place, and the legs between them.

    Neighbouring waypoints are at least `WAYPOINT_SPACING` ship lengths apart, unless the corridor would leave
    the water. The track stays within the cross-track distances of each leg, to port and to starboard. Where the water
    has room for it, they are `CORRIDOR` ship lengths at least, and `MARGIN` more than the planned track needs, so that
    a ship that sails it nearly does not raise an alarm.

    Args:
        safe_water: where the hull may be, in (east, north), or None when the chart is not at hand; then the track's
            fence is where the ship's centre may be.
        departure: time of the first waypoint, with its time zone.

    Raises:
        InputError: the plan stays in one place.
        NoPlan: the track itself leaves the safe water.
    """
    fence, water = _fence_and_water(track, safe_water)
    half_beam_m = 0.0 if safe_water is None else track.beam_m / 2
    points = track.trajectory.pose[:, :2]
    passage = Passage(points=points, legs=track.legs, length_m=track.length_m)

    def fits(one: Stop, two: Stop, sides: Sides) -> bool:
        return corridor_in_water(points[one[0]], points[two[0]], sides, water=water, half_beam_m=half_beam_m)

    samples = cut_into_chords(
        points, boundaries=_boundaries(track), tolerance_m=_cut_m(_tolerance(track, None)), water=water
    )
    stops = choose_stops(passage, samples, fits=fits)
    places, fit = _places_and_fit(track, stops, water)
    ends = track.frame.to_metres(places)
    sides = []
    for (one, two), (start, end) in zip(pairwise(stops), pairwise(ends), strict=True):
        needed = sides_needed(points[one[0] : two[1] + 1], start, end)
        least = (_rounded_up(needed[0] + fit.curved_m), _rounded_up(needed[1] + fit.curved_m))
        wanted = [_rounded_up(max(CORRIDOR, side / track.length_m + MARGIN) * track.length_m) for side in needed]
        wide = widened(start, end, least, wanted=(wanted[0], wanted[1]), water=water, half_beam_m=half_beam_m)
        sides.append((_rounded_down(wide[0]), _rounded_down(wide[1])))
    names, held = _names(track, stops), [_held(track, stop) for stop in stops]
    route = _route(track, stops, places, [sides[0], *sides], fit=fit, fence=fence, departure=departure)
    points_named = zip(route.waypoints, names, held, strict=True)
    return replace(route, waypoints=tuple(replace(point, name=name, held=runs) for point, name, runs in points_named))


def _boundaries(track: PlannedTrack) -> list[int]:
    return [*(leg.first for leg in track.legs), track.legs[-1].last]


def _cut_m(tolerance_m: float) -> float:
    """What remains of a tolerance after standing still and rounding [m]."""
    return tolerance_m - tolerance_m / 10 - min(0.02, tolerance_m / 10)


def _rounded_up(length_m: float) -> float:
    """A length rounded up to the resolution of cross-track distances in files [m]; at least one step."""
    return max(math.ceil(length_m / XTD_STEP_M - 1e-9), 1) * XTD_STEP_M


def _rounded_down(length_m: float) -> float:
    return max(math.floor(length_m / XTD_STEP_M + 1e-9), 1) * XTD_STEP_M


def _places_and_fit(
    track: PlannedTrack, groups: list[Stop], water: shapely.MultiPolygon | None
) -> tuple[Array, RouteFit]:
    """Waypoints as written [deg], and how well the legs between them fit the track."""
    places = _written_places(track, groups)
    if len(groups) < 2:
        raise InputError(f"the route has {len(groups)} distinct waypoints, expected 2 or more")
    fit = fit_route(track.trajectory.pose[:, :2], groups, places, frame=track.frame, water=water)
    if fit.in_water is False:
        raise NoPlan("the route leaves the allowed water after rounding of its waypoints: give a smaller tolerance")
    return places, fit


def _route(
    track: PlannedTrack,
    groups: list[Stop],
    places: Array,
    sides: Sequence[Sides],
    *,
    fit: RouteFit,
    fence: Fence | None,
    departure: datetime | None,
) -> Route:
    return Route(
        name=ROUTE_NAME,
        scenario=track.scenario,
        vessel=track.vessel,
        waypoints=_waypoints(track, groups, places, sides),
        xtd_m=max(max(side) for side in sides),
        frame=track.frame,
        fit=fit,
        fence=fence,
        departure=departure,
    )


def _runs(track: PlannedTrack, first: int, last: int) -> list[int]:
    """Numbers, from 1, of the runs that are sailed between two samples, the longest part first."""
    runs = [leg for leg in track.legs if leg.kind == "primitive"]
    parts = [(max(run.first, first) - min(run.last, last), number) for number, run in enumerate(runs, start=1)]
    return [number for part, number in sorted(parts) if part < 0]


def _run_name(track: PlannedTrack, number: int) -> str:
    return [leg.name for leg in track.legs if leg.kind == "primitive"][number - 1]


def _held(track: PlannedTrack, stop: Stop) -> str:
    numbers = sorted(_runs(track, *stop))
    named = ", ".join(dict.fromkeys(_run_name(track, number) for number in numbers))
    if not numbers:
        return ""
    return f"run {numbers[0]}, {named}" if len(numbers) == 1 else f"runs {numbers[0]} to {numbers[-1]}, {named}"


def _names(track: PlannedTrack, stops: list[Stop]) -> list[str]:
    """Waypoints named after the run that begins there, or that the way leads to; unique."""
    wanted = [_name(track, one, two) for one, two in pairwise(stops)]
    wanted.append(_stop_name(track, stops[-1]) or "goal")
    seen: dict[str, int] = {}
    names = []
    for name in wanted:
        seen[name] = seen.get(name, 0) + 1
        names.append(name if seen[name] == 1 else f"{name} {seen[name]}")
    return names


def _name(track: PlannedTrack, one: Stop, two: Stop) -> str:
    runs = _runs(track, one[1], two[0])
    if runs:
        return f"R{runs[0]:02d} {_run_name(track, runs[0])[:NAMED_LETTERS]}"
    later = [number for number in _runs(track, one[1], len(track.trajectory) - 1) if number]
    return _stop_name(track, one) or (f"to R{min(later):02d}" if later else "to goal")


def _stop_name(track: PlannedTrack, stop: Stop) -> str:
    numbers = sorted(_runs(track, *stop))
    if not numbers:
        return ""
    first = f"R{numbers[0]:02d}{f'-{numbers[-1]:02d}' if len(numbers) > 1 else ''}"
    return f"{first} {_run_name(track, numbers[0])[:NAMED_LETTERS]}"


def _fence_and_water(
    track: PlannedTrack, water: shapely.MultiPolygon | None
) -> tuple[Fence | None, shapely.MultiPolygon | None]:
    """The fence around the track, and where legs may go: the water, or the track's own fence without a chart."""
    if water is None:
        fence = track.fence
        water = None if fence is None else as_multipolygon(fence_polygon(fence, track.frame))
    else:
        fence = build_fence(
            track.trajectory.pose[:, :2],
            water=water,
            beam_m=track.beam_m,
            clearance_m=track.clearance_m,
            frame=track.frame,
        )
    if water is not None:
        shapely.prepare(water)
    return fence, water


def _written_places(track: PlannedTrack, groups: list[Stop]) -> Array:
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


def _waypoints(
    track: PlannedTrack, groups: list[Stop], places_deg: Array, sides: Sequence[Sides]
) -> tuple[Waypoint, ...]:
    sample_time = track.commands.sample_time_s
    places = track.frame.to_metres(places_deg)
    waypoints: list[Waypoint] = []
    left = groups[0][0]
    for number, (arrival, departure) in enumerate(groups):
        index = _main_leg(track, groups[number - 1][1], arrival) if number else 0
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
                xtd_port_m=sides[number][0],
                xtd_starboard_m=sides[number][1],
            )
        )
        left = departure
    return tuple(waypoints)


def _main_leg(track: PlannedTrack, left: int, arrival: int) -> int:
    """Index of the leg of the plan that a chord belongs to: of its run, or else of the leg that it ends in."""
    parts = [
        (leg.kind == "primitive", min(leg.last, arrival) - max(leg.first, left), index)
        for index, leg in enumerate(track.legs)
        if leg.first < arrival and leg.last > left
    ]
    return max(part for part in parts if part[0])[2] if any(part[0] for part in parts) else parts[-1][2]
