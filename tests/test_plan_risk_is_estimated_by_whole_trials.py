"""Whole trials of drawn ships: legs and ways round steered, runs open loop from where they really begin."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import shapely

from expdesign import workflows
from expdesign.plan.control.tracking import Helmsman
from expdesign.plan.legs import LegTask
from expdesign.plan.monte_carlo import guidance
from expdesign.plan.monte_carlo import risk as monte_carlo_risk
from expdesign.plan.monte_carlo.guidance import GO_AROUNDS, PARALLEL_SHARE, STANDSTILL_SHARE, Guidance
from expdesign.plan.monte_carlo.procedure import ABORT_CAUSES, goal_within_m, tolerances
from expdesign.plan.monte_carlo.risk import CollisionCheck, Trials, estimate_risk, failed_chance_constraint, sail_trials
from expdesign.plan.runs import Fleet, Truths, draw_truths
from expdesign.plan.sailing import Timeline
from expdesign.plan.values import Leg
from expdesign.scenario import load_scenario
from expdesign.simulation import CALM, Environment
from plan_case import at_rest, find_leg, leg_water, primitive

ROOT = Path(__file__).parents[1]
OPEN = shapely.box(-400, -300, 400, 500)


@cache
def planned():
    """Two accelerations from rest, 60 m apart, the second across the first, and back to the start; in open water."""
    water = leg_water(OPEN)
    run = primitive(water.vessel)
    line = Timeline(begin=at_rest(0, 0, 0.0), begin_inputs=np.zeros(4))
    line.sail("primitive", "go", run.commands.values, water.sail(line.begin, run.commands.values, line.given))
    for index, end in enumerate((at_rest(60, 60, np.pi / 2), at_rest(0, 0, 0.0))):
        task = LegTask(start=line.state, end=end, start_inputs=line.inputs, end_inputs=np.zeros(4), seed=1)
        leg = find_leg(task, water)
        assert leg is not None
        line.sail("reposition", "go" if index == 0 else "goal", leg, water.sail(line.state, leg, line.given))
        if index == 0:
            values = run.commands.values + 2 * np.pi * np.round(line.inputs / (2 * np.pi)) * [0, 1, 0, 1]
            line.sail("primitive", "go", values, water.sail(line.state, values, line.given))
    return line.joined(sample_time_s=1.0, names=water.vessel.model.inputs)


def sailing(basin=OPEN, environment=None, *, certain=False, draws=30, seed=0):
    water = leg_water(basin, clearance_m=5.0)
    if environment is not None:
        water = replace(water, environment=environment)
    if certain:
        model = replace(water.vessel.model, parameter_std=np.zeros(len(water.vessel.model.names)))
        water = replace(water, vessel=replace(water.vessel, model=model))
    rng = np.random.default_rng(seed)
    return water, sail_trials(water, planned(), draws=draws, rng=rng)


@pytest.mark.thorough
def test_nominal_ships_reach_the_goal_without_go_arounds():
    _, trials = sailing(certain=True, draws=3)
    assert trials.completed.all()
    assert not trials.go_arounds.any()
    runs = [leg.kind == "primitive" for leg in planned().legs]
    assert (trials.used[runs] < 1.0).all()


def test_every_trial_has_one_outcome_and_runs_begin_within_tolerance():
    weather = Environment(current_std_mps=0.25)
    _, trials = sailing(environment=weather, draws=30)
    ends = trials.left.sum(axis=0) + trials.aborted.sum(axis=0) + trials.completed
    np.testing.assert_array_equal(ends, 1)
    begun = ~np.isnan(trials.used)
    assert (trials.used[begun] <= 1.0).all()
    assert trials.go_arounds.max() <= GO_AROUNDS
    over = np.cumsum(trials.left | trials.aborted, axis=0)[:-1] > 0
    assert not trials.samples[1:][over].any()  # nothing is sailed after the end
    ways = np.array([leg.kind == "reposition" for leg in planned().legs])
    assert (trials.samples.max(axis=1)[ways] <= np.array(trials.longest)[ways] + 1.0).all()
    assert not np.array(trials.longest)[~ways].any()


def test_parts_sailed_in_turn_have_streams_of_their_own_and_no_more_ships_than_one_part(monkeypatch):
    _, alone = sailing(draws=10)
    at_once = []

    def drawn(vessel, environment, draws, rng):
        at_once.append(draws)
        return draw_truths(vessel, environment, draws, rng)

    monkeypatch.setattr(monte_carlo_risk, "TRIALS_AT_ONCE", 10)
    monkeypatch.setattr(monte_carlo_risk, "draw_truths", drawn)
    _, parted = sailing(draws=25)
    assert at_once == [10, 10, 5]
    assert parted.used.shape == (len(planned().legs), 25)
    np.testing.assert_array_equal(parted.used[:, :10], alone.used)
    assert np.unique(parted.samples.sum(axis=0)[parted.completed]).size > 10  # no part repeats another
    assert not np.array_equal(parted.used[2, 10:20], alone.used[2])


@pytest.mark.thorough
def test_an_unknown_current_causes_go_arounds_and_costs_time():
    calm = leg_water(OPEN, clearance_m=5.0)
    windy = replace(calm, environment=Environment(current_std_mps=0.5))
    few, many = (estimate_risk(water, planned(), rng=np.random.default_rng(1), draws=30)[0] for water in (calm, windy))
    assert sum(leg.go_arounds for leg in many.legs) > sum(leg.go_arounds for leg in few.legs)
    assert many.extra_median_s > few.extra_median_s


def test_a_ship_whose_return_to_a_long_leg_is_blocked_by_an_island_goes_around_it():
    rocks = shapely.box(25, 80, 45, 130)
    water = leg_water(shapely.box(-200, -200, 300, 700).difference(rocks), clearance_m=5.0)
    task = LegTask(
        start=at_rest(0, 0, 0.0), end=at_rest(500, 0, 0.0), start_inputs=np.zeros(4), end_inputs=np.zeros(4), seed=1
    )
    leg = find_leg(task, water)
    track = water.sail(task.start, leg)
    helm = Helmsman(vessel=water.vessel, environment=CALM, ship=water.ship)
    certain = Truths(
        parameters=np.tile(water.vessel.model.parameters, (2, 1)), current_to=np.zeros((2, 2)), wind_to=np.zeros((2, 2))
    )
    fleet = Fleet(water.vessel, CALM, certain, state=task.start, standing=np.zeros(4), rng=np.random.default_rng(0))
    fleet.states[:, 1] = [3.0, 65.0]  # both see the beginning of the leg
    guidance = Guidance(
        helm,
        water,
        np.hstack([track.pose, track.velocity]),
        within=tolerances(water),
        sailing=np.ones(2, dtype=bool),
        inputs=np.zeros(4),
        last=True,
    )
    found = guidance.sail(fleet, np.zeros((2, 3)))
    np.testing.assert_array_equal(found.go_arounds, [0, 1])
    assert found.begun.all()
    assert np.isnan(CollisionCheck(area=water.area, vessel=water.vessel).exits(found.poses)).all()


def test_a_leg_too_short_to_return_to_is_sailed_beside_its_place_as_far_as_the_run_may_begin_there():
    water = leg_water(shapely.box(-200, -200, 200, 200), clearance_m=5.0)
    task = LegTask(
        start=at_rest(0, 0, 0.0), end=at_rest(80, 0, 0.0), start_inputs=np.zeros(4), end_inputs=np.zeros(4), seed=1
    )
    track = water.sail(task.start, find_leg(task, water))
    helm = Helmsman(vessel=water.vessel, environment=CALM, ship=water.ship)
    certain = Truths(
        parameters=np.tile(water.vessel.model.parameters, (4, 1)), current_to=np.zeros((4, 2)), wind_to=np.zeros((4, 2))
    )
    beside = {}
    for position_m in (40.0, 160.0):
        fleet = Fleet(water.vessel, CALM, certain, state=task.start, standing=np.zeros(4), rng=np.random.default_rng(0))
        fleet.states[:, 1] = [0.0, 10.0, -35.0, 35.0]
        guidance = Guidance(
            helm,
            water,
            np.hstack([track.pose, track.velocity]),
            within=replace(tolerances(water), position_m=position_m),
            sailing=np.ones(4, dtype=bool),
            inputs=np.zeros(4),
            last=False,
        )
        found = guidance.sail(fleet, np.zeros((4, 3)))
        assert found.begun.all()
        assert not found.go_arounds.any()
        beside[position_m] = found.poses[-1, :, 1], found.samples
    (narrow, late), (wide, soon) = beside[40.0], beside[160.0]
    most_m = STANDSTILL_SHARE * PARALLEL_SHARE * 40.0
    assert (np.abs(wide[:2]) < 2.0).all()  # a leg long enough is returned to
    assert (np.abs(narrow[2:]) < most_m + 2.0).all()
    assert (wide[2:] * [-1, 1] > np.abs(narrow[2:])).all()
    assert (soon[2:] <= late[2:]).all()


def test_a_long_leg_to_a_run_that_begins_sideways_takes_no_longer_than_one_to_a_run_ahead():
    """Azimuths turn to the angles of the run on its last stretch.

    Kept near 90 degrees on the whole leg, they would push ahead one sample and astern the next.
    """
    water = replace(leg_water(OPEN, clearance_m=5.0), environment=Environment(current_to=np.array([0.05, 0.1])))
    end = np.array([300.0, 0.0, 0.0, 0.5, 0.0, 0.0])
    task = LegTask(start=at_rest(0, 0, 0.0), end=end, start_inputs=np.zeros(4), end_inputs=np.zeros(4), seed=1)
    track = water.sail(task.start, find_leg(task, water))
    took = {}
    for angle in (0.0, -np.pi / 2):
        rng = np.random.default_rng(0)
        truths = draw_truths(water.vessel, water.environment, 20, rng)
        fleet = Fleet(water.vessel, water.environment, truths, state=task.start, standing=np.zeros(4), rng=rng)
        guidance = Guidance(
            Helmsman(vessel=water.vessel, environment=water.environment, ship=water.ship),
            water,
            np.hstack([track.pose, track.velocity]),
            within=tolerances(water),
            sailing=np.ones(20, dtype=bool),
            inputs=np.array([5.0, angle, 5.0, angle]),
            last=False,
        )
        found = guidance.sail(fleet, np.zeros((20, 3)))
        took[angle] = np.median(found.samples[found.begun])
    assert took[-np.pi / 2] < 1.1 * took[0.0]


def test_a_ship_that_does_not_arrive_is_given_up_when_the_plan_would_be_over(monkeypatch: pytest.MonkeyPatch):
    water = leg_water(OPEN, clearance_m=5.0)
    task = LegTask(
        start=at_rest(0, 0, 0.0), end=at_rest(60, 0, 0.0), start_inputs=np.zeros(4), end_inputs=np.zeros(4), seed=1
    )
    track = water.sail(task.start, find_leg(task, water))
    helm = Helmsman(vessel=water.vessel, environment=CALM, ship=water.ship)
    idle = 0.0 * water.vessel.model.parameters[None]  # nothing moves this ship
    truths = Truths(parameters=idle, current_to=np.zeros((1, 2)), wind_to=np.zeros((1, 2)))
    took = {}
    for attempts, longest in ((0.0, 100.0), (0.2, 10.0), (0.0, np.inf)):
        monkeypatch.setattr(guidance, "LONGEST_ATTEMPTS", attempts)
        fleet = Fleet(water.vessel, CALM, truths, state=task.start, standing=np.zeros(4), rng=np.random.default_rng(0))
        sailed = Guidance(
            helm,
            water,
            np.hstack([track.pose, track.velocity]),
            within=tolerances(water),
            sailing=np.ones(1, dtype=bool),
            inputs=np.zeros(4),
            last=False,
            longest=longest,
        ).sail(fleet, np.zeros((1, 3)))
        assert not sailed.begun.any()
        assert ABORT_CAUSES[sailed.abort_cause[0]] == "time"
        took[longest] = int(sailed.samples[0])
    assert took[100.0] == 101
    assert 11 < took[10.0] < took[np.inf]  # a share of an attempt has its time in any case
    assert took[np.inf] > 200


def test_water_that_ends_on_a_run_is_left_there_and_the_message_says_where():
    legs = planned().legs
    reach = float(planned().trajectory.pose[legs[0].last, 0])
    water, trials = sailing(shapely.box(-400, -300, 400, reach), certain=True, draws=3)
    assert trials.left[0].all()
    assert not trials.samples[1:].any()
    assert (np.abs(trials.place[0, :, 0] - reach) < water.vessel.length_m).all()
    risk, trials = estimate_risk(water, planned(), rng=np.random.default_rng(0), draws=20)
    message = failed_chance_constraint(risk, trials, legs, water.area, confidence=0.95)
    lat, lon = water.area.frame.to_degrees(np.nanmedian(trials.place[0], axis=0))
    assert "in run 1, 'go'" in message
    assert f"{lat:.5f}, {lon:.5f}" in message
    assert risk.left == 1.0


def outcomes(left: np.ndarray, aborted: np.ndarray) -> Trials:
    """Trials that end so, (legs, n) each."""
    blank = np.zeros(left.shape, dtype=int)
    return Trials(
        left=left,
        aborted=aborted,
        go_arounds=blank,
        samples=blank,
        used=np.zeros(left.shape),
        abort_cause=blank,
        place=np.where(left[..., None], np.full(2, 10.0), np.nan),
        within=(tolerances(leg_water(OPEN)),) * len(left),
        longest=(100.0,) * len(left),
    )


def test_of_trials_that_no_longer_end_on_a_leg_as_many_end_on_those_after_it():
    """60 of 100 are aborted on the first leg, 20 of the 40 left leave the water on the second, 10 of 20 are aborted."""
    left, aborted = np.zeros((2, 3, 100), dtype=bool)
    aborted[0, :60], left[1, 60:80], aborted[2, 80:90] = True, True, True
    trials = outcomes(left, aborted)
    assert trials.shares() == pytest.approx((0.2, 0.7))
    assert trials.shares([False, True, True]) == pytest.approx((0.5, 0.25))
    assert trials.shares([True, True, False]) == pytest.approx((0.2, 0.6))


def test_the_chance_constraint_holds_or_fails_by_the_share_alone():
    legs = (Leg(kind="reposition", name="a", first=0, last=1), Leg(kind="primitive", name="a", first=1, last=2))
    left = np.zeros((2, 100), dtype=bool)
    left[0, :5] = True
    trials = outcomes(left, np.zeros_like(left))
    risk = replace(sailed_risk(), left=0.05, trials=100)
    assert risk.error == pytest.approx(np.sqrt(0.05 * 0.95 / 100))
    sea = leg_water(OPEN).area
    kept, broken = 1.0 - 0.05 - 1.01 * risk.error, 1.0 - 0.05 - 0.99 * risk.error
    assert failed_chance_constraint(risk, trials, legs, sea, confidence=kept) == ""
    assert "on the way to run 1" in failed_chance_constraint(risk, trials, legs, sea, confidence=broken)
    none = replace(risk, left=0.0)
    assert failed_chance_constraint(none, trials, legs, sea, confidence=0.9999) == ""


def test_many_aborted_trials_give_a_warning_and_most_of_them_no_plan():
    few, many, most = (replace(sailed_risk(), left=0.0, aborted=x, reasons=("in run 7",)) for x in (0.1, 0.27, 0.5))
    assert few.note == ""
    assert replace(few, aborted_most=0.09).note
    assert "about 3 in 10" in many.note
    assert many.note.endswith("in run 7")
    sailed, sea = Trials(**dict.fromkeys(Trials.__dataclass_fields__, np.zeros(1))), leg_water(OPEN).area
    assert failed_chance_constraint(many, sailed, (), sea, confidence=0.95) == ""
    message = failed_chance_constraint(most, sailed, (), sea, confidence=0.95)
    assert "run 7" in message
    assert "clearance" not in message  # more of it would not help


def test_ships_reach_the_goal_only_if_they_are_there():
    whole, legs = planned().states, planned().legs
    water = replace(leg_water(OPEN, clearance_m=5.0), environment=Environment(current_std_mps=0.5))
    ships = 20
    last = whole[legs[-1].first : legs[-1].last + 1]
    helm = Helmsman(vessel=water.vessel, environment=water.environment, ship=water.ship)
    rng = np.random.default_rng(0)
    truths = draw_truths(water.vessel, water.environment, ships, rng)
    fleet = Fleet(water.vessel, water.environment, truths, state=last[0], standing=np.zeros(4), rng=rng)
    guidance = Guidance(
        helm,
        water,
        last,
        within=tolerances(water),
        sailing=np.ones(ships, dtype=bool),
        inputs=np.zeros(4),
        last=True,
    )
    found = guidance.sail(fleet, np.zeros((ships, 3)))
    off_m = np.hypot(*(found.poses[..., :2] - last[-1, :2]).T).min(axis=1)
    assert 0 < found.begun.sum() < ships  # some currents are faster than the ship
    assert off_m[found.begun].max() <= goal_within_m(water)
    assert off_m[~found.begun].min() > goal_within_m(water)


@cache
def sailed_risk():
    water = leg_water(OPEN, clearance_m=5.0)
    return estimate_risk(water, planned(), rng=np.random.default_rng(0), draws=4)[0]


@pytest.mark.slow
def test_the_risk_of_a_real_plan_holds_in_other_draws_and_without_breaks_it_need_not(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "tests" / "benchmarks"))
    import safety

    case = load_scenario(ROOT / "scenarios" / "narrows.toml")
    information = workflows.scored(case)
    plan = workflows.planned(case, information, workflows.designed(case, information))
    water = safety.water_of(case, plan)
    by_the_book = estimate_risk(water, plan.sailed, draws=200, rng=np.random.default_rng(3))[0]
    with safety.unbroken():
        unbroken = estimate_risk(water, plan.sailed, draws=200, rng=np.random.default_rng(3))[0]
    sys.modules.pop("safety")
    assert by_the_book.left <= 1.0 - case.plan.confidence + 2 * by_the_book.error
    assert unbroken.left >= by_the_book.left
    assert unbroken.extra_median_s < by_the_book.extra_median_s
