"""Every route format says the same as the route, passes its schema, and is read by independent readers."""

import csv
import io
import json
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

import gpxpy
import numpy as np
import pytest
from lxml import etree
from shapely.geometry import shape

import export_case as case
from expdesign.conventions import KNOTS_PER_MPS, METRES_PER_NAUTICAL_MILE
from expdesign.errors import InputError, UnknownName
from expdesign.export.formats import FORMATS, STANDARD, find_format, route_files
from expdesign.export.formats.geojson import cut_at_antimeridian
from expdesign.export.routes import Route, build_route
from sample_files import SAMPLES

DEPARTURE = datetime(2027, 5, 1, 8, 0, tzinfo=UTC)
ODD = 'A&B <"\N{SNOWMAN}"> \x07'


@cache
def routes() -> dict[str, Route]:
    plain = build_route(case.planned(), safe_water=case.plan().area.water)
    named = replace(plain.waypoints[3], leg_name=ODD)
    odd = replace(plain, scenario=ODD, vessel=ODD, waypoints=(*plain.waypoints[:3], named, *plain.waypoints[4:]))
    return {"plain": plain, "timed": build_route(case.planned(), departure=DEPARTURE), "odd": odd}


@pytest.fixture(params=["plain", "timed", "odd"])
def route(request: pytest.FixtureRequest) -> Route:
    return routes()[request.param]


def positions(route: Route) -> np.ndarray:
    return np.array([(point.lat_deg, point.lon_deg) for point in route.waypoints])


def schema(name: str) -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(SAMPLES / name))


@pytest.mark.parametrize(
    ("name", "version"), [("rtz", "1_2"), ("rtz-1.1", "1_1"), ("rtz-1.0", "1_0")], ids=lambda value: str(value)
)
def test_rtz_passes_the_schema_of_its_version(route: Route, name: str, version: str) -> None:
    schema(f"rtz/RTZ_Schema_version_{version}.xsd").assertValid(etree.fromstring(find_format(name).write(route)))


def test_gpx_passes_the_schema_of_version_1_1(route: Route) -> None:
    schema("gpx/gpx-1.1.xsd").assertValid(etree.fromstring(find_format("gpx").write(route)))


def test_rtz_obeys_the_rules_that_its_schema_does_not_check(route: Route) -> None:
    content = find_format("rtz").write(route)
    root = etree.fromstring(content)
    space = {"r": "http://www.cirm.org/RTZ/1/2"}
    waypoints = root.findall("r:waypoints/r:waypoint", space)
    ids = [element.get("id") for element in waypoints]
    assert len(ids) == len(set(ids)) == len(route.waypoints)
    assert len({element.get("name") for element in waypoints}) == len(ids)
    assert root.find("r:routeInfo", space).get("routeName") == Path(find_format("rtz").file_name).stem
    assert [element.find("r:leg", space) is None for element in waypoints] == [True] + [False] * (len(ids) - 1)
    assert [e.get("waypointId") for e in root.findall(".//r:scheduleElement", space)] == ids
    assert len(content) < 400_000


def test_rtz_says_the_same_as_the_route_in_knots_and_nautical_miles() -> None:
    route = routes()["timed"]
    root = etree.fromstring(find_format("rtz").write(route))
    space = {"r": "http://www.cirm.org/RTZ/1/2"}
    read = [(float(e.get("lat")), float(e.get("lon"))) for e in root.findall(".//r:position", space)]
    assert np.abs(np.array(read) - positions(route)).max() < 1e-9
    for leg in root.findall(".//r:leg", space):
        assert float(leg.get("portsideXTD")) * METRES_PER_NAUTICAL_MILE == pytest.approx(route.xtd_m, abs=1e-6)
        assert leg.get("starboardXTD") == leg.get("portsideXTD")
    elements = root.findall(".//r:scheduleElement", space)
    speeds = [float(element.get("speed")) / KNOTS_PER_MPS for element in elements[1:]]
    assert speeds == pytest.approx([point.speed_mps for point in route.waypoints[1:]], abs=1e-3)
    for element, point in zip(elements[1:], route.waypoints[1:], strict=True):
        eta = datetime.fromisoformat(element.get("eta"))
        assert (eta - DEPARTURE).total_seconds() == pytest.approx(point.time_s, abs=0.5)
    assert elements[0].get("etd") is not None
    assert elements[0].get("eta") is None


def test_gpx_is_read_back_by_gpxpy() -> None:
    for route in routes().values():
        read = gpxpy.parse(find_format("gpx").write(route).decode()).routes[0]
        assert np.abs(np.array([(p.latitude, p.longitude) for p in read.points]) - positions(route)).max() < 1e-9
        assert [point.name for point in read.points] == [point.name for point in route.waypoints]
        times = [point.time for point in read.points]
        if route.departure is None:
            assert times == [None] * len(times)
        else:
            seconds = [(time - DEPARTURE).total_seconds() for time in times]
            assert seconds == pytest.approx([point.time_s for point in route.waypoints], abs=0.5)


def test_gpx_gives_opencpn_a_speed_for_every_chord() -> None:
    route = routes()["plain"]
    root = etree.fromstring(find_format("gpx").write(route))
    speeds = [e.get("planned_speed") for e in root.iter("{http://www.opencpn.org}rte_properties")]
    wanted = [point.speed_mps * KNOTS_PER_MPS for point in route.waypoints]
    assert [float(speed) for speed in speeds] == pytest.approx(wanted, abs=1e-3)


def test_geojson_lines_are_the_chords_of_the_legs(route: Route) -> None:
    collection = json.loads(find_format("geojson").write(route))
    lines = [f for f in collection["features"] if f["geometry"]["type"] == "LineString"]
    points = [f for f in collection["features"] if f["geometry"]["type"] == "Point"]
    joined = [tuple(lines[0]["geometry"]["coordinates"][0])]
    for line in lines:
        assert shape(line["geometry"]).is_valid
        assert tuple(line["geometry"]["coordinates"][0]) == joined[-1]
        joined += [tuple(position) for position in line["geometry"]["coordinates"][1:]]
    assert np.array_equal(np.array(joined)[:, ::-1], positions(route))
    assert np.array_equal([[shape(p["geometry"]).y, shape(p["geometry"]).x] for p in points], positions(route))
    assert [line["properties"]["leg"] for line in lines] == sorted({point.leg for point in route.waypoints[1:]})


def test_the_table_has_the_same_numbers(route: Route) -> None:
    rows = list(csv.DictReader(io.StringIO(find_format("csv").write(route).decode())))
    read = np.array([(float(row["lat_deg"]), float(row["lon_deg"])) for row in rows])
    assert np.abs(read - positions(route)).max() < 1e-9
    assert [float(row["time_s"]) for row in rows] == [point.time_s for point in route.waypoints]
    assert [row["leg_name"] for row in rows] == [point.leg_name for point in route.waypoints]


@pytest.mark.parametrize(
    ("line", "parts"),
    [
        ([(179.0, 0.0), (-179.0, 2.0)], [[(179.0, 0.0), (180.0, 1.0)], [(-180.0, 1.0), (-179.0, 2.0)]]),
        ([(-179.5, 4.0), (179.5, 0.0)], [[(-179.5, 4.0), (-180.0, 2.0)], [(180.0, 2.0), (179.5, 0.0)]]),
        ([(179.0, 1.0), (-180.0, 3.0), (-179.0, 5.0)],
         [[(179.0, 1.0), (180.0, 3.0)], [(-180.0, 3.0), (-179.0, 5.0)]]),
        ([(24.0, 60.0), (25.0, 60.0)], [[(24.0, 60.0), (25.0, 60.0)]]),
    ],
)  # fmt: skip
def test_lines_are_cut_at_the_antimeridian(line: list[tuple[float, float]], parts: object) -> None:
    assert cut_at_antimeridian(line) == parts


def test_a_route_too_long_for_an_ecdis_is_refused_with_a_way_out() -> None:
    route = routes()["plain"]
    many = tuple(replace(route.waypoints[1], name=f"WP{k:05d}", time_s=float(k), north_m=float(k)) for k in range(2000))
    with pytest.raises(InputError, match=r"a larger tolerance than 5\.0 m gives fewer waypoints"):
        find_format("rtz").write(replace(route, waypoints=many))


def test_files_are_named_as_the_contract_says_and_unknown_formats_list_the_known_ones() -> None:
    route = routes()["plain"]
    assert set(route_files(route, STANDARD)) == {
        "route.rtz", "route.gpx", "route.kml", "route.geojson", "route.plan", "route.waypoints", "route.csv"
    }  # fmt: skip
    assert len({known.file_name for known in FORMATS}) == len(FORMATS)
    names = [known.name for known in FORMATS]
    assert len(set(names)) == len(names)
    with pytest.raises(UnknownName) as caught:
        route_files(route, ["rtz", "tcx"])
    assert all(name in str(caught.value) for name in names)
