"""Dangers in GeoJSON charts close the same water as the same dangers in an S-57 cell, none silently left out."""

import json

import numpy as np
import pytest
import shapely

from expdesign.errors import FileError
from expdesign.scenario import load_area
from expdesign.scenario.charts.geojson_dangers import LANGUAGES
from scenario_files import collection, feature, square

PLACE = [0.002, 0.001]
NEEDED_M, MARGIN_M = 3.5, 25.0
LAND = feature("land", square(0.02), square(0.008)[::-1])  # a frame of land round a square of water


def danger(layer="points", kind="Point", at=PLACE, **properties):
    made = feature(layer, at, kind=kind)
    made["properties"].update(properties)
    return made


@pytest.fixture
def loaded(tmp_path):
    """Features, lines of [chart] -> area."""

    def load(*features, chart=""):
        (tmp_path / "chart.geojson").write_text(json.dumps(collection(LAND, *features)), encoding="utf-8")
        path = tmp_path / "area.toml"
        path.write_text(f'[area]\nname = "a"\n[chart]\ngeojson = "chart.geojson"\n{chart}\n', encoding="utf-8")
        return load_area(path, draught_m=2.5)

    return load


def closed_m2(loaded, *features, chart=""):
    return loaded(chart=chart).water.area - loaded(*features, chart=chart).water.area


NATIONAL = {
    "French": ("Épaves", "haut-fond", "ROCHE", "Hauts-fonds", "récif", "Bouées"),
    "German": ("Wracks", "Untiefe", "Unterwasserfelsen", "Unterwasserhindernis", "Klippen", "Tonnen"),
    "Swedish": ("Vrak", "Grund", "undervattensgrund", "Sten_P", "Grynnor", "prickar"),
    "Norwegian": ("Grunne", "Skjær", "SKJAER", "Båe", "skipsvrak", "Bøyer"),
    "Finnish": ("Hylky_P", "Vesikivi_P", "kari", "Matalikko", "viitat"),
    "Dutch": ("wrakken", "ondiepte", "Rotsen", "obstakels", "boeien"),
}
"""Layers as national charts name them."""
DISC = shapely.Point(0, 0).buffer(MARGIN_M, quad_segs=8).area


@pytest.mark.parametrize(
    "point",
    [
        *(danger(layer) for layers in NATIONAL.values() for layer in layers),
        danger(objtype="Skjær"),
        danger(historic="wreck"),
        danger("Grunne", dybde=2.0),
        *(danger(layer) for layer in ("UWTROC", "uwtroc", "rocks", "underwater_rock", "Wrecks", "SHOALS", "OBSTRN")),
        danger(type="wreck"),
        danger(**{"seamark:type": "obstruction"}),
        danger(natural="reef"),
        danger(OBJL=153),
        danger(CATWRK=2),
        danger("buoy"),
        danger("BCNLAT"),
        danger("rocks", depth_m=1.0),
        danger("rocks", VALSOU=3.4),
        danger("rocks", depth=-0.5),
        danger("rocks", depth="3.4"),
        danger("rocks", depth="unknown"),
        danger("rocks", depth=None),
        danger("rocks", depth=30.0, VALSOU=1.0),
        danger("SOUNDG", at=[*PLACE, 2.0]),
        danger("rocks", "MultiPoint", [PLACE]),
        danger("rocks", at=[*PLACE, 40.0]),
        {**danger("rocks"), "geometry": {"type": "GeometryCollection", "geometries": [danger()["geometry"]]}},
    ],
)
def test_a_point_of_danger_is_kept_clear_of_by_the_margin(loaded, point):
    area = loaded(point)
    assert loaded().water.area - area.water.area == pytest.approx(DISC, rel=1e-4)
    there = area.frame.to_metres(np.array(PLACE[::-1]))
    assert area.water.distance(shapely.Point(there[::-1])) == pytest.approx(MARGIN_M, rel=0.01)
    assert any("kept clear of 1 " in note for note in area.notes) or "BCNLAT" in str(point)  # which is like land
    assert not any("not used" in note for note in area.notes)


def test_no_word_stands_for_two_kinds_of_danger():
    words = [word for words in LANGUAGES.values() for word in words.split()]
    assert len(set(words)) == len(words)


@pytest.mark.parametrize("kind", ["obstruction", "unsurveyed", "UNSARE", "shoal", "IkkeKartlagtSjømåltOmråde"])
def test_areas_of_danger_are_closed_as_they_are(loaded, kind):
    area = feature(kind if kind.isupper() else "areas", square(0.001))
    area["properties"]["kind"] = kind
    side_m = 0.002 * 111_000
    assert closed_m2(loaded, area) == pytest.approx(side_m**2, rel=0.02)


def test_lines_of_danger_are_walls(loaded):
    closed = closed_m2(loaded, danger("rocks", "LineString", [[0.0, 0.0], [0.002, 0.0]]))
    assert closed == pytest.approx(2 * 0.002 * 111_300, rel=0.05)


@pytest.mark.parametrize("point", [danger("rocks", depth_m=3.5), danger("SOUNDG", at=[*PLACE, 20.0])])
def test_deep_dangers_close_nothing(loaded, point):
    assert closed_m2(loaded, point) == 0.0


def test_a_danger_in_a_deep_layer_is_closed_and_the_tide_opens_it(loaded):
    deep = feature("deep", square(0.0075))
    shoal = feature("deep", square(0.001))
    shoal["properties"].update(kind="shoal", depth=2.0)
    depths = "depth_layers = {deep = 10.0}"
    assert loaded(deep, chart=depths).water.area - loaded(deep, shoal, chart=depths).water.area > 4e4
    tide = depths + "\n[depth]\ntide_m = 2.0"
    assert loaded(deep, chart=tide).water.area == pytest.approx(loaded(deep, shoal, chart=tide).water.area)


def test_soundings_and_dangers_are_read_beside_areas_with_a_depth(loaded):
    deep = feature("sea", square(0.0075))
    deep["properties"]["depth"] = 12.0
    chart = 'depth_property = "depth"'
    water = loaded(deep, chart=chart).water.area
    for shallow in (danger("spots", depth=2.0), danger("rocks", depth=2.0), danger("rocks")):
        assert water - loaded(deep, shallow, chart=chart).water.area == pytest.approx(DISC, rel=1e-4)
    assert loaded(deep, danger("rocks", depth=9.0), chart=chart).water.area == pytest.approx(water)


def test_everything_that_is_not_used_is_named_in_one_line_each(loaded):
    area = loaded(danger("lights"), danger("lights"), danger("points", type="tree"), feature("parks", square(0.001)))
    unused = [note for note in area.notes if "not used" in note]
    assert unused == [
        "chart.geojson: not used: 2 Point in layer 'lights'",
        "chart.geojson: not used: 1 Point in layer 'points' of type 'tree'",
        "chart.geojson: not used: 1 Polygon in layer 'parks'",
    ]


@pytest.mark.parametrize("key", ["name", "navn", "namn", "nimi", "nom", "naam", "OBJNAM", "label", "title"])
@pytest.mark.parametrize("name", ["Grund", "Stein", "Mole", "Kari", "Pont Harbour", "Port of Rock", "Wreck Bay"])
def test_proper_names_are_no_dangers(loaded, key, name):
    for place in (danger("harbours", **{key: name}), danger("places", type="harbour", **{key: name})):
        assert closed_m2(loaded, place) == 0.0


def test_everything_that_closes_water_is_named_with_what_it_is_taken_for(loaded):
    area = loaded(danger("Grund"), danger("Grund"), danger("points", type="stein"), danger("points", type="tree"))
    assert [note for note in area.notes if "taken for" in note] == [
        "chart.geojson: taken for OBSTRN: 2 Point in layer 'Grund'",
        "chart.geojson: taken for UWTROC: 1 Point in layer 'points' of type 'stein'",
    ]


def test_the_layers_of_dangers_can_be_stated(loaded):
    stones, rocks = danger("steiner"), danger("rocks", at=[-0.002, 0.0])
    area = loaded(stones, rocks, chart='danger_layers = ["steiner"]')
    assert loaded().water.area - area.water.area == pytest.approx(DISC, rel=1e-4)
    assert any("not used: 1 Point in layer 'rocks'" in note for note in area.notes)
    with pytest.raises(FileError, match=r"chart\.danger_layers\[1\]: is 'rock', did you mean 'rocks'"):
        loaded(rocks, chart='danger_layers = ["rock"]')
    with pytest.raises(FileError, match=r"is 'land', also a layer of land"):
        loaded(chart='danger_layers = ["land"]')


def test_bridges_open_for_ships_that_fit_below(loaded):
    bridge = danger("BRIDGE", "LineString", [[0.0, -0.01], [0.0, 0.01]], VERCLR=12.0)
    assert len(loaded(bridge).water.geoms) == 2
    assert len(loaded(bridge, chart="air_draught_m = 10.0").water.geoms) == 1


@pytest.mark.parametrize("at", [[0.0], ["x", 0.0], [0.0, 95.0], None])
def test_wrong_positions_of_dangers_are_refused_in_one_line(loaded, at):
    with pytest.raises(FileError, match=r"feature 2 \(layer 'rocks'\): has .* position"):
        loaded(danger("rocks", at=at))


def test_dangers_beyond_the_antimeridian_are_where_they_are(tmp_path):
    def load(*features):
        chart = collection(feature("land", square(0.02, lon_deg=180.0), square(0.008, lon_deg=180.0)[::-1]), *features)
        (tmp_path / "chart.geojson").write_text(json.dumps(chart), encoding="utf-8")
        (tmp_path / "a.toml").write_text('[area]\nname = "a"\n[chart]\ngeojson = "chart.geojson"\n', encoding="utf-8")
        return load_area(tmp_path / "a.toml", draught_m=1.0).water

    assert load().area - load(danger("rocks", at=[-179.998, 0.001])).area == pytest.approx(DISC, rel=1e-4)


SEAMARKS = (
    *("rock", "wreck", "obstruction", "buoy_lateral", "buoy_cardinal", "beacon_special_purpose", "pile", "pylon"),
    *("platform", "fishing_facility", "marine_farm", "mooring", "hulk", "pontoon", "light_vessel", "light_float"),
    *("weed", "gate"),
)


@pytest.mark.parametrize("key", ["seamark:type", "seamark_type", "seamark-type"])
@pytest.mark.parametrize("value", SEAMARKS)
def test_a_seamark_that_ships_keep_clear_of_closes_water(loaded, key, value):
    assert closed_m2(loaded, danger(**{key: value})) > 0.5 * DISC


@pytest.mark.parametrize("layer", ["UWTROC", "OBSTRN", "WRECKS", "SOUNDG", "PILPNT", "BOYLAT", "BCNCAR", "MORFAC"])
def test_an_object_class_closes_water_as_layer_or_acronym_in_any_case(loaded, layer):
    for point in (danger(layer), danger(layer.lower()), danger(acronym=layer)):
        assert closed_m2(loaded, point) > 0.5 * DISC


def test_a_seamark_that_is_no_danger_is_named_as_not_used(loaded):
    area = loaded(danger("lights", **{"seamark:type": "light_minor"}))
    assert area.water.area == loaded().water.area
    assert any("not used: 1 Point in layer 'lights' of seamark:type 'light_minor'" in note for note in area.notes)
