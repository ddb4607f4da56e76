"""A stretch that a model loses counts as lost; a first cause counts beside the same fit; order is by what is lost."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.conventions import OUTPUTS
from expdesign.diagnosis import judgement
from expdesign.diagnosis.accuracy import squared_sums
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit import CrossValidation
from expdesign.diagnosis.fit.cross_validation import error_of_constants
from expdesign.diagnosis.fit.tuning import TUNING
from expdesign.diagnosis.judgement import losses_without
from expdesign.diagnosis.motion import simulate_from_measured
from expdesign.diagnosis.select import backward_elimination
from expdesign.diagnosis.select.backward_elimination import compared_with, improves_held_out
from expdesign.diagnosis.vessel_file.reading import extended_model
from held_out_cases import errors, steps_of

OPEN = np.array([[-6.0], [-6.0], [9.0], [9.0], [9.0], [9.0]])
"""Gains of six runs, 4 points on average and perhaps none."""


def test_the_error_of_constants_is_the_variance_about_the_means_of_runs():
    """Runs around 5 and -3, one of which lacks a sample: 4 of 5 samples are one off, the other is on the mean."""
    measured = np.array([[6.0, 4.0], [6.0, 4.0], [-3.0, np.nan]])[..., None]
    found = error_of_constants(measured, np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(found[:, 0], np.array([2.0, 2.0, 1.0]) * 4.0 / 5.0)


def test_a_model_that_runs_away_loses_stretches_and_no_more():
    """Held out whole it is as bad as it is; a model that predicts every stretch is judged as ever."""
    record = hidden_record("barge", seed=2, batches=3, samples=120)
    ship = extended_model(vessel_of("barge"), record)
    windows = cut_windows(ship.model, record)
    turned = np.where([term.equation == "r" for term in ship.model.terms], -4.0, 1.0) * ship.model.parameters
    wild = replace(ship, model=replace(ship.model, parameters=turned))
    good, bad = (CrossValidation(windows, record).without(None, one) for one in (ship, wild))
    short = cut_windows(ship.model, record, longest_s=TUNING.ahead_s)
    columns = [OUTPUTS.index(name) for name in ship.model.outputs]
    measured = short.measured[..., columns]
    most = error_of_constants(measured, short.batch)
    exact, _ = squared_sums(simulate_from_measured(ship, short).error[..., columns], measured)
    np.testing.assert_allclose(good.ahead().squared_error, exact)
    lost = bad.ahead().squared_error
    assert (lost <= most * (1 + 1e-9)).all()
    assert (lost[:, 2] == most[:, 2]).mean() > 0.5
    assert (bad.squared_error[:, 2] > error_of_constants(windows.measured[..., columns], windows.batch)[:, 2]).all()


@pytest.mark.parametrize(
    ("re_estimated", "cause", "beside_stated", "kept"),
    [(50.0, "wind", False, True), (None, "wind", False, False), (70.0 + OPEN, "wind", False, False),
     (50.0, "parameters", False, False), (50.0, "wind", True, False)],
)  # fmt: skip
def test_a_first_cause_is_certain_beside_the_same_fit_without_it(monkeypatch, re_estimated, cause, beside_stated, kept):
    """Its gain on the model in use is open, 4 points on average; a model as good without it leaves it open."""
    monkeypatch.setattr(backward_elimination, "prediction_gain", lambda *_: (0.0, (-1.0, 1.0)))
    found = steps_of("first")
    (step,) = found.steps
    chosen = SimpleNamespace(**vars(step.chosen) | {"candidate": replace(step.chosen.candidate, cause=cause)})
    chosen.fit = SimpleNamespace(noise=None)
    step.chosen = chosen
    found = replace(found, beside_stated=beside_stated)
    held = [errors(70.0), errors(70.0 + OPEN)]
    without = None if re_estimated is None else errors(re_estimated)
    assert improves_held_out(found, held, 0, object(), without) == [kept]  # type: ignore[arg-type]
    before, beside = compared_with(found, held, without, 0)
    assert beside == kept
    assert before is (without if kept else held[0])


@pytest.mark.parametrize(("ahead", "kept"), [(75.0, True), (70.0 + OPEN, False)])
def test_a_first_cause_that_one_of_many_runs_shows_is_told_in_stretches(monkeypatch, ahead, kept):
    """Five runs are simulated alike without and with it, so that its gain in whole runs is open."""
    monkeypatch.setattr(backward_elimination, "prediction_gain", lambda *_: (0.0, (-1.0, 1.0)))
    found = steps_of("first")
    found.steps[0].chosen.fit = SimpleNamespace(noise=None)
    fits = (70.0, 70.0 + np.array([[20.0], [0.0], [0.0], [0.0], [0.0], [0.0]]))
    held = [
        replace(errors(whole), ahead=lambda short=short: replace(errors(short), in_stretches=True))
        for whole, short in zip(fits, (70.0, ahead), strict=True)
    ]
    told = judgement._where_more_is_certain(found, held, 0)
    assert all(item.in_stretches is kept for item in told)
    assert improves_held_out(found, told, 0, object()) == [kept]  # type: ignore[arg-type]


def test_causes_are_ordered_by_what_the_model_loses_without_each(monkeypatch):
    """The first cause gains 20 points and the second 10 after it, but without the second 10 are lost, else 5."""
    found = steps_of("first", "second")
    held = [errors(value) for value in (50.0, 70.0, 80.0, 90.0)]  # a third cause was taken out
    only_second = SimpleNamespace(chosen=SimpleNamespace(fit="second alone"))
    monkeypatch.setattr(judgement, "without_step", lambda *_: [only_second])
    validation = SimpleNamespace(of={"second alone": errors(75.0)}.get)
    np.testing.assert_allclose(losses_without(found, held, validation, None), [5.0, 10.0])  # type: ignore[arg-type]
    monkeypatch.setattr(judgement, "without_step", lambda *_: None)
    np.testing.assert_allclose(losses_without(found, held, validation, None), [np.inf, 10.0])  # type: ignore[arg-type]
    assert losses_without(steps_of(), held, validation, None).size == 0  # type: ignore[arg-type]
