"""Runs that find no place do not end the search for the shortest day: others are tried."""

from types import SimpleNamespace

import pytest

from expdesign.errors import NoAnswer, NoPlan, NoRoom
from expdesign.scenario import load_scenario
from expdesign.shortest_day import AccuracySettings, alternate, drafting, shortest_day, stated_accuracy
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.planned import plan_problem
from expdesign.workflows.steps.scored import ready
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")

STORY = SCENARIOS / "story.toml"


class Found(Exception):
    """Ends the search where a day would be drafted."""


@pytest.fixture(scope="module")
def asked():
    case = load_scenario(STORY)
    information, _ = ready(case, seed=1)
    design = designed(case, information, seed=1)
    accuracy = stated_accuracy(AccuracySettings(as_durations=True), design, case.vessel)
    return plan_problem(case, information, design, seed=1), accuracy


def test_other_runs_are_tried_each_once(asked, monkeypatch):
    tried = []

    def refuse(problem, *, like, progress):
        tried.append(problem.design.repeats)
        if len(tried) == 3:
            raise Found
        raise NoPlan("no place for a run")

    monkeypatch.setattr(drafting, "draft_trial", refuse)
    with pytest.raises(Found):
        shortest_day(*asked)
    assert len(set(tried)) == 3


def test_where_no_day_has_a_plan_the_last_refusal_is_told(asked, monkeypatch):
    def refuse(problem, *, like, progress):
        raise NoPlan("no place for a run")

    monkeypatch.setattr(drafting, "draft_trial", refuse)
    monkeypatch.setattr(alternate, "ROUNDS", 2)
    with pytest.raises(NoPlan, match="no place for a run"):
        shortest_day(*asked)


def test_limits_that_allow_no_more_end_the_search_with_what_was_tried(asked, monkeypatch):
    problem, accuracy = asked
    answers = iter([alternate.cheapest_runs])

    def choose(*arguments, **options):
        for once in answers:
            return once(*arguments, **options)
        raise NoAnswer("no more runs are allowed")

    def refuse(problem, *, like, progress):
        raise NoPlan("no place for a run")

    monkeypatch.setattr(alternate, "cheapest_runs", choose)
    monkeypatch.setattr(drafting, "draft_trial", refuse)
    with pytest.raises(NoPlan, match="no place for a run"):
        shortest_day(problem, accuracy)


def test_a_run_without_any_place_is_not_chosen_again_and_costs_no_day(asked, monkeypatch):
    problem, accuracy = asked
    names, tried, rounds = problem.design.problem.names, [], 2

    def refuse(problem, *, like, progress):
        tried.append({name for name, count in zip(names, problem.design.repeats, strict=True) if count})
        if len(tried) > 2:
            raise NoPlan("no place for a run")
        error = NoRoom("no room for a run", what="room")
        error.lacking = (min(tried[-1]),)
        raise error

    monkeypatch.setattr(drafting, "draft_trial", refuse)
    monkeypatch.setattr(alternate, "ROUNDS", rounds)
    with pytest.raises(NoPlan, match="no place for a run"):
        shortest_day(problem, accuracy)
    assert len(tried) == 2 + rounds
    assert min(tried[0]) not in set().union(*tried[1:])
    assert min(tried[1]) not in set().union(*tried[2:])


@pytest.mark.parametrize(("what", "costs"), [("unstable", 0), ("sailing", 1)])
def test_a_run_that_cannot_be_sailed_is_not_chosen_again(asked, monkeypatch, what, costs):
    problem, accuracy = asked
    names, tried, rounds = problem.design.problem.names, [], 2

    def refuse(problem, *, like, progress):
        tried.append({name for name, count in zip(names, problem.design.repeats, strict=True) if count})
        if len(tried) > 1:
            raise NoPlan("no place for a run")
        raise NoPlan("a run cannot be sailed", what=what, which=min(tried[-1]))

    monkeypatch.setattr(drafting, "draft_trial", refuse)
    monkeypatch.setattr(alternate, "ROUNDS", rounds)
    with pytest.raises(NoPlan, match="no place for a run"):
        shortest_day(problem, accuracy)
    assert len(tried) == 1 + rounds - costs
    assert min(tried[0]) not in set().union(*tried[1:])


def test_a_remedy_is_looked_for_once_when_no_day_is_left(asked, monkeypatch):
    """Not for each day that is refused, as another may be planned."""
    problem, accuracy = asked
    search = alternate._Search(problem=problem, accuracy=accuracy, added=())
    days = [
        SimpleNamespace(repeats=problem.design.repeats, draft=SimpleNamespace(sailed=None, number=k)) for k in range(3)
    ]
    planned, advised = [], []

    def refuse(task, draft, *, progress):
        planned.append(draft.number)
        raise NoPlan(f"day {draft.number} is too risky")

    monkeypatch.setattr(alternate, "plan_drafted", refuse)
    monkeypatch.setattr(alternate, "with_advice", lambda task, error, progress: advised.append(str(error)) or error)
    with pytest.raises(NoPlan, match="day 2"):
        search.planned(days, days, None, lambda *_: None, good=lambda *_: True)
    assert planned == [0, 1, 2]
    assert advised == ["day 2 is too risky"]
