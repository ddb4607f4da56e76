"""The shortest day reaches the accuracy asked for, by information recomputed from its files, and is the least tried."""

import json
import os
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from expdesign import workflows
from expdesign.information import regressor_rows
from expdesign.memory import VARIABLE
from expdesign.scenario import load_scenario
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Environment, delivered
from outside_check import columns
from short_examples import copied

ASKED = "total_s = 250.0\naccuracy = {as = 'durations'}\ngrow = {families = ['zigzag', 'multisine'], pool = 16}"


@pytest.fixture(scope="module")
def day(made_once):
    """Folder of the day, and its scenario file with the runs of all drafts."""

    def run(folder):
        scenario = copied(folder.with_name("day-scenario"), "story", {"total_s = 720.0": ASKED})
        with patch.dict(os.environ, {VARIABLE: str(folder.with_name("day-cache"))}):
            workflows.run(scenario, folder, seed=1)
        return str(scenario)

    return made_once("shortest-day", run)


STEP_MPS = 1e-3  # of differences by the current


def log_det_beside_current(vessel, motion, commands, parameters):
    """log det of what centred regressors tell of the parameters, the current to north and east being unknown."""
    model, sensors = vessel.model, vessel.sensors
    noise = {"u": sensors.velocity_mps, "v": sensors.velocity_mps, "r": sensors.yaw_rate_radps}
    output = np.array([model.outputs.index(term.equation) for term in model.terms])

    def rows(north_mps=0.0, east_mps=0.0):
        return regressor_rows(model, motion, commands, Environment(current_to=(north_mps, east_mps)))

    table = np.zeros((len(commands), len(model.outputs), len(output) + 2))
    table[:, output, np.arange(len(output))] = rows()
    heading, r = motion.pose[: len(commands), 2], motion.velocity[: len(commands), 2]
    for column, (north_mps, east_mps) in enumerate(STEP_MPS * np.eye(2), start=len(output)):
        change = (rows(north_mps, east_mps) - rows(-north_mps, -east_mps)) * model.parameters / (2 * STEP_MPS)
        for place in range(len(model.outputs)):
            table[:, place, column] = change[:, output == place].sum(axis=1)
        towards = heading - np.arctan2(east_mps, north_mps)
        table[:, 0, column] -= r * np.sin(towards) * model.time_scale_s  # as the ship turns in the current
        table[:, 1, column] -= r * np.cos(towards) * model.time_scale_s
    table /= np.array([noise[name] for name in model.outputs])[:, None]
    table -= table.mean(axis=0)
    covariance = np.linalg.inv(np.einsum("kna,knb->ab", table, table))
    chosen = [model.names.index(name) for name in parameters]
    scale = np.array([noise[model.terms[index].equation] for index in chosen])
    return -np.linalg.slogdet(covariance[np.ix_(chosen, chosen)] / np.outer(scale, scale))[1]


@pytest.mark.thorough
def test_the_track_holds_what_was_asked_for(day):
    folder, scenario = day
    case = load_scenario(Path(scenario))
    durations, found = (
        json.loads((folder / name).read_text(encoding="utf-8")) for name in ("durations.json", "day.json")
    )
    track, given = (columns(folder / name) for name in ("track.csv", "commands.csv"))
    model, parameters = case.vessel.model, durations["parameters"]
    commands = Commands(
        sample_time_s=case.vessel.sample_time_s,
        names=model.inputs,
        values=np.stack(list(given.values())[1:-1], axis=1),
    )
    motion = Trajectory(
        sample_time_s=case.vessel.sample_time_s,
        pose=np.stack([track[name] for name in ("north_m", "east_m", "heading_rad")], axis=1),
        velocity=np.stack([track[name] for name in ("u_mps", "v_mps", "r_radps")], axis=1),
    )
    told = log_det_beside_current(case.vessel, motion, delivered(case.vessel, commands), parameters)
    asked = durations["log_det"] + len(parameters) * np.log(durations["total_s"] / case.vessel.sample_time_s)
    share = np.exp((told - asked) / len(parameters))
    assert share == pytest.approx(found["information"], rel=1e-3)
    assert share >= 1.0


def test_the_day_is_the_shortest_that_was_tried_and_reached_it(day):
    folder, _ = day
    found = json.loads((folder / "day.json").read_text(encoding="utf-8"))
    plan = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    best = min((item for item in found["tried"] if item["information"] >= 1.0), key=lambda item: item["expected_s"])
    assert found["day_s"] == best["day_s"] <= best["expected_s"]
    assert plan["verified"]
    assert len(found["tried"]) > 1


def test_no_day_found_is_shorter_than_the_bound(day):
    folder, _ = day
    found = json.loads((folder / "day.json").read_text(encoding="utf-8"))
    bound = found["bound"]
    assert found["day_bound_s"] == max(bound["information_s"], bound["way_s"])
    assert 0 < bound["information_s"] <= bound["information_searched_s"]
    assert found["day_over_bound"] == pytest.approx(found["day_s"] / found["day_bound_s"])
    for item in found["tried"]:
        assert item["day_s"] >= bound["way_s"]
        assert item["day_s"] / item["information"] >= bound["information_s"]


def test_files_and_report_say_where_the_minutes_go(day):
    folder, _ = day
    found = json.loads((folder / "day.json").read_text(encoding="utf-8"))
    parts, page = found["goes_to"], (folder / "report.html").read_text(encoding="utf-8")
    assert sum(parts.values()) == pytest.approx(found["day_s"])
    assert parts["way_s"] == pytest.approx(found["bound"]["way_s"], rel=0.02)  # both at about transit speed
    assert found["day_s"] <= found["day_median_s"] + 5.0 <= found["day_95_s"] + 5.0
    shares, days_s = ([item[name] for item in found["curve"]] for name in ("information", "day_s"))
    assert shares == sorted(shares)
    assert days_s == sorted(days_s)  # more information never takes less
    assert "the way to the goal takes 7\N{NO-BREAK SPACE}min" in page
    assert 'id="pareto-' in page


@pytest.mark.slow
def test_two_processes_find_the_same_day(day, tmp_path):
    folder, scenario = day
    workflows.run(Path(scenario), tmp_path, seed=1, jobs=2, cache=False)
    for name in ("plan.json", "day.json", "track.csv"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


@pytest.mark.thorough
@pytest.mark.usefixtures("undrawn_here")
def test_a_draft_is_one_day_of_a_smaller_search_with_what_it_tells(day, tmp_path):
    folder, scenario = day
    with patch.dict(os.environ, {VARIABLE: str(folder.with_name("day-cache"))}):
        workflows.run(Path(scenario), tmp_path, draft=True, seed=1)
    found = json.loads((tmp_path / "day.json").read_text("utf-8"))
    assert found["draft"] is True
    (only,) = found["tried"]
    assert found["day_s"] == only["day_s"]
    assert found["information"] == pytest.approx(only["information"], rel=1e-9)
    assert "day_bound_s" not in found
