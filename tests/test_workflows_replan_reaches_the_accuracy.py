"""The rest of a trial that asks for an accuracy or a length of the day."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.errors import InputError
from expdesign.scenario import load_scenario
from expdesign.shortest_day import AccuracySettings, stated_accuracy
from expdesign.workflows.commands.replan import _stated_before
from expdesign.workflows.steps import day
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.present import PresentState, _left, present_state, rest_of
from expdesign.workflows.steps.scored import scored
from replan_case import SAMPLES, STORY, measured


def shortest_day_so_far(folder: Path, remaining_s: float | None = None, **asked_of_day: float) -> PresentState:
    """The story's trial, asked for in the shortest day, after 200 s."""
    measured(folder / "a.csv")
    state = present_state(load_scenario(STORY), [folder / "a.csv"], remaining_s=remaining_s)
    asked = replace(state.first.design, accuracy=AccuracySettings(as_durations=True, **asked_of_day))
    first = replace(state.first, design=asked)
    return replace(state, first=first, left_s=_left(first, state.sailed_s, remaining_s))


def test_the_rest_of_a_shortest_day_tells_most_in_the_time_left_where_that_is_stated(tmp_path: Path) -> None:
    case, notes = rest_of(shortest_day_so_far(tmp_path, remaining_s=240.0))
    assert case.design.accuracy is None
    assert case.design.total_s == 240.0
    assert [note for note in notes if "design.accuracy" in note]


def test_else_it_lacks_what_the_data_do_not_tell_of_the_same_accuracy(tmp_path: Path, monkeypatch) -> None:
    state = shortest_day_so_far(tmp_path)
    assert np.isnan(state.left_s)
    case, _ = rest_of(state)
    information = tuple(scored(case))
    design, reference = designed(case, information), _stated_before(state, case, information, 0)
    asked = []
    monkeypatch.setattr(day, "_searched", lambda case, information, design, accuracy, *_: asked.append(accuracy))
    day.planned_day(case, information, design, reference=reference)
    (lacking,) = asked
    whole = stated_accuracy(case.design.accuracy, reference, case.vessel)
    enough = whole.samples * np.tensordot(reference.fractions, reference.problem.matrices, axes=1)
    assert whole.margin(enough) == pytest.approx(0.0, abs=1e-6)
    assert lacking.margin(enough) > 0.01  # with the data it is more than enough
    assert lacking.margin(enough - lacking.prior) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("key", ["day_s", "most_s"])
def test_lengths_of_the_day_count_from_its_start(tmp_path: Path, key: str) -> None:
    case, _ = rest_of(shortest_day_so_far(tmp_path, **{key: 500.0}))
    assert getattr(case.design.accuracy, key) == 500.0 - SAMPLES
    with pytest.raises(InputError, match=f"{key} is 200: no time is left"):
        rest_of(shortest_day_so_far(tmp_path, **{key: float(SAMPLES)}))
