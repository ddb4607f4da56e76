"""Who follows the advice of a refusal to the letter is not refused for the same reason again.

Each case is refused, takes the one key that the message names with the value it names, and is planned once more.
"""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from expdesign.errors import NoPlan
from expdesign.plan import PlanSettings, checked, remedies, remedy_changes, sailing, solve
from expdesign.plan.assembly import check_connected, leg_water, plan_room, search_space, ship_on_legs
from expdesign.plan.feasibility import place_of
from expdesign.plan.legs import LegWater, escapes
from expdesign.plan.legs.water import check_ends
from expdesign.plan.local_planner import local_planner
from expdesign.plan.local_planner.agile import AgilePlanner
from expdesign.plan.remedies import REMEDY_WORK, REPLANS, advised
from expdesign.plan.runs import draws_for
from expdesign.plan.solve import plan_trial
from expdesign.plan.values import PlanProblem, WorkBudget
from expdesign.progress import silent
from expdesign.scenario import load_scenario
from expdesign.simulation import CALM, Environment
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.planned import plan_problem
from expdesign.workflows.steps.scored import scored
from helm_case import catamaran
from plan_case import acceleration, area, ship
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")

WIDE = shapely.box(-400, -400, 400, 400)


def problem(
    water: shapely.Geometry, *, start=(0.0, -200.0, 0.0), goal=(0.0, 200.0, 0.0), runs=1, environment=CALM, **wishes
) -> PlanProblem:
    """Some runs in a water, between two berths."""
    vessel = ship()
    return PlanProblem(
        vessel=vessel,
        area=area(water),
        environment=environment,
        settings=PlanSettings(**wishes),
        primitives=(acceleration(vessel, speed_mps=1.0),),
        design=SimpleNamespace(problem=SimpleNamespace(names=("go",)), repeats=(runs,)),
        start=np.array(start),
        goal=np.array(goal),
    )


@pytest.fixture(autouse=True)
def plans_end_with_their_checks(monkeypatch):
    """A plan that passes verification and trials is represented by its track."""
    monkeypatch.setattr(solve, "_plan", lambda problem, sailed, **rest: sailed.trajectory)


def refusal(case: PlanProblem) -> str:
    with pytest.raises(NoPlan) as caught:
        plan_trial(case)
    return str(caught.value)


def setting(text: str, key: str) -> float:
    """The value that a message gives a key."""
    found = re.search(rf"with plan\.{key} = ([\d.e+-]+\d)", text)
    assert found is not None, text
    return float(found[1])


def changed(case: PlanProblem, **settings) -> PlanProblem:
    return replace(case, settings=replace(case.settings, **settings))


def gap(half_m: float) -> shapely.Geometry:
    return WIDE.difference(shapely.box(-10, -400, 10, -half_m).union(shapely.box(-10, half_m, 10, 400)))


@pytest.mark.thorough
def test_the_clearance_named_for_a_narrow_passage_leads_through_it():
    case = problem(gap(24.0), clearance_m=25.0)
    text = refusal(case)
    assert "the widest passage leaves" in text
    assert 0 < setting(text, "clearance_m") < 25.0
    plan_trial(changed(case, clearance_m=setting(text, "clearance_m")))


@pytest.mark.thorough
def test_the_clearance_named_for_a_run_without_a_place_gives_it_one():
    pool = problem(shapely.box(-90, -90, 90, 90), start=(0.0, -5.0, 0.0), goal=(0.0, 5.0, 0.0), clearance_m=65.0)
    certain = replace(pool.vessel.model, parameter_std=np.zeros(len(pool.vessel.model.names)))
    case = replace(pool, vessel=replace(pool.vessel, model=certain))
    text = refusal(case)
    assert text.startswith("no room for 'go'")
    followed = changed(case, clearance_m=setting(text, "clearance_m"))
    water = leg_water(followed, ship_on_legs(followed))
    search_space(followed, water, local_planner(water, followed.used))  # no longer refused
    plan_trial(followed)


@pytest.mark.thorough
def test_a_goal_that_land_cuts_off_comes_with_the_nearest_one_that_can_be_reached():
    case = problem(gap(-1.0))
    text = refusal(case)
    north, east = re.search(r"north_m = (-?[\d.]+), east_m = (-?[\d.]+)", text).groups()
    moved = replace(case, goal=np.array([float(north), float(east), 0.0]))
    check_connected(moved)
    plan_trial(moved)


@pytest.mark.slow
def test_the_confidence_named_where_it_cannot_be_estimated_can_be():
    case = problem(WIDE, confidence=0.99999)
    text = refusal(case)
    assert "too high to be estimated" in text
    plan_trial(changed(case, confidence=setting(text, "confidence")))


@pytest.mark.thorough
def test_the_speed_named_against_a_current_overcomes_it():
    stream = Environment(current_to=np.array([0.0, 0.5]))
    case = problem(WIDE, environment=stream, transit_speed_mps=0.4)
    text = refusal(case)
    assert "without plan.transit_speed_mps the vessel is capable" in text
    plan_trial(changed(case, transit_speed_mps=None))


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{"transit_speed_mps": 50.0}, {"turning_radius_m": 1.0}])
def test_without_a_speed_or_a_radius_beyond_the_ship_there_is_a_plan(settings):
    case = problem(WIDE, **settings)
    ((key, _),) = settings.items()
    assert f"without plan.{key} the vessel is capable" in refusal(case)
    plan_trial(changed(case, **{key: None}))


def test_the_heading_named_for_a_berth_leads_out_of_it():
    vessel = catamaran()
    base = problem(WIDE, clearance_m=0.5)
    radius = ship_on_legs(replace(base, vessel=vessel)).turning_radius_m
    bay = shapely.box(-8 * radius, 0, 8 * radius, 8 * radius)
    slip = bay.union(shapely.box(-0.6 * radius, -4 * radius, 0.6 * radius, 0.1))
    into = np.array([-2 * radius, 0.0, np.pi])
    case = replace(base, vessel=vessel, area=area(slip), start=into, goal=into)
    water = leg_water(case, ship_on_legs(case))
    with pytest.raises(NoPlan) as caught:
        check_ends(case.start, case.goal, water)
    text = str(advised(case, caught.value))
    heading = np.radians(float(re.search(r"start\.heading_deg = (\d+)", text)[1]))
    assert escapes(np.array([*into[:2], heading]), water)


def test_a_run_without_a_place_is_refused_before_anything_is_searched_and_one_with_a_place_is_not():
    for half_m, fits in ((35.0, False), (300.0, True)):
        case = problem(shapely.box(-half_m, -half_m, half_m, half_m), start=(0.0, -5.0, 0.0), goal=(0.0, 5.0, 0.0))
        water = leg_water(case, ship_on_legs(case))
        if fits:
            space = plan_room(case, water, silent).space
            assert place_of(space, 0).pose is not None
        else:
            with pytest.raises(NoPlan, match="fits nowhere"):
                plan_room(case, water, silent)


@pytest.mark.slow
def test_the_clearance_named_where_no_leg_is_found_is_one_with_which_runs_are_sailed(monkeypatch):
    leg = AgilePlanner.leg
    monkeypatch.setattr(AgilePlanner, "leg", lambda self, task, water: leg(self, task, water) if wide(water) else None)

    def wide(water: LegWater) -> bool:
        return water.clearance_m < 0.8

    case = problem(WIDE, clearance_m=1.0, time_budget_s=5.0)
    text = refusal(case)
    assert "places were tried: no leg leads to 'go'" in text
    assert "every run is sailed" in text
    assert "not tried: more plan.time_budget_s" in text
    plan_trial(changed(case, clearance_m=setting(text, "clearance_m")))


@pytest.mark.slow
def test_the_seed_named_where_verification_fails_gives_a_plan_that_passes(monkeypatch):
    verify, asked = checked.verify_plan, []

    def first_fails(*what, **how):
        found = verify(*what, **how)
        asked.append(found)
        return replace(found, problems=("planted",)) if len(asked) == 1 else found

    monkeypatch.setattr(checked, "verify_plan", first_fails)
    case = problem(WIDE)
    text = refusal(case)
    assert "does not pass its own verification: planted" in text
    seed = int(re.search(r"with --seed (\d+) the plan passes its verification", text)[1])
    plan_trial(replace(case, seed=seed))


@pytest.fixture(scope="module")
def story() -> PlanProblem:
    case = load_scenario(SCENARIOS / "story.toml")
    information = scored(case)
    return plan_problem(case, information, designed(case, information))


def in_current(case: PlanProblem, std_mps: float) -> PlanProblem:
    return replace(case, environment=replace(case.environment, current_std_mps=std_mps))


@pytest.mark.slow
def test_the_forecast_named_where_most_trials_are_aborted_is_one_with_which_the_plan_is_accepted(story):
    """With a current so uncertain, more than half of the ships do not get to the first runs in time."""
    text = refusal(in_current(story, 1.4))
    assert "were aborted because a run could not be begun" in text
    std_mps = float(
        re.search(r"with environment\.current_to\.std_mps = ([\d.]+) \(a better forecast\) drawn trials accept", text)[
            1
        ]
    )
    assert std_mps == pytest.approx(0.7)
    plan_trial(in_current(story, std_mps))


def test_what_is_named_where_trials_are_aborted_is_what_they_accept(monkeypatch, story):
    whole = in_current(story, 1.4)
    monkeypatch.setattr(remedies, "first_sailed", lambda other, budget: ())
    refused = {"what": "risk", "which": "deceleration"}

    monkeypatch.setattr(remedies, "accepted", lambda other, budget: other.repeats["deceleration"] == 0)
    text = str(advised(whole, NoPlan("too risky", **refused)))
    assert text == 'too risky; with design.excluded = ["deceleration"] drawn trials accept the plan'
    monkeypatch.setattr(remedies, "accepted", lambda other, budget: other.environment.current_std_mps < 1.0)
    forecast = "environment.current_to.std_mps = 0.7 (a better forecast)"
    text = str(advised(whole, NoPlan("too risky", **refused)))
    assert text == f"too risky; with {forecast} drawn trials accept the plan"
    monkeypatch.setattr(remedies, "accepted", lambda other, budget: False)
    text = str(advised(whole, NoPlan("too risky", **refused)))
    assert text == f'too risky; no single change of those tried helps ({forecast}, design.excluded = ["deceleration"])'
    known = in_current(story, 0.0)
    text = str(advised(known, NoPlan("too risky", what="risk", which="goal")))
    assert text == "too risky; no remedy could be checked"


def too_risky(case: PlanProblem, plans: int, *, elsewhere: bool = True, aborted: float = 0.0) -> NoPlan:
    """A refusal after so many plans, of which the first would have met a lower confidence."""
    error = NoPlan("too risky", what="risk", which="deceleration")
    error.confidence, error.tried = 0.8, ("a plan",) * plans
    water = leg_water(case, ship_on_legs(case))
    error.plan = SimpleNamespace(
        sailed="",
        water=water,
        spent_s=PLAN_S,
        promises=lambda name, confidence: elsewhere,
        risk=SimpleNamespace(aborted=aborted),
    )
    return error


PLAN_S = 100.0


@pytest.fixture
def made(monkeypatch):
    """The problems planned in while looking for remedies, none of which are accepted; each takes the refused work."""
    planned = []

    def first(other, budget):
        planned.append(other)
        budget.spent_s += PLAN_S
        return (), ()

    monkeypatch.setattr(remedies, "first_sailed", first)
    monkeypatch.setattr(remedies, "promising", lambda other, water, sailed, budget: False)
    monkeypatch.setattr(remedies, "accepted", lambda other, *_, budget: False)
    return planned


@pytest.mark.parametrize("helps", [True, False])
def test_a_lower_confidence_is_named_if_a_plan_made_with_it_is_accepted(monkeypatch, story, made, helps):
    case = in_current(story, 1.4)
    monkeypatch.setattr(remedies, "accepted", lambda other, *_, budget: helps and other.settings.confidence == 0.8)
    text = str(advised(case, too_risky(case, 3)))
    assert [other.settings.confidence for other in made] == [0.8]
    assert ("with plan.confidence = 0.8 drawn trials accept the plan" in text) == helps
    assert "not tried" not in text
    assert helps or re.search(r"no single change of those tried helps \(.*plan\.confidence = 0\.8", text)


def test_no_plan_is_made_in_a_forecast_in_which_the_refused_one_fails_too(monkeypatch, story, made):
    case, judged = in_current(story, 1.4), []

    def likely(other, water, sailed, budget):
        judged.append((other.environment.current_std_mps, water.environment is other.environment))
        return False

    monkeypatch.setattr(remedies, "promising", likely)
    text = str(advised(case, too_risky(case, 1)))
    assert judged == [(0.7, True)]
    assert [other.environment.current_std_mps for other in made] == [1.4] * len(made)
    assert "environment.current_to.std_mps = 0.7 (a better forecast)" in text


@pytest.mark.parametrize(("aborted", "tried"), [(0.2, True), (0.05, False)])
def test_wider_tolerances_are_tried_first_where_too_many_trials_are_aborted(monkeypatch, story, made, aborted, tried):
    case = in_current(story, 1.4)

    def likely(other, water, sailed, budget):
        return other.settings.start_tolerance == water.start_tolerance == 4.0

    monkeypatch.setattr(remedies, "promising", likely)
    monkeypatch.setattr(remedies, "accepted", lambda other, *_, budget: other.settings.start_tolerance == 4.0)
    text = str(advised(case, too_risky(case, 1, aborted=aborted)))
    assert ("with plan.start_tolerance = 4 drawn trials accept the plan" in text) == tried
    assert [other.settings.start_tolerance for other in made][:1] == [4.0 if tried else case.settings.start_tolerance]


@pytest.mark.parametrize("plans", [1, 2, 3])
def test_a_refusal_makes_no_more_plans_than_a_trial_may_take_and_says_each_before(monkeypatch, story, plans):
    case, told, said = in_current(story, 1.4), [], []
    monkeypatch.setattr(remedies, "first_sailed", lambda other, budget: said.append(told[-1]) or ((), ()))
    monkeypatch.setattr(remedies, "promising", lambda other, water, sailed, budget: True)
    monkeypatch.setattr(remedies, "accepted", lambda other, *_, budget: False)
    advised(case, too_risky(case, plans), lambda activity, share: told.append(activity))
    assert "too risky" in told[0]
    assert 1 <= len(said) <= max(1, REPLANS + 1 - plans)
    assert "std_mps = 0.7" in said[0]
    assert len(set(said)) == len(said)


@pytest.mark.parametrize("spent", [0.0, 0.7, 0.8])
def test_no_plan_is_begun_for_which_no_work_is_left_and_the_refusal_names_it(monkeypatch, story, made, spent):
    """Of `REMEDY_WORK` times the refused plan, a plan takes one, and drawn trials in a forecast what is spent."""
    case, refused = in_current(story, 1.4), too_risky(in_current(story, 1.4), 1)
    refused.confidence = None

    def likely(other, water, sailed, budget):
        budget.spent_s += spent * PLAN_S
        return False

    monkeypatch.setattr(remedies, "promising", likely)
    text = str(advised(case, refused))
    fits = 1.0 + spent <= REMEDY_WORK
    assert len(made) == fits
    assert ("as much work as planning: design.excluded with deceleration" in text) != fits


@pytest.mark.parametrize(("spent", "plans"), [(0.7, 2), (0.8, 1)])
def test_where_legs_fail_no_plan_is_begun_for_which_no_work_is_left(monkeypatch, story, spent, plans):
    made = []

    def failed(other, budget):
        made.append(other)
        budget.spent_s += spent * PLAN_S

    monkeypatch.setattr(remedies, "first_sailed", failed)
    refused = NoPlan("no leg leads on", what="sailing", which="deceleration")
    refused.spent_s = PLAN_S
    text = str(advised(story, refused))
    assert len(made) == plans
    assert ('as much work as planning: design.excluded = ["deceleration"]' in text) == (plans == 1)


def test_a_refusal_where_legs_fail_tells_the_work_that_it_took(monkeypatch, story):
    def failed(voyage, *_):
        voyage.budget.optimised(1000, 100)
        raise NoPlan("no leg leads on", what="sailing")

    monkeypatch.setattr(sailing, "_sailed", failed)
    budget, water = WorkBudget(), leg_water(story, ship_on_legs(story))
    room = SimpleNamespace(water=water, space=SimpleNamespace(planner=None))
    with pytest.raises(NoPlan) as refused:
        sailing.sail_all(story, room, silent, stated=water, budget=budget)
    assert refused.value.spent_s == budget.spent_s > 0


def test_no_design_is_made_without_a_run_where_the_rest_of_the_refused_plan_fails_too(monkeypatch, story, made):
    monkeypatch.setattr(remedy_changes, "solve_durations", lambda task: pytest.fail("a design is made"))
    case = in_current(story, 0.0)
    refused = too_risky(case, 1, elsewhere=False)
    refused.confidence = None
    text = str(advised(case, refused))
    assert not made
    assert "design.excluded with deceleration: too many drawn trials fail elsewhere" in text


def test_no_forecast_of_a_wind_that_moves_no_ship_is_asked_for(story, made):
    case = replace(story, environment=replace(story.environment, current_std_mps=0.0, wind_std_mps=2.0))
    assert not case.vessel.model.reads_air
    assert "wind" not in str(advised(case, too_risky(case, 1)))


def test_a_thousand_runs_can_be_planned_for_at_the_usual_confidence():
    assert draws_for(1.0 - (1.0 - PlanSettings.confidence) / 1000) * (1.0 - PlanSettings.confidence) / 1000 >= 1.0


def refused(number: int, left: float) -> SimpleNamespace:
    """A plan that is too risky, all of whose entries say which one it is."""
    trajectory = SimpleNamespace(pose=np.full((3, 3), float(number)))
    return SimpleNamespace(
        sailed=SimpleNamespace(trajectory=trajectory, legs=()),
        risk=SimpleNamespace(left=left, error=0.01),
        trials=None,
        failed=f"plan {number} fails near {number}",
        place=np.full(2, float(number)),
        worst=f"run {number}",
    )


def test_words_mark_and_track_of_a_refusal_are_of_one_plan() -> None:
    made = [refused(1, 0.9), refused(2, 0.7), refused(3, 0.8)]
    problem = SimpleNamespace(settings=SimpleNamespace(confidence=0.95))
    error = solve.too_risky(problem, None, made)
    assert "plan 2 fails near 2" in error.obstacle
    assert error.place == (2.0, 2.0)
    assert error.which == "run 2"
    assert (error.poses == 2.0).all()
    again = solve.not_again(NoPlan("no path"), made[:1])
    assert "plan 1 fails near 1" in again.obstacle
    assert again.place == (1.0, 1.0)
    assert (again.poses == 1.0).all()
