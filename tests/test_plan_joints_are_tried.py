"""Joints between runs are tried with optimised legs before the search counts on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from plan_case import leg_water
from test_plan_verification_catches_what_is_wrong import primitive

from expdesign.plan.goal_ways import build_goal_ways
from expdesign.plan.joint_trials import LONGER, joints_of, settled
from expdesign.plan.leg_times import joints, leg_times
from expdesign.plan.legs import LegTask, find_leg
from expdesign.plan.search_space import SearchSpace, stamp
from expdesign.plan.speed_changes import leg_end
from expdesign.plan.values import Placement
from expdesign.simulation import CALM


@pytest.fixture(scope="module")
def water():
    return leg_water(shapely.box(-800, -800, 800, 800))


@pytest.fixture(scope="module")
def space(water):
    """The search space of accelerations from rest."""
    go = primitive(water.vessel)
    still = leg_end(water.vessel, CALM, 0.0, None, top_mps=water.ship.transit_speed_mps, yaw_rate_radps=0.3).changes
    goal = np.array([0.0, 500.0, 0.0])
    return SearchSpace(
        stamps=(stamp(go, np.full(len(go.trajectory), 25.0), length_m=30.0, beam_m=9.0),),
        frame=water.area.frame,
        field=water.field,
        goal_way=build_goal_ways(water.narrowest_ways, water.field, goal[:2]),
        goal=goal,
        ship=water.ship,
        times=leg_times(water.vessel, water.ship, still),
        hull_m=30.0,
        leg_margin_m=25.0,
        current_to=np.zeros(2),
    )


def test_short_legs_between_placements_are_joints_and_each_pair_counts_once(water, space):
    run = space.stamps[0]
    ahead = float(run.displacement[0])
    places = [np.zeros(3), np.array([ahead + 20, 0.0, 0.0]), np.array([2 * ahead + 40, 0.0, 0.0])]
    far = np.array([0.0, -600.0, 1.0])
    found = joints_of(space, np.zeros(3), "", [Placement(primitive="go", pose=pose) for pose in [*places, far]])
    assert [joint.pair for joint in found] == [("", "go"), ("go", "go")]
    np.testing.assert_allclose(found[1].step, [20.0, 0.0, 0.0], atol=1e-9)


def test_a_joint_that_was_tried_lasts_no_longer_than_the_one_the_rule_asked_for(water, space):
    go = primitive(water.vessel)
    tried = joints_of(
        space,
        np.array([0.0, 0.0, 0.0]),
        "go",
        [Placement(primitive="go", pose=np.array([25.0, 0.0, 0.0]))],
    )
    known = settled(space, water, {"go": go}, tried, carried=False, seed=1)
    assert known.settle_s[("go", "go")] in [longer * space.times.settle_s for longer in LONGER]
    again = settled(known, water, {}, tried, carried=False, seed=1)  # nothing is tried twice
    assert again.settle_s == known.settle_s

    def leg_s(rule):
        found = joints(rule, space.stamps[0].exit_mps, space.stamps[0].entry_mps)
        straight = np.flatnonzero((found.step[:, 2] == 0) & (np.abs(found.step[:, 1]) < 1e-9) & (found.step[:, 0] > 0))
        step = found.step[straight[np.argmin(found.seconds[straight] - found.step[straight, 0] / rule.speed_mps)]]
        task = LegTask(
            start=np.r_[0.0, 0.0, 0.0, go.exit_velocity],
            end=np.r_[step, go.entry_velocity],
            start_inputs=go.commands.values[-1],
            end_inputs=go.entry_inputs,
            seed=1,
        )
        return len(find_leg(task, water)) * water.vessel.sample_time_s

    assert leg_s(known.joint_times(space.times, "go", "go")) <= leg_s(replace(space.times)) + 1e-9
