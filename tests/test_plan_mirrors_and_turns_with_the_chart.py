import json
from dataclasses import replace

import numpy as np
import pytest
import shapely

from expdesign import workflows
from expdesign.plan.solve import plan_trial
from expdesign.plan.values import PlanProblem
from expdesign.scenario import load_scenario
from expdesign.workflows import plan_problem
from short_examples import SHORTER, copied, example_run

FLIP = np.array([1.0, -1.0, -1.0])  # north, east, heading; or forces ahead, to starboard, about the vertical
TURNED = 0.10
"""Largest change of cost when the chart is turned: placements are found on grids, which turn with no chart."""


@pytest.fixture(scope="module")
def problem(tmp_path_factory) -> PlanProblem:
    case = load_scenario(copied(tmp_path_factory.mktemp("copy"), "model-ship", SHORTER["model-ship"]))
    information = workflows.scored(case)
    return plan_problem(case, information, workflows.designed(case, information), seed=1)


@pytest.fixture(scope="module")
def cost_s(made_once) -> float:
    folder, _ = example_run(made_once, "model-ship")
    return json.loads((folder / "plan.json").read_text(encoding="utf-8"))["reposition_s"]


def moved(problem: PlanProblem, points, poses) -> PlanProblem:
    """The same with the chart's (east, north) points and the poses moved."""
    area = problem.area
    return replace(
        problem,
        area=replace(area, water=shapely.transform(area.water, points), land=shapely.transform(area.land, points)),
        start=poses(problem.start),
        goal=poses(problem.goal),
    )


def mirrored(primitive):
    """The run that goes to port where this one goes to starboard: the vessel takes forces, so they are flipped."""
    commands, motion = primitive.commands, primitive.trajectory
    return replace(
        primitive,
        commands=replace(commands, values=commands.values * FLIP),
        entry_inputs=primitive.entry_inputs * FLIP,
        trajectory=replace(motion, pose=motion.pose * FLIP, velocity=motion.velocity * FLIP),
    )


@pytest.mark.slow
def test_a_mirrored_chart_with_mirrored_runs_costs_the_same(problem, cost_s):
    assert problem.vessel.model.inputs == ("tau_x", "tau_y", "tau_psi")
    other = moved(problem, lambda xy: xy * (-1.0, 1.0), lambda pose: pose * FLIP)
    plan = plan_trial(replace(other, primitives=tuple(mirrored(item) for item in problem.primitives)))
    assert plan.seconds("reposition") == pytest.approx(cost_s, abs=2 * problem.vessel.sample_time_s)


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.7, -1.9, 3.0])
def test_a_turned_chart_costs_nearly_the_same(problem, cost_s, angle):
    c, s = np.cos(angle), np.sin(angle)
    other = moved(
        problem,
        lambda xy: xy @ np.array([[c, -s], [s, c]]),
        lambda pose: np.array([pose[0] * c - pose[1] * s, pose[0] * s + pose[1] * c, pose[2] + angle]),
    )
    assert plan_trial(other).seconds("reposition") == pytest.approx(cost_s, rel=TURNED)
