"""Where a search by likelihoods leaves much unexplained, causes are compared by predictions a short time ahead."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis import diagnose, stated_parameters
from expdesign.diagnosis.causes import Candidate
from expdesign.diagnosis.causes.hull import CHANGE_POINTS
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit import AHEAD_S, FitOptions, HeldOut, counting_stretches, fit
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import initial_states, stable_windows
from expdesign.diagnosis.prediction_comparison import (
    MUCH,
    Compared,
    _values_tried,
    compare_predictions,
    fitted_to_all,
    signed_rank_p_values,
)
from expdesign.diagnosis.select import Selection, Step, open_candidates
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.progress import silent
from expdesign.signals import Record
from held_out_cases import steps_of

BIAS_RAD = 0.3
selecting = import_module("expdesign.diagnosis.diagnose")
judging = import_module("expdesign.diagnosis.judgement")


def trial(seed: int, **hidden: object) -> Record:
    return hidden_record("coaster", seed=seed, batches=3, samples=240, **hidden)  # type: ignore[arg-type]


def compared(record: Record, seed: int = 0) -> tuple[ExtendedModel, Compared]:
    """Causes beside parameters that the file states to 10 %."""
    ship = extended_model(vessel_of("coaster", relative_std=0.1), record)
    found = compare_predictions(ship, cut_windows(ship.model, record, longest_s=AHEAD_S), seed, silent)
    assert found is not None
    return ship, found


@cache
def biased() -> tuple[ExtendedModel, Compared]:
    """With a heading bias."""
    return compared(trial(1, faults={"heading_bias": BIAS_RAD}))


def test_a_time_that_was_chosen_on_what_is_held_out_counts_as_often_as_it_was_tried():
    """Its stretches show a change where the error is worst, of a ship that does not change; fits hold the time."""
    record = trial(1)
    ship = extended_model(vessel_of("coaster"), record)
    windows = cut_windows(ship.model, record, longest_s=AHEAD_S)
    base = fit(ship, windows, (), starts=initial_states(windows), options=FitOptions(steps=0))
    candidates = open_candidates(base, windows)
    tried = {
        one.cause: _values_tried(SimpleNamespace(test=SimpleNamespace(candidate=one)), candidates)  # type: ignore[arg-type]
        for one in candidates
    }
    assert tried["change_point"] == CHANGE_POINTS
    assert {tried[one.cause] for one in candidates if one.grid is None} == {1}


@pytest.mark.thorough
def test_the_hidden_cause_predicts_best_and_is_certain():
    first = biased()[1].causes[0]
    assert first.cause == "heading_bias"
    assert first.is_certain
    assert abs(first.fit.value("heading_bias") - BIAS_RAD) < 3.5 * first.fit.std("heading_bias")


@pytest.mark.thorough
def test_where_nothing_is_hidden_nothing_is_certain():
    """A trial has a certain cause with a chance of 2.5 % at most: two trials have none in 95 of 100."""
    assert not [item.cause for seed in range(2) for item in compared(trial(seed))[1].causes if item.is_certain]


def test_a_current_that_wanders_gains_and_is_no_certain_cause():
    """Nothing is hidden but weather: of a steady current the gain has to be large for certain, whatever is left."""
    record = hidden_record("tug", seed=233, batches=3, samples=240)
    ship = extended_model(vessel_of("tug", relative_std=0.1), record)
    found = compare_predictions(ship, cut_windows(ship.model, record, longest_s=AHEAD_S), 0, silent)
    assert found is not None
    first = found.causes[0]
    assert first.cause == "current"
    assert first.gain_interval[0] > 0.0
    assert not first.is_certain
    for left in (10.0, 60.0):  # of a tank, and of a lake
        much = left * (MUCH + np.array([0.01, 0.4]))
        gains = replace(first, gain=0.3 * left, gain_interval=tuple(much), left=left, p_value=0.001)
        assert gains.is_certain
        assert not replace(gains, gain_interval=tuple(much - 0.02 * left)).is_certain


def errors(squared: np.ndarray) -> HeldOut:
    return HeldOut(squared_error=squared, squared_deviation=np.ones_like(squared))


def of(cause: str, error: float, *, certain: bool = True, weather: bool = False, gains: bool = True) -> SimpleNamespace:
    """A compared cause with this squared error in each of ten stretches."""
    return SimpleNamespace(
        cause=cause, held=errors(np.full((10, 3), error)), is_certain=certain, is_slow_weather=weather, p_value=0.001,
        may_be_weather=weather and gains, gain=1.0 - error,
        fit=SimpleNamespace(ship=cause), point=SimpleNamespace(test=SimpleNamespace(candidate=Candidate(cause=cause,
        free={}))),
    )  # fmt: skip


def judged(monkeypatch, *causes: SimpleNamespace, found: float | None) -> tuple[str, tuple[str, ...]] | None:
    """The cause that is found by predictions, or kept from the search, with its alternatives.

    `found` is the error with the cause "searched", which the search found; None where it found nothing.
    """

    def chosen(item, *_):
        return SimpleNamespace(candidate=Candidate(cause=item.cause, free={}), fit=item.cause)

    monkeypatch.setattr(judging, "harms", lambda *_: False)
    monkeypatch.setattr(judging, "fitted_to_all", chosen)
    steps = () if found is None else (Step(chosen=chosen(of("searched", 0.0)), p_value=0.0, alternatives=(),
                                           before=None, tests=()),)  # fmt: skip
    kept = Selection(steps=steps, first=None, last=None, last_tests=())  # type: ignore[arg-type]
    compared = SimpleNamespace(
        causes=causes,
        without=errors(np.ones((10, 3))),
        tests=(),
        of=lambda _: None if np.isnan(found) else errors(np.full((10, 3), found)),
    )
    by_predictions = judging.found_by_predictions(kept, compared, (None, None), None, 0)
    kept = by_predictions[0] if by_predictions else judging.with_alternatives(kept, compared, 0)
    return (
        None
        if not kept.steps
        else (
            kept.steps[0].chosen.candidate.cause,
            tuple(other.candidate.cause for other in kept.steps[0].alternatives),
        )
    )


def test_what_predicts_better_for_certain_takes_the_place_of_what_the_search_found(monkeypatch):
    current, bias = of("current", 0.2, weather=True), of("heading_bias", 0.3)
    assert judged(monkeypatch, current, bias, found=0.5) == ("current", ())
    assert judged(monkeypatch, current, found=0.2) == ("searched", ("current",))
    assert judged(monkeypatch, current, found=0.1) == ("searched", ())
    small = of("current", 0.3, certain=False, weather=True)
    assert judged(monkeypatch, bias, small, found=0.5) == ("searched", ("heading_bias",))
    assert judged(monkeypatch, bias, found=0.5) == ("heading_bias", ())
    assert judged(monkeypatch, bias, found=np.nan) == ("searched", ())  # which cannot be fitted in stretches


def test_what_slow_weather_predicts_as_well_is_no_certain_cause(monkeypatch):
    bias = of("heading_bias", 0.3)
    assert judged(monkeypatch, bias, of("current", 0.3, certain=False, weather=True), found=None) is None
    assert judged(monkeypatch, bias, of("current", 0.4, certain=False, weather=True), found=None) == (
        "heading_bias",
        (),
    )
    assert judged(monkeypatch, of("current", 0.3, weather=True), bias, found=None) == ("current", ("heading_bias",))
    # which may gain nothing itself
    small = of("current", 0.3, certain=False, weather=True, gains=False)
    assert judged(monkeypatch, bias, small, found=None) == ("heading_bias", ("current",))


@pytest.mark.parametrize(
    ("re_estimated", "alternatives"), [(0.2, None), (0.3, ("parameters",)), (0.4, ())], ids=["better", "level", "worse"]
)
def test_beside_the_file_a_cause_predicts_no_worse_than_all_parameters_re_estimated(
    monkeypatch, re_estimated, alternatives
):
    """Fewer numbers that predict as well are the answer, and all parameters are the other one."""

    def chosen(item, *_):
        return SimpleNamespace(candidate=Candidate(cause=item.cause, free={}), fit=None)

    parameters = Candidate(cause="parameters", free={"theta:Y_v": 0.0})
    monkeypatch.setattr(judging, "harms", lambda *_: False)
    monkeypatch.setattr(stated_parameters, "open_candidates", lambda *_: [parameters])
    monkeypatch.setattr(judging, "fitted_to_all", chosen)
    kept = Selection(steps=(), first=SimpleNamespace(ship=None), last=None, last_tests=())  # type: ignore[arg-type]
    current, without = of("current", 0.3, weather=True), errors(np.ones((10, 3)))
    compared = SimpleNamespace(causes=(current,), without=without, tests=(), without_in=lambda _: None)
    alone = errors(np.full((10, 3), re_estimated))
    found = judging.found_by_predictions(kept, compared, (None, None), None, 0, alone)  # type: ignore[arg-type]
    if alternatives is None:
        assert found is None
    else:
        assert found[0].beside_stated
        assert tuple(one.candidate.cause for one in found[0].steps[0].alternatives) == alternatives


def test_sizes_found_by_predictions_are_no_surer_than_the_likelihood_and_the_stretches():
    ship, found = biased()
    windows, first = stable_windows(ship, trial(1, faults={"heading_bias": BIAS_RAD})), found.causes[0]
    chosen = fitted_to_all(first, found.without_in(windows), windows)
    assert chosen is not None
    free, starts = chosen.fit.free_keys, chosen.fit.starts
    likeliest = fit(chosen.fit.ship, windows, free, starts=starts, options=FitOptions(steps=0))
    for other in (likeliest, counting_stretches(first.fit)):
        assert chosen.fit.std("heading_bias") >= 0.999 * other.std("heading_bias")


def test_the_signed_rank_test_counts_stretches_not_their_size():
    """Less in each of n stretches has a chance of one in 2^n, however large the errors of some are."""
    lost = np.geomspace(1.0, 1e9, 10)[:, None] * np.ones(3)
    left = lost * np.linspace(0.5, 0.9, 10)[:, None]
    assert signed_rank_p_values(errors(lost), [errors(left)])[0] == pytest.approx(0.5**10)
    assert signed_rank_p_values(errors(left), [errors(lost)])[0] == 1.0
    assert signed_rank_p_values(errors(lost), [errors(lost)])[0] == 1.0


def test_stretches_of_runs_that_differ_are_no_independent_witnesses():
    """Four runs of 60 stretches with a gain of their own each, none on average: uniform p-values of half-normal causes.

    As if stretches were independent, most causes would seem certain one way or the other.
    """
    rng, p_values, plain = np.random.default_rng(4), [], []
    run = np.repeat(np.arange(4.0), 60)
    for _ in range(60):
        lost = replace(errors(np.ones((240, 3))), run=run)
        gains = np.repeat(rng.standard_normal((6, 4)), 60, axis=1) + rng.standard_normal((6, 240))
        causes = [replace(errors(np.exp(-gain)[:, None] * np.ones((240, 3))), run=run) for gain in gains]
        p_values += signed_rank_p_values(lost, causes)
        plain += signed_rank_p_values(replace(lost, run=None), [replace(one, run=None) for one in causes])
    small = (np.array(p_values) < 0.05).mean()
    assert small < 0.05 + 4 * np.sqrt(0.05 * 0.95 / len(p_values))
    assert (np.array(plain) < 0.05).mean() > 0.3


@pytest.mark.thorough
def test_a_diagnosis_that_drops_what_its_search_found_names_what_predicts_best(monkeypatch):
    """However much is explained. The finding carries its gain on the same model fitted without it, and says so."""

    def nothing(found, _windows, cross_validated, *_):
        kept, held = cross_validated(found.with_steps(()))
        return replace(kept, beside_stated=True), held

    monkeypatch.setattr(selecting, "eliminate_backward", nothing)
    monkeypatch.setattr(selecting, "explains_little", lambda *_: False)
    record = trial(2, faults={"heading_bias": BIAS_RAD})
    vessel = vessel_of("coaster", relative_std=0.1)
    found = diagnose(vessel, record)
    assert [item.cause for item in found.findings] == ["heading_bias"]
    (item,) = found.findings
    extended = found.extended.model  # its parameters, which are right, stay as they are
    np.testing.assert_array_equal(extended.parameters, vessel.model.parameters)
    np.testing.assert_array_equal(extended.parameter_std, vessel.model.parameter_std)
    assert item.gain_interval[0] > 0.0
    assert item.p_value < 0.025
    assert abs(item.estimates[0].value + BIAS_RAD) < 3.5 * item.estimates[0].std
    assert found.unit == "30 s stretches of runs"
    assert [note for note in found.notes if "compared by predictions" in note]
    assert not [note for note in found.notes if "sign of the misalignment" in note]
    assert (found.after.fit > found.before.fit).all()


@pytest.mark.thorough
def test_what_no_search_found_is_not_named_where_much_is_explained(monkeypatch):
    """The search found and dropped another cause than the one that predicts best."""
    (best,) = steps_of("best").steps  # a current
    monkeypatch.setattr(selecting, "explains_little", lambda *_: False)
    monkeypatch.setattr(selecting, "compare_predictions", lambda *_: SimpleNamespace(causes=()))
    monkeypatch.setattr(selecting, "found_by_predictions", lambda kept, *_: (kept.with_steps((best,)), []))
    monkeypatch.setattr(selecting, "eliminate_backward", lambda found, _w, check, *_: check(found.with_steps(())))
    vessel = vessel_of("coaster", relative_std=0.1)
    assert not diagnose(vessel, trial(2, faults={"heading_bias": BIAS_RAD})).findings


class Asked(Exception):
    """Causes that may be found by predictions."""


@pytest.mark.thorough
@pytest.mark.parametrize(("dropped", "asked"), [("heading_bias", {"heading_bias"}), ("parameters", None)])
def test_any_cause_may_be_found_where_the_search_found_parameters_that_are_no_finding(monkeypatch, dropped, asked):
    """Other values of many parameters imitate any cause, so that the search has told nothing of the others.

    As they are no finding, others stand beside the parameters of the file.
    """

    def found_so(*given: object) -> Selection:
        found = search(*given)
        (step,) = found.steps
        named = replace(step.chosen.candidate, cause=dropped)
        return replace(found, steps=(replace(step, chosen=replace(step.chosen, candidate=named)),))

    def compared_with(ship: ExtendedModel, _short, _seed, _progress, only: set[str] | None = None) -> None:
        assert bool(ship.stated_std or ship.model.parameter_std.any()) is (only is not None)
        raise Asked(only)

    search = selecting.select_forward
    monkeypatch.setattr(selecting, "select_forward", found_so)
    monkeypatch.setattr(selecting, "explains_little", lambda *_: False)
    monkeypatch.setattr(selecting, "eliminate_backward", lambda found, _w, check, *_: check(found.with_steps(())))
    monkeypatch.setattr(selecting, "compare_predictions", compared_with)
    with pytest.raises(Asked) as told:
        diagnose(vessel_of("coaster", relative_std=0.1), trial(2, faults={"heading_bias": BIAS_RAD}))
    assert told.value.args == (asked,)


@pytest.mark.thorough
def test_a_simulation_that_explains_much_is_left_to_the_search(monkeypatch):
    monkeypatch.setattr(selecting, "compare_predictions", lambda *_: pytest.fail("causes were compared"))
    diagnose(vessel_of("coaster", relative_std=0.1), trial(3))
