"""Causes are judged in whole held-out runs where these tell, else in stretches; beside which parameters."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from expdesign.diagnosis import judgement, stated_parameters
from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.fit.held_out import HeldOut, certain_reductions, held_out_gain
from expdesign.diagnosis.judgement import _where_more_is_certain, errors_as_judged
from expdesign.diagnosis.select import Step
from expdesign.diagnosis.select.backward_elimination import improves_held_out
from expdesign.progress import silent
from held_out_cases import POSSIBLE, errors, steps_of


class Model(SimpleNamespace):
    """A fit by name, all effects zero."""

    def __init__(self, name: str, **others: object) -> None:
        super().__init__(**{"name": name, "value": lambda _key: 0.0, "ship": POSSIBLE} | others)


def whole_and_ahead(*pairs: tuple[np.ndarray | float, np.ndarray | float]) -> list[HeldOut]:
    """Errors of models by their fits to whole runs and in short stretches."""
    return [
        replace(errors(whole), ahead=lambda short=short: replace(errors(short), in_stretches=True))
        for whole, short in pairs
    ]


def drawn(rng: np.random.Generator, runs: int) -> tuple[HeldOut, HeldOut]:
    """Runs that differ in size, in how well they are simulated, and in what a cause takes off their error."""
    size = np.exp(0.3 * rng.standard_normal((runs, 3)))
    before = 0.2 * size * np.exp(0.3 * rng.standard_normal((runs, 3)))
    after = before * np.exp(-0.3 + 0.3 * rng.standard_normal((runs, 1)))
    return HeldOut(squared_error=before, squared_deviation=size), HeldOut(squared_error=after, squared_deviation=size)


@pytest.mark.parametrize("runs", [3, 4, 8])
def test_intervals_of_improvements_hold_the_truth_however_few_runs_there_are(runs: int):
    """150 draws of as many runs; 0.75 of the quantiles of draws of three runs would."""
    rng, count = np.random.default_rng(runs), 150
    before, after = drawn(rng, 200_000)
    gain = (after.fit - before.fit).mean()
    share = 1 - np.sqrt(after.squared_error.sum(axis=0) / before.squared_error.sum(axis=0))
    held = []
    for _ in range(count):
        pair = drawn(rng, runs)
        _, (low, high) = held_out_gain(*pair, 0)
        _, least, most = certain_reductions(*pair, 0)
        held.append([low < gain < high, *((least < share) & (share < most))])
    found = np.mean(held, axis=0)
    assert (found > 0.95 - 4 * np.sqrt(0.95 * 0.05 / count)).all(), found


STRETCHES = 20


def of_stretches(rng: np.random.Generator, runs: int, correlation: float, between: float) -> tuple[HeldOut, HeldOut]:
    """Runs of stretches, each like the one before, which differ between runs too."""
    drawn = rng.standard_normal((STRETCHES, runs, 3, 3))
    for k in range(1, STRETCHES):
        drawn[k] = correlation * drawn[k - 1] + np.sqrt(1.0 - correlation**2) * drawn[k]
    drawn = (drawn + between * rng.standard_normal((1, runs, 3, 3))).swapaxes(0, 1).reshape(-1, 3, 3)
    size = np.ones((len(drawn), 3))
    before = 0.2 * np.exp(0.6 * drawn[:, 0])
    after = before * np.exp(-0.3 + 0.3 * (drawn[:, 1] + drawn[:, 2, :1]))
    run = np.repeat(np.arange(runs), STRETCHES)
    one, other = (HeldOut(squared_error=lost, squared_deviation=size, run=run) for lost in (before, after))
    return one, other


@pytest.mark.parametrize("correlation", [0.0, 0.4])
@pytest.mark.parametrize(("runs", "between"), [(1, 0.0), (2, 0.0), (3, 0.5), (6, 0.5), (10, 0.5)])
def test_intervals_by_stretches_hold_the_truth_of_one_run_sailed_on_and_of_other_runs(runs, between, correlation):
    """Of one or two runs that of these, of more that of all runs.

    200 draws. Quantiles of draws of single stretches hold it in 0.69 of those of one run with a correlation of 0.4.
    """
    rng, count = np.random.default_rng(runs), 200
    before, after = of_stretches(rng, 5_000, correlation, between)
    ratio, held = (100.0 - after.mean_fit) / (100.0 - before.mean_fit), []
    for _ in range(count):
        pair = of_stretches(rng, runs, correlation, between)
        low, high = np.array(held_out_gain(*pair, 0)[1]) / (100.0 - pair[0].mean_fit)
        held.append(low < 1.0 - ratio < high)
    assert np.mean(held) > 0.95 - 4 * np.sqrt(0.95 * 0.05 / count)


def test_a_later_cause_is_certain_in_stretches_where_whole_runs_leave_its_gain_open():
    """What whole runs tell is told in these."""
    found = steps_of("first", "later")
    spread = np.array([[-6.0], [-6.0], [9.0], [9.0], [9.0], [9.0]])  # 4 points on average, perhaps none
    for later, ahead, kept, in_stretches in (
        (70.0 + spread, 71.0, True, True),
        (70.0 + spread, 70.0 + spread, False, False),
        (74.0, 70.0, True, False),
    ):
        held = _where_more_is_certain(found, whole_and_ahead((50.0, 50.0), (70.0, 70.0), (later, ahead)), 0)
        assert all(item.in_stretches is in_stretches for item in held)
        assert improves_held_out(found, held, 0) == [True, kept]


def test_no_cause_is_found_whose_stated_improvement_may_be_none():
    """However large it is on average, first or later."""
    spread = np.array([[-6.0], [-6.0], [9.0], [9.0], [9.0], [9.0]])
    for later, kept in ((70.0 + spread, False), (74.0 + 0.1 * spread, True)):
        assert improves_held_out(steps_of("first"), [errors(70.0), errors(later)], 0) == [kept]
        assert improves_held_out(steps_of("first", "later"), [errors(50.0), errors(70.0), errors(later)], 0)[1] is kept


def test_causes_are_judged_in_stretches_where_only_these_tell_of_the_first_one():
    """Stretches that do not tell either leave the runs."""
    spread = np.array([[-9.0], [-9.0], [-9.0], [6.0], [6.0], [6.0]])
    for ahead, in_stretches in ((75.0, True), (70.0 + spread, False), (65.0, False)):
        held = _where_more_is_certain(steps_of("wind"), whole_and_ahead((70.0, 70.0), (70.0 + spread, ahead)), 0)
        assert all(item.in_stretches is in_stretches for item in held)


def test_causes_are_fitted_beside_the_file_where_it_simulates_better_with_them_for_certain(monkeypatch):
    """Parameters of the file are better without any cause in both cases: the cause decides."""
    first = Model("first", keys=("theta:Y_v",), ship=None)
    found = replace(steps_of("wind"), first=first, last=Model("re-estimated"))  # type: ignore[arg-type]
    known = replace(found, last=Model("beside"), beside_stated=True)  # type: ignore[arg-type]
    monkeypatch.setattr(judgement, "fitted_ahead", lambda *_, beside_stated: known if beside_stated else found)
    monkeypatch.setattr(judgement, "within_stated_std", lambda _fit: True)
    monkeypatch.setattr(judgement, "only_nuisance", lambda *_: False)
    unclear = 75.0 + np.array([[-25.0], [-20.0], [-10.0], [15.0], [20.0], [20.0]])
    for whole, ahead, chosen in (
        (unclear, 74.0, known),
        (74.0, unclear, known),
        (unclear, unclear, found),
        (unclear, 66.0, found),
    ):
        stated, before, after, by_file = whole_and_ahead((45.0, 45.0), (20.0, 20.0), (70.0, 70.0), (whole, ahead))
        fits = {"first": before, "wind": after, "re-estimated": after, "beside": by_file}
        validation = SimpleNamespace(
            of=lambda one, *_, fits=fits: fits[getattr(one, "name", one)],
            short_windows=lambda _ship: None,
        )
        kept, _ = errors_as_judged(found, stated, validation, None, silent, 0)  # type: ignore[arg-type]
        assert kept is chosen


@pytest.mark.parametrize(
    ("alone", "with_cause", "rival"), [(70.0, 71.0, False), (70.0, None, True), (75.0, 71.0, True)]
)
def test_parameters_far_beyond_the_file_are_the_other_answer_where_they_alone_gain_as_much(
    monkeypatch, alone, with_cause, rival
):
    """The gain on the file as it is counts that of parameters fitted beside the cause."""
    spread = np.array([[-6.0], [-6.0], [9.0], [9.0], [9.0], [9.0]])
    after = errors(70.0 + spread if with_cause is None else with_cause)
    chosen = SimpleNamespace(keys=("wind",), fit=Model("fit", noise=None))
    step = Step(chosen=chosen, p_value=0.0, alternatives=(), before=None, tests=())  # type: ignore[arg-type]
    first = Model("first", keys=("theta:Y_v",), ship=None)
    found = replace(steps_of("wind"), steps=(step,), first=first)  # type: ignore[arg-type]
    monkeypatch.setattr(stated_parameters, "within_stated_std", lambda _fit: False)
    monkeypatch.setattr(stated_parameters, "only_nuisance", lambda *_: False)
    monkeypatch.setattr(stated_parameters, "certain_in_predictions", lambda *_: 0.0)
    parameters = Candidate(cause="parameters", free={"theta:Y_v": 0.0})
    monkeypatch.setattr(stated_parameters, "open_candidates", lambda *_: [parameters])
    validation = SimpleNamespace(of=lambda _: errors(alone))
    judged = stated_parameters.with_parameters_as_rival(found, [errors(20.0), after], validation, None, 0)  # type: ignore[arg-type]
    assert [one.candidate.cause for one in judged.steps[0].alternatives] == ["parameters"] * rival
