"""Legs of ships with propeller and rudder: they arrive, within limits and rates, and end with a steady run-up."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from expdesign.plan import PlanSettings
from expdesign.plan.chart.goal_distance import clearance_field
from expdesign.plan.control import APPROACH_HULLS
from expdesign.plan.control.ships import capability
from expdesign.plan.legs import LegTask, LegWater, _casadi
from expdesign.plan.legs.helm import _shortest_first
from expdesign.plan.legs.problem import LegProblem
from expdesign.plan.legs.recovery import displaced, recover
from expdesign.plan.values import WorkBudget
from expdesign.scenario import load_area, load_vessel
from expdesign.signals import Commands
from expdesign.simulation import CALM, simulate, steady_ahead
from helm_case import catamaran, coaster, open_water
from plan_case import find_leg

SHIPS = {"coaster": coaster, "catamaran": catamaran}


@cache
def sailed(ship: str, case: str):
    """(water, task, commands) of a leg, lengths in hulls."""
    water = open_water(SHIPS[ship]())
    vessel, length = water.vessel, water.vessel.length_m
    ahead = steady_ahead(vessel, 0.8 * water.ship.transit_speed_mps)
    still, rest = np.zeros(3), np.zeros(len(vessel.limits))
    turn = water.ship.turns[-2]
    turning = np.array([turn.surge_mps, turn.sway_mps, turn.yaw_rate_radps])
    approach = water.ship.approach
    over = np.array(approach.helm.inputs(approach.drive, approach.angle_rad + approach.starboard * turn.helm_rad))
    start, before, end, after = {
        "off from rest": ((0.0, 0.0, 0.0, *still), rest, (14 * length, 3 * length, 0.3, *ahead.velocity), ahead.inputs),
        "after a turn": (
            (0.0, 0.0, 0.0, *turning),
            over,
            (16 * length, 9 * length, 1.2, *ahead.velocity),
            ahead.inputs,
        ),
        "far": (
            (-24 * length, -20 * length, 0.2, *turning),
            over,
            (26 * length, 8 * length, 1.2, *ahead.velocity),
            ahead.inputs,
        ),
        "to rest": ((0.0, 0.0, 0.0, *ahead.velocity), ahead.inputs, (20 * length, 6 * length, 0.5, *still), rest),
    }[case]
    task = LegTask(start=np.array(start), end=np.array(end), start_inputs=before, end_inputs=after, seed=1)
    values = find_leg(task, water)
    assert values is not None
    return water, task, values


BOTH = pytest.mark.parametrize(
    ("ship", "case"),
    [
        ("coaster", "after a turn"),
        ("coaster", "far"),
        pytest.param("coaster", "to rest", marks=pytest.mark.thorough),
        pytest.param("coaster", "off from rest", marks=pytest.mark.slow),
        pytest.param("catamaran", "after a turn", marks=pytest.mark.slow),
        pytest.param("catamaran", "far", marks=pytest.mark.slow),
    ],
)
ONE = pytest.mark.parametrize("ship", ["coaster", pytest.param("catamaran", marks=pytest.mark.slow)])


@pytest.mark.thorough
@BOTH
def test_the_commands_sailed_with_a_tenth_of_the_step_arrive(ship, case):
    water, task, values = sailed(ship, case)
    vessel = water.vessel
    commands = Commands(sample_time_s=vessel.sample_time_s, names=vessel.model.inputs, values=values)
    coarse, fine = (
        simulate(vessel, commands, pose=task.start[:3], velocity=task.start[3:], substeps=substeps)
        for substeps in (2, 20)
    )
    length = vessel.length_m
    assert np.hypot(*(fine.pose - coarse.pose)[:, :2].T).max() < length / 30
    assert np.hypot(*(fine.pose[-1] - task.end[:3])[:2]) < length / 100
    assert np.abs(fine.pose[-1, 2] - task.end[2]) < 0.01
    np.testing.assert_allclose(fine.velocity[-1, :2], task.end[3:5], atol=0.01 * water.ship.transit_speed_mps)


@BOTH
def test_limits_and_rates_hold_from_the_commands_before_to_those_after(ship, case):
    water, task, values = sailed(ship, case)
    steps = np.diff(np.vstack([task.start_inputs, values]), axis=0)
    for index, limit in enumerate(water.vessel.limits):
        assert values[:, index].min() >= limit.low - 1e-6
        assert values[:, index].max() <= limit.high + 1e-6
        assert np.abs(steps[:, index]).max() <= water.vessel.rates[index] * water.vessel.sample_time_s * (1 + 1e-6)
    np.testing.assert_allclose(values[-1], task.end_inputs, atol=1e-6)


@BOTH
def test_no_leg_asks_for_more_than_the_helm_gives(ship, case):
    water, task, values = sailed(ship, case)
    track = water.sail(task.start, values, task.past)
    speed, rate = np.hypot(*track.velocity[:, :2].T), np.abs(track.velocity[:, 2])
    hardest = max(abs(turn.yaw_rate_radps) for turn in water.ship.turns)
    slack = 1.02 * max(hardest, abs(task.start[5]))
    assert rate.max() <= max(water.ship.yaw_rate_radps, slack)
    assert speed.max() <= 1.01 * max(water.ship.transit_speed_mps, speed[0])
    moving = speed > 0.05 * water.ship.transit_speed_mps
    assert rate[~moving].max(initial=0.0) < 0.3 * hardest  # nothing turns it where it stands
    planned = [
        item.length_m(water.ship.turning_radius_m) for item in _shortest_first(task.start, task, water, water.ship)
    ]
    sailed_m = speed.sum() * water.vessel.sample_time_s
    assert sailed_m < max(planned) + 6 * water.vessel.length_m


@ONE
def test_a_long_leg_is_steady_ahead_in_between_and_hardly_longer_than_its_path(ship):
    water, task, values = sailed(ship, "far")
    transit = water.ship.approach
    steady = np.flatnonzero((np.abs(values - transit.inputs) < 1e-6).all(axis=1))
    assert len(steady) * water.vessel.sample_time_s * transit.speed_mps > 20 * water.vessel.length_m
    velocity = water.sail(task.start, values, task.past).velocity[steady[0] : steady[-1] + 1]
    np.testing.assert_allclose(velocity, np.tile(transit.velocity, (len(velocity), 1)), atol=2e-3 * transit.speed_mps)
    path_m = min(
        item.length_m(water.ship.turning_radius_m) for item in _shortest_first(task.start, task, water, water.ship)
    )
    time_s = len(values) * water.vessel.sample_time_s
    assert time_s < 1.15 * path_m / transit.speed_mps


@pytest.mark.thorough
@ONE
def test_a_run_begins_after_a_steady_run_up_with_its_own_commands(ship):
    water, task, values = sailed(ship, "after a turn")
    track = water.sail(task.start, values, task.past)
    count = int(np.ceil(APPROACH_HULLS * water.vessel.length_m / task.end[3] / water.vessel.sample_time_s))
    np.testing.assert_allclose(values[-count:], np.tile(task.end_inputs, (count, 1)), atol=1e-6)
    steady = track.velocity[-count - 1 :]
    np.testing.assert_allclose(steady, np.tile(task.end[3:], (count + 1, 1)), atol=2e-3 * task.end[3])
    assert np.hypot(*(track.pose[-1] - track.pose[-count - 1])[:2]) >= 0.99 * APPROACH_HULLS * water.vessel.length_m


@ONE
def test_a_swing_is_checked_on_the_side_where_the_ship_turned(ship):
    water, task, _ = sailed(ship, "after a turn")
    check = recover(task.start, task.past, water, water.ship)
    assert abs(check.states[-1, 5]) < 0.1 * abs(task.start[5])
    scales = {"sample_time_s": water.vessel.sample_time_s, "hull_m": water.vessel.length_m}
    ahead, starboard, turned, time_s = displaced(check, water.ship, **scales)
    assert ahead > 0
    assert starboard > 0
    assert turned > 0
    mirrored = task.start * [1, -1, -1, 1, -1, -1]
    over = task.past[-1].copy()
    over = over[::-1] if ship == "catamaran" else over * [1, -1]
    other = displaced(recover(mirrored, over[None], water, water.ship), water.ship, **scales)
    np.testing.assert_allclose(other, [ahead, -starboard, -turned, time_s], rtol=1e-6)


@pytest.mark.parametrize("ship", SHIPS)
def test_a_ship_that_goes_straight_needs_no_check(ship):
    water = open_water(SHIPS[ship]())
    ahead = steady_ahead(water.vessel, 0.8 * water.ship.transit_speed_mps)
    check = recover(np.r_[0.0, 0.0, 1.0, ahead.velocity], ahead.inputs[None], water, water.ship)
    assert len(check.commands) == 0


BAY = Path(__file__).parents[2] / "shared" / "data" / "field" / "bay"


@pytest.mark.thorough
def test_a_leg_past_an_islet_is_found_though_the_fastest_one_in_its_corridor_cuts_across(tmp_path):
    if not BAY.exists():
        pytest.skip("the data beside the project are not here")
    for name in ("bay.toml", "bay1.geojson"):
        text = (BAY / name).read_text(encoding="utf-8").replace("bay0", "bay1")
        (tmp_path / name).write_text(text, encoding="utf-8")
    vessel, settings = load_vessel(BAY / "osv.toml"), PlanSettings()
    sea = load_area(tmp_path / "bay.toml", draught_m=vessel.draught_m)
    water = LegWater(
        vessel=vessel,
        environment=CALM,
        ship=capability(vessel, settings),
        area=sea,
        clearance_m=settings.clearance_m,
        field=clearance_field(sea, resolution_m=vessel.length_m / 8),
    )
    rest = np.zeros(len(vessel.limits))
    start, end = np.array([-521.0, 366.0, 0.63, 0.0, 0.0, 0.0]), np.array([-67.0, -113.0, -2.43, 0.0, 0.0, 0.0])
    task = LegTask(start=start, end=end, start_inputs=rest, end_inputs=rest, seed=1, budget=WorkBudget(most_s=40.0))
    values = find_leg(task, water)
    assert values is not None
    assert water.holds(water.states(start, values)[:, :3])


@pytest.mark.parametrize(("hulls", "enough"), [(16.0, True), (7.0, False)])
def test_a_leg_without_room_to_gather_speed_is_hardly_tried(hulls: float, enough: bool) -> None:
    """Her own helmsman, who follows the first guess, says so; IPOPT would go to and fro with every guess."""
    water = open_water(coaster())
    vessel, ship = water.vessel, water.ship
    slow, swift = (steady_ahead(vessel, share * ship.transit_speed_mps) for share in (0.4, 1.0))
    task = LegTask(
        start=np.array([0.0, 0.0, 0.0, *slow.velocity]),
        end=np.array([hulls * vessel.length_m, 2.0 * vessel.length_m, 0.3, *swift.velocity]),
        start_inputs=slow.inputs,
        end_inputs=swift.inputs,
        seed=1,
        budget=WorkBudget(most_s=40.0),
    )
    assert (find_leg(task, water) is not None) == enough
    assert task.budget.spent_s < 5.0


def test_what_ipopt_leaves_near_an_answer_in_free_time_is_a_guess_and_nothing_else_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """About an answer it may go to and fro until its iterations end; what comes of the guess is sailed exactly."""
    water, left = open_water(coaster()), list[tuple[bool, float, bool]]()
    vessel, whole = water.vessel, _casadi.Program.solve

    def told(program: _casadi.Program, problem: LegProblem, step_s: float) -> tuple[LegProblem, float] | None:
        answer, fresh = whole(program, problem, step_s), not problem.budget.exhausted
        outcome = program.solver.stats() if fresh or answer is not None else {"success": True}
        if not outcome["success"]:
            left.append((program.free, outcome["iterations"]["inf_pr"][-1], answer is not None))
        return answer

    monkeypatch.setattr(_casadi.Program, "solve", told)
    monkeypatch.setattr(_casadi, "ITERATIONS", 25)  # the fastest motion takes 81
    _casadi._program.cache_clear()
    ahead, rest = steady_ahead(vessel, 0.8 * water.ship.transit_speed_mps), np.zeros(len(vessel.limits))
    task = LegTask(
        start=np.array([0.0, 0.0, 0.0, *ahead.velocity]),
        end=np.array([12 * vessel.length_m, 6 * vessel.length_m, 0.5, 0.0, 0.0, 0.0]),
        start_inputs=ahead.inputs,
        end_inputs=rest,
        seed=1,
        budget=WorkBudget(most_s=8.0),
    )
    try:
        find_leg(task, water)
    finally:
        _casadi._program.cache_clear()
    assert {free for free, _, _ in left} == {True, False}
    assert {taken for _, _, taken in left} == {True, False}
    for free, miss, taken in left:
        assert taken == (free and miss < 0.03)


@pytest.mark.parametrize("to", ["run", "rest"])
def test_a_ship_that_goes_astern_stops_and_goes_on(to: str) -> None:
    """Her thrust ahead stops her: what a run leaves her with is no reason that no leg leads on."""
    water = open_water(coaster())
    vessel, approach = water.vessel, water.ship.approach
    ahead, rest = steady_ahead(vessel, 0.8 * water.ship.transit_speed_mps), np.zeros(len(vessel.limits))
    back = np.array(approach.helm.inputs(-1.0, approach.angle_rad))
    count = int(400.0 / vessel.sample_time_s)
    astern = water.states(np.r_[0.0, 0.0, 0.0, ahead.velocity], np.tile(back, (count, 1)), ahead.inputs[None])[-1, 3:]
    assert astern[0] < -0.5 * water.ship.transit_speed_mps
    velocity, inputs = (ahead.velocity, ahead.inputs) if to == "run" else (np.zeros(3), rest)
    task = LegTask(
        start=np.r_[0.0, 0.0, 0.0, astern],
        end=np.array([16 * vessel.length_m, 4 * vessel.length_m, 0.4, *velocity]),
        start_inputs=back,
        end_inputs=inputs,
        seed=1,
        budget=WorkBudget(most_s=12.0),
    )
    values = find_leg(task, water)
    assert values is not None
    surge = water.sail(task.start, values, task.past).velocity[:, 0]
    assert np.sum(np.diff(np.sign(surge[surge != 0.0])) != 0) <= 2  # she does not go astern again, but for the stop
