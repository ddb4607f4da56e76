"""The route for the bridge: few legs, waypoints far enough apart, and a corridor that holds the track and has water."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely
from lxml import etree

import export_case as case
from expdesign import workflows
from expdesign.conventions import METRES_PER_NAUTICAL_MILE
from expdesign.errors import InputError
from expdesign.export.formats import find_format, route_files
from expdesign.export.formats.check import check_rtz
from expdesign.export.routes import PlannedTrack, Route, Waypoint, build_bridge_route, build_route, read_plan
from expdesign.export.routes.build import MARGIN
from expdesign.export.routes.chords import WAYPOINT_SPACING, corridor, corridor_in_water, sides_needed
from expdesign.plan.values import Leg
from expdesign.signals import Commands, Trajectory

SHIP_M = case.tug().length_m


def track_along(points: np.ndarray, legs: tuple[Leg, ...]) -> PlannedTrack:
    """A track through (k, 2) north, east, one second each."""
    pose = np.column_stack([points, np.zeros(len(points))])
    return replace(
        case.planned(),
        commands=Commands(sample_time_s=1.0, names=("tau_x",), values=np.zeros((len(points) - 1, 1))),
        trajectory=Trajectory(sample_time_s=1.0, pose=pose, velocity=np.zeros_like(pose)),
        legs=legs,
    )


def place(point: Waypoint) -> np.ndarray:
    return np.array([point.north_m, point.east_m])


def spacings(route: Route) -> np.ndarray:
    return np.array([np.hypot(*(place(two) - place(one))) for one, two in pairwise(route.waypoints)])


def outside(track: PlannedTrack, route: Route) -> float:
    """How far the track leaves the corridor of the leg of its time, by signed distances of its own [m]."""
    worst = -np.inf
    points = track.trajectory.pose[:, :2]
    for one, two in pairwise(route.waypoints):
        step = track.commands.sample_time_s
        samples = points[round(one.time_s / step) : round((two.time_s + two.stay_s) / step) + 1]
        along = place(two) - place(one)
        leg = shapely.LineString([place(one), place(two)])
        for sample in samples:
            away = leg.distance(shapely.Point(sample))
            starboard = np.cross(np.append(along, 0), np.append(sample - place(one), 0))[2] >= 0
            worst = max(worst, away - (two.xtd_starboard_m if starboard else two.xtd_port_m))
    return worst


@pytest.fixture(params=["chart", "fence"])
def route(request: pytest.FixtureRequest, tmp_path: Path) -> Route:
    """The route of the case: planned with its chart, and read from its files, which hold only a fence."""
    if request.param == "chart":
        return build_bridge_route(case.planned(), safe_water=case.plan().area.water)
    for name, content in case.plan_files().items():
        (tmp_path / name).write_text(content)
    return build_bridge_route(read_plan(tmp_path / "plan.json"))


def test_the_track_stays_within_the_cross_track_distances_of_its_leg(route: Route) -> None:
    assert outside(case.planned(), route) <= 0.0
    assert route.xtd_m == max(max(point.xtd_port_m, point.xtd_starboard_m) for point in route.waypoints)


def test_a_ship_in_the_corridor_is_in_allowed_water(route: Route) -> None:
    """The ship's centre anywhere in it, with half the beam to both sides."""
    water = case.plan().area.water
    for one, two in pairwise(route.waypoints):
        sides = (two.xtd_port_m, two.xtd_starboard_m)
        assert water.covers(corridor(place(one), place(two), sides).buffer(case.tug().beam_m / 2 - 1e-3))


def test_waypoints_are_ship_lengths_apart_and_fewer_than_those_of_the_fine_route(route: Route) -> None:
    assert spacings(route).min() >= WAYPOINT_SPACING * SHIP_M
    fine = build_route(case.planned(), safe_water=case.plan().area.water)
    assert len(route.waypoints) < len(fine.waypoints) / 2


def test_no_leg_belongs_to_two_runs_and_every_run_is_named_once(route: Route) -> None:
    runs = sum(leg.kind == "primitive" for leg in case.plan().legs)
    named = [point.leg for point in route.waypoints[1:] if point.leg_kind == "primitive"]
    held = sum(len(_numbers(point.held)) for point in route.waypoints)
    assert len(set(named)) == len(named)
    assert len(named) + held == runs
    assert len({point.name for point in route.waypoints}) == len(route.waypoints)


def _numbers(held: str) -> range:
    """The runs of `run 4, name` and `runs 4 to 6, name`."""
    if not held:
        return range(0)
    numbers = [int(word) for word in held.partition(",")[0].split() if word.isdigit()]
    return range(numbers[0], numbers[-1] + 1)


def test_the_route_begins_and_ends_where_the_track_does(route: Route) -> None:
    pose = case.plan().trajectory.pose
    assert place(route.waypoints[0]) == pytest.approx(pose[0, :2], abs=0.02)
    assert place(route.waypoints[-1]) == pytest.approx(pose[-1, :2], abs=0.02)
    assert route.waypoints[-1].time_s == case.plan().commands.duration_s


def test_runs_that_stay_in_one_place_become_a_stop_that_lasts_as_long() -> None:
    """Two runs back and forth over less than a ship length, between ways of ten."""
    there = np.linspace(0, 10 * SHIP_M, 101)
    swing = 0.8 * SHIP_M * np.sin(np.linspace(0, 2 * np.pi, 61))
    north = np.concatenate([there, 10 * SHIP_M + swing[1:], 10 * SHIP_M + swing[1:], there[1:] + 10 * SHIP_M])
    legs = tuple(
        Leg(kind=kind, name=name, first=first, last=last)
        for kind, name, first, last in (
            ("reposition", "swing", 0, 100), ("primitive", "swing", 100, 160), ("primitive", "swing", 160, 220),
            ("reposition", "goal", 220, 320),
        )
    )  # fmt: skip
    track = track_along(np.stack([north, np.zeros_like(north)], axis=1), legs)
    route = build_bridge_route(track)
    assert [(point.time_s, point.stay_s) for point in route.waypoints] == [(0, 0), (100, 120), (320, 0)]
    assert [point.name for point in route.waypoints] == ["to R01", "R01-02 swing", "goal"]
    assert route.waypoints[1].held == "runs 1 to 2, swing"
    assert outside(track, route) <= 0.0


def test_a_bend_is_cut_only_as_far_as_the_water_allows() -> None:
    """Half a ring of water around an island: chords that cut the corner are not in it."""
    angle = np.linspace(0, np.pi, 401)
    points = 400 * np.stack([np.sin(angle), 1 - np.cos(angle)], axis=1)
    track = track_along(points, (Leg(kind="reposition", name="goal", first=0, last=400),))
    middle = shapely.Point(400, 0)
    water = shapely.MultiPolygon([middle.buffer(440, quad_segs=64) - middle.buffer(375, quad_segs=64)])
    free, kept = build_bridge_route(track), build_bridge_route(track, safe_water=water)
    assert len(kept.waypoints) > len(free.waypoints)
    assert outside(track, kept) <= 0.0
    assert outside(track, free) <= -MARGIN * SHIP_M  # who sails the track nearly raises no alarm
    for one, two in pairwise(kept.waypoints):
        sides = (two.xtd_port_m, two.xtd_starboard_m)
        assert corridor_in_water(place(one), place(two), sides, water=water, half_beam_m=case.tug().beam_m / 2)
        assert two.xtd_port_m <= (1.0 + MARGIN) * SHIP_M + 0.2


def test_the_corridor_is_what_lies_within_its_sides() -> None:
    """Of random points exactly those are inside whose own needed sides are no wider."""
    rng = np.random.default_rng(3)
    start, end, sides = np.array([10.0, -20.0]), np.array([140.0, 60.0]), (12.0, 35.0)
    inside = corridor(start, end, sides)
    points = rng.uniform(-60, 220, size=(4000, 2))
    for point in points:
        needed = sides_needed(point[None], start, end)
        margin = max(needed[0] - sides[0], needed[1] - sides[1])
        if abs(margin) > 0.1:  # its round ends are polygons
            assert inside.covers(shapely.Point(point[::-1])) == (margin < 0)


def test_a_route_with_a_name_gives_files_of_that_name_and_bears_it_inside() -> None:
    named = replace(build_bridge_route(case.planned()), name="sound-7")
    files = route_files(named, ("rtz", "rtz-1.0", "gpx", "csv"))
    assert set(files) == {"sound-7.rtz", "sound-7-rtz10.rtz", "sound-7.gpx", "sound-7.csv"}
    assert check_rtz(files["sound-7.rtz"], "sound-7") == check_rtz(files["sound-7-rtz10.rtz"], "sound-7-rtz10") == []
    assert etree.fromstring(files["sound-7.gpx"]).findtext("{*}rte/{*}name") == "sound-7"
    unnamed = find_format("gpx").write(build_bridge_route(case.planned()))
    assert etree.fromstring(unnamed).findtext("{*}rte/{*}name") == "test-sound"


def test_rtz_states_the_sides_of_every_leg() -> None:
    route = build_bridge_route(case.planned(), safe_water=case.plan().area.water)
    content = find_format("rtz").write(route)
    legs = etree.fromstring(content).findall(".//{*}waypoint/{*}leg")
    for leg, point in zip(legs, route.waypoints[1:], strict=True):
        sides = [float(leg.get(key)) * METRES_PER_NAUTICAL_MILE for key in ("portsideXTD", "starboardXTD")]
        assert sides == pytest.approx([point.xtd_port_m, point.xtd_starboard_m], abs=1e-6)
    rows = list(csv.DictReader(io.StringIO(find_format("csv").write(route).decode())))
    assert [float(row["xtd_m"]) for row in rows] == pytest.approx([route.xtd_m] * len(rows), abs=1e-4)
    assert [row["waypoint"] for row in rows] == [point.name for point in route.waypoints]


@pytest.mark.parametrize("name", ["../a", "", "a b", ".hidden", "x" * 64])
def test_names_that_are_no_plain_file_names_are_refused(name: str, tmp_path: Path) -> None:
    for file, content in case.plan_files().items():
        (tmp_path / file).write_text(content)
    with pytest.raises(InputError, match="--name is"):
        workflows.export(tmp_path / "plan.json", tmp_path / "out", formats=["rtz"], name=name)
    assert not (tmp_path / "out").exists()


def test_export_gives_few_legs_or_every_turn_as_asked(tmp_path: Path) -> None:
    for file, content in case.plan_files().items():
        (tmp_path / file).write_text(content)
    counts = [
        workflows.export(tmp_path / "plan.json", tmp_path, formats=["csv"], **asked).summary["waypoints"]
        for asked in ({}, {"fine": True}, {"tolerance_m": 0.5})
    ]
    assert counts == sorted(counts)
    assert len(set(counts)) == 3
