"""What the search for manoeuvres does not depend on makes no scenario search anew, and shared results are the same."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from expdesign.growing import GrowSettings
from expdesign.growing.search import LEADERS, OFFSPRING, STRIDES, Measure
from expdesign.memory import Memory, remembering
from expdesign.scenario import load_scenario
from expdesign.shortest_day import AccuracySettings, values
from expdesign.shortest_day.values import DRAFT_POOL, DRAFT_SEARCHES
from expdesign.workflows.steps import day
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.scored import scored
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")

STORY = SCENARIOS / "story.toml"
POOL = 8


@pytest.fixture
def evaluated(monkeypatch):
    """Number of candidates in each batch simulated."""
    counts, plain = [], Measure.of_one_duration
    monkeypatch.setattr(Measure, "of_one_duration", lambda self, specs: counts.append(len(specs)) or plain(self, specs))
    return counts


def asking(**accuracy):
    """The story's scenario, asking for an accuracy, with few candidates."""
    case = load_scenario(STORY)
    grow = GrowSettings(pool=POOL, families=("multisine",), run_s=60.0)
    return replace(
        case, design=replace(case.design, accuracy=AccuracySettings(as_durations=True, **accuracy), grow=grow)
    )


def found(case, monkeypatch):
    """The manoeuvres that a scenario's search adds."""
    with monkeypatch.context() as patch:
        added, plain = [], day._added
        patch.setattr(day, "_added", lambda *arguments: added.append(plain(*arguments)))
        information = scored(case)
        day.search_additions(case, information, designed(case, information))
    return added[0]


@pytest.mark.thorough
@pytest.mark.parametrize("settings", [{"clearance_m": 35.0}, {"confidence": 0.8}])
def test_other_settings_of_the_plan_take_over_the_search(tmp_path, monkeypatch, evaluated, settings):
    with remembering(Memory(tmp_path)):
        first = found(asking(), monkeypatch)
        assert first
        assert sum(evaluated) > 0
        evaluated.clear()
        case = asking()
        assert found(replace(case, plan=replace(case.plan, **settings)), monkeypatch) == first
    assert not evaluated


def test_a_draft_looks_at_fewer_candidates_and_says_so(monkeypatch, evaluated):
    case = asking()
    case = replace(case, design=replace(case.design, grow=replace(case.design.grow, pool=4 * POOL)))
    found(case, monkeypatch)
    whole = sum(evaluated)
    evaluated.clear()
    found(replace(case, plan=replace(case.plan, draft=True)), monkeypatch)
    steps = LEADERS * OFFSPRING * len(STRIDES)
    assert 0 < sum(evaluated) <= DRAFT_POOL + DRAFT_SEARCHES * steps < whole / 2
    plans = (SimpleNamespace(draft=draft) for draft in (True, False))
    notes = [values.ShortestDay.note.fget(SimpleNamespace(plan=plan)) for plan in plans]
    assert f"{DRAFT_POOL} candidates of every family" in notes[0]
    assert notes[1] == ""


@pytest.mark.thorough
def test_another_speed_of_legs_is_another_search(tmp_path, monkeypatch, evaluated):
    with remembering(Memory(tmp_path)):
        found(asking(), monkeypatch)
        evaluated.clear()
        case = asking()
        found(replace(case, plan=replace(case.plan, transit_speed_mps=2.0)), monkeypatch)
    assert sum(evaluated) > 0


@pytest.mark.thorough
def test_another_accuracy_searches_among_the_same_candidates(tmp_path, monkeypatch, evaluated):
    longer = asking()
    longer = replace(longer, design=replace(longer.design, total_s=2 * longer.design.total_s))
    alone = found(longer, monkeypatch)
    anew = sum(evaluated)
    evaluated.clear()
    with remembering(Memory(tmp_path)):
        found(asking(), monkeypatch)
        evaluated.clear()
        assert found(longer, monkeypatch) == alone
    assert sum(evaluated) <= anew - POOL
