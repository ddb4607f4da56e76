"""Where the rest of a trial begins, what it counts on, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expdesign import workflows
from expdesign.cli import main
from expdesign.durations import DurationProblem, optimal_shares, solve_durations
from expdesign.estimation.methods import estimate
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.scenario import load_scenario
from expdesign.signals import Batch, Commands, Record
from expdesign.simulation import Environment, Variation, simulate
from expdesign.vessel import Response
from expdesign.workflows.steps.known import combined, expected_std, purchases
from expdesign.workflows.steps.present import (
    _at_end,
    _standing,
    present_state,
    rest_of,
    weather_for_rest,
)
from replan_case import NAMES, SAMPLES, SCENARIOS, SHIP, STORY, measured, wandering
from scenario_files import spoil


def refused(capsys, *arguments: object, status: int = 2) -> str:
    assert main(["replan", *map(str, arguments), "--quiet"]) == status
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


# where it begins


@pytest.mark.parametrize("degrees", [False, True])
def test_the_rest_begins_at_the_last_row_in_metres_or_in_degrees(tmp_path, degrees):
    last = measured(tmp_path / "a.csv", degrees=degrees)
    state = present_state(load_scenario(STORY), [tmp_path / "a.csv"])
    assert np.abs(state.pose - last).max() < 1e-6
    case, _ = rest_of(state)
    assert case.start.tolist() == state.pose.tolist()


def test_the_last_file_gives_the_present_place(tmp_path):
    measured(tmp_path / "a.csv")
    last = measured(tmp_path / "b.csv", pose=(0.0, 0.0, 2.0))
    state = present_state(load_scenario(STORY), [tmp_path / "a.csv", tmp_path / "b.csv"])
    assert np.abs(state.pose - last).max() < 1e-6
    assert state.sailed_s == 2 * SAMPLES


def test_antenna_and_compass_errors_that_the_vessel_file_states_are_taken_off(tmp_path):
    last = measured(tmp_path / "a.csv")
    text = (SCENARIOS / "vessels/tender-20m.toml").read_text(encoding="utf-8")
    found = "[sensors]\nposition_forward_m = 5.0\nposition_starboard_m = -2.0\nheading_bias_rad = 0.1"
    (tmp_path / "ship.toml").write_text(text.replace("[sensors]", found), encoding="utf-8")
    state = present_state(load_scenario(STORY), [tmp_path / "a.csv"], vessel=tmp_path / "ship.toml")
    heading = last[2] - 0.1
    c, s = np.cos(heading), np.sin(heading)
    antenna = state.pose[:2] + np.array([5.0 * c + 2.0 * s, 5.0 * s - 2.0 * c])
    assert state.ship.sensors.place("position") == (5.0, -2.0)
    assert np.abs(antenna - last[:2]).max() < 1e-9
    assert state.pose[2] == pytest.approx(heading)


# how it moves there


def test_the_rest_begins_with_the_motion_and_the_commands_of_the_last_rows(tmp_path):
    measured(tmp_path / "a.csv", noise=0.0)
    commands = wandering()
    run = simulate(SHIP, commands, pose=np.array([-100.0, -450.0, 1.0]))
    found = present_state(load_scenario(STORY), [tmp_path / "a.csv"])
    assert found.under_way is not None
    assert rest_of(found)[0].under_way is found.under_way
    assert np.array_equal(found.under_way.inputs, commands.values[-1])
    bend = np.abs(np.diff(run.velocity[-7:-1], n=2, axis=0)).max(axis=0)  # what no straight line follows
    assert (np.abs(found.under_way.velocity - run.velocity[-2]) <= 4 * bend + 1e-6).all()
    assert present_state(load_scenario(STORY), [tmp_path / "a.csv"], stopped=True).under_way is None


def test_noise_of_the_last_row_is_averaged_over_seconds():
    rng, slope = np.random.default_rng(0), 0.01 * np.arange(6)
    ends = np.array([_at_end(slope + row) for row in rng.standard_normal((4000, 6))])
    variance = (4 * 6 - 2) / (6 * 7)  # of the end of a straight line through n values: (4 n - 2) / (n (n + 1))
    assert abs(ends.mean() - slope[-1]) < 4 * np.sqrt(variance / 4000)
    assert abs(ends.var() / variance - 1) < 4 * np.sqrt(2 / 4000)


def test_what_late_actuators_deliver_stands_as_the_rest_begins():
    slow = [replace(item, responses=(Response(lag_s=3.0),) * 2) for item in SHIP.model.actuators]
    ship = replace(SHIP, model=replace(SHIP.model, actuators=tuple(slow)))
    commands = wandering()
    batch = Batch(
        name="a",
        sample_time_s=1.0,
        input_names=SHIP.model.inputs,
        inputs=commands.values,
        velocity=np.zeros((SAMPLES, 3)),
    )
    gone = 1 - np.exp(-1 / 3.0)
    delivered = commands.values[0]
    for row in commands.values[:-1]:
        delivered = delivered + gone * (row - delivered)
    np.testing.assert_allclose(_standing(batch, ship), delivered, atol=1e-9)


# how much is left


@pytest.mark.thorough
def test_what_is_left_is_the_whole_less_the_data_unless_it_is_said(tmp_path):
    measured(tmp_path / "a.csv")
    counted = present_state(load_scenario(STORY), [tmp_path / "a.csv"])
    assert counted.left_s == load_scenario(STORY).design.total_s - SAMPLES
    assert not counted.left_stated
    assert (
        rest_of(present_state(load_scenario(STORY), [tmp_path / "a.csv"], remaining_s=240.0))[0].design.total_s == 240.0
    )


def test_data_that_fill_the_whole_time_need_a_word_about_what_is_left(tmp_path, capsys):
    for name in "abcd":
        measured(tmp_path / f"{name}.csv")
    error = refused(capsys, STORY, "--data", *(tmp_path / f"{name}.csv" for name in "abcd"))
    assert "--remaining S" in error
    assert "800 s" in error


# what it counts on


def test_without_a_vessel_the_parameters_are_estimated_from_the_data(tmp_path):
    measured(tmp_path / "a.csv")
    state = present_state(load_scenario(STORY), [tmp_path / "a.csv"])
    assert state.origin.startswith("estimated from the data so far")
    error = np.abs(state.ship.model.parameters - SHIP.model.parameters)
    assert (error < 4 * state.ship.model.parameter_std + 0.02 * np.abs(SHIP.model.parameters)).all()
    assert (state.ship.model.parameters != SHIP.model.parameters).all()


@pytest.mark.parametrize("current", [(0.0, 0.0), (0.15, -0.1), (0.0, 0.3)])
def test_a_current_that_nobody_stated_is_told_where_the_rest_is_planned_with_it_in_the_values(tmp_path, current):
    """Values that had taken a current up were planned with, and no note said so; `estimate` of the same data did."""
    measured(tmp_path / "a.csv", current=current)
    state = present_state(load_scenario(STORY), [tmp_path / "a.csv"])
    assert any("current" in note for note in state.notes) == any(current)
    if not any(current):
        assert not any("times what the vessel file states" in note for note in state.notes)


def test_parameters_that_the_data_cannot_identify_keep_their_values_and_are_named(tmp_path):
    values = wandering().values.copy()
    values[:, 1::2] = 0.0
    commands = Commands(sample_time_s=1.0, names=SHIP.model.inputs, values=values)
    run = simulate(SHIP, commands, pose=np.array([-100.0, -450.0, 1.0]))
    noise = 1e-3 * np.random.default_rng(0).standard_normal((SAMPLES, 1))
    velocity = run.velocity[:-1] + np.hstack([noise, np.zeros((SAMPLES, 2))])
    table = np.column_stack([np.arange(SAMPLES), run.pose[:-1], velocity, values])
    header = ",".join((*NAMES, "n1_rps", "a1_rad", "n2_rps", "a2_rad"))
    np.savetxt(tmp_path / "ahead.csv", table, delimiter=",", header=header, comments="")
    state = present_state(load_scenario(STORY), [tmp_path / "ahead.csv"])
    assert any("cannot determine" in note and "N_mu" in note for note in state.notes)
    now = dict(zip(state.ship.model.names, state.ship.model.parameters.tolist(), strict=True))
    std = dict(zip(state.ship.model.names, state.ship.model.parameter_std.tolist(), strict=True))
    before = dict(zip(SHIP.model.names, SHIP.model.parameters.tolist(), strict=True))
    assert now["N_mu"] == before["N_mu"]
    assert std["N_mu"] == SHIP.model.parameter_std[SHIP.model.names.index("N_mu")]
    assert now["X_u"] != before["X_u"]


def test_an_estimate_and_what_was_known_before_combine_like_information():
    commands = wandering()
    run = simulate(SHIP, commands)
    velocity = run.velocity[:-1] + 0.02 * np.random.default_rng(1).standard_normal((SAMPLES, 3))
    batch = Batch(
        name="a", sample_time_s=1.0, input_names=commands.names, inputs=commands.values, velocity=velocity,
        pose=run.pose[:-1],
    )  # fmt: skip
    told = estimate(Record(batches=(batch,)), SHIP.model, method="ls")
    scale = np.sqrt(np.diag(told.covariance))
    inverse = np.linalg.inv(told.covariance / np.outer(scale, scale))
    known = np.diag((scale / SHIP.model.parameter_std) ** 2)
    covariance = np.linalg.inv(inverse + known)
    mean = covariance @ (inverse @ (told.values / scale) + known @ (SHIP.model.parameters / scale))
    ship = combined(SHIP, told, prior_counts=True)
    assert np.allclose(ship.model.parameters, mean * scale, rtol=1e-8)
    assert np.allclose(ship.model.parameter_std, np.sqrt(np.diag(covariance)) * scale, rtol=1e-6)
    alone = combined(SHIP, told, prior_counts=False)
    assert np.array_equal(alone.model.parameters, told.values)
    assert np.allclose(alone.model.parameter_std, told.std)


def test_the_vessel_files_weather_counts_only_where_the_scenario_has_none():
    found = Environment(
        current_to=np.array([0.1, 0.2]), wind_to=np.array([5.0, 0.0]), wind_std_mps=0.1,
        current_variation=Variation(std_mps=0.05, correlation_s=60.0),
    )  # fmt: skip
    forecast = Environment(wind_to=np.array([1.0, 1.0]), wind_std_mps=0.5, current_std_mps=0.15)
    weather, words = weather_for_rest(forecast, found)
    assert weather.current_to.tolist() == [0.1, 0.2]
    assert (weather.current_std_mps, weather.current_variation) == (0.15, found.current_variation)
    assert (weather.wind_to.tolist(), weather.wind_std_mps) == ([1.0, 1.0], 0.5)
    assert words == "current from the vessel file, as the scenario has none, wind from the scenario"
    same, _ = weather_for_rest(found, forecast)
    assert same.current_to.tolist() == [0.1, 0.2]
    assert same.wind_to.tolist() == [5.0, 0.0]


def test_manoeuvres_that_the_ship_can_no_longer_do_are_left_out_and_named(tmp_path):
    measured(tmp_path / "a.csv")
    text = (SCENARIOS / "vessels/tender-20m.toml").read_text(encoding="utf-8")
    (tmp_path / "weak.toml").write_text(text.replace("X_mu = 0.012\n", "X_mu = 0.0045\n"), encoding="utf-8")
    case, notes = rest_of(present_state(load_scenario(STORY), [tmp_path / "a.csv"], vessel=tmp_path / "weak.toml"))
    left = {item.name for item in load_scenario(STORY).dictionary} - {item.name for item in case.dictionary}
    assert "deceleration" in left
    assert len(notes) == len(left)
    assert all(any(name in note for note in notes) for name in left)


@pytest.mark.thorough
def test_the_rest_can_be_made_best_for_one_parameter(tmp_path):
    measured(tmp_path / "a.csv")
    state = present_state(load_scenario(STORY), [tmp_path / "a.csv"], remaining_s=360.0)
    variances = {}
    for interest in ((), ("N_r",), ("X_abs_u_u",)):
        case, _ = rest_of(state, interest=interest)
        problem = workflows.duration_problem(case, workflows.scored(case))
        shares = optimal_shares(problem).fractions
        known = problem.prior + np.tensordot(shares, problem.matrices, axes=1)
        variances[interest] = dict(zip(problem.parameters, np.diag(np.linalg.inv(known)), strict=False))
    for name in ("N_r", "X_abs_u_u"):
        assert variances[(name,)][name] == min(found[name] for found in variances.values())
        assert variances[(name,)][name] < 0.99 * variances[()][name]


# what is told


def test_the_rest_only_adds_information_and_unidentified_parameters_are_nan():
    straight = Commands(sample_time_s=1.0, names=SHIP.model.inputs, values=np.tile([8.0, 0.0, 8.0, 0.0], (60, 1)))
    ahead = TrialPart(commands=straight, velocity=np.zeros(3))
    both = (ahead, TrialPart(commands=wandering(), velocity=np.zeros(3)))
    names = SHIP.model.names
    first = expected_std(SHIP, both[:1], names, environment=Environment(), mean_subtraction="none")
    after = expected_std(SHIP, both, names, environment=Environment(), mean_subtraction="none")
    assert np.isnan(first[names.index("N_mu")])
    assert np.isfinite(after).all()
    twice = [replace(part, repeats=2.0) for part in both]
    assert np.allclose(
        expected_std(SHIP, twice, names, environment=Environment(), mean_subtraction="none"), after / np.sqrt(2)
    )


def test_what_is_told_counts_that_a_steady_current_is_unknown():
    """As designs and reports do: the current is estimated along, one for all parts."""
    parts, names = (TrialPart(commands=wandering(), velocity=np.zeros(3)),) * 2, SHIP.model.names
    known, unknown = (
        expected_std(SHIP, parts, names, environment=Environment(current_std_mps=std), mean_subtraction="complete")
        for std in (0.0, 0.15)
    )
    covariance = expected_covariance(SHIP, parts, names, unknown_current=True)
    assert np.allclose(unknown, np.sqrt(np.diag(covariance)))
    assert unknown[names.index("Y_v")] > 1.05 * known[names.index("Y_v")]


def test_the_runs_credited_with_a_parameter_have_the_information_about_it():
    problem = DurationProblem(
        names=("of a", "of b"),
        parameters=("a", "b"),
        mean_subtraction="none",
        matrices=np.array([np.diag([1.0, 0.0]), np.diag([0.0, 1.0])]),
        run_s=np.array([10.0, 10.0]),
        total_s=40.0,
        prior=np.diag([0.5, 0.0]),
    )
    design = replace(solve_durations(problem), repeats=(2, 2))
    a, b = purchases(design, ("a", "b"))
    assert (a.primitive, a.runs) == ("of a", 2)
    assert a.without == pytest.approx(np.sqrt(2.0))
    assert (b.primitive, b.without) == ("of b", np.inf)
    (sure,) = purchases(replace(design, problem=replace(problem, prior=np.diag([50.0, 0.0]))), ("a",))
    assert sure.primitive == ""


# what is refused


def test_data_without_a_position_are_refused(tmp_path, capsys):
    measured(tmp_path / "a.csv", drop=("north_m", "east_m"))
    error = refused(capsys, STORY, "--data", tmp_path / "a.csv")
    assert "a.csv: row 1: gives no final position and heading" in error
    measured(tmp_path / "a.csv", drop=("heading_rad",))
    assert "expected heading_rad" in refused(capsys, STORY, "--data", tmp_path / "a.csv")


def test_a_ship_outside_the_safe_water_is_refused_with_its_place(tmp_path, capsys):
    last = measured(tmp_path / "a.csv", pose=(1200.0, 0.0, 0.3))
    error = refused(capsys, STORY, "--data", tmp_path / "a.csv", "--out", tmp_path / "out")
    assert f"row {SAMPLES + 1}" in error
    lat, lon = load_scenario(STORY).area.frame.to_degrees(last[:2])
    assert f"({lat:.6f}, {lon:.6f}) is on land" in error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("length_m = 20.0", "length_m = 21.0", "vessel.length_m: is 21, expected 20"),
        ("sample_time_s = 1.0", "sample_time_s = 0.5", "vessel.sample_time_s: is 0.5, expected 1"),
        ('kind = "azimuth"\nforward_m = 6.0', 'kind = "azimuth"\nforward_m = 99.0', "forward_m"),
    ],
)
def test_another_ship_is_refused(tmp_path, capsys, old, new, key):
    measured(tmp_path / "a.csv")
    ship = tmp_path / "other.toml"
    ship.write_text((SCENARIOS / "vessels/tender-20m.toml").read_text(encoding="utf-8"), encoding="utf-8")
    spoil(ship, old, new)
    assert key in refused(capsys, STORY, "--data", tmp_path / "a.csv", "--vessel", ship)


@pytest.mark.parametrize("left", ["0", "-5", "nan"])
def test_no_time_left_is_refused(tmp_path, capsys, left):
    measured(tmp_path / "a.csv")
    assert "--remaining is" in refused(capsys, STORY, "--data", tmp_path / "a.csv", "--remaining", left)


def test_an_unknown_parameter_of_interest_is_refused_with_the_nearest(tmp_path, capsys):
    measured(tmp_path / "a.csv")
    assert "'Y_urr', did you mean 'Y_ur'?" in refused(
        capsys, STORY, "--data", tmp_path / "a.csv", "--interest", "Y_urr"
    )


def test_too_little_time_for_any_run_has_no_answer(tmp_path, capsys):
    measured(tmp_path / "a.csv")
    error = refused(capsys, STORY, "--data", tmp_path / "a.csv", "--remaining", "20", status=3)
    assert "no whole run fits in the 20 s left" in error


@pytest.mark.thorough
def test_an_interruption_leaves_nothing(tmp_path):
    measured(tmp_path / "a.csv")

    def interrupt(what: str, share: float) -> None:
        if share > 0.15:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        workflows.replan(STORY, tmp_path / "out", data=[tmp_path / "a.csv"], remaining_s=240.0, progress=interrupt)
    assert not (tmp_path / "out").exists()
