"""Where too many drawn trials leave the water, the planner replans with more room, or names the place in its refusal.

Where too many are aborted, it plans once more with more room for the run that they could not begin.

The strait is as wide as the ship needs where she points along it. In an unknown current she has to point
aside to go straight, and her bow comes nearer to the rocks than a plan can tell.
"""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from expdesign.errors import NoPlan
from expdesign.plan import PlanSettings, drafts, solve
from expdesign.plan.solve import plan_trial
from expdesign.plan.values import PlanProblem
from expdesign.simulation import Environment
from plan_case import acceleration, area, place_in, ship

STRAIT_M, GAP_M, ASIDE_M = 250.0, 9.0, 160.0
"""How far north the strait is, half its width, and how far east of it a wide one is."""
UNKNOWN = Environment(current_std_mps=0.25)


def problem(*gaps: tuple[float, float]) -> PlanProblem:
    """A run and a passage north through a wall with gaps, each (east, half its width) [m]."""
    wall = shapely.box(-200, STRAIT_M - 5, 400, STRAIT_M + 5)
    for east, half in gaps:
        wall = wall.difference(shapely.box(east - half, STRAIT_M - 10, east + half, STRAIT_M + 10))
    vessel = ship()
    return PlanProblem(
        vessel=vessel,
        area=area(shapely.box(-200, -150, 400, 420).difference(wall)),
        environment=UNKNOWN,
        settings=PlanSettings(clearance_m=1.0),
        primitives=(acceleration(vessel),),
        design=SimpleNamespace(problem=SimpleNamespace(names=("go",)), repeats=(1,)),
        start=np.array([0.0, 0.0, 0.0]),
        goal=np.array([340.0, 0.0, 0.0]),
    )


@pytest.fixture
def attempts(monkeypatch):
    """Risk estimates, attempt after attempt; a plan is represented by its track."""
    found = []

    def noted(risk, *others, **known):
        found.append(risk)
        return checked(risk, *others, **known)

    checked = solve.failed_chance_constraint
    monkeypatch.setattr(solve, "failed_chance_constraint", noted)
    monkeypatch.setattr(solve, "_plan", lambda problem, sailed, **rest: sailed.trajectory)
    return found


def crossing_m(track) -> float:
    """How far east a track goes through the wall."""
    return float(np.interp(STRAIT_M, track.pose[:, 0], track.pose[:, 1]))


@pytest.mark.thorough
def test_a_wider_passage_is_taken_where_too_many_trials_leave_the_direct_one_whatever_the_work_budget(attempts):
    case = problem((0.0, GAP_M), (ASIDE_M, 45.0))
    track = plan_trial(replace(case, settings=replace(case.settings, time_budget_s=0.1)))
    first, last = attempts
    assert first.left > 0.05
    assert first.legs[-1].left == max(leg.left for leg in first.legs)
    assert last.left + last.error <= 0.05
    assert abs(crossing_m(track) - ASIDE_M) < 45.0


def test_with_known_weather_the_direct_passage_meets_the_chance_constraint(attempts):
    calm = problem((0.0, GAP_M), (ASIDE_M, 45.0))
    certain = replace(calm.vessel.model, parameter_std=np.zeros(len(calm.vessel.model.names)))
    track = plan_trial(replace(calm, environment=Environment(), vessel=replace(calm.vessel, model=certain)))
    assert [found.left for found in attempts] == [0.0]
    assert abs(crossing_m(track)) < GAP_M


@pytest.mark.thorough
def test_without_a_wider_passage_the_refusal_names_the_share_the_leg_and_the_place(attempts):
    with pytest.raises(NoPlan) as caught:
        plan_trial(problem((0.0, GAP_M)))
    text = str(caught.value)
    share = f"{attempts[0].left:.1%} of {attempts[0].trials} drawn trials"
    assert text.startswith(f"the plan found is too risky: {share}")
    assert "on the leg to the goal" in text
    np.testing.assert_allclose(place_in(text), [STRAIT_M, 0.0], atol=30.0)
    assert "there is no path to the goal with more clearance; " in text
    named = re.search(
        r"with environment\.current_to\.std_mps = ([\d.]+\d) \(a better forecast\) drawn trials accept", text
    )
    assert named is not None, text
    case = problem((0.0, GAP_M))
    plan_trial(replace(case, environment=replace(case.environment, current_std_mps=float(named[1]))))


@pytest.mark.slow
def test_where_runs_have_the_same_room_the_confidence_named_accepts_the_first_plan(attempts):
    case = problem((0.0, 9.2))  # a short run does not stray as far as the clearance
    case = replace(
        case,
        primitives=(acceleration(case.vessel, duration_s=3.0),),
        environment=Environment(current_std_mps=0.5),
        settings=replace(case.settings, clearance_m=1.6),
    )
    with pytest.raises(NoPlan) as caught:
        plan_trial(case)
    text = str(caught.value)
    named = re.search(r"with plan\.confidence = ([\d.]+\d) the first plan is made once more, and accepted", text)
    assert named is not None, text
    plan_trial(replace(case, settings=replace(case.settings, confidence=float(named[1]))))
    assert attempts[-1].left == attempts[0].left


@pytest.mark.parametrize(
    ("shares", "worst", "rooms", "taken"),
    [
        ((0.3, 0.02), 0, [1.0, solve.WIDENING], 0.02),  # of the first plan, of the second
        ((0.3, 0.4), 0, [1.0, solve.WIDENING], 0.3),
        ((0.05,), 0, [1.0], 0.05),  # few enough
        ((0.3,), 2, [1.0], 0.3),  # the goal has no room to be widened
    ],
)
def test_where_too_many_trials_are_aborted_their_run_gets_more_room_once(monkeypatch, shares, worst, rooms, taken):
    rooms_m, risks, sail_all, drawn_risk = [], list(shares), solve.sail_all, solve.drawn_risk

    def sailed(problem, room, *others, **known):
        rooms_m.append(float(np.mean(room.space.footprints[0].room_m)))
        return sail_all(problem, room, *others, **known)

    def drawn(*others, **known):
        risk, trials = drawn_risk(*others, **known)
        aborted = np.zeros_like(trials.aborted)
        aborted[worst, :10] = True
        return replace(risk, aborted=risks.pop(0), reasons=("somewhere",)), replace(trials, aborted=aborted)

    monkeypatch.setattr(drafts, "sail_all", sailed)
    monkeypatch.setattr(solve, "sail_all", sailed)
    monkeypatch.setattr(solve, "drawn_risk", drawn)
    monkeypatch.setattr(solve, "_plan", lambda problem, sailed, **rest: SimpleNamespace(**rest))
    monkeypatch.setattr(solve, "_bound_s", lambda *_: 0.0)
    calm = replace(problem((0.0, 60.0)), environment=Environment())
    assert plan_trial(calm).risk.aborted == taken
    np.testing.assert_allclose(np.array(rooms_m) / rooms_m[0], rooms)
    assert not risks
