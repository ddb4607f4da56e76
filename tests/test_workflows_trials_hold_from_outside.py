"""The main job on the example scenarios, looked at only through the files it leaves.

The whole trials are looked at with `-m slow`; by default they are shorter.
"""

from __future__ import annotations

import json
import tomllib
from xml.etree import ElementTree

import numpy as np
import pytest

from expdesign import workflows
from outside_check import columns, hull_to_land_m, recomputed_gap, replayed, runs_of_plan
from short_examples import SCENARIOS, SHORTER, copied, example_run

pytestmark = pytest.mark.usefixtures("undrawn")

LOOKED_AT = {
    "harbour": ("areas/harbour.geojson", "vessels/azimuth-30m.toml", 20.0),
    "helsinki": ("areas/helsinki-gshhg.geojson", "vessels/azimuth-30m.toml", 20.0),
    "model-ship": ("areas/pond.geojson", "vessels/model-ship.toml", 1.0),
    "story": ("areas/bay.geojson", "vessels/tender-20m.toml", 20.0),
}
"""Chart, vessel and clearance."""
WHOLE = ("helsinki", "model-ship", "story")
SCENARIO = [*SHORTER, *(pytest.param(f"{name}-whole", marks=pytest.mark.slow) for name in WHOLE)]
PLAIN = [name for name in SCENARIO if name != "harbour"]
"""Scenarios without limits on durations and without depths on the chart."""
EXPECTED = {
    "dictionary.json",
    "durations.json",
    "plan.json",
    "track.csv",
    "commands.csv",
    "route.csv",
    "route.geojson",
    "route.gpx",
    "route.rtz",
    "route.kml",
    "route.plan",
    "route.waypoints",
    "report.html",
    "cards.html",
}
OF_A_SHORT_DAY = {"day.json", "dictionary-grown.toml"}


@pytest.fixture(params=SCENARIO)
def result(request, made_once):
    name = request.param.removesuffix("-whole")
    folder, files = example_run(made_once, name, whole=name != request.param)
    chart, vessel, clearance_m = LOOKED_AT[name]
    return files, folder, SCENARIOS / chart, SCENARIOS / vessel, clearance_m


def test_every_documented_file_is_there_and_nothing_else(result):
    files, folder, chart, *_ = result
    expected = EXPECTED | (OF_A_SHORT_DAY if chart == SCENARIOS / LOOKED_AT["helsinki"][0] else set())
    assert sorted(files) == sorted(expected)
    assert {path.name for path in folder.iterdir()} == expected


@pytest.mark.parametrize("result", PLAIN, indirect=True)
def test_the_certificate_can_be_recomputed_from_the_dictionary_file(result):
    _, folder, *_ = result
    written = json.loads((folder / "durations.json").read_text())
    assert written["gap"] < 1e-6 * written["dimension"]
    assert abs(recomputed_gap(folder)) < 1e-6
    assert abs(sum(item["fraction"] for item in written["primitives"]) - 1) < 1e-12


@pytest.mark.parametrize("result", PLAIN, indirect=True)
def test_the_hull_keeps_its_clearance_at_every_sample(result):
    _, folder, chart, vessel, clearance_m = result
    ship = tomllib.loads(vessel.read_text())["vessel"]
    distance = hull_to_land_m(columns(folder / "track.csv"), chart, ship["length_m"], ship["beam_m"])
    # two projections of a few kilometres agree to a few parts in ten thousand
    assert distance.min() > 0.98 * clearance_m
    assert json.loads((folder / "plan.json").read_text())["clearance_min_m"] == pytest.approx(distance.min(), rel=0.02)


def test_the_commands_reproduce_the_track(result):
    _, folder, _, vessel, _ = result
    track, commands = columns(folder / "track.csv"), columns(folder / "commands.csv")
    again = replayed(commands, track, vessel)
    sailed = np.r_[0.0, np.cumsum(np.hypot(np.diff(track["north_m"]), np.diff(track["east_m"])))]
    apart = np.hypot(again[:, 0] - track["north_m"], again[:, 1] - track["east_m"])
    assert len(again) == len(track["time_s"])
    assert (apart <= np.maximum(1.0 if sailed[-1] > 2000 else 0.03, 0.01 * sailed)).all()


def test_every_chosen_primitive_is_run_as_often_as_asked(result):
    _, folder, *_ = result
    done, asked = runs_of_plan(folder)
    assert done == asked
    assert sum(asked.values()) > 1


def test_the_plan_is_verified_and_keeps_its_confidence(result):
    _, folder, *_ = result
    plan = json.loads((folder / "plan.json").read_text())
    assert plan["verified"] is True
    assert plan["leave_water_probability"] <= 0.05
    assert plan["reposition_s"] >= plan["reposition_bound_s"]
    assert plan["informative_s"] + plan["reposition_s"] == pytest.approx(plan["legs"][-1]["end"]["time_s"])


def test_nothing_jumps(result):
    _, folder, _, vessel, _ = result
    track, commands = columns(folder / "track.csv"), columns(folder / "commands.csv")
    step_s = tomllib.loads(vessel.read_text())["vessel"]["sample_time_s"]
    speed = np.hypot(track["u_mps"], track["v_mps"])
    moved = np.hypot(np.diff(track["north_m"]), np.diff(track["east_m"]))
    assert (moved <= step_s * (speed[1:] + speed[:-1]) * 0.75 + 1e-3).all()
    turned = np.abs(np.diff(track["heading_rad"]))
    rate = np.abs(track["r_radps"])
    assert (turned <= step_s * np.maximum(rate[1:], rate[:-1]) * 1.5 + 1e-3).all()
    ship = tomllib.loads(vessel.read_text())
    if "n1_rps" in commands:
        for name, rate_key in (("n1_rps", "speed_rate_rps2"), ("a1_rad", "angle_rate_radps")):
            limit = ship["actuators"][0][rate_key] * step_s
            assert np.abs(np.diff(commands[name])).max() <= limit * (1 + 1e-9)


def test_the_route_names_itself_as_its_file(result):
    _, folder, *_ = result
    root = ElementTree.parse(folder / "route.rtz").getroot()
    info = root.find("{http://www.cirm.org/RTZ/1/2}routeInfo")
    assert info.get("routeName") == "route"


def test_export_and_rehearsal_work_on_the_files_alone(result, tmp_path):
    _, folder, _, vessel, _ = result
    workflows.export(folder / "plan.json", tmp_path, formats=("rtz", "gpx"))
    assert {path.name for path in tmp_path.iterdir()} == {"route.rtz", "route.gpx"}
    truth = vessel.with_name(vessel.stem + "-true.toml")
    outcome = workflows.simulate(folder / "plan.json", tmp_path, truth=truth, seed=3)
    measured = columns(tmp_path / "measured.csv")
    commands = columns(folder / "commands.csv")
    assert outcome.summary["samples"] == len(measured["time_s"]) == len(commands["time_s"])
    for name in set(commands) - {"time_s", "leg"}:
        np.testing.assert_allclose(measured[name], commands[name], rtol=1e-9)
    assert not measured["steered"].any(), "legs too are sailed by the commands of the plan"


def test_same_seed_same_files_another_seed_another_measurement(result, tmp_path):
    _, folder, _, vessel, _ = result
    truth = vessel.with_name(vessel.stem + "-true.toml")
    texts = []
    for number, seed in enumerate((3, 3, 4)):
        workflows.simulate(folder / "plan.json", tmp_path / str(number), truth=truth, seed=seed)
        texts.append((tmp_path / str(number) / "measured.csv").read_bytes())
    assert texts[0] == texts[1] != texts[2]


@pytest.mark.thorough
@pytest.mark.usefixtures("undrawn_here")
@pytest.mark.parametrize("result", ["story"], indirect=True)
def test_a_plan_follows_edited_durations_and_is_the_same_by_any_number_of_processes(result, tmp_path):
    _, folder, *_ = result
    content = json.loads((folder / "durations.json").read_text())
    once = "zigzag-speed-0.8"
    for item in content["primitives"]:
        item["repeats"] = int(item["name"] == once)
    edited = tmp_path / "durations.json"
    edited.write_text(json.dumps(content))
    first, again = tmp_path / "first", tmp_path / "again"
    for out, jobs in ((first, 1), (again, 2)):
        workflows.plan(SCENARIOS / "story.toml", out, durations=edited, seed=1, jobs=jobs)
    legs = json.loads((first / "plan.json").read_text())["legs"]
    assert [leg["name"] for leg in legs if leg["kind"] == "primitive"] == [once]
    for name in ("plan.json", "track.csv", "commands.csv"):
        assert (first / name).read_bytes() == (again / name).read_bytes()


def test_a_what_if_is_one_changed_line(tmp_path):
    before = workflows.durations(SCENARIOS / "model-ship.toml", tmp_path / "before").summary
    changed = copied(tmp_path, "model-ship", {'mean_subtraction = "complete"': 'mean_subtraction = "none"'})
    after = workflows.durations(changed, tmp_path / "after").summary
    assert before["runs"] != after["runs"]
