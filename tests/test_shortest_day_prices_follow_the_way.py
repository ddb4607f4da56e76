"""What runs are taken to tell in a day is what they tell along its way, an unknown current counted."""

import numpy as np
import pytest

from expdesign.plan.values import Leg, SailedTrial
from expdesign.plan.verify import track_information
from expdesign.scenario import load_scenario
from expdesign.shortest_day import AccuracySettings, stated_accuracy
from expdesign.shortest_day.prices import courses_of, runs_along, straight_courses
from expdesign.signals import Trajectory
from expdesign.simulation import simulate
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.planned import plan_problem
from expdesign.workflows.steps.scored import scored
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module", params=["helsinki", "story"])
def asked(request):
    case = load_scenario(SCENARIOS / f"{request.param}.toml")
    information = scored(case)
    design = designed(case, information)
    return plan_problem(case, information, design), stated_accuracy(
        AccuracySettings(as_durations=True), design, case.vessel
    )


def test_runs_along_courses_tell_what_their_tracks_tell(asked):
    problem, _ = asked
    courses, told = np.array([0.3, 2.0]), []
    for run in problem.primitives:
        heading = courses - np.arctan2(run.displacement[1], run.displacement[0])
        tracks = [
            simulate(
                problem.vessel, run.commands, pose=np.array([0.0, 0.0, psi]), velocity=run.entry_velocity,
                environment=problem.environment, standing=run.entry_inputs,
            )
            for psi in heading
        ]  # fmt: skip
        leg = Leg(kind="primitive", name=run.name, first=0, last=len(run.commands))
        sailed = [SailedTrial(commands=run.commands, trajectory=track, legs=(leg,)) for track in tracks]
        told.append(
            np.mean(
                [
                    track_information(problem.vessel, problem.design.problem, problem.environment, one)[0]
                    for one in sailed
                ],
                axis=0,
            )
        )
    for expected, found in zip(told, runs_along(problem, courses), strict=True):
        size = np.sqrt(np.maximum(np.diag(expected), np.finfo(float).tiny))
        assert np.abs((found - expected) / np.outer(size, size)).max() < 1e-9


def test_the_tangent_of_the_accuracy_bounds_it_beside_an_unknown_current(asked):
    problem, accuracy = asked
    runs, rng = runs_along(problem, np.array([0.0, 2.0, 4.0])), np.random.default_rng(1)
    middle = 3.0 * runs.sum(axis=0)
    slope, margin = accuracy.supergradient(middle), accuracy.margin(middle)
    assert len(middle) == len(accuracy.prior) + 2
    for run in runs:
        step = 1e-5 * run
        change = accuracy.margin(middle + step) - accuracy.margin(middle - step)
        assert change / 2 == pytest.approx(float(np.sum(slope * step)), rel=1e-4)
    for _ in range(20):
        other = np.tensordot(rng.exponential(3.0, len(runs)), runs, axes=1)
        assert accuracy.margin(other) <= margin + float(np.sum(slope * (other - middle))) + 1e-9


def test_courses_are_those_of_the_way(asked):
    problem, _ = asked
    straight = np.arctan2(*(problem.goal - problem.start)[[1, 0]])
    assert np.mean(straight_courses(problem)) == pytest.approx(straight)
    angle = np.linspace(0.0, np.pi / 2, 401)
    quarter = np.column_stack([100 * np.sin(angle), 100 * (1 - np.cos(angle)), angle])
    track = Trajectory(sample_time_s=1.0, pose=quarter, velocity=np.zeros((401, 3)))
    count = len(courses_of(track))
    assert courses_of(track) == pytest.approx((np.arange(count) + 0.5) * np.pi / 2 / count, abs=1e-6)
