import json
import math

import numpy as np
import pytest
import shapely

from expdesign.errors import FileError, NoPlan
from expdesign.scenario import load_area, load_scenario
from scenario_files import collection, feature, spoil, square, square_chart, write_scenario

BOW_TIE = [[0.001, 0.001], [0.003, 0.003], [0.003, 0.001], [0.001, 0.003], [0.001, 0.001]]
TOUCHING = [[0, 0], [0.002, 0], [0.001, 0.001], [0.002, 0.002], [0, 0.002], [0.001, 0.001], [0, 0]]

WRONG_CHARTS = [
    ([], "", "is no GeoJSON object"),
    ({"type": "Topology"}, "type", "is 'Topology', expected FeatureCollection"),
    ({"type": "FeatureCollection"}, "features", "is missing or no list"),
    (collection(), "features", "is empty, expected at least one polygon"),
    (collection(3), "feature 1", "is no GeoJSON feature"),
    (collection(feature(7, square(1.0))), "feature 1", "has the layer 7, expected the name"),
    (
        collection(feature("land", [[0, 0], [1, 1], [1, 0]], kind="LineString")),
        "feature 1 (layer 'land')",
        "is a LineString, expected Polygon or MultiPolygon",
    ),
    (collection(feature("land", square(1.0), kind="Circle")), "feature 1", "geometry of type 'Circle'"),
    (collection({"type": "Feature", "properties": {}, "geometry": 3}), "feature 1", "geometry of type 3"),
    (collection(feature("land")), "feature 1 (layer 'land')", "has a polygon without rings"),
    (collection(feature("land", 3)), "feature 1 (layer 'land')", "has 3 where a position"),
    (collection(feature("land", [None, [0, 0]])), "feature 1 (layer 'land')", "has None where a position"),
    (collection(feature("land", [])), "feature 1 (layer 'land')", "has [] where a position"),
    (collection(feature("land", [[0, 0], [1]])), "feature 1 (layer 'land')", "has [1] where a position"),
    (collection(feature("land", [[0, 0], ["1", 0]])), "feature 1 (layer 'land')", "has ['1', 0] where a position"),
    (collection(feature("land", [[0, 0], [True, 0]])), "feature 1 (layer 'land')", "has [True, 0] where a position"),
    (collection(feature("land", square(0.1, lat_deg=95.0))), "feature 1 (layer 'land')", "position [-0.1, 94.9]"),
    (collection(feature("land", [[25e5, 6e6], [25e5, 7e6], [26e5, 6e6]])), None, "position [2.5e+06, 6e+06]"),
    (collection(feature("land", [[0, 0], [1, 1], [0, 0]])), None, "has a ring with 2 different corners, expected at"),
    (collection(feature("land", [[-120, 80], [0, 80], [120, 80], [-120, 80]])), None, "goes around a pole"),
    (
        collection(feature("land", square(0.1)), feature("land", BOW_TIE)),
        "feature 2 (layer 'land')",
        "crosses itself at 0.00200 N, 0.00200 E, expected outlines that neither cross",
    ),
    (collection(feature("land", square(0.1), BOW_TIE)), "feature 1 (layer 'land')", "crosses itself at 0.00200 N"),
    (collection(feature("land", square(0.1), square(0.1, lon_deg=1.0))), None, "has a hole outside its outline"),
    (collection(feature("land", BOW_TIE)), "feature 1 (layer 'land')", "crosses itself"),
    (collection(feature("land", square(0.1), square(0.05), square(0.05))), None, "crosses itself"),
    (collection(feature("land", square(0.1), square(0.05), square(0.02))), None, "has a hole inside a hole"),
    (collection(feature("land", square(0.1)), feature("land", [[0, 0], [1, 1], [2, 2], [0, 0]])), None, "no area"),
    (collection(feature("land", square(0.1), square(0.1))), "feature 1 (layer 'land')", "encloses no area"),
    (collection(feature("land", [[-180, -80], [180, -80], [180, 80], [-180, 80]])), None, "encloses no area"),
    ({**square_chart(), "crs": {"properties": {"name": "EPSG:25832"}}}, "crs", "is 'EPSG:25832', expected longitude"),
]


@pytest.fixture
def area(tmp_path):
    """An area file that takes land from a chart with the chart's own extent as bounds."""
    write_scenario(tmp_path)
    path = tmp_path / "area.toml"
    path.write_text('[area]\nname = "a"\n[chart]\ngeojson = "chart.geojson"\n', encoding="utf-8")
    return path


def _write(area, chart):
    text = chart if isinstance(chart, str) else json.dumps(chart)
    (area.parent / "chart.geojson").write_text(text, encoding="utf-8")


def _water(area, chart):
    _write(area, chart)
    return load_area(area, draught_m=1.0)


@pytest.mark.parametrize(("chart", "key", "words"), WRONG_CHARTS)
def test_wrong_charts_are_refused_in_one_line(area, chart, key, words):
    _write(area, chart)
    with pytest.raises(FileError) as caught:
        load_area(area, draught_m=1.0)
    assert "\n" not in str(caught.value)
    assert caught.value.path.name == "chart.geojson"
    assert key is None or caught.value.key == key
    assert words in caught.value.problem


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is not valid JSON: Expecting value (at line 1, column 1)"),
        ('{"type":\n "Polygon",', "(at line 2, column 12)"),
        ('{"type": "Polygon", "coordinates": [[[NaN, 1]]]}', "holds NaN, expected finite numbers"),
        (5000 * "[", "is not"),
        ('{"type": "Polygon", "coordinates": [[[1e999, 1]]]}', "has [inf, 1] where a position"),
    ],
)
def test_charts_that_are_not_json_are_refused_in_one_line(area, text, words):
    _with_keys(area, 'outlines = "land"')
    _write(area, text)
    with pytest.raises(FileError) as caught:
        load_area(area, draught_m=1.0)
    assert "\n" not in str(caught.value)
    assert words in str(caught.value)


def test_a_crossing_outline_is_refused_through_the_scenario_too(tmp_path):
    path = write_scenario(tmp_path)
    chart = square_chart()
    chart["features"].append(feature("land", BOW_TIE))
    (tmp_path / "chart.geojson").write_text(json.dumps(chart), encoding="utf-8")
    with pytest.raises(FileError, match=r"feature 5 \(layer 'land'\): crosses itself at 0.00200 N, 0.00200 E"):
        load_scenario(path)


def test_harmless_flaws_change_nothing_and_are_noted(area):
    clean = _water(area, collection(feature("land", square(0.02), square(0.008))))
    ring = square(0.02)
    flawed = _water(area, collection(feature("land", [ring[0], *ring[:-1]], square(0.008))))
    assert flawed.water.equals(clean.water)
    assert clean.notes == ()
    assert set(flawed.notes) == {"chart.geojson: 1 repeated point removed", "chart.geojson: 1 ring closed"}


def test_outlines_that_touch_themselves_keep_their_area(area):
    outer = feature("land", square(0.02), square(0.008))
    touching = _water(area, collection(outer, feature("land", TOUCHING)))
    apart = [[[0, 0], [0.002, 0], [0.001, 0.001], [0, 0]], [[0, 0.002], [0.001, 0.001], [0.002, 0.002], [0, 0.002]]]
    by_hand = _water(area, collection(outer, *(feature("land", part) for part in apart)))
    assert touching.water.symmetric_difference(by_hand.water).area < 1e-6
    assert touching.notes == ("chart.geojson: 1 polygon taken apart where it touches itself",)


def test_flaws_that_leave_no_doubt_about_land_and_water_are_mended(area):
    """A hole along the shore is a bay, a spike without width is none, an islet counted twice is there once."""
    outer = feature("land", square(0.02), square(0.008))
    bay_hole = [[0, 0.001], [0.002, 0.001], [0.002, 0.002], [0, 0.002], [0, 0.001]]
    shell = [[0, 0], [0.003, 0], [0.003, 0.003], [0, 0.003], [0, 0]]
    bay = [
        [0, 0],
        [0.003, 0],
        [0.003, 0.003],
        [0, 0.003],
        [0, 0.002],
        [0.002, 0.002],
        [0.002, 0.001],
        [0, 0.001],
        [0, 0],
    ]
    spike = [*shell[:3], [0.004, 0.004], *shell[2:]]
    notch = [*shell[:3], [0.001, 0.001], *shell[2:]]
    flawed = {"bay": ([shell, bay_hole], [bay]), "spike": ([spike], [shell]), "notch": ([notch], [shell])}
    for rings, drawn_well in flawed.values():
        mended = _water(area, collection(outer, feature("land", *rings)))
        clean = _water(area, collection(outer, feature("land", *drawn_well)))
        assert mended.water.symmetric_difference(clean.water).area < 1e-6
        assert "taken apart where it touches itself" in mended.notes[0]


@pytest.mark.parametrize("size_deg", [1e-5, 1e-4, 1e-3])
def test_a_crossing_of_a_metre_on_a_long_coast_is_still_refused(area, size_deg):
    """The area enclosed by a small crossing is ambiguous, however large the land is."""
    loop = [[0.0, -0.5], [size_deg, -0.5 - size_deg], [0.0, -0.5 - size_deg], [size_deg, -0.5]]
    coast = [[-0.5, -0.5], *loop, [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]]
    _write(area, collection(feature("land", coast)))
    with pytest.raises(FileError, match="crosses itself"):
        load_area(area, draught_m=1.0)


def test_overlapping_parts_count_once_and_islands_in_lakes_in_islands_alternate(area):
    rings = [square(half) for half in (0.02, 0.016, 0.012, 0.008)]
    nested = _water(area, collection(feature("land", rings[0], rings[1]), feature("land", rings[2], rings[3])))
    side = [2 * half * 111_319.49 for half in (0.016, 0.012, 0.008)]
    assert nested.water.area == pytest.approx(side[0] ** 2 - side[1] ** 2 + side[2] ** 2, rel=0.01)
    twice = _water(area, collection(*2 * [feature("land", rings[0], rings[1]), feature("land", rings[2], rings[3])]))
    assert twice.water.symmetric_difference(nested.water).area < 1e-6
    parts = [[rings[0], rings[1]], [rings[2], rings[3]]]
    _with_keys(area, 'outlines = "land"')
    together = _water(area, {"type": "MultiPolygon", "coordinates": parts})
    assert together.water.symmetric_difference(nested.water).area < 1e-6


@pytest.mark.parametrize("shift_deg", [155.0, 156.0, 180.0])
def test_the_antimeridian_changes_nothing(area, shift_deg):
    """The same chart elsewhere on the parallel has the same water, also where longitudes jump from 180 to -180."""

    def chart(shift):
        wrap = lambda lon: (lon + shift + 180) % 360 - 180  # noqa: E731
        rings = [[[wrap(x), y] for x, y in square(0.02 * scale, lon_deg=25.0, lat_deg=60.0)] for scale in (1.0, 0.6)]
        island = [[wrap(x), y] for x, y in square(0.002, lon_deg=25.005, lat_deg=60.005)]
        return collection(feature("land", *rings), feature("land", island))

    here, there = _water(area, chart(0.0)), _water(area, chart(shift_deg))
    assert there.water.symmetric_difference(here.water).area < 1e-3
    assert abs((there.frame.lon_deg - here.frame.lon_deg - shift_deg + 180) % 360 - 180) < 1e-9


def test_bounds_over_the_antimeridian_meet_parts_on_both_sides(area):
    west = feature("land", [[179.99, 0], [180, 0], [180, 0.01], [179.99, 0.01], [179.99, 0]])
    east = feature("land", [[-180, 0], [-179.99, 0], [-179.99, 0.01], [-180, 0.01], [-180, 0]])
    bounds = "[bounds]\nsouth_deg = -0.01\nnorth_deg = 0.02\nwest_deg = 179.98\neast_deg = -179.98\n"
    area.write_text(area.read_text() + bounds, encoding="utf-8")
    loaded = _water(area, collection(west, east))
    assert len(loaded.land.geoms) == 1
    assert loaded.land.area == pytest.approx(loaded.water.area / 5, rel=1e-4)
    assert abs(loaded.frame.lon_deg) == pytest.approx(180.0)


def test_bare_polygons_and_features_without_layers_are_what_the_area_file_says(area):
    _with_keys(area, 'outlines = "land"')
    coordinates = [square(0.02), square(0.008)]
    bare = _water(area, {"type": "Polygon", "coordinates": coordinates})
    plain = {"type": "Feature", "properties": None, "geometry": {"type": "Polygon", "coordinates": coordinates}}
    for chart in (plain, collection(plain, {"type": "Feature", "properties": {}, "geometry": None})):
        assert _water(area, chart).water.equals(bare.water)
    _with_keys(area)
    named = _water(area, collection(feature("land", *coordinates)))
    assert named.water.equals(bare.water)


def test_bounds_beyond_the_chart_are_noted(tmp_path):
    write_scenario(tmp_path)
    path = tmp_path / "area.toml"
    spoil(path, "depth_layers = {seabed5m = 5.0, seabed20m = 20}", "")
    assert not any("beyond" in note for note in load_area(path, draught_m=1.0).notes)
    spoil(path, "south_deg = -0.01", "south_deg = -0.03")
    assert "beyond the polygons" in load_area(path, draught_m=1.0).notes[-1]


def test_depth_layers_admit_only_water_deep_enough_for_draught_and_margin(tmp_path):
    write_scenario(tmp_path)
    path = tmp_path / "area.toml"
    side = {draught: 2 * half * 111_319.49 for draught, half in ((2.5, 0.0075), (4.0, 0.0075), (4.1, 0.002))}
    for draught, length in side.items():
        loaded = load_area(path, draught_m=draught)
        west, south, east, north = loaded.water.bounds
        assert east - west == pytest.approx(length, rel=1e-4)
        assert north - south == pytest.approx(length * 110_574.4 / 111_319.49, rel=1e-4)
        assert f"{draught:g} m draught + 1 m under the keel" in loaded.depth_rule
    wreck = shapely.Point(0.007 * 111_319.49, 0.007 * 110_574.4)
    loaded = load_area(path, draught_m=2.5)
    assert not loaded.water.intersects(wreck)
    assert not loaded.land.intersects(wreck)
    spoil(path, "depth_layers = {seabed5m = 5.0, seabed20m = 20}", "")
    assert load_area(path, draught_m=50.0).depth_rule.startswith("Depth is not checked")


def _of_depth(depth_m, ring, **properties):
    return {**feature("sea", ring), "properties": {"DRVAL1": depth_m, **properties}}


def _with_keys(area, *lines):
    area.write_text('[area]\nname = "a"\n[chart]\ngeojson = "chart.geojson"\n' + "\n".join(lines), encoding="utf-8")


def test_areas_with_a_depth_of_their_own_admit_water_deep_enough_and_the_least_depth_counts(area):
    """As electronic charts give them; beside them, features without a depth are land."""
    _with_keys(area, 'depth_property = "DRVAL1"')
    island = {**feature("x", square(0.001, lon_deg=0.004)), "properties": {"DRVAL1": None, "name": "islet"}}
    deep, shoal = _of_depth(10, square(0.01)), _of_depth(1.5, square(0.002))
    loaded = _water(area, collection(deep, shoal, _of_depth(20.0, square(0.001)), island))
    by_hand = shapely.Polygon(square(0.01)).difference(
        shapely.union_all([shapely.Polygon(ring) for ring in (square(0.002), square(0.001, lon_deg=0.004))])
    )
    assert loaded.water.area == pytest.approx(by_hand.area * 111_319.49 * 110_574.4, rel=1e-4)
    assert len(loaded.land.geoms) == 1
    assert loaded.depth_rule.startswith("Allowed water lies where DRVAL1 is at least 10 m for 1 m draught")
    assert [depth for depth, _ in loaded.depths] == [1.5, 10, 20]
    only_depths = _water(area, collection(deep, shoal))
    assert only_depths.land.is_empty
    with pytest.raises(NoPlan, match=r"chart.depth_property: no layer is as deep as .*the deepest is 'DRVAL1 = 10'"):
        load_area(area, draught_m=30.0)


def test_the_layer_may_stand_under_another_name(area):
    """Layers under another property give the same water; an unknown property is refused with the known ones."""
    rings = [square(0.02), square(0.008)]
    plain = _water(area, collection(feature("land", *rings), feature("sea", square(0.001))))
    _with_keys(area, 'layer_property = "objectType"')
    named = [
        {**feature("x", *part), "properties": {"objectType": name}}
        for name, part in (("land", rings), ("sea", [square(0.001)]))
    ]
    assert _water(area, collection(*named)).water.equals(plain.water)
    _with_keys(area, 'depth_property = "DRVAL"')
    _write(area, collection(_of_depth(10, square(0.01))))
    with pytest.raises(FileError, match=r"chart.depth_property: is 'DRVAL', .*DRVAL1"):
        load_area(area, draught_m=1.0)
    _with_keys(area, 'depth_property = "DRVAL1"', "depth_layers = {sea = 5.0}")
    with pytest.raises(FileError, match=r"chart.depth_property: is given with depth_layers"):
        load_area(area, draught_m=1.0)
    _with_keys(area, 'depth_property = "DRVAL1"')
    _write(area, collection(_of_depth("ten", square(0.01))))
    with pytest.raises(FileError, match=r"feature 1: has DRVAL1 = 'ten', expected a depth in metres"):
        load_area(area, draught_m=1.0)


def test_a_chart_without_layers_says_that_all_of_it_counts_as_land(area):
    """Depth areas of a chart whose layers are not named would else only be a puzzle."""
    _with_keys(area, 'outlines = "land"')
    _write(area, collection(_of_depth(10, square(0.01))))
    with pytest.raises(NoPlan, match=r"all of it is land; chart.geojson: 1 polygons name no layer and enclose land"):
        load_area(area, draught_m=1.0)


def test_chart_edges_are_straight_in_latitude_and_longitude(area):
    """A long edge along a parallel follows it, as GeoJSON says, instead of the straight line in the frame."""
    chart = collection(feature("land", square(0.25, lat_deg=60.0), square(0.2, lat_deg=60.0)))
    loaded = _water(area, chart)
    north_edge = loaded.frame.to_metres(np.array([[60.2, lon] for lon in np.linspace(-0.19, 0.19, 9)]))
    distance = shapely.distance(loaded.water.boundary, shapely.points(north_edge[:, ::-1]))
    assert distance.max() < 0.01
    sagitta = (
        (0.2 * math.radians(1) * math.cos(math.radians(60.2)) * 6.39e6) ** 2 / 2 / 6.39e6 * math.tan(math.radians(60.2))
    )
    assert sagitta > 10
