from pathlib import Path

import numpy as np
import pytest
import shapely

from expdesign.errors import NoPlan
from expdesign.scenario import load_area, load_scenario, load_vessel
from sample_files import SAMPLES, outside
from scenario_files import SCENARIOS

ROOT = Path(__file__).resolve().parent.parent

# F. Ljungberg, doctoral thesis, Linköping University, Table 6.1 (true, nominal) and Table 9.1 (true, nominal).
TABLE_6_1 = {
    "X_u": (-0.05, -0.2),
    "X_vr": (1, 0.8),
    "X_abs_u_u": (-0.05, 0),
    "W_abs_u_u": (-0.0005, 0),
    "X_mu": (0.02, 0.01),
    "X_kappa": (-0.0025, 0),
    "Y_v": (-0.2, -0.3),
    "Y_ur": (-0.65, -0.8),
    "Y_abs_v_v": (-0.2, 0),
    "Y_abs_v_r": (-0.1, 0),
    "W_abs_v_v": (-0.0015, 0),
    "Y_mu": (0.02, 0.01),
    "N_r": (-0.1, -0.15),
    "N_uv": (-0.0015, 0),
    "N_abs_v_v": (-0.001, 0),
    "N_abs_v_r": (-0.04, 0),
    "W_uv": (-0.00003, 0),
    "N_mu": (0.0003, 0.00015),
}
TABLE_9_1 = {
    "X_u": (-0.06, -0.08),
    "X_vr": (0.08, 0),
    "X_abs_u_u": (-0.01, 0),
    "X_mu": (1.4e-5, 1e-5),
    "Y_v": (-0.1, -0.08),
    "Y_ur": (-0.006, 0),
    "Y_mu": (1.4e-5, 1e-5),
    "N_r": (-0.35, -0.4),
    "N_uv": (-0.03, 0),
    "N_mu": (3e-4, 3.5e-4),
}


@pytest.mark.parametrize(
    ("name", "table", "column"),
    [
        ("azimuth-30m-true", TABLE_6_1, 0),
        ("azimuth-30m", TABLE_6_1, 1),
        ("model-ship-true", TABLE_9_1, 0),
        ("model-ship", TABLE_9_1, 1),
    ],
)
def test_vessel_files_hold_the_published_parameters(name, table, column):
    model = load_vessel(SCENARIOS / "vessels" / f"{name}.toml").model
    assert dict(zip(model.names, model.parameters, strict=True)) == {key: row[column] for key, row in table.items()}
    assert model.form == "discrete"
    assert (model.parameter_std == 0).all() if column == 0 else (model.parameter_std > 0).all()


def test_truth_and_nominal_vessels_differ_only_in_what_is_known_of_them():
    for name in ("azimuth-30m", "model-ship"):
        nominal, true = (load_vessel(SCENARIOS / "vessels" / f"{name}{end}.toml") for end in ("", "-true"))
        assert nominal.limits == true.limits
        assert nominal.sensors == true.sensors
        np.testing.assert_array_equal(nominal.hull_b, true.hull_b)
        assert nominal.model.terms == true.model.terms


def _parts_with_both_ends(scenario, clearance_m):
    """The connected waters, `clearance_m` from everything forbidden, that hold start and goal."""
    start, goal = (shapely.Point(pose[1], pose[0]) for pose in (scenario.start, scenario.goal))
    return [part for part in scenario.area.safe_water(clearance_m).geoms if part.covers(start) and part.covers(goal)]


@pytest.mark.parametrize(("name", "gate_m"), [("helsinki", (60.0, 150.0)), ("model-ship", (16.0, 60.0))])
def test_start_and_goal_are_joined_only_through_narrows(name, gate_m):
    scenario = load_scenario(SCENARIOS / f"{name}.toml")
    assert _parts_with_both_ends(scenario, scenario.plan.clearance_m + scenario.vessel.beam_m / 2)
    assert _parts_with_both_ends(scenario, gate_m[0] / 2)
    assert not _parts_with_both_ends(scenario, gate_m[1] / 2)
    assert len({spec.name for spec in scenario.dictionary}) == len(scenario.dictionary) > 0


def test_the_pond_is_the_size_of_its_description():
    area = load_scenario(SCENARIOS / "model-ship.toml").area
    west, south, east, north = area.water.bounds
    assert (east - west, north - south) == pytest.approx((320, 200), rel=0.06)
    assert len(area.water.geoms) == 1
    assert len(area.water.geoms[0].interiors) == 1


def test_every_scenario_file_loads():
    paths = sorted(SCENARIOS.glob("*.toml"))
    assert len(paths) >= 2
    for path in paths:
        scenario = load_scenario(path)
        assert scenario.path == path
        assert scenario.area.source


@pytest.mark.parametrize("points", [10_000, pytest.param(100_000, marks=pytest.mark.outside)])
def test_a_chart_of_many_points_with_depths_is_read(tmp_path, points):
    chart = SAMPLES / "kartverket/aalesund-centre.geojson" if points == 10_000 else outside("charts/aalesund.geojson")
    path = tmp_path / "aalesund.toml"
    layers = 'land_layers = ["land", "shore"]\ndepth_layers = {seabed0m = 0, seabed5m = 5, seabed10m = 10}'
    path.write_text(f'[area]\nname = "Ålesund"\n[chart]\ngeojson = "{chart}"\n{layers}\n', "utf-8")
    shallow, deep = load_area(path, draught_m=2.5), load_area(path, draught_m=8.0)
    assert deep.water.area < shallow.water.area
    assert deep.water.difference(shallow.water).area < 1e-3 * deep.water.area
    assert shallow.water.intersection(shallow.land).area < 1e-6 * shallow.water.area
    assert shallow.water.is_valid
    with pytest.raises(NoPlan, match="the deepest is 'seabed10m' with 10 m"):
        load_area(path, draught_m=9.5)
