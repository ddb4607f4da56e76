"""Wrong scenarios: one line on standard error, the right exit status, and no results; a refused plan leaves a draft."""

from __future__ import annotations

import json

import pytest

from expdesign.cli import main
from scenario_files import collection, feature, spoil, square, write_scenario


def unknown_key(folder):
    spoil(folder / "scenario.toml", "total_s = 600", "totl_s = 600")


def missing_file(folder):
    (folder / "dictionary.toml").unlink()


def start_on_land(folder):
    spoil(folder / "scenario.toml", "north_m = 200\neast_m = -400.0", "north_m = 200\neast_m = -950.0")


def negative_length(folder):
    spoil(folder / "vessel.toml", "length_m = 30", "length_m = -30")


def self_crossing_chart(folder):
    bow_tie = [[0.001, 0.001], [0.002, 0.002], [0.002, 0.001], [0.001, 0.002], [0.001, 0.001]]
    chart = collection(feature("land", square(0.02), square(0.008)[::-1]), feature("land", bow_tie))
    (folder / "chart.geojson").write_text(json.dumps(chart), encoding="utf-8")
    spoil(folder / "area.toml", "depth_layers = {seabed5m = 5.0, seabed20m = 20}\n", "")


def no_chart_at_all(folder):
    spoil(folder / "area.toml", 'geojson = "chart.geojson"', 'geojson = "nowhere.geojson"')


def walled_off_goal(folder):
    wall = [[0.0, -0.008], [0.0, 0.008], [0.001, 0.008], [0.001, -0.008], [0.0, -0.008]]
    chart = collection(feature("land", square(0.02), square(0.008)[::-1]), feature("land", wall))
    (folder / "chart.geojson").write_text(json.dumps(chart), encoding="utf-8")
    spoil(folder / "area.toml", "depth_layers = {seabed5m = 5.0, seabed20m = 20}\n", "")
    real_ship(folder)


def too_narrow_a_gap(folder):
    walls = [
        [[0.0, -0.008], [0.0, -0.0002], [0.001, -0.0002], [0.001, -0.008], [0.0, -0.008]],
        [[0.0, 0.0002], [0.0, 0.008], [0.001, 0.008], [0.001, 0.0002], [0.0, 0.0002]],
    ]
    chart = collection(feature("land", square(0.02), square(0.008)[::-1]), *(feature("land", wall) for wall in walls))
    (folder / "chart.geojson").write_text(json.dumps(chart), encoding="utf-8")
    spoil(folder / "area.toml", "depth_layers = {seabed5m = 5.0, seabed20m = 20}\n", "")
    real_ship(folder)


def too_uncertain_for_the_area(folder):
    real_ship(folder)
    wild = "current_to = {north_mps = 0.0, east_mps = 0.0, std_mps = 5.0}"
    spoil(folder / "scenario.toml", "[environment]", f"[environment]\n{wild}")


def slow_dictionary(folder):
    """Speeds that the one azimuth of the small scenario's ship can hold."""
    spoil(folder / "dictionary.toml", "speed_mps = 1.2", "speed_mps = 0.5")
    spoil(folder / "dictionary.toml", "speed_mps = [0.5, 1.1]", "speed_mps = 0.5")


def blind_parameters(folder):
    slow_dictionary(folder)
    spoil(folder / "scenario.toml", "wind_to = {north_mps = 3.0, east_mps = -2}", "")
    spoil(folder / "scenario.toml", "current_to = {north_mps = 0.1, east_mps = 0.0, std_mps = 0.05}", "")


def real_ship(folder):
    """Ten parameters, two azimuths, calm: a scenario that the planner would accept in open water."""
    spoil(folder / "vessel.toml", 'structure = "surge"', 'structure = "manoeuvring-10"')
    old = "X_u = -0.2\nX_abs_u_u = -0.05\nW_abs_u_u = 0.0\nX_mu = 0.01\n"
    new = (
        "X_u = -0.2\nX_abs_u_u = 0.0\nX_vr = 0.8\nX_mu = 0.01\nY_v = -0.3\nY_ur = -0.8\nY_mu = 0.01\n"
        "N_r = -0.15\nN_uv = 0.0\nN_mu = 0.00015\n"
    )
    spoil(folder / "vessel.toml", old, new)
    spoil(folder / "vessel.toml", "X_u = 0.06", "X_u = 0.0")
    blind_parameters(folder)
    sway = (
        '[[primitives]]\nfamily = "sway_zigzag"\nduration_s = 60.0\nperiod_s = 30.0\nspeed_mps = 0.3\nsway_mps = 0.2\n'
    )
    turn = (
        '[[primitives]]\nfamily = "inward_spiral"\nduration_s = 60.0\nspeed_mps = 0.3\nsway_mps = 0.1\n'
        "yaw_rate_radps = 0.05\nentry_s = 10.0\n"
    )
    with (folder / "dictionary.toml").open("a", encoding="utf-8") as file:
        file.write(sway + turn)


@pytest.mark.parametrize(
    ("mistake", "status", "words"),
    [
        (unknown_key, 2, ("scenario.toml", "totl_s", "total_s")),
        (missing_file, 2, ("dictionary.toml",)),
        (start_on_land, 2, ("scenario.toml", "start")),
        (negative_length, 2, ("vessel.toml", "length_m", "-30", "more than 0")),
        (self_crossing_chart, 2, ("chart.geojson", "cross")),
        (no_chart_at_all, 2, ("nowhere.geojson",)),
        (walled_off_goal, 3, ("goal cannot be reached",)),
        (too_narrow_a_gap, 3, ("goal cannot be reached", "near", "needed")),
        (too_uncertain_for_the_area, 3, ("no room for", "parameter_std", "near")),
        (blind_parameters, 3, ("W_abs_u_u",)),
    ],
)
def test_one_line_the_right_status_no_results(tmp_path, capsys, mistake, status, words):
    scenario = write_scenario(tmp_path)
    mistake(tmp_path)
    out = tmp_path / "results"
    assert main(["run", str(scenario), "--out", str(out), "--quiet"]) == status
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.strip().splitlines()) == 1, captured.err
    for word in words:
        assert word in captured.err
    left = {path.name for path in out.iterdir()} if out.exists() else set()
    planned = mistake in (walled_off_goal, too_narrow_a_gap, too_uncertain_for_the_area)
    assert left == ({"refused.html", "refused.json"} if planned else set())
