"""The time that a drafted day is expected to take, and the price of its runs, are those of drawn trials."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from expdesign.plan import PlanSettings
from expdesign.plan.checked import LATENESS_TRIALS, drawn_lateness_s
from expdesign.plan.control import capability
from expdesign.plan.monte_carlo import sail_trials
from expdesign.plan.solve import draft_trial
from expdesign.plan.values import PlanProblem
from expdesign.scenario import load_scenario
from expdesign.shortest_day.prices import LEAST_LEG_S, DraftedDay, _legs_s
from expdesign.simulation import Environment
from expdesign.workflows.steps.day import with_leg_speed
from plan_case import acceleration, area, ship
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def drafted() -> DraftedDay:
    """A day of two runs in an unknown current."""
    vessel = ship()
    problem = PlanProblem(
        vessel=vessel,
        area=area(shapely.box(-500, -500, 900, 900)),
        environment=Environment(current_std_mps=0.1),
        settings=PlanSettings(),
        primitives=(acceleration(vessel, speed_mps=1.0),),
        design=SimpleNamespace(problem=SimpleNamespace(names=("go",)), repeats=(2,)),
        start=np.zeros(3),
        goal=np.array([400.0, 200.0, 0.0]),
        expected=True,
    )
    draft = draft_trial(problem)
    day = DraftedDay(repeats=(2,), draft=draft, information=np.zeros((5, 1, 1)), margin=0.0)
    return day.late(drawn_lateness_s(replace(problem, area=draft.area), draft.water, draft.sailed))


@pytest.mark.thorough
def test_a_draft_is_expected_to_take_as_long_as_other_drawn_trials_of_it(drafted):
    draft = drafted.draft
    others = sail_trials(draft.water, draft.sailed, draws=400, rng=np.random.default_rng(5))
    taken = others.samples.sum(axis=0)[others.completed] * draft.sailed.commands.sample_time_s
    error = taken.std() * np.sqrt(1 / len(taken) + 1 / LATENESS_TRIALS)
    assert drafted.expected_s == pytest.approx(drafted.day_s + draft.late_s.sum())
    assert abs(drafted.expected_s - taken.mean()) < 4 * error


def test_a_run_costs_what_trials_lose_on_the_leg_to_it(drafted):
    legs = drafted.draft.sailed.legs
    to_run = next(k for k, leg in enumerate(legs) if leg.kind == "reposition")
    later = drafted.draft.late_s.copy()
    later[to_run] += 100.0
    slow = replace(drafted, draft=replace(drafted.draft, late_s=later))
    before, after = (_legs_s(("go",), [day], np.array([45.0])) for day in (drafted, slow))
    assert before[0] > LEAST_LEG_S
    assert after - before == pytest.approx(100.0 / 2)  # over both runs


def test_a_day_that_no_drawn_trial_ends_tells_what_runs_cost_as_planned(drafted):
    count = len(drafted.draft.sailed.legs)
    planned, lost = (_legs_s(("go",), [drafted.late(np.full(count, late))], np.array([45.0])) for late in (0.0, np.inf))
    assert lost == pytest.approx(planned)


def test_legs_are_faster_than_usual_only_where_no_speed_is_stated():
    case = load_scenario(SCENARIOS / "story.toml")
    usual = capability(case.vessel, case.plan)
    faster = capability(case.vessel, with_leg_speed(case))
    assert usual.transit_speed_mps < faster.transit_speed_mps < faster.top_speed_mps == usual.top_speed_mps
    stated = replace(case, plan=replace(case.plan, transit_speed_mps=1.0))
    assert with_leg_speed(stated).transit_speed_mps == 1.0
