from pathlib import Path

import pytest

from expdesign.errors import FileError, InputError, NoPlan
from expdesign.scenario import load_area, load_dictionary, load_scenario, load_vessel
from expdesign.scenario.card_file import CardFile
from expdesign.scenario.charts.zones import AreaTable
from expdesign.scenario.dictionaries import DictionaryTable, LoadsFile
from expdesign.scenario.import_files import InstrumentsFile, MappingFile
from expdesign.scenario.scenario_file import ScenarioFile
from expdesign.scenario.tables import Entry, check_table, read_toml
from expdesign.scenario.vessels.vessel_tables import VesselTable
from scenario_files import SCENARIOS, spoil, write_scenario

SCENARIO_CASES = [
    ('name = "square"', "name = 3", "scenario.name", "is 3, expected text"),
    ('name = "square"', 'name = "a/b"', "scenario.name", "is 'a/b', expected at most 80 letters"),
    ('name = "square"', 'name = ".."', "scenario.name", "is '..'"),
    ('name = "square"', 'nam = "square"', "scenario.nam", "did you mean 'name'?"),
    ('vessel = "vessel.toml"', "", "scenario.vessel", "is missing, expected the path of a vessel file"),
    ('vessel = "vessel.toml"', 'vessel = "ship.toml"', "scenario.vessel", "'ship.toml'"),
    ('vessel = "vessel.toml"', 'vessel = "\\u0000"', "scenario.vessel", "does not exist"),
    ('area = "area.toml"', 'area = ""', "scenario.area", "is '', expected text that is not empty"),
    ("total_s = 600", "total_s = -3", "design.total_s", "is -3, expected more than 0"),
    ("total_s = 600", "total_s = true", "design.total_s", "is true, expected a number"),
    ("total_s = 600", 'total_s = "600"', "design.total_s", "is '600', expected a number, without quotes"),
    ("total_s = 600", "total_s = nan", "design.total_s", "is nan, expected a finite number"),
    ("total_s = 600", "total_s = inf", "design.total_s", "is inf, expected a finite number"),
    ("total_s = 600", "total_s = 2026-01-01", "design.total_s", "is 2026-01-01, expected a number"),
    ("total_s = 600", "total_s = [600]", "design.total_s", "is a list, expected a number"),
    ("total_s = 600", "total_s = 0.5", "design.total_s", "is 0.5, expected at least the vessel's sample_time_s = 1"),
    ("total_s = 600", "", "design.total_s", "is missing, expected the total informative time"),
    ("total_s = 600", "total = 600", "design.total", "did you mean 'total_s'?"),
    ("[design]", "[desing]", "desing", "did you mean 'design'?"),
    ('criterion = "D"', 'criterion = "C"', "design.criterion", "is 'C', expected 'D', 'D_s', 'A', 'E', 'V' or 'T'"),
    ("fixed_parameters = []", 'fixed_parameters = ["X_w"]', "design.fixed_parameters[1]", "is 'X_w', did you mean"),
    ("fixed_parameters = []", 'fixed_parameters = ["X_u", "X_u"]', "design.fixed_parameters[2]", "'X_u' again"),
    ("fixed_parameters = []", "fixed_parameters = [1]", "design.fixed_parameters[1]", "is 1, expected text"),
    (
        "fixed_parameters = []",
        'fixed_parameters = ["X_u", "X_mu", "X_abs_u_u", "W_abs_u_u"]',
        "design.fixed_parameters",
        "every parameter",
    ),
    ("heading_deg = 90", "heading_deg = 400", "start.heading_deg", "is 400, expected at most 360"),
    ("heading_deg = 90", "", "start.heading_deg", "is missing, expected the heading [deg]"),
    ("north_m = 200", "lat_deg = 0.0", "start", "gives lat_deg and east_m, expected lat_deg and lon_deg, or north_m"),
    ("north_m = 200", "", "start", "gives east_m, expected"),
    ("lat_deg = 0.0\nlon_deg = 0.0045\n", "", "goal", "gives no position"),
    ("lat_deg = 0.0\n", "lat_deg = 91\n", "goal.lat_deg", "is 91, expected at most 90"),
    ("std_mps = 0.05", "std_mps = -0.05", "environment.current_to.std_mps", "is -0.05, expected at least 0"),
    ("north_mps = 0.1, ", "", "environment.current_to.north_mps", "is missing, expected the velocity to north"),
    ("north_mps = 0.1", "north_mps = 20", "environment.current_to.north_mps", "is 20, expected at most 15"),
    ("wind_to", "wind_from", "environment.wind_from", "did you mean 'wind_to'?"),
    ("clearance_m = 20.0", "clearance_m = -1", "plan.clearance_m", "is -1, expected at least 0"),
    ("clearance_m = 20.0", "clearance_m = 1e308", "plan.clearance_m", "is 1e+308, expected at most 1e+12"),
    ("confidence = 0.9", "confidence = 1", "plan.confidence", "is 1, expected less than 1"),
    ("confidence = 0.9", "aborted_most = 0.6", "plan.aborted_most", "is 0.6, expected at most 0.5"),
    ("confidence = 0.9", "transit_speed_mps = 0.01", "plan.transit_speed_mps", "is 0.01, expected at least 0.02"),
    ("[plan]", "[[plan]]", "plan", "is a list, expected a table"),
    ("[start]", "[start", "", "line 11"),
    ("[start]", "[design]", "", "is not valid TOML"),
    ("east_m = -400.0", "east_m = 2000.0", "start", "is outside the allowed water"),
    ("east_m = -400.0", "east_m = -1000.0", "start", "is on land"),
    ("east_m = -400.0", "east_m = -830.0", "start", "is 4.9 m from forbidden water, less than the hull"),
    ("east_m = -400.0", "east_m = -810.0", "start", "leaves 9.9 m between the hull and forbidden water"),
    ("lon_deg = 0.0045", "lon_deg = 0.0090", "goal", "and a way from the start is lat_deg = 0.0"),
    ("lon_deg = 0.0045", "lon_deg = 90", "goal", "is thousands of kilometres from the area"),
    ("clearance_m = 20.0", "clearance_m = 2000.0", "start", "nowhere in the area"),
]

VESSEL_CASES = [
    ("[vessel]", "[ship]", "ship", "is not a known key, expected one of vessel, actuators, model, sensors"),
    ("length_m = 30", "lenght_m = 30", "vessel.lenght_m", "did you mean 'length_m'?"),
    ("length_m = 30", "length_m = 0", "vessel.length_m", "is 0, expected more than 0"),
    ("length_m = 30", "", "vessel.length_m", "is missing, expected the length of the hull [m]"),
    ('name = "a ship"', 'name = ""', "vessel.name", "is '', expected text that is not empty"),
    ('kind = "azimuth"', 'kind = "azimut"', "actuators[1].kind", "is 'azimut', did you mean 'azimuth'?"),
    ('kind = "azimuth"', "", "actuators[1].kind", "is missing, expected one of azimuth, tunnel"),
    ('kind = "azimuth"', "kind = 1", "actuators[1].kind", "is 1, expected one of azimuth"),
    ('kind = "azimuth"', 'kind = "rudder"', "actuators[1].speed_min_rps", "is not a known key"),
    ('kind = "azimuth"', 'kind = "force"', "actuators[1].speed_min_rps", "is not a known key"),
    ("forward_m = 9.0", "forward_m = 90", "actuators[1].forward_m", "is 90, expected -30 to 30"),
    ("forward_m = -9.0", "starboard_m = 9.5", "actuators[2].starboard_m", "is 9.5, expected -9 to 9"),
    ("speed_max_rps = 15.0", "speed_max_rps = -15", "actuators[1].speed_max_rps", "is -15, expected more than"),
    ("speed_max_rps = 10.0", "", "actuators[2].speed_max_rps", "is missing, expected the highest propeller speed"),
    ("speed_rate_rps2 = 1.5", "speed_rate_rps2 = 0", "actuators[1].speed_rate_rps2", "is 0, expected more than 0"),
    ("angle_rate_radps = 0.25", "angle_max_rad = 90", "actuators[1].angle_max_rad", "is 90, expected at most 12.56"),
    ("angle_rate_radps = 0.25", "angel_rate_radps = 1", "actuators[1].angel_rate_radps", "'angle_rate_radps'"),
    ('structure = "surge"', 'structure = "surgee"', "model.structure", "is 'surgee', did you mean 'surge'?"),
    ('structure = "surge"', 'structure = "custom"', "model.terms", "needs [[model.terms]]"),
    ('structure = "surge"', 'structure = "manoeuvring-10"', "model.parameters", "'W_abs_u_u' is not a parameter"),
    ('form = "discrete"', 'form = "discret"', "model.form", "is 'discret', expected 'discrete' or 'continuous'"),
    ("X_u = -0.2\n", "", "model.parameters", "X_u is missing, expected every parameter of structure 'surge'"),
    ("X_u = -0.2\nX_abs_u_u = -0.05\n", "", "model.parameters", "X_u, X_abs_u_u are missing"),
    ("X_u = -0.2\n", "X_u = false\n", "model.parameters.X_u", "is false, expected a number"),
    ("X_u = -0.2\n", "X_u = nan\n", "model.parameters.X_u", "is nan, expected a finite number"),
    (
        "X_mu = 0.01",
        "X_mu = 0.01\nX_nu = 1.0",
        "model.parameters",
        "'X_nu' is not a parameter of the structure, did you",
    ),
    ("X_u = 0.06", "X_u = -0.06", "model.parameter_std.X_u", "is -0.06, expected at least 0"),
    ("X_u = 0.06", "Z = 0.06", "model.parameter_std", "'Z' is not a parameter of the structure, expected one of"),
    (
        "[sensors]",
        "[model.parameter_correlation]\nX_u = { X_mu = 1.5 }\n[sensors]",
        "model.parameter_correlation.X_u.X_mu",
        "is 1.5, expected -1 to 1",
    ),
    (
        "[sensors]",
        "[model.parameter_correlation]\nX_u = { Z = 0.5 }\n[sensors]",
        "model.parameter_correlation.X_u",
        "'Z' is not a parameter of the structure, expected one of",
    ),
    (
        "[sensors]",
        "[model.parameter_correlation]\nX_u = { X_mu = 0.5 }\nX_mu = { X_u = 0.5 }\n[sensors]",
        "model.parameter_correlation.X_mu.X_u",
        "is given already, expected each pair of parameters once",
    ),
    (
        "[sensors]",
        "[model.parameter_correlation]\nX_u = { X_mu = 0.9, X_abs_u_u = 0.9 }\nX_mu = { X_abs_u_u = -0.9 }\n[sensors]",
        "model.parameter_correlation",
        "contradicts itself: no parameters have such correlations",
    ),
    (
        "[sensors]",
        "[model.parameter_min]\nX_u = 0.5\n[model.parameter_max]\nX_u = 0.0\n[sensors]",
        "model.parameter_max.X_u",
        "is 0, expected more than parameter_min = 0.5",
    ),
    ("[sensors]", "[model.parameter_max]\nZ = 0\n[sensors]", "model.parameter_max", "'Z' is not a parameter"),
    (
        "[sensors]",
        "[model.parameter_max]\nX_mu = 0\n[sensors]",
        "model.parameters.X_mu",
        "is 0.01, known, expected -inf to 0 as stated",
    ),
    ("velocity_mps = 0.01", "velocity_mps = -1", "sensors.velocity_mps", "is -1, expected at least 0"),
    ("velocity_mps = 0.01", "speed_mps = 0.01", "sensors.speed_mps", "is not a known key, did you mean"),
]

DICTIONARY_CASES = [
    ("[dictionary]", "[directory]", "directory", "did you mean 'dictionary'?"),
    ('family = "zigzag"', 'family = "zigzack"', "primitives[2].family", "is 'zigzack', did you mean 'zigzag'?"),
    ('family = "zigzag"', "", "primitives[2].family", "is missing, expected one of acceleration"),
    ('family = "zigzag"', "family = 2", "primitives[2].family", "is 2, expected one of acceleration"),
    ("speed_mps = [0.5, 1.1]", "", "primitives[2]", "speed_mps is missing"),
    ("speed_mps = [0.5, 1.1]", "speed_mps = []", "primitives[2].speed_mps", "is an empty list"),
    ("speed_mps = [0.5, 1.1]", "speed_mps = [0.5, true]", "primitives[2].speed_mps", "is true, expected a finite"),
    ("speed_mps = [0.5, 1.1]", 'speed_mps = "fast"', "primitives[2].speed_mps", "is 'fast', expected a finite"),
    ("speed_mps = [0.5, 1.1]", "speed_mps = [0.5, 0.5]", "primitives[2].speed_mps", "has 0.5 more than once"),
    ("speed_mps = [0.5, 1.1]", "speed_mps = inf", "primitives[2].speed_mps", "is inf, expected a finite number"),
    ("speed_mps = [0.5, 1.1]", f"speed_mps = 1{400 * '0'}", "primitives[2].speed_mps", "expected a finite number"),
    ("speed_mps = [0.5, 1.1]", "speed_kn = 1.0", "primitives[2]", "'speed_kn', did you mean"),
    ("speed_mps = [0.5, 1.1]", "speed_mps = [0.5, 900]", "primitives[2]", "speed_mps is 900, expected -50 to 50"),
    ('name = "zz"', 'name = "acceleration"', "primitives[2].name", None),
    ('name = "zz"', 'name = "../zz"', "primitives[2].name", "is '../zz', expected at most 80 letters"),
    ('name = "zz"', "name = 5", "primitives[2].name", "is 5, expected at most 80 letters"),
]

AREA_CASES = [
    ("geojson =", "geojsn =", "chart.geojsn", "did you mean 'geojson'?"),
    ('geojson = "chart.geojson"', "", "chart.geojson", "is missing, expected the path of a GeoJSON chart"),
    ('geojson = "chart.geojson"', 'geojson = "no.geojson"', "chart.geojson", "'no.geojson'"),
    ("geojson =", "s57 =", "chart.land_layers", "is given with s57, expected it with geojson only"),
    ("geojson =", "s57 = 'a.000'\ngeojson =", "chart.s57", "is 'a.000' in addition to geojson, expected one chart"),
    ('["land"]', '["lnad"]', "chart.land_layers[1]", "is 'lnad', did you mean 'land'? (known: buoy, land, seabed20m"),
    ('["land"]', '"land"', "chart.land_layers", "is 'land', expected a list"),
    ('["land"]', '["land", "seabed5m"]', "chart.depth_layers.seabed5m", "is also a land layer"),
    ('["land"]', '["land", "buoy"]', None, "is a Point, expected Polygon or MultiPolygon"),
    ("seabed5m = 5.0", "seabed6m = 5.0", "chart.depth_layers", "is 'seabed6m', did you mean"),
    ("seabed5m = 5.0", 'seabed5m = "5"', "chart.depth_layers.seabed5m", "is '5', expected a number, without quotes"),
    ("{seabed5m = 5.0, seabed20m = 20}", "{}", "chart.depth_layers", "is empty"),
    ('notice = "invented"', 'outlines = "sea"', "chart.outlines", "is 'sea', expected 'water' or 'land'"),
    ('notice = "invented"', 'water_layers = ["se"]', "chart.water_layers[1]", "is 'se', expected one of buoy"),
    ('notice = "invented"', 'water_layers = ["land"]', "chart.water_layers[1]", "is 'land', also a layer of land"),
    ('notice = "invented"', "skip_features = [1.5]", "chart.skip_features[1]", "is 1.5, expected a whole number"),
    ('notice = "invented"', "skip_features = [9]", "chart.skip_features[1]", "is 9, expected 1 to 4"),
    ('notice = "invented"', 'skip_features = ["Pint"]', "chart.skip_features[1]", "is 'Pint', did you mean 'Point'?"),
    ("south_deg = -0.01", "south_deg = 0.02", "bounds.north_deg", "is 0.01, expected more than south_deg = 0.02"),
    ("west_deg = -0.01", "west_deg = 0.02", "bounds.east_deg", "is 0.01, expected east of west_deg = 0.02"),
    ("west_deg = -0.01", "", "bounds.west_deg", "is missing, expected the western longitude"),
    ("south_deg = -0.01", "south_deg = -5", "bounds", "cover 557 x 2.2 km from latitude -5 to 0.01"),
    ("south_deg = -0.01", "south_deg = -88", "bounds", "at most 85 degrees from the equator"),
    (
        "west_deg = -0.01\nnorth_deg = 0.01\neast_deg = 0.01",
        "west_deg = 1\nnorth_deg = 0.01\neast_deg = 1.1",
        "bounds",
        None,
    ),
    ("under_keel_m = 1.0", "under_keel_m = -1.0", "depth.under_keel_m", "is -1, expected at least 0"),
    ("[0.006, 0.006]", "[0.006]", "no_go[1].polygon[1]", "expected at least 2 entries"),
    ("[0.006, 0.006]", "[60006, 0.006]", "no_go[1].polygon[1]", "is [60006, 0.006], expected [latitude, longitude]"),
    ("[0.006, 0.006], [0.006, 0.008]", "[0.006, 0.008], [0.006, 0.006]", "no_go[1].polygon", "crosses itself"),
    ("polygon = [[0.006, 0.006], ", "polygon = [] #", "no_go[1].polygon", "is an empty list, expected at least 3"),
]


def _refusal(load, path: Path) -> FileError:
    """The one-line error of a loader."""
    with pytest.raises(FileError) as caught:
        load(path)
    assert isinstance(caught.value, InputError)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(caught.value.path))
    return caught.value


def _check(error: FileError, path: Path, key: str | None, words: str | None) -> None:
    if key is not None:
        assert (error.path, error.key) == (path, key), str(error)
    if words is not None:
        assert words in error.problem, str(error)


@pytest.mark.parametrize(("old", "new", "key", "words"), SCENARIO_CASES)
def test_scenario_file(tmp_path, old, new, key, words):
    path = write_scenario(tmp_path)
    spoil(path, old, new)
    _check(_refusal(load_scenario, path), path, key, words)


@pytest.mark.parametrize(("old", "new", "key", "words"), VESSEL_CASES)
def test_vessel_file_alone_and_through_the_scenario(tmp_path, old, new, key, words):
    scenario, path = write_scenario(tmp_path), tmp_path / "vessel.toml"
    spoil(path, old, new)
    error = _refusal(load_vessel, path)
    _check(error, path, key, words)
    assert str(_refusal(load_scenario, scenario)) == str(error)


@pytest.mark.parametrize(("old", "new", "key", "words"), DICTIONARY_CASES)
def test_dictionary_file(tmp_path, old, new, key, words):
    write_scenario(tmp_path)
    path = tmp_path / "dictionary.toml"
    if words is None:
        spoil(path, "speed_mps = [0.5, 1.1]", "speed_mps = 0.5")
    spoil(path, old, new)
    _check(_refusal(load_dictionary, path), path, key, words)


@pytest.mark.parametrize(("old", "new", "key", "words"), AREA_CASES)
def test_area_file(tmp_path, old, new, key, words):
    write_scenario(tmp_path)
    path = tmp_path / "area.toml"
    spoil(path, old, new)
    _check(_refusal(lambda file: load_area(file, draught_m=2.5), path), path, key, words)


@pytest.mark.parametrize("load", [load_scenario, load_vessel, load_dictionary])
def test_files_that_cannot_be_read(tmp_path, load):
    missing, binary, nested = tmp_path / "none.toml", tmp_path / "binary.toml", tmp_path / "nested.toml"
    binary.write_bytes(b"name = '\xff'")
    nested.write_text("a = " + 5000 * "[")
    assert "does not exist" in _refusal(load, missing).problem
    assert "is a directory" in _refusal(load, tmp_path).problem
    assert "is not UTF-8 text (byte 0xff at offset 8)" in _refusal(load, binary).problem
    assert "TOML" in _refusal(load, nested).problem


def test_custom_terms_name_the_term_and_what_is_wrong_in_it(tmp_path):
    write_scenario(tmp_path)
    path = tmp_path / "vessel.toml"
    term = '[[model.terms]]\nequation = "u"\nname = "X_u"\nexpression = "u"\n'
    spoil(path, 'structure = "surge"', 'structure = "custom"')
    spoil(path, "[sensors]", term + term.replace('"u"\nname', '"w"\nname') + "[sensors]")
    _check(_refusal(load_vessel, path), path, "model.terms[2].equation", "is 'w', expected 'u', 'v' or 'r'")
    spoil(path, '"w"', '"v"')
    _check(_refusal(load_vessel, path), path, "model.terms[2].name", "is 'X_u', expected another name")
    spoil(path, '"v"\nname = "X_u"\nexpression = "u"', '"v"\nname = "Y_n"\nexpression = "abs(n3)"')
    _check(_refusal(load_vessel, path), path, "model.terms[2].expression", "'n3'")
    spoil(path, "abs(n3)", "exec(n2)")
    _check(_refusal(load_vessel, path), path, "model.terms[2].expression", "is not allowed")


def test_a_generalised_force_stands_alone(tmp_path):
    write_scenario(tmp_path)
    path = tmp_path / "vessel.toml"
    limits = "\n".join(f"{axis}_min = -1\n{axis}_max = 1" for axis in ("x", "y", "psi"))
    spoil(path, "[model]", f'[[actuators]]\nkind = "force"\n{limits}\n[model]')
    _check(_refusal(load_vessel, path), path, "actuators[3].kind", "expected no other thruster")


def test_water_that_is_nowhere_deep_enough_is_no_answer_rather_than_wrong_input(tmp_path):
    write_scenario(tmp_path)
    with pytest.raises(NoPlan, match=r"draught .* = 31 m, the deepest is 'seabed20m' with 20 m") as caught:
        load_area(tmp_path / "area.toml", draught_m=30.0)
    assert "\n" not in str(caught.value)


def test_no_go_zones_over_everything_are_named_as_the_reason(tmp_path):
    write_scenario(tmp_path)
    spoil(
        tmp_path / "area.toml",
        "[[0.006, 0.006], [0.006, 0.008], [0.008, 0.008], [0.008, 0.006]]",
        "[[-1, -1], [-1, 1], [1, 1], [1, -1]]",
    )
    with pytest.raises(NoPlan, match="no-go zones cover all its water"):
        load_area(tmp_path / "area.toml", draught_m=2.5)


EXAMPLES = {
    "scenario": "harbour.toml", "vessel": "vessels/coaster-80m.toml", "dictionary": "dictionaries/standard.toml",
    "area": "areas/bay.toml", "card": "cards/coaster-80m.toml", "loads": "loads/roll-trial.toml",
}  # fmt: skip
"""Kind of file -> an example of it."""
FILES = {
    "scenario": ScenarioFile, "vessel": VesselTable, "dictionary": DictionaryTable, "area": AreaTable, "card": CardFile,
    "loads": LoadsFile, "mapping": MappingFile, "instruments": InstrumentsFile,
}  # fmt: skip


@pytest.mark.parametrize("given", EXAMPLES)
@pytest.mark.parametrize("expected", FILES)
def test_a_file_of_another_kind_is_called_one(expected: str, given: str) -> None:
    """A scenario in place of the vessel was asked whether [scenario] should be [sensors]."""
    path = SCENARIOS / EXAMPLES[given]
    if given == expected:
        check_table(FILES[expected], read_toml(path), Entry(path))
        return
    error = _refusal(lambda file: check_table(FILES[expected], read_toml(file), Entry(file)), path)
    words = f"has the keys of a file of kind {given!r}, expected one of kind {expected!r}"
    assert error.problem == f"{words} (see expdesign explain {expected})"
