"""Another day is drafted where several days promise that its runs tell enough, not where the boldest of them does."""

from types import SimpleNamespace

import numpy as np
import pytest

from expdesign.errors import NoAnswer
from expdesign.progress import silent
from expdesign.shortest_day import alternate
from expdesign.shortest_day.alternate import PROMISED, ROUNDS, _Foreseen, _Search
from expdesign.shortest_day.cheapest import Choice
from expdesign.shortest_day.drafting import Drafting

PRICES = None


def foreseen(name: int, expected_s: float, margin: float) -> _Foreseen:
    return _Foreseen(Choice(repeats=(name,), cost_s=1.0, bound_s=1.0), expected_s, margin)


def search(offers: list[list[_Foreseen]], monkeypatch) -> _Search:
    """One whose choices at each margin asked for are given; past them the limits allow no more."""

    def choices(self, prices, days, *, margin):
        step = round(margin / alternate.LEVEL_STEP)
        if step >= len(offers):
            raise NoAnswer("no more")
        return offers[step]

    monkeypatch.setattr(_Search, "choices", choices)
    return _Search(problem=None, accuracy=None, added=())


def day(expected_s: float, margin: float) -> SimpleNamespace:
    return SimpleNamespace(expected_s=expected_s, margin=margin, repeats=(0,))


def test_the_cheapest_runs_are_passed_over_where_other_days_promise_less_of_them(monkeypatch):
    offers = [[foreseen(1, 900.0, -0.3), foreseen(2, 1000.0, PROMISED + 0.01)]]
    tried = [Choice(repeats=(9,), cost_s=1.0, bound_s=1.0)]
    assert search(offers, monkeypatch).untried(PRICES, [day(1100.0, -0.5)], tried).repeats == (2,)


def test_more_is_asked_for_while_no_day_reaches_the_accuracy(monkeypatch):
    offers = [[foreseen(1, 900.0, PROMISED / 2)], [foreseen(2, 1000.0, 2 * PROMISED)]]
    tried = [Choice(repeats=(9,), cost_s=1.0, bound_s=1.0)]
    found = search(offers, monkeypatch)
    assert found.untried(PRICES, [day(1100.0, -0.5)], tried).repeats == (2,)
    assert found.untried(PRICES, [day(1100.0, 0.01)], tried).repeats == (1,)  # one does


def test_runs_that_come_nearest_are_tried_where_the_limits_allow_no_more(monkeypatch):
    offers = [[foreseen(1, 900.0, -0.4)], [foreseen(2, 1000.0, -0.1), foreseen(1, 900.0, -0.4)]]
    tried = [Choice(repeats=(9,), cost_s=1.0, bound_s=1.0)]
    found = search(offers, monkeypatch)
    assert found.untried(PRICES, [day(1100.0, -0.5)], tried).repeats == (2,)
    assert found.untried(PRICES, [day(1100.0, 0.01)], tried) is None  # an accurate day needs no such luck
    with pytest.raises(NoAnswer):
        search([], monkeypatch).untried(PRICES, [], [])


def test_no_day_is_drafted_for_a_hundredth_of_its_time(monkeypatch):
    tried = [Choice(repeats=(9,), cost_s=1.0, bound_s=1.0)]
    for expected_s, wanted in ((995.0, None), (980.0, (1,))):
        found = search([[foreseen(1, expected_s, 0.2)]], monkeypatch).untried(PRICES, [day(1000.0, 0.01)], tried)
        assert (None if found is None else found.repeats) == wanted


def test_a_day_that_no_drawn_trial_ends_is_no_reason_to_draft_no_other(monkeypatch):
    tried = [Choice(repeats=(9,), cost_s=1.0, bound_s=1.0)]
    for expected_s in (1000.0, np.inf):  # another near it is expected to be as bad
        found = search([[foreseen(1, expected_s, 0.2)]], monkeypatch).untried(PRICES, [day(np.inf, 0.01)], tried)
        assert found is not None
        assert found.repeats == (1,)


def test_no_runs_are_drafted_twice(monkeypatch):
    offers = [[foreseen(1, 900.0, 0.2), foreseen(0, 800.0, 0.2)], [foreseen(2, 950.0, 0.2), foreseen(1, 900.0, 0.2)]]
    tried = [Choice(repeats=(1,), cost_s=1.0, bound_s=1.0)]
    known = day(1100.0, -0.5)  # of the runs (0,)
    assert search(offers, monkeypatch).untried(PRICES, [known], tried).repeats == (2,)


@pytest.mark.parametrize(
    ("margins", "fullest", "drafted"),
    [
        ((0.1, 0.1, 0.1), False, 2),
        ((0.1, np.inf, np.inf, 0.1, 0.1), False, 4),  # a day that no drawn trial ends is not good enough
        ((-0.1, 0.1, -0.1, 0.1, 0.1), False, 4),
        ((-0.1,) * 6, False, ROUNDS),
        ((0.1,) * 6, True, ROUNDS),  # the fullest day is no day that reaches an accuracy
    ],
)
def test_two_days_that_reach_the_accuracy_are_enough(monkeypatch, margins, fullest, drafted):
    monkeypatch.setattr(alternate, "first_prices", lambda _: PRICES)
    monkeypatch.setattr(_Search, "prices", lambda self, days: PRICES)
    drafts = [day(1000.0, margin) if margin < np.inf else day(np.inf, 0.1) for margin in margins]
    monkeypatch.setattr(Drafting, "with_another", lambda self, days, *_: [*days, drafts[len(days)]])
    problem = SimpleNamespace(settings=SimpleNamespace(draft=False))
    found = _Search(problem=problem, accuracy=None, added=(), fullest=fullest)
    days, *_ = found.rounds(lambda *_: Choice(repeats=(1,), cost_s=1.0, bound_s=1.0), silent)
    assert len(days) == drafted


def test_what_is_foreseen_is_the_average_of_what_the_nearest_days_promise(monkeypatch):
    """With margins that are sums: each day promises its own margin and what the runs tell more than its own."""
    promises = {-0.1: 0.5, 0.2: 0.1, 0.3: -0.3, -2.0: 9.0}  # margin of a day: what it promises; the last is too far
    days = [SimpleNamespace(margin=m, whole=0.0, expected_s=1.0, repeats=(k,)) for k, m in enumerate(promises)]

    def near_day(offer, runs, day, names):
        return SimpleNamespace(information=lambda counts: promises[day.margin] - day.margin)

    monkeypatch.setattr(alternate, "near_day", near_day)
    monkeypatch.setattr(alternate, "cheapest_runs", lambda *_, **__: Choice(repeats=(7,), cost_s=1.0, bound_s=1.0))
    monkeypatch.setattr(_Search, "offer", lambda self, prices: SimpleNamespace(total_s=lambda counts: 1.0))
    problem = SimpleNamespace(design=SimpleNamespace(problem=SimpleNamespace(names=("a",))))
    accuracy = SimpleNamespace(margin=lambda information: information)
    found = _Search(problem=problem, accuracy=accuracy, added=()).choices(
        SimpleNamespace(runs=None, level=0.0), days, margin=0.0
    )
    assert len(found) == alternate.NEAREST
    assert [one.margin for one in found] == pytest.approx(3 * [np.mean([0.5, 0.1, -0.3])])
