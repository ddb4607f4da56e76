"""The lattice planner as users meet it: the harbour scenario through its files, and both planners on a small trial."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import shapely

from expdesign import workflows
from expdesign.cli import main
from outside_check import columns
from scenario_files import SCENARIOS
from short_examples import example_run

pytestmark = pytest.mark.usefixtures("undrawn")

SMALL = """
[scenario]
name = "small"
vessel = "{folder}/vessels/tender-20m.toml"
dictionary = "dictionary.toml"
area = "{folder}/areas/bay.toml"
[design]
total_s = 120.0
criterion = "D"
mean_subtraction = "none"
least_s = {{zigzag = 60.0, sway-zigzag = 60.0}}
[start]
north_m = -100.0
east_m = -450.0
heading_deg = 60.0
[goal]
north_m = 0.0
east_m = -150.0
heading_deg = 0.0
[plan]
planner = "{planner}"
"""
ZIGZAGS = """
[dictionary]
name = "two"
[[primitives]]
name = "zigzag"
family = "zigzag"
duration_s = 60.0
period_s = 30.0
speed_mps = 1.2
sway_mps = 0.15
yaw_rate_radps = 0.05
[[primitives]]
name = "sway-zigzag"
family = "sway_zigzag"
duration_s = 60.0
period_s = 30.0
speed_mps = 0.6
sway_mps = 0.3
"""


def small(folder: Path, planner: str) -> Path:
    """A scenario with two runs."""
    (folder / "dictionary.toml").write_text(ZIGZAGS, "utf-8")
    path = folder / f"{planner}.toml"
    path.write_text(SMALL.format(folder=SCENARIOS, planner=planner), "utf-8")
    return path


@pytest.fixture
def harbour(made_once):
    """Folder of the harbour scenario's results."""
    return example_run(made_once, "harbour")[0]


def plan_of(folder: Path):
    return json.loads((folder / "plan.json").read_text())


def runs_of(plan) -> Counter[str]:
    return Counter(leg["name"] for leg in plan["legs"] if leg["kind"] == "primitive")


@pytest.mark.thorough
def test_every_zigzag_is_run_three_times_on_a_verified_round_trip(harbour):
    plan, track = plan_of(harbour), columns(harbour / "track.csv")
    assert plan["verified"] is True
    assert runs_of(plan) == {"zigzag-flat": 3, "zigzag-steep": 3, "zigzag-sway": 3}
    ends = np.array([[track[name][k] for name in ("north_m", "east_m", "heading_rad")] for k in (0, -1)])
    np.testing.assert_allclose(ends[1, :2], ends[0, :2], atol=0.1)
    assert np.cos(ends[1, 2] - ends[0, 2]) == pytest.approx(1.0, abs=1e-4)
    assert track["north_m"].min() < 300.0 < track["north_m"].max()  # out between the moles and back


@pytest.mark.thorough
def test_the_hull_keeps_its_clearance_from_land_and_from_water_that_is_too_shallow(harbour):
    chart = json.loads((SCENARIOS / "areas" / "harbour.geojson").read_text())
    layers: dict[str, list[shapely.Geometry]] = {}
    for feature in chart["features"]:
        layers.setdefault(feature["properties"]["layer"], []).append(shapely.geometry.shape(feature["geometry"]))
    assert set(layers) == {"land", "depth2m", "depth5m", "depth10m"}
    deep = shapely.union_all(layers["depth5m"] + layers["depth10m"]).difference(shapely.union_all(layers["land"]))
    track = columns(harbour / "track.csv")
    metres = np.array([111_320 * np.cos(np.radians(track["lat_deg"][0])), 111_360.0])  # per degree east and north
    boundary = shapely.transform(shapely.boundary(deep), lambda points: points * metres)
    c, s = np.cos(track["heading_rad"]), np.sin(track["heading_rad"])
    for forward, starboard in ((15.0, -4.5), (15.0, 4.5), (-15.0, -4.5), (-15.0, 4.5)):
        east = track["lon_deg"] * metres[0] + s * forward + c * starboard
        north = track["lat_deg"] * metres[1] + c * forward - s * starboard
        assert shapely.contains(deep, shapely.points(east / metres[0], north / metres[1])).all()
        assert shapely.distance(boundary, shapely.points(east, north)).min() > 0.98 * 20.0


@pytest.mark.thorough
def test_the_proof_is_written_with_the_plan(harbour):
    proof = plan_of(harbour)["lattice"]
    assert 0.0 < proof["lower_bound_s"] <= proof["cost_s"]
    assert proof["gap"] == pytest.approx(1 - proof["lower_bound_s"] / proof["cost_s"])
    assert proof["gap"] <= 0.02
    assert proof["headings"] == 8


@pytest.mark.thorough
def test_the_sailed_plan_takes_about_as_long_as_the_lattice_says(harbour):
    plan = plan_of(harbour)
    assert plan["lattice"]["places_refused"] == 0
    assert plan["reposition_s"] == pytest.approx(plan["lattice"]["cost_s"], rel=0.15)


@pytest.mark.parametrize("planner", [pytest.param("beam", marks=pytest.mark.slow), "lattice"])
def test_both_planners_give_verified_plans_of_the_same_runs(planner, tmp_path):
    summary = workflows.plan(small(tmp_path, planner), tmp_path / "out").summary
    plan = plan_of(tmp_path / "out")
    assert plan["verified"] is True
    assert runs_of(plan) == {"zigzag": 1, "sway-zigzag": 1}
    assert ("lattice" in plan) == (planner == "lattice")
    assert summary.get("lattice_gap") == plan.get("lattice", {}).get("gap")
    assert plan["reposition_s"] >= plan["reposition_bound_s"]


def test_a_planner_that_does_not_exist_is_refused_with_those_that_do(tmp_path, capsys):
    assert main(["plan", str(small(tmp_path, "astar")), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    message = capsys.readouterr().err.strip()
    assert "\n" not in message
    assert "plan.planner" in message
    assert "'astar', expected 'beam' or 'lattice'" in message
    assert not (tmp_path / "out").exists()


def test_a_lattice_too_coarse_ends_in_one_line(tmp_path, capsys):
    path = small(tmp_path, "lattice")
    path.write_text(path.read_text("utf-8") + "lattice_spacing_m = 3000.0\n", "utf-8")
    assert main(["plan", str(path), "--out", str(tmp_path / "out"), "--quiet"]) == 3
    message = capsys.readouterr().err.strip()
    assert "\n" not in message
    assert "on a lattice of 3000 m" in message
    assert "not tried: a plan.lattice_spacing_m smaller" in message
