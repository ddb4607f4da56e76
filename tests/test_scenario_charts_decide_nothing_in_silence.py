"""Which side is water, which way depths count and which number is the latitude is stated, never guessed."""

import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import shapely

from expdesign.errors import FileError, NoPlan
from expdesign.plan.values import PlanSettings
from expdesign.scenario import load_area, load_scenario
from expdesign.scenario.scenario_file import berth_problem, build_berth
from expdesign.sea_area import as_multipolygon
from sample_files import outside
from scenario_files import AREA, collection, feature, spoil, square, write_scenario

LAT, LON = 54.5, 18.6
M_PER_DEGREE = (110_574.4, 111_319.49)  # of latitude and longitude at the equator, where the small charts lie


def plain(*rings, kind="Polygon", **properties):
    """A feature that names no layer."""
    return {**feature("", *rings, kind=kind), "properties": properties}


@pytest.fixture
def loaded(tmp_path):
    """Features, lines of [chart], other tables -> area."""

    def load(*features, chart="", tables=""):
        (tmp_path / "chart.geojson").write_text(json.dumps(collection(*features)), encoding="utf-8")
        path = tmp_path / "area.toml"
        path.write_text(
            f'[area]\nname = "a"\n[chart]\ngeojson = "chart.geojson"\n{chart}\n{tables}\n', encoding="utf-8"
        )
        return load_area(path, draught_m=2.5)

    return load


def side_m(half_deg):
    return 2 * half_deg * np.prod(M_PER_DEGREE) ** 0.5


BOUNDS = "[bounds]\nsouth_deg = -0.01\nwest_deg = -0.01\nnorth_deg = 0.01\neast_deg = 0.01"


def test_an_outline_that_names_no_layer_is_refused_with_the_key_and_both_choices(loaded):
    for chart in ([plain(square(0.005))], [plain(square(0.005), name="pond"), feature("land", square(0.001))]):
        with pytest.raises(FileError) as caught:
            loaded(*chart, tables=BOUNDS)
        assert caught.value.key == "chart.outlines"
        assert "expected 'water' or 'land'" in caught.value.problem
        assert "\n" not in str(caught.value)


def test_water_and_land_are_the_two_sides_of_the_same_outline(loaded):
    inside = loaded(plain(square(0.005)), chart="outlines = 'water'", tables=BOUNDS)
    beyond = loaded(plain(square(0.005)), chart="outlines = 'land'", tables=BOUNDS)
    assert inside.water.area == pytest.approx(side_m(0.005) ** 2, rel=1e-4)
    assert inside.water.symmetric_difference(beyond.land).area < 1e-3
    assert beyond.water.symmetric_difference(inside.land).area < 1e-3
    assert any("1 polygons name no layer and enclose water" in note for note in inside.notes)
    assert not any("beyond the polygons" in note for note in inside.notes)
    named = loaded(feature("lake", square(0.005)), chart="water_layers = ['lake']", tables=BOUNDS)
    assert named.water.equals(inside.water)


def test_a_place_is_water_where_an_odd_number_of_outlines_encloses_it(loaded):
    halves = (0.008, 0.005, 0.002)
    area = loaded(*(plain(square(half)) for half in halves), chart="outlines = 'water'", tables=BOUNDS)
    degrees = np.random.default_rng(1).uniform(-0.009, 0.009, (500, 2))
    enclosed = sum((np.abs(degrees) < half).all(axis=1) for half in halves)
    points = shapely.points(area.frame.to_metres(degrees)[:, ::-1])
    assert (shapely.contains(area.water, points) == (enclosed % 2 == 1)).all()
    assert any("islands" in note for note in area.notes)


@pytest.mark.outside
def test_the_pond_of_a_map_editor_has_its_water_inside(tmp_path):
    pond = outside("field/outline/pond-outline.geojson")
    (tmp_path / pond.name).write_text(pond.read_text(encoding="utf-8"), encoding="utf-8")
    path = tmp_path / "area.toml"
    text = outside("field/outline/area.toml").read_text(encoding="utf-8")
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=r"chart\.outlines: is missing.*'water' or 'land'"):
        load_area(path, draught_m=0.1)
    path.write_text(text.replace("[bounds]", 'outlines = "water"\n[bounds]'), encoding="utf-8")
    area = load_area(path, draught_m=0.1)
    outline = json.loads(pond.read_text(encoding="utf-8"))["features"][0]["geometry"]["coordinates"][0]
    ring = shapely.Polygon(area.frame.to_metres(np.array(outline)[:, ::-1])[:, ::-1])
    assert area.water.symmetric_difference(ring).area < 1e-3 * ring.area


CROSSED = [[0.001, 0.001], [0.003, 0.003], [0.003, 0.001], [0.001, 0.003], [0.001, 0.001]]
UNUSABLE = {
    "crossing": feature("land", CROSSED),
    "line": feature("land", CROSSED[:3], kind="LineString"),
    "point": plain([0.0, 0.0], kind="Point"),
    "no feature": 3,
    "strange type": feature("land", square(0.1), kind="Circle"),
    "no position": feature("land", [None, [0, 0]]),
    "danger out of range": feature("rocks", [0.0, 95.0], kind="Point"),
    "layer that is a number": {**plain(square(0.001)), "properties": {"layer": 7}},
}


@pytest.mark.parametrize("what", UNUSABLE)
def test_a_feature_that_cannot_be_used_is_left_out_by_a_key_and_named(loaded, what):
    land = feature("land", square(0.02), square(0.008)[::-1])
    way_out = r"or skip_features = \[2\] below \[chart\] of area\.toml.*would then count as water"
    with pytest.raises(FileError, match=way_out):
        loaded(land, UNUSABLE[what])
    area = loaded(land, UNUSABLE[what], chart="skip_features = [2]")
    assert area.water.equals(loaded(land).water)
    assert "chart.geojson: left out, as skip_features says: features 2" in area.notes
    if what in ("line", "point"):
        kind = UNUSABLE[what]["geometry"]["type"]
        assert loaded(land, UNUSABLE[what], chart=f"skip_features = ['{kind}']").water.equals(area.water)


@pytest.mark.parametrize(
    ("name", "begins", "said"),
    [
        ("pond.kml", b'<?xml version="1.0"?>\n<kml xmlns="http://www.opengis.net/kml/2.2">', "is KML"),
        ("pond.osm", b"\xef\xbb\xbf<?xml version='1.0'?>\n<osm version='0.6'>", "is OpenStreetMap XML"),
        ("pond.xml", b"<osm version='0.6'>", "multipolygons"),
        ("pond.gpx", b"<?xml version='1.0'?><gpx>", "is GPX"),
        ("pond.gml", b"<?xml version='1.0'?><FeatureCollection>", "is XML"),
        ("pond.kmz", b"PK\x03\x04\x14", "is a zip archive such as KMZ"),
        ("pond.shp", b"\x00\x00\x27\x0a\x00", "is a shapefile"),
        ("pond.dbf", b"\x03y", "is a part of a shapefile"),
        ("pond.gpkg", b"SQLite format 3\x00", "is a GeoPackage"),
        ("pond.json", b'{"version": 0.6, "osm3s": {}}', "is Overpass JSON"),
    ],
)
def test_a_map_in_another_format_is_refused_with_the_way_to_geojson(tmp_path, name, begins, said):
    (tmp_path / name).write_bytes(begins)
    path = tmp_path / "area.toml"
    path.write_text(f'[area]\nname = "a"\n[chart]\ngeojson = "{name}"\n', encoding="utf-8")
    with pytest.raises(FileError) as caught:
        load_area(path, draught_m=1.0)
    assert said in str(caught.value)
    assert "expected GeoJSON: " in str(caught.value)
    assert "\n" not in str(caught.value)


def sea(depth, half_deg):
    return {**plain(square(half_deg)), "properties": {"z": depth}}


def test_heights_are_depths_with_the_other_sign_and_are_asked_for(loaded):
    spots = [
        feature("SOUNDG", [0.002, 0.001, 2.0], kind="Point"),
        feature("SOUNDG", [-0.002, 0.001, 9.0], kind="Point"),
    ]
    depths = loaded(sea(12.0, 0.008), sea(1.0, 0.001), *spots, chart="depth_property = 'z'")
    negative = [sea(-12.0, 0.008), sea(-1.0, 0.001)]
    heights = [*negative, *(feature("SOUNDG", [*spot["geometry"]["coordinates"][:2], -z], kind="Point")
                            for spot, z in zip(spots, (2.0, 9.0), strict=True))]  # fmt: skip
    up = loaded(*heights, chart="depth_property = 'z'\ndepth_positive = 'up'")
    assert up.water.equals(depths.water)
    assert [depth for depth, _ in up.depths] == [1.0, 12.0]
    for chart in (heights, [*negative, spots[0]]):
        with pytest.raises(FileError, match=r"chart\.depth_positive: is missing, .*negative.*expected 'up'.*or 'down'"):
            loaded(*chart, chart="depth_property = 'z'")
    with pytest.raises(NoPlan, match="no layer is as deep"):
        loaded(*negative, chart="depth_property = 'z'\ndepth_positive = 'down'")


def test_soundings_alone_are_no_chart_of_depths(loaded):
    spots = [{**plain([0.001 * k, 0.0], kind="Point"), "properties": {"z": -6.8}} for k in range(3)]
    with pytest.raises(FileError, match=r"chart\.depth_property: is 'z', which only points state"):
        loaded(feature("land", square(0.02), square(0.008)[::-1]), *spots, chart="depth_property = 'z'")


def test_single_depths_above_water_are_said(loaded):
    area = loaded(sea(12.0, 0.008), sea(6.0, 0.003), sea(-0.5, 0.001), chart="depth_property = 'z'")
    assert "chart.geojson: 1 of 3 depths are negative, which count as above water" in area.notes
    assert not loaded(sea(12.0, 0.008), chart="depth_property = 'z'").notes[1:]


BASINS = collection(
    feature("land", square(0.02), square(0.008)[::-1]),
    feature("land", [[-0.0002, -0.009], [0.0002, -0.009], [0.0002, 0.0005], [-0.0002, 0.0005], [-0.0002, -0.009]]),
    feature("land", [[-0.0002, 0.0009], [0.0002, 0.0009], [0.0002, 0.009], [-0.0002, 0.009], [-0.0002, 0.0009]]),
)
"""Two basins joined by a gap of 44 m, too narrow for 20 m of clearance on both sides of a hull of 9 m."""


@pytest.mark.parametrize("end", ["start", "goal"])
@pytest.mark.parametrize("east_m", [-10.0, 10.0, -1200.0, 1200.0])
def test_the_place_offered_has_a_way_to_the_other_end(tmp_path, end, east_m):
    """Also where another place is nearer, in water that the clearance parts from the other end."""
    path = write_scenario(tmp_path)
    (tmp_path / "chart.geojson").write_text(json.dumps(BASINS), encoding="utf-8")
    spoil(tmp_path / "area.toml", "depth_layers = {seabed5m = 5.0, seabed20m = 20}", "")
    spoil(path, "north_m = 200\neast_m = -400.0", "north_m = 200\neast_m = 500.0")
    stated = {"start": "north_m = 200\neast_m = 500.0", "goal": "lat_deg = 0.0\nlon_deg = 0.0045"}[end]
    spoil(path, stated, f"north_m = 150\neast_m = {east_m}")
    with pytest.raises(FileError) as caught:
        load_scenario(path)
    way = "a way to the goal" if end == "start" else "a way from the start"
    offered = re.search(rf"the nearest place with room and {way} is (\w+ = \S+), (\w+ = \S+)$", str(caught.value))
    spoil(path, f"north_m = 150\neast_m = {east_m}", f"{offered[1]}\n{offered[2]}")
    case = load_scenario(path)
    ends = [shapely.Point(pose[1], pose[0]) for pose in (case.start, case.goal)]
    ways = case.area.safe_water(case.plan.clearance_m + case.vessel.beam_m / 2)
    assert any(all(part.covers(point) for point in ends) for part in ways.geoms)


def in_the_bay(folder):
    """The scenario, its area about 6000 km from where it lies with latitude and longitude swapped."""
    path = write_scenario(folder)
    at = partial(square, lon_deg=LON, lat_deg=LAT)
    rock = feature("rocks", [LON + 0.003, LAT], kind="Point")
    islet = feature("land", square(0.0004, lon_deg=LON - 0.004, lat_deg=LAT - 0.004))
    deep = feature("seabed20m", at(0.012))
    chart = collection(feature("land", at(0.02), at(0.015)[::-1]), islet, deep, rock)
    (folder / "chart.geojson").write_text(json.dumps(chart), encoding="utf-8")
    south, west, north, east = LAT - 0.01, LON - 0.01, LAT + 0.01, LON + 0.01
    zone = str([[LAT + y, LON + x] for x, y in ((0.006, 0.006), (0.008, 0.006), (0.008, 0.008))])
    text = re.sub(r"polygon = .*", f"polygon = {zone}", AREA).replace(
        "depth_layers = {seabed5m = 5.0, ", "depth_layers = {"
    )
    for key, value in {"south": south, "west": west, "north": north, "east": east}.items():
        text = re.sub(rf"{key}_deg = .*", f"{key}_deg = {value}", text)
    (folder / "area.toml").write_text(text, encoding="utf-8")
    spoil(path, "lat_deg = 0.0\nlon_deg = 0.0045", f"lat_deg = {LAT}\nlon_deg = {LON - 0.0045}")
    return path


def swap_feature(number, folder):
    chart = json.loads((folder / "chart.geojson").read_text(encoding="utf-8"))

    def swap(part):
        return part[::-1] if isinstance(part[0], float) else [swap(inner) for inner in part]

    geometry = chart["features"][number - 1]["geometry"]
    geometry["coordinates"] = swap(geometry["coordinates"])
    (folder / "chart.geojson").write_text(json.dumps(chart), encoding="utf-8")


def swap_corner(number, folder):
    chart = json.loads((folder / "chart.geojson").read_text(encoding="utf-8"))
    chart["features"][number - 1]["geometry"]["coordinates"][0][2].reverse()
    (folder / "chart.geojson").write_text(json.dumps(chart), encoding="utf-8")


def swap_lines(name, folder):
    """Swap two numbers that a file states one after the other."""
    number = r"-?[\d.]+"

    def swap_in(pattern, text):
        found = re.search(pattern, text)
        assert found
        first, second = found.span(1), found.span(2)
        return text[: first[0]] + found[2] + text[first[1] : second[0]] + found[1] + text[second[1] :]

    file, patterns = {
        "goal": ("scenario.toml", [rf"lat_deg = ({number})\nlon_deg = ({number})"]),
        "corner": ("area.toml", [rf"polygon = \[\[({number}), ({number})\]"]),
        "bounds": ("area.toml", [rf"south_deg = ({number})\nwest_deg = ({number})",
                                 rf"north_deg = ({number})\neast_deg = ({number})"]),
    }[name]  # fmt: skip
    text = (folder / file).read_text(encoding="utf-8")
    for pattern in patterns:
        text = swap_in(pattern, text)
    (folder / file).write_text(text, encoding="utf-8")


def swap_zone(folder):
    path = folder / "area.toml"
    text = path.read_text(encoding="utf-8")
    zone = json.loads(re.search(r"polygon = (.*)", text)[1])
    path.write_text(re.sub(r"polygon = .*", f"polygon = {[corner[::-1] for corner in zone]}", text), encoding="utf-8")


def start_in_degrees(folder):
    spoil(folder / "scenario.toml", "north_m = 200\neast_m = -400.0", f"lat_deg = {LON}\nlon_deg = {LAT}")


def start_in_metres(folder):
    spoil(folder / "scenario.toml", "north_m = 200\neast_m = -400.0", "north_m = 3000.0\neast_m = 30.0")
    spoil(folder / "area.toml", f"east_deg = {LON + 0.01}", f"east_deg = {LON + 0.1}")
    chart = json.loads((folder / "chart.geojson").read_text(encoding="utf-8"))
    wide = [[LON - 0.02, LAT - 0.02], [LON + 0.12, LAT - 0.02], [LON + 0.12, LAT + 0.02], [LON - 0.02, LAT + 0.02]]
    chart["features"][0] = feature("land", wide, [[x, y * 0.1 + LAT * 0.9] for x, y in wide])
    chart["features"][2] = feature("seabed20m", wide)
    (folder / "chart.geojson").write_text(json.dumps(chart), encoding="utf-8")


SWAPPED = {
    "start in degrees": (start_in_degrees, "start"),
    "start in metres": (start_in_metres, "start"),
    "goal": (partial(swap_lines, "goal"), "goal"),
    "bounds": (partial(swap_lines, "bounds"), "bounds"),
    "no-go zone": (swap_zone, "no_go[1].polygon"),
    "corner of a no-go zone": (partial(swap_lines, "corner"), "no_go[1].polygon[1]"),
    "land": (partial(swap_feature, 2), "feature 2 (layer 'land')"),
    "depth area": (partial(swap_feature, 3), "feature 3 (layer 'seabed20m')"),
    "danger": (partial(swap_feature, 4), "feature 4 (layer 'rocks')"),
    "corner of land": (partial(swap_corner, 2), "feature 2 (layer 'land')"),
    "corner of a depth area": (partial(swap_corner, 3), "feature 3 (layer 'seabed20m')"),
}


def check_swapped(path: Path, what: str) -> None:
    """A scenario is read, and after a change it is refused in a line that names what is swapped."""
    load_scenario(path)
    change, key = SWAPPED[what]
    change(path.parent)
    with pytest.raises(FileError, match="swapped") as caught:
        load_scenario(path)
    assert caught.value.key == key
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("what", SWAPPED)
def test_every_coordinate_with_its_numbers_swapped_is_refused_and_named(tmp_path, what):
    check_swapped(in_the_bay(tmp_path), what)


@pytest.mark.parametrize("what", [name for name, (_, key) in SWAPPED.items() if key.startswith("feature")])
def test_swapped_numbers_of_a_chart_are_named_where_no_bounds_are_given(tmp_path, what):
    path = in_the_bay(tmp_path)
    area = tmp_path / "area.toml"
    area.write_text(re.sub(r"\[bounds\]\n(\w+_deg = .*\n)+", "", area.read_text(encoding="utf-8")), encoding="utf-8")
    check_swapped(path, what)


def test_a_place_in_the_area_is_not_called_swapped(tmp_path):
    """Many a place has its mirror image in the area's water, too."""
    case = load_scenario(in_the_bay(tmp_path))
    zone = shapely.box(-420.0, 180.0, -380.0, 220.0)
    area = replace(case.area, water=as_multipolygon(case.area.water.difference(zone)))
    berth = build_berth(np.array([200.0, -400.0]), 0.0, area, degrees=False)
    assert area.water.covers(berth.swapped(area))
    said = berth_problem(berth, case.vessel, area, PlanSettings(), end=case.goal, way="a way to the goal")
    assert "outside the allowed water" in said
    assert "swapped" not in said


def test_a_recorded_position_with_its_numbers_swapped_is_named(tmp_path):
    case = load_scenario(in_the_bay(tmp_path))

    def problem(stated):
        berth = build_berth(np.array(stated), 0.0, case.area, degrees=True)
        return berth_problem(berth, case.vessel, case.area, PlanSettings(), end=case.goal, way="a way to the goal")

    assert problem([LAT, LON - 0.002]) == ""
    assert "with latitude and longitude swapped it is in the area" in problem([LON - 0.002, LAT])
    assert "swapped" not in problem([LON + 3.0, LAT])


def test_a_no_go_zone_outside_the_bounds_closes_nothing_and_is_said(tmp_path):
    in_the_bay(tmp_path)
    path = tmp_path / "area.toml"
    text = path.read_text(encoding="utf-8")
    zone = [[LAT + y, LON + 0.03 + x] for x, y in ((0.006, 0.006), (0.008, 0.006), (0.008, 0.008))]
    path.write_text(re.sub(r"polygon = .*", f"polygon = {zone}", text), encoding="utf-8")
    notes = load_area(path, draught_m=1.0).notes
    assert "no-go zone 'wreck' lies 1.68 km outside the bounds and closes nothing" in notes
    far = [[lat, lon + 20] for lat, lon in zone]
    path.write_text(re.sub(r"polygon = .*", f"polygon = {far}", text), encoding="utf-8")
    with pytest.raises(FileError, match=r"of 'wreck' lies 129\d km outside the bounds, expected corners \[latitude"):
        load_area(path, draught_m=1.0)
