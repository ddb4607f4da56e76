"""Files for earth browsers and autopilots, read by independent readers; every format brings the same track back."""

import csv
import io
import json
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache

import gpxpy
import numpy as np
import pytest
from lxml import etree
from shapely.geometry import LinearRing, shape

import export_case as case
from expdesign.export.formats import FORMATS, find_format
from expdesign.export.formats.check import check_gpx, check_rtz
from expdesign.export.formats.missions import DO_CHANGE_SPEED, NAV_WAYPOINT
from expdesign.export.routes import Route, build_route
from route_readers import PLAN_SCHEMA, READERS

DEPARTURE = datetime(2027, 5, 1, 8, 0, tzinfo=UTC)
ODD = "Åbo \"sväng\" <b>&amp; 'zig\\zag'</b>; \N{SNOWMAN} 訓練"
LONG = "a very long name " * 30


@cache
def routes() -> dict[str, Route]:
    plain = build_route(case.planned(), safe_water=case.plan().area.water, departure=DEPARTURE)
    found = {"plain": plain}
    for key, name in (("odd", ODD), ("long", LONG)):
        points = tuple(replace(point, leg_name=name) for point in plain.waypoints)
        found[key] = replace(plain, scenario=name, vessel=name, waypoints=points)
    return found


@pytest.fixture(params=["plain", "odd", "long"])
def route(request: pytest.FixtureRequest) -> Route:
    return routes()[request.param]


def written(route: Route, name: str) -> bytes:
    return find_format(name).write(route)


def places(route: Route) -> np.ndarray:
    return np.array([(point.lat_deg, point.lon_deg) for point in route.waypoints])


def test_there_is_a_reader_for_every_format() -> None:
    assert set(READERS) == {known.name for known in FORMATS}


@pytest.mark.parametrize("name", READERS)
def test_every_format_brings_the_track_back_within_the_stated_distance(route: Route, name: str) -> None:
    """Waypoints exactly; the track of track.csv within the cross-track distance of the line through them."""
    read = np.array(READERS[name](written(route, name)))
    assert np.abs(read - places(route)).max() < 1e-9
    rows = list(csv.DictReader(io.StringIO(case.plan_files()["track.csv"])))
    track = np.array([(float(row["lat_deg"]), float(row["lon_deg"])) for row in rows])
    frame = case.plan().area.frame
    line = shape({"type": "LineString", "coordinates": frame.to_metres(read)})
    far = max(line.distance(shape({"type": "Point", "coordinates": p})) for p in frame.to_metres(track)[::7])
    assert far <= route.xtd_m


def test_names_of_any_kind_survive(route: Route) -> None:
    name = route.waypoints[1].leg_name
    assert name in etree.fromstring(written(route, "rtz")).find(".//{*}leg").get("legInfo")
    assert name in gpxpy.parse(written(route, "gpx").decode()).routes[0].points[1].description
    assert name in etree.fromstring(written(route, "kml")).findtext(".//{*}Folder/{*}Placemark/{*}name")
    assert json.loads(written(route, "geojson"))["features"][0]["properties"]["name"] == name
    row = list(csv.DictReader(io.StringIO(written(route, "csv").decode())))[1]
    assert row["leg_name"] == name


def test_our_own_checkers_find_nothing_wrong(route: Route) -> None:
    for name in ("rtz", "rtz-1.0", "rtz-1.1"):
        known = find_format(name)
        assert check_rtz(known.write(route), known.file_name.removesuffix(".rtz")) == []
    assert check_gpx(written(route, "gpx")) == []


def test_a_qgroundcontrol_plan_obeys_its_guide_and_fences_the_allowed_water(route: Route) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    plan = json.loads(written(route, "qgc"))
    jsonschema.validate(plan, PLAN_SCHEMA)
    items = plan["mission"]["items"]
    assert [item["doJumpId"] for item in items] == list(range(1, len(items) + 1))
    polygons = plan["geoFence"]["polygons"]
    assert [polygon["inclusion"] for polygon in polygons] == [True] + [False] * (len(polygons) - 1)
    fence = shape({"type": "Polygon", "coordinates": [p["polygon"] for p in polygons]})
    assert fence.is_valid
    assert all(fence.covers(shape({"type": "Point", "coordinates": place})) for place in places(route))


def test_missions_set_the_speed_before_every_leg(route: Route) -> None:
    speed, ordered, held = None, [], []
    for item in json.loads(written(route, "qgc"))["mission"]["items"]:
        if item["command"] == DO_CHANGE_SPEED:
            speed = item["params"][1]
        else:
            ordered.append(speed)
            held.append(item["params"][0])
    assert ordered[1:] == pytest.approx([point.speed_mps for point in route.waypoints[1:]], abs=1e-3)
    assert held == pytest.approx([point.stay_s for point in route.waypoints], abs=1e-3)


@pytest.mark.filterwarnings("ignore")
def test_pymavlink_reads_the_waypoint_file(route: Route, tmp_path: object) -> None:
    mavwp = pytest.importorskip("pymavlink.mavwp")
    path = tmp_path / "route.waypoints"
    path.write_bytes(written(route, "ardupilot"))
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(path)) == len(json.loads(written(route, "qgc"))["mission"]["items"]) + 1
    points = [loader.wp(k) for k in range(1, loader.count()) if loader.wp(k).command == NAV_WAYPOINT]
    assert np.abs(np.array([(p.x, p.y) for p in points]) - places(route)).max() < 1e-7


def test_geojson_polygons_follow_the_right_hand_rule() -> None:
    polygons = [
        f["geometry"]["coordinates"]
        for f in json.loads(written(routes()["plain"], "geojson"))["features"]
        if f["geometry"]["type"] == "Polygon"
    ]
    assert polygons
    for outer, *holes in polygons:
        assert LinearRing(outer).is_ccw
        assert not any(LinearRing(hole).is_ccw for hole in holes)


def test_schedules_give_speeds_and_times_in_order() -> None:
    route = routes()["plain"]
    elements = etree.fromstring(written(route, "rtz")).findall(".//{*}scheduleElement")
    times = [datetime.fromisoformat(e.get("eta")) for e in elements[1:]]
    seconds = [(time - DEPARTURE).total_seconds() for time in times]
    assert seconds == pytest.approx([point.time_s for point in route.waypoints[1:]], abs=0.5)
    assert all(float(e.get("speed")) >= 0 for e in elements[1:])
