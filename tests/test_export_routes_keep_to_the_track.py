"""A route's chords stay as near to the track as they promise, and in the water."""

from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyproj
import pytest
import shapely

import export_case as case
from expdesign.errors import InputError, NoPlan
from expdesign.export.routes import PlannedTrack, Route, build_route, read_plan
from expdesign.export.routes.route import build_fence, fence_polygon
from expdesign.plan.values import Leg
from expdesign.sea_area import LocalFrame
from expdesign.signals import Commands, Trajectory


def track_along(points: np.ndarray, *, legs: tuple[Leg, ...] = (), clearance_m: float = 30.0) -> PlannedTrack:
    """A track through (k, 2) north, east, one second each."""
    pose = np.column_stack([points, np.zeros(len(points))])
    commands = Commands(sample_time_s=1.0, names=("tau_x",), values=np.zeros((len(points) - 1, 1)))
    return replace(
        case.planned(),
        commands=commands,
        trajectory=Trajectory(sample_time_s=1.0, pose=pose, velocity=np.zeros_like(pose)),
        legs=legs or (Leg(kind="reposition", name="along", first=0, last=len(points) - 1),),
        clearance_m=clearance_m,
    )


def places(route: Route) -> np.ndarray:
    return np.array([(point.north_m, point.east_m) for point in route.waypoints])


def farthest_from_its_chord(track: PlannedTrack, route: Route) -> float:
    """Largest distance of any sample from the chord that is sailed at its time, by shapely [m]."""
    worst = 0.0
    for one, two in pairwise(route.waypoints):
        first, last = round(one.time_s), round(two.time_s + two.stay_s)
        chord = shapely.LineString([(one.north_m, one.east_m), (two.north_m, two.east_m)])
        samples = shapely.points(track.trajectory.pose[first : last + 1, :2])
        worst = max(worst, float(shapely.distance(samples, chord).max()))
    return worst


@pytest.mark.parametrize("tolerance_m", [0.2, 1.0, 5.0, 20.0])
def test_the_track_stays_within_the_tolerance_of_the_chord_of_its_time(tolerance_m: float) -> None:
    route = build_route(case.planned(), tolerance_m=tolerance_m)
    assert farthest_from_its_chord(case.planned(), route) <= tolerance_m <= route.xtd_m <= tolerance_m + 0.19


def test_a_smaller_tolerance_never_gives_fewer_waypoints() -> None:
    counts = [len(build_route(case.planned(), tolerance_m=t).waypoints) for t in (0.2, 1.0, 5.0, 20.0)]
    assert counts == sorted(counts, reverse=True)


def test_the_default_tolerance_is_a_third_of_the_clearance_and_at_most_half_the_beam() -> None:
    assert build_route(case.planned()).xtd_m == pytest.approx(case.tug().beam_m / 2, abs=0.19)
    assert build_route(replace(case.planned(), clearance_m=3.0)).xtd_m == pytest.approx(1.0, abs=0.19)


def test_a_straight_track_needs_two_waypoints() -> None:
    north = np.linspace(0, 400, 201)
    assert len(build_route(track_along(np.stack([north, 2 * north], axis=1))).waypoints) == 2


def test_a_circle_is_cut_into_few_more_chords_than_the_sagitta_asks_for() -> None:
    radius, tolerance = 100.0, 3.0
    angle = np.linspace(0, 2 * np.pi, 1201)
    circle = track_along(radius * np.stack([np.sin(angle), 1 - np.cos(angle)], axis=1))
    least = np.pi / np.arccos(1 - tolerance / radius)
    assert least <= len(build_route(circle, tolerance_m=tolerance).waypoints) - 1 <= 2.2 * least


def test_a_ship_that_goes_back_on_its_own_track_gets_waypoints_where_it_turns() -> None:
    north = np.concatenate([np.linspace(0, 100, 51), np.linspace(100, 40, 31)[1:], np.linspace(40, 200, 81)[1:]])
    route = build_route(track_along(np.stack([north, np.zeros_like(north)], axis=1)), tolerance_m=2.0)
    assert places(route)[:, 0] == pytest.approx([0, 100, 40, 200], abs=0.01)


def test_standing_still_is_a_stay_at_one_waypoint() -> None:
    north = np.concatenate([np.zeros(61), np.linspace(0, 100, 51)[1:], np.full(30, 100.0), np.linspace(100, 200, 51)])
    last = len(north) - 1
    legs = (
        Leg(kind="reposition", name="wait", first=0, last=60),
        Leg(kind="primitive", name="out", first=60, last=110),
        Leg(kind="reposition", name="turn on the spot", first=110, last=140),
        Leg(kind="primitive", name="on", first=140, last=last),
    )
    route = build_route(track_along(np.stack([north, np.zeros_like(north)], axis=1), legs=legs), tolerance_m=2.0)
    assert [(w.time_s, w.stay_s) for w in route.waypoints] == [(0, 60), (110, 30), (last, 0)]
    assert [w.north_m for w in route.waypoints] == pytest.approx([0, 100, 200], abs=0.01)
    assert [w.leg_name for w in route.waypoints[1:]] == ["out", "on"]
    assert [w.speed_mps for w in route.waypoints] == pytest.approx([0.0, 2.0, 2.0], rel=0.02)


def test_a_plan_that_stays_in_one_place_is_no_route() -> None:
    with pytest.raises(InputError, match="1 distinct waypoints, expected 2 or more"):
        build_route(track_along(np.zeros((50, 2))))


def test_speeds_times_and_chords_agree() -> None:
    route = build_route(case.planned())
    for one, two in pairwise(route.waypoints):
        seconds = two.time_s - one.time_s - one.stay_s
        length = np.hypot(two.north_m - one.north_m, two.east_m - one.east_m)
        assert two.speed_mps == pytest.approx(length / seconds, rel=1e-12)
    last = route.waypoints[-1]
    assert last.time_s + last.stay_s == case.plan().commands.duration_s
    assert route.length_m <= case.plan().trajectory.distance_m


def test_every_leg_that_moves_the_ship_begins_at_a_waypoint() -> None:
    route, plan = build_route(case.planned()), case.plan()
    covered = {second for point in route.waypoints for second in (point.time_s, point.time_s + point.stay_s)}
    assert {leg.first * 1.0 for leg in plan.legs if leg.first} <= covered | {0.0}


def test_chords_are_refined_until_they_stay_in_the_water() -> None:
    angle = np.linspace(0, np.pi, 201)
    points = np.stack([100 * np.sin(angle), 100 - 100 * np.cos(angle)], axis=1)
    ring = shapely.Point(100, 0).buffer(110, quad_segs=64) - shapely.Point(100, 0).buffer(98, quad_segs=64)
    water = shapely.MultiPolygon([ring])
    free = build_route(track_along(points), tolerance_m=30.0)
    kept = build_route(track_along(points), tolerance_m=30.0, safe_water=water)
    assert not water.covers(shapely.LineString(places(free)[:, ::-1]))
    assert water.covers(shapely.LineString(places(kept)[:, ::-1]))
    assert len(kept.waypoints) > len(free.waypoints)


def test_the_route_of_the_case_stays_in_its_safe_water() -> None:
    water = case.plan().area.safe_water(case.CLEARANCE_M)
    route = build_route(case.planned(), safe_water=water)
    assert water.covers(shapely.LineString(places(route)[:, ::-1]))


def test_a_track_that_leaves_the_water_is_named_with_its_place() -> None:
    points = np.stack([np.linspace(0, 100, 51), np.zeros(51)], axis=1)
    water = shapely.MultiPolygon([shapely.box(-5, -5, 5, 60)])
    with pytest.raises(NoPlan, match=r"leaves the allowed water near north (58|60) m, east 0 m"):
        build_route(track_along(points), safe_water=water)


def test_longitude_180_is_written_as_minus_180() -> None:
    frame = LocalFrame(10.0, 180.0)
    east = pyproj.Geod(ellps="WGS84").fwd(180.0, 10.0, 90.0, 1000.0)[0]
    points = np.stack([np.zeros(3), np.array([-1000.0, 0.0, 1000.0])], axis=1)
    legs = (Leg(kind="primitive", name="a", first=0, last=1), Leg(kind="primitive", name="b", first=1, last=2))
    route = build_route(replace(track_along(points, legs=legs), frame=frame))
    assert [point.lon_deg for point in route.waypoints] == pytest.approx([-east, -180.0, east], abs=1e-7)
    assert all(-180.0 <= point.lon_deg < 180.0 for point in route.waypoints)


def test_the_stated_distance_bounds_what_is_measured_on_the_files_own_positions() -> None:
    """The track lies within the cross-track distance of straight lines, rhumb lines and geodesics alike."""
    track = case.planned()
    route = build_route(track, tolerance_m=1.0, safe_water=case.plan().area.water)
    geod = pyproj.Geod(ellps="WGS84")
    worst = 0.0
    for one, two in pairwise(route.waypoints):
        line = geod.npts(one.lon_deg, one.lat_deg, two.lon_deg, two.lat_deg, 20, initial_idx=0, terminus_idx=0)
        sailed = shapely.LineString(track.frame.to_metres(np.array(line)[:, ::-1]))
        first, last = round(one.time_s), round(two.time_s + two.stay_s)
        samples = shapely.points(track.trajectory.pose[first : last + 1, :2])
        worst = max(worst, float(shapely.distance(samples, sailed).max()))
    assert worst <= route.fit.largest_m <= route.xtd_m
    assert route.fit.in_water is True
    assert max(route.fit.loxodrome_m, route.fit.orthodrome_m) < 0.01


def test_a_long_leg_shows_how_far_a_rhumb_line_deviates_from_a_great_circle() -> None:
    """By d^2 tan(lat) / (8 R) in the middle of an east-west leg."""
    points = np.stack([np.zeros(2), np.array([-5000.0, 5000.0])], axis=1)
    fit = build_route(track_along(points), tolerance_m=20.0).fit
    expected = 10_000.0**2 * np.tan(np.radians(case.plan().area.frame.lat_deg)) / (8 * 6.38e6)
    assert fit.loxodrome_m == pytest.approx(expected, rel=0.02)
    assert fit.orthodrome_m < 0.01


def test_the_fence_holds_the_track_and_lies_in_the_allowed_water() -> None:
    plan = case.plan()
    route = build_route(case.planned(), safe_water=plan.area.water)
    fence = fence_polygon(route.fence, plan.area.frame)
    assert plan.area.water.covers(fence)
    assert fence.covers(shapely.LineString(plan.trajectory.pose[:, 1::-1]))
    assert fence.boundary.distance(plan.area.water.boundary) >= case.tug().beam_m / 2 - 0.05
    assert len(route.fence.outside) >= 1  # the island is fenced out
    assert build_route(case.planned()).fence is None


@pytest.mark.parametrize("tolerance_m", [0.0, -1.0, float("nan"), float("inf")])
def test_a_tolerance_that_is_none_is_refused(tolerance_m: float) -> None:
    with pytest.raises(InputError, match="expected more than 0"):
        build_route(case.planned(), tolerance_m=tolerance_m)


def test_a_departure_without_time_zone_is_refused_and_one_with_it_becomes_utc() -> None:
    with pytest.raises(InputError, match="has no time zone"):
        build_route(case.planned(), departure=datetime(2027, 5, 1, 8, 0))
    route = build_route(case.planned(), departure=datetime(2027, 5, 1, 23, 59, 30, tzinfo=UTC))
    assert route.utc(45.0) == "2027-05-02T00:00:15Z"
    assert build_route(case.planned()).utc(45.0) is None


def test_a_plan_read_from_its_files_brings_its_fence_and_its_route_stays_inside(tmp_path: Path) -> None:
    for name, content in case.plan_files().items():
        (tmp_path / name).write_text(content)
    track = read_plan(tmp_path / "plan.json")
    fresh = build_route(case.planned(), safe_water=case.plan().area.water)
    route = build_route(track)
    assert route.fence == fresh.fence
    assert route.fit.in_water is True
    legs = shapely.LineString(places(route)[:, ::-1])
    assert fence_polygon(route.fence, track.frame).covers(legs)


def test_the_fence_holds_off_a_shore_of_very_many_corners() -> None:
    """A jagged shore, a corner in every thirtieth of the inset: the fence lies in the water, half a beam off land."""
    rng = np.random.default_rng(5)
    angle = np.linspace(0, 2 * np.pi, 6000, endpoint=False)
    radius = 300 + 20 * np.sin(5 * angle) + 0.2 * rng.normal(size=len(angle))
    water = shapely.Polygon(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))
    track = np.stack([np.linspace(-150, 150, 50), np.zeros(50)], axis=1)
    frame = LocalFrame(60.0, 25.0)
    fence = build_fence(track, water=water, beam_m=6.0, clearance_m=15.0, frame=frame)
    assert fence is not None
    polygon = fence_polygon(fence, frame)
    assert water.covers(polygon)
    assert polygon.covers(shapely.LineString(track[:, ::-1]))
    assert polygon.boundary.distance(water.boundary) >= 6.0 / 2 - 0.05
