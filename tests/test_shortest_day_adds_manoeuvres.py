"""Manoeuvres that the shortest day adds pay for themselves, keep to the limits, and count the way they make good."""

from dataclasses import replace

import numpy as np
import pytest

from expdesign.dictionary import build_primitive
from expdesign.growing import GrowSettings, Worth
from expdesign.growing.search import made_good_m
from expdesign.plan.local_planner import GoAroundTime
from expdesign.scenario import load_scenario
from expdesign.shortest_day import AccuracySettings, manoeuvres_worth_adding, stated_accuracy
from expdesign.shortest_day.cheapest import cheapest_shares
from expdesign.shortest_day.prices import first_prices, offered
from expdesign.workflows.steps.day import _with_additions
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.planned import plan_problem
from expdesign.workflows.steps.scored import scored
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")

STORY = SCENARIOS / "story.toml"
FEW = GrowSettings(families=("zigzag",), pool=8, rounds=1, seed=1)


@pytest.fixture(scope="module")
def asked():
    case = load_scenario(STORY)
    information = scored(case)
    design = designed(case, information)
    accuracy = stated_accuracy(AccuracySettings(as_durations=True), design, case.vessel)
    return case, plan_problem(case, information, design), accuracy


@pytest.fixture(scope="module")
def added(asked):
    _, problem, accuracy = asked
    return manoeuvres_worth_adding(problem, accuracy, FEW)


@pytest.mark.thorough
def test_with_them_the_runs_cost_less_and_the_accuracy_stays_that_of_the_dictionary(asked, added):
    case, problem, accuracy = asked
    wider = _with_additions(case, added)
    information = scored(wider)
    design = designed(wider, information)
    grown = plan_problem(wider, information, design)
    names = tuple(spec.name for spec in added)
    before = cheapest_shares(accuracy, offered(problem, first_prices(problem)))
    after = cheapest_shares(accuracy, offered(grown, first_prices(grown), free=names))
    assert added
    assert after.bound_s < before.bound_s
    assert design.fractions[-len(added) :] == pytest.approx(0.0)
    again = stated_accuracy(AccuracySettings(as_durations=True), design, case.vessel)
    assert again.level == pytest.approx(accuracy.level, abs=1e-6)
    barred = offered(grown, first_prices(grown))
    assert (barred.most[-len(added) :] == 0).all()


@pytest.mark.thorough
def test_they_keep_to_the_velocities_of_the_dictionary_and_below_the_speed_of_legs(asked, added):
    case, problem, _ = asked
    motion = np.concatenate([item.trajectory.velocity for item in problem.primitives])
    low, high = motion.min(axis=0), motion.max(axis=0)
    high[0] = max(high[0], 0.95 * first_prices_speed(problem))
    high[1:] = np.abs(motion[:, 1:]).max(axis=0)  # to both sides alike
    low[1:] = -high[1:]
    for spec in added:
        velocity = build_primitive(case.vessel, spec).trajectory.velocity
        assert (velocity >= low - 1e-6).all()
        assert (velocity <= high + 1e-6).all()


@pytest.mark.thorough
def test_they_last_as_long_as_the_longest_run_or_a_share_of_that(asked, added):
    _, problem, _ = asked
    longest_s = max(item.duration_s for item in problem.primitives)
    assert {spec.settings["duration_s"] for spec in added} <= {longest_s / 4, longest_s / 2, longest_s}


def first_prices_speed(problem):
    """Transit speed, from the time that the straight way takes at it."""
    return float(np.hypot(*(problem.goal - problem.start)[:2])) / first_prices(problem).way_s


@pytest.mark.thorough
def test_the_same_seed_finds_the_same_of_the_duration_stated(asked):
    _, problem, accuracy = asked
    first, again = (manoeuvres_worth_adding(problem, accuracy, replace(FEW, run_s=50.0)) for _ in range(2))
    assert [(spec.name, spec.settings) for spec in again] == [(spec.name, spec.settings) for spec in first]
    assert {spec.settings["duration_s"] for spec in first} == {50.0}


def test_where_there_is_no_way_to_go_way_made_good_saves_nothing(asked):
    _, problem, accuracy = asked
    there = replace(problem, goal=problem.start)
    assert first_prices(there).way_s == 0.0
    with_way, without = (cheapest_shares(accuracy, offered(item, first_prices(item))) for item in (problem, there))
    assert with_way.bound_s <= without.bound_s


def test_way_made_good_is_the_distance_between_the_ends_of_a_run(asked):
    _, problem, _ = asked
    for item in problem.primitives:
        found = made_good_m(item.trajectory.velocity[None], item.trajectory.sample_time_s)[0]
        assert found == pytest.approx(np.hypot(*item.displacement[:2]), rel=0.01, abs=0.5)


def test_a_run_is_worth_more_the_more_way_it_saves_and_the_less_leg_it_brings():
    matrices = np.eye(2)[None].repeat(3, axis=0)
    ways = np.array([0.0, 50.0, 90.0])
    free, dear = (Worth(gradient=np.eye(2), leg_s=leg_s, saved_s_per_m=1.0) for leg_s in (0.0, 30.0))
    assert free.of(matrices, ways, 100.0) == pytest.approx([2.0, 4.0, 20.0])
    assert (dear.of(matrices, ways, 100.0) < free.of(matrices, ways, 100.0)).all()
    assert Worth(gradient=np.eye(2)).of(matrices, ways, 100.0) == pytest.approx(2.0)


def test_go_arounds_are_the_rarer_the_longer_the_leg():
    time = GoAroundTime(soon_s=100.0, settled_s=50.0)
    expected = time.seconds(np.array([0.0, 50.0, 500.0]))
    assert expected == pytest.approx([100.0, 100.0 / np.e, 0.0], abs=0.01)
