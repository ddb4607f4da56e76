"""Work is counted, the same on every machine: a leg and joints that would cost more than there is are given up."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from expdesign.errors import NoPlan
from expdesign.plan import PlanSettings
from expdesign.plan.legs import LegTask
from expdesign.plan.local_planner import TransitionTrials
from expdesign.plan.local_planner.agile import AgilePlanner
from expdesign.plan.solve import draft_trial, plan_trial
from expdesign.plan.values import PlanProblem, WorkBudget
from expdesign.simulation import CALM
from plan_case import acceleration, area, at_rest, find_leg, leg_water, primitive, ship, space_of


@pytest.fixture(scope="module")
def water():
    return leg_water(shapely.box(-400, -400, 400, 400))


def task(end: np.ndarray) -> LegTask:
    return LegTask(start=at_rest(0, 0, 0.0), end=end, start_inputs=np.zeros(4), end_inputs=np.zeros(4), seed=1)


def test_the_same_leg_costs_the_same_each_time(water):
    spent = []
    for _ in range(2):
        asked = replace(task(at_rest(30, 60, 2.0)), budget=WorkBudget())
        assert find_leg(asked, water) is not None
        spent.append(asked.budget.spent_s)
    assert spent[0] == spent[1] > 0.0


@pytest.mark.thorough
def test_a_leg_that_cannot_be_sailed_costs_no_more_than_it_may(water):
    ends = at_rest(15, 0, 0.0) + np.array([0.0, 0.0, 0.0, -3.0, 3.0, 0.0])  # faster sideways than the ship can go
    much, little = (replace(task(ends), budget=WorkBudget(most_s=most_s)) for most_s in (2.0, 0.2))
    for asked in (much, little):
        assert find_leg(asked, water) is None
        assert asked.budget.exhausted
    assert little.budget.spent_s < much.budget.spent_s / 2


def test_transitions_are_left_to_the_rule_when_there_is_nothing_left_to_spend(water):
    go = primitive(water.vessel)
    space, spent = space_of(water, go, np.array([0.0, 300.0, 0.0])), WorkBudget(most_s=1.0)
    spent.optimised(iterations=100, samples=100)
    assert spent.exhausted
    rest = np.zeros(3), np.zeros(len(water.vessel.limits))
    trials = TransitionTrials(
        water=water, primitives={"go": go}, start=np.zeros(3), under_way=rest, made_good=True, budget=spent
    )
    found = space.planner.with_transitions(space, [("go", "go")], trials)
    assert found.tried == space.tried


def accelerations(count: int, planner: str = "beam") -> PlanProblem:
    """So many runs in open water, on the way to a goal 200 m to the north."""
    vessel = ship()
    go = acceleration(vessel)
    return PlanProblem(
        vessel=vessel,
        area=area(shapely.box(-300, -300, 300, 300)),
        environment=CALM,
        settings=PlanSettings(clearance_m=1.0, time_budget_s=20.0, planner=planner),
        primitives=(go,),
        design=SimpleNamespace(problem=SimpleNamespace(names=(go.name,)), repeats=(count,)),
        start=np.zeros(3),
        goal=np.array([200.0, 0.0, 0.0]),
    )


@pytest.mark.thorough
@pytest.mark.parametrize("planner", ["beam", "lattice"])
@pytest.mark.parametrize(("leg_s", "tries"), [(0.0, 11), (8.0, 3)])  # 2 s each at least: 11 x 2, or 3 x 8, pass 20
def test_a_search_that_is_stuck_ends_when_its_budget_is_worked_off_not_by_a_clock(monkeypatch, planner, leg_s, tries):
    def nowhere(planner, asked: LegTask, water) -> None:
        asked.budget.spent_s += leg_s

    monkeypatch.setattr(AgilePlanner, "leg", nowhere)
    with pytest.raises(NoPlan, match=f"time_budget_s = 20, {tries} places were tried: no leg leads to 'go' near 60"):
        plan_trial(accelerations(1, planner))


@pytest.mark.thorough
def test_a_run_from_which_no_leg_leads_on_is_placed_elsewhere(monkeypatch):
    found, begins, trapped = AgilePlanner.leg, [], []

    def with_a_trap(planner, asked: LegTask, water):
        """Legs, but none from where the run first placed ends."""
        if begins and not trapped and np.any(asked.start != begins[0]):
            trapped.append(asked.start[:2])
        begins.append(asked.start)
        from_trap = trapped and np.hypot(*(asked.start[:2] - trapped[0])) < 1.0
        return None if from_trap else found(planner, asked, water)

    monkeypatch.setattr(AgilePlanner, "leg", with_a_trap)
    sailed = draft_trial(accelerations(3)).sailed
    assert trapped
    assert [leg.name for leg in sailed.legs if leg.kind == "primitive"] == ["go"] * 3
