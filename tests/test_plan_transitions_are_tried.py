"""Transitions between runs are tried with optimised legs before the search counts on them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from expdesign.plan import PlanSettings, assembly
from expdesign.plan.legs import LegTask
from expdesign.plan.local_planner import TransitionTrials, pairs_of
from expdesign.plan.values import Placement
from plan_case import find_leg, leg_water, primitive, space_of


@pytest.fixture(scope="module")
def water():
    return leg_water(shapely.box(-800, -800, 800, 800))


@pytest.fixture(scope="module")
def space(water):
    """The search space of accelerations from rest."""
    return space_of(water, primitive(water.vessel), np.array([0.0, 500.0, 0.0]))


def tried(space, water, runs, *, made_good=True):
    """The space with the transition between two accelerations tried."""
    rest = np.zeros(3), np.zeros(len(water.vessel.limits))
    trials = TransitionTrials(water=water, primitives=runs, start=np.zeros(3), under_way=rest, made_good=made_good)
    return space.planner.with_transitions(space, [("go", "go")], trials)


def test_each_pair_of_runs_counts_once_and_so_do_both_ends():
    places = [Placement(primitive=name, pose=np.zeros(3)) for name in ("a", "b", "b", "b", "a")]
    assert pairs_of(places) == [("", "a"), ("a", "b"), ("b", "b"), ("b", "a"), ("a", "")]


@pytest.mark.thorough
def test_a_tried_transition_is_sailed_as_optimised_and_loses_no_more_than_others(water, space):
    go = primitive(water.vessel)
    known = tried(space, water, {"go": go})
    again = tried(known, water, {})  # nothing is tried twice
    assert again.tried == known.tried
    transition, sample_s = known.tried[("go", "go")], water.vessel.sample_time_s

    def leg_s(step):
        task = LegTask(
            start=np.r_[0.0, 0.0, 0.0, go.exit_velocity],
            end=np.r_[step, go.entry_velocity],
            start_inputs=go.commands.values[-1],
            end_inputs=go.entry_inputs,
            seed=1,
        )
        return len(find_leg(task, water)) * sample_s

    assert leg_s(transition.step) <= transition.seconds + sample_s
    lost_s = transition.seconds - transition.step[0] / space.planner.times.speed_mps
    others = np.column_stack([[15.0, 30.0, 60.0], np.zeros((3, 2))])
    assert lost_s <= min(leg_s(step) - step[0] / space.planner.times.speed_mps for step in others) + sample_s


def test_the_draft_of_a_day_tries_no_transitions_and_every_other_plan_does(space):
    most = {
        (draft, day): assembly._most_trials(
            SimpleNamespace(settings=PlanSettings(draft=draft), expected=day), space.planner
        )
        for draft in (False, True)
        for day in (False, True)
    }
    assert most.pop((True, True)) == 0
    assert all(count == space.planner.transition_trials > 0 for count in most.values())


def test_where_it_does_not_matter_where_transitions_lead_the_quickest_counts(water, space):
    go = primitive(water.vessel)
    found = [tried(space, water, {"go": go}, made_good=made_good).tried[("go", "go")] for made_good in (False, True)]
    assert found[0].seconds <= found[1].seconds + water.vessel.sample_time_s
