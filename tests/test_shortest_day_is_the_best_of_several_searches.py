"""Of several searches for the shortest day, the day is taken whose drawn trials end soonest."""

from dataclasses import make_dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

import expdesign.shortest_day
from expdesign.errors import InputError, NoAnswer, NoPlan
from expdesign.growing import GrowSettings
from expdesign.scenario import load_scenario
from expdesign.shortest_day import AccuracySettings
from expdesign.workflows.steps import day as step
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.scored import scored
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")

STORY = SCENARIOS / "story.toml"


def found(monkeypatch, *outcomes):
    """The day of searches that end so: a median, or a refusal."""

    def search(case, information, design, accuracy, stated, seed, start, progress):
        outcome = outcomes[start]
        if isinstance(outcome, Exception):
            raise outcome
        plan = SimpleNamespace(day=SimpleNamespace(median_s=outcome))
        return step.Day(information=(), design=design, plan=plan)

    monkeypatch.setattr(step, "_searched", search)
    return step._shortest_of(
        len(outcomes), (None, (), None, None, None, 0), lambda activity, share: None
    ).plan.day.median_s


def test_the_day_with_the_shortest_median_is_taken(monkeypatch):
    assert found(monkeypatch, 4541.0, 4427.0, 4600.0) == 4427.0


def test_searches_without_an_answer_or_a_trial_at_the_goal_are_passed_over(monkeypatch):
    assert found(monkeypatch, NoPlan("no place"), np.nan, 4427.0) == 4427.0


def test_where_none_has_an_answer_the_first_refusal_is_told(monkeypatch):
    with pytest.raises(NoAnswer, match="no place for a run"):
        found(monkeypatch, NoAnswer("no place for a run"), NoPlan("another"))


def test_searches_begin_with_other_candidates_and_the_first_with_those_of_the_seed(monkeypatch):
    case = load_scenario(STORY)
    case = replace(case, design=replace(case.design, accuracy=AccuracySettings(as_durations=True, starts=3)))
    seeds = []

    def grown(problem, accuracy, settings, day_s, *, progress):
        seeds.append(settings.seed)
        raise InputError("enough was seen")

    problem = make_dataclass("Problem", ["settings", "seed"])(None, 0)
    monkeypatch.setattr(expdesign.shortest_day, "manoeuvres_worth_adding", grown)
    for start in (0, 1, 2, 1):
        step._added(case, problem, None, (7, start), lambda activity, share: None)
    assert seeds[0] == 7
    assert len(set(seeds)) == 3
    assert seeds[1] == seeds[3]
    seeds.clear()
    case = replace(case, design=replace(case.design, grow=GrowSettings(seed=5)))
    for start in (0, 1):
        with pytest.raises(InputError, match="enough was seen"):
            step._added(case, problem, None, (7, start), lambda activity, share: None)
    assert seeds[0] == 5 != seeds[1]


def test_several_searches_reach_the_trial_and_each_is_made(monkeypatch):
    case = load_scenario(STORY)
    case = replace(case, design=replace(case.design, accuracy=AccuracySettings(as_durations=True, starts=2)))
    information = tuple(scored(case))
    made = []

    def search(case, information, design, accuracy, stated, seed, start, progress):
        made.append((seed, start))
        raise NoAnswer("enough was seen")

    monkeypatch.setattr(step, "_searched", search)
    with pytest.raises(NoAnswer, match="enough was seen"):
        step.planned_day(case, information, designed(case, information), seed=4)
    assert made == [(4, 0), (4, 1)]


def test_several_searches_without_manoeuvres_to_find_are_refused(tmp_path):
    text = STORY.read_text("utf-8").replace('"vessels/', f'"{STORY.parent}/vessels/')
    text = text.replace('"dictionaries/', f'"{STORY.parent}/dictionaries/').replace(
        '"areas/', f'"{STORY.parent}/areas/'
    )
    asked = '\n[design.accuracy]\nas = "durations"\ngrow = false\nstarts = 2\n'
    (tmp_path / "story.toml").write_text(text + asked, "utf-8")
    with pytest.raises(InputError, match=r"design\.accuracy\.starts: is 2 without a search for manoeuvres"):
        load_scenario(tmp_path / "story.toml")
