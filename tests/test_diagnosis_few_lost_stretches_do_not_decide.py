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
from expdesign.diagnosis.fit.held_out import HeldOut, certain_reductions, held_out_gain
from expdesign.diagnosis.fit.output_error import AHEAD_S
from expdesign.diagnosis.judgement import losses_without
from expdesign.diagnosis.motion import simulate_from_measured
from expdesign.diagnosis.select import backward_elimination
from expdesign.diagnosis.select.backward_elimination import compared_with, improves_held_out
from expdesign.diagnosis.vessel_file.reading import extended_model
from held_out_cases import errors, steps_of

OPEN = np.array([[-6.0], [-6.0], [9.0], [9.0], [9.0], [9.0]])  # gains of six runs, 4 points on average and perhaps none


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
    short = cut_windows(ship.model, record, longest_s=AHEAD_S)
    columns = [OUTPUTS.index(name) for name in ship.model.outputs]
    measured = short.measured[..., columns]
    most = error_of_constants(measured, short.batch)
    exact, _ = squared_sums(simulate_from_measured(ship, short).error[..., columns], measured)
    np.testing.assert_allclose(good.ahead().squared_error, exact)
    lost = bad.ahead().squared_error
    assert (lost <= most * (1 + 1e-9)).all()
    assert (lost[:, 2] == most[:, 2]).mean() > 0.5
    assert (bad.squared_error[:, 2] > error_of_constants(windows.measured[..., columns], windows.batch)[:, 2]).all()


def in_stretches(error: np.ndarray, runs: int = 4) -> HeldOut:
    """Relative errors (b, n) of the stretches of so many runs."""
    run = np.repeat(np.arange(float(runs)), len(error) // runs)
    return HeldOut(squared_error=error**2, squared_deviation=np.ones_like(error), run=run)


def test_stretches_count_alike_however_large_their_errors_are():
    """A cause halves all errors but those of one stretch, lost with it, whose squares are nine tenths of all."""
    rng = np.random.default_rng(0)
    before = 0.2 * np.exp(0.3 * rng.standard_normal((40, 3)))
    after = 0.5 * before * np.exp(0.1 * rng.standard_normal((40, 3)))
    after[17] = 3.0
    assert (after**2).sum() > 3.0 * (before**2).sum()
    gain, (low, high) = held_out_gain(in_stretches(before), in_stretches(after), 0)
    assert 0.0 < low < gain < high
    share, least, most = certain_reductions(in_stretches(before), in_stretches(after), 0)
    assert ((least > 0.0) & (least < share) & (share < most)).all()
    whole = [replace(in_stretches(one), run=None) for one in (before, after)]
    assert held_out_gain(*whole, 0)[0] < 0.0


def test_gains_in_stretches_have_closed_forms():
    """Errors that halve, double or stay, each the same in all stretches; the scale of an output changes nothing."""
    before = 0.2 * np.exp(np.random.default_rng(0).standard_normal((40, 3)))
    fit = 100.0 * (1.0 - np.exp(np.log(before).mean()))
    for factors, ratio in (((0.5, 0.5, 0.5), 0.5), ((0.5, 2.0, 1.0), 1.0), ((0.125, 1.0, 1.0), 0.5)):
        pair = in_stretches(before), in_stretches(before * np.array(factors))
        assert pair[0].mean_fit == pytest.approx(fit)
        gain, interval = held_out_gain(*pair, 0)
        np.testing.assert_allclose([gain, *interval], (100.0 - fit) * (1.0 - ratio), atol=1e-9)
        assert gain == pytest.approx(pair[1].mean_fit - fit, abs=1e-9)
        np.testing.assert_allclose(certain_reductions(*pair, 0), np.tile(1.0 - np.array(factors), (3, 1)), atol=1e-9)
    empty = np.array([0.0, 1.0, 1.0])  # an output that is not measured in some stretches
    seen = [replace(one, **{name: getattr(one, name) * np.where(np.arange(40)[:, None] % 2, 1.0, empty)
                            for name in ("squared_error", "squared_deviation")}) for one in pair]  # fmt: skip
    np.testing.assert_allclose(certain_reductions(*seen, 0)[0], 1.0 - np.array(factors), atol=1e-9)


@pytest.mark.parametrize("cause", ["change_point", "current"])
def test_a_change_of_the_ship_never_shows_in_predictions_alone(monkeypatch, cause):
    """Simulations of runs leave it open; what is not chosen by its time shows in predictions."""
    monkeypatch.setattr(backward_elimination, "prediction_gain", lambda *_: (0.5, (0.4, 0.6)))
    found = steps_of("first", "later")
    for step in found.steps:
        chosen = SimpleNamespace(**vars(step.chosen) | {"candidate": replace(step.chosen.candidate, cause=cause)})
        chosen.fit = SimpleNamespace(noise=None)
        step.chosen = chosen
    held = [errors(70.0), errors(70.0 + OPEN), errors(74.0 + 2.0 * OPEN)]
    assert improves_held_out(found, held, 0, object()) == [cause == "current"] * 2  # type: ignore[arg-type]


def test_one_output_that_gains_for_certain_is_no_finding_where_all_together_may_not():
    """Surge gains 5 points in every run, sway and yaw lose or gain in turn."""
    turn = OPEN - OPEN.mean()
    held = [errors(70.0), errors(70.0 + np.hstack([np.full((6, 1), 5.0), turn, turn]))]
    assert certain_reductions(*held, 0)[1][0] > 0.0
    assert improves_held_out(steps_of("first"), held, 0) == [False]
    assert improves_held_out(
        steps_of("first"), [held[0], errors(70.0 + np.array([5.0, 0.5, 0.5]) * np.ones((6, 1)))], 0
    ) == [True]


@pytest.mark.parametrize(
    ("re_estimated", "cause", "beside_stated", "kept"),
    [(50.0, "wind", False, True), (None, "wind", False, False), (70.0 + OPEN, "wind", False, False),
     (50.0, "parameters", False, False), (50.0, "wind", True, False)],
)  # fmt: skip
def test_a_first_cause_is_certain_beside_the_same_fit_without_it(monkeypatch, re_estimated, cause, beside_stated, kept):
    """Its gain on the model in use is open, 4 points on average; a model as good without it leaves it open."""
    monkeypatch.setattr(backward_elimination, "prediction_gain", lambda *_: (0.0, (-1.0, 1.0)))
    monkeypatch.setattr(backward_elimination, "within_stated_std", lambda _fit: True)
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


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("measured", ["whole", "ahead", "on_other_runs", None])
def test_what_makes_simulations_of_any_output_worse_for_certain_never_shows_in_predictions(
    monkeypatch, place, measured
):
    """First or later, in whole runs, in stretches, or in those of runs that models were not fitted to.

    Predictions gain by half. Surge and sway leave it open in simulations, and yaw is worse in every run.
    """
    monkeypatch.setattr(backward_elimination, "prediction_gain", lambda *_: (0.5, (0.4, 0.6)))
    found = steps_of(*("first", "later")[: place + 1])
    for step in found.steps:
        step.chosen.fit = SimpleNamespace(noise=None)
    before = [errors(60.0)] if place == 0 else [errors(40.0), errors(60.0)]
    open_one, worse = (errors(60.0 + np.hstack([OPEN, OPEN, yaw])) for yaw in (OPEN, 0.1 * OPEN - 3.5))

    def last(name: str) -> HeldOut:
        return worse if name == measured else open_one

    held = [replace(one, ahead=lambda one=one: one, on_other_runs=lambda one=one: one) for one in before]
    held.append(replace(last("whole"), ahead=lambda: last("ahead"), on_other_runs=lambda: last("on_other_runs")))
    assert improves_held_out(found, held, 0, object())[place] is (measured is None)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("alone", "other_runs", "kept"),
    [(0.5, 70.0 + OPEN, True), (0.01, 70.0 + OPEN, False), (0.01, 75.0, True), (0.01, None, False)],
)
def test_predictions_show_a_first_cause_beside_re_estimated_parameters_too(monkeypatch, alone, other_runs, kept):
    """Parameters far from those of the file, fitted with a cause, may be all that predictions gain with it.

    Unless stretches of runs that neither was fitted to are simulated better for certain.
    """
    found, without = steps_of("first"), errors(64.0)
    found.steps[0].chosen.fit = SimpleNamespace(noise=None)

    def gain(before: HeldOut, *_: object) -> tuple[float, tuple[float, float]]:
        share = alone if before is without else 0.5
        return share, (0.9 * share, 1.1 * share)

    monkeypatch.setattr(backward_elimination, "prediction_gain", gain)
    monkeypatch.setattr(backward_elimination, "within_stated_std", lambda _fit: False)
    held = [errors(70.0), errors(70.0 + OPEN)]
    if other_runs is not None:
        stretches = (errors(70.0), errors(other_runs))
        held = [
            replace(one, on_other_runs=lambda short=short: short) for one, short in zip(held, stretches, strict=True)
        ]
    assert improves_held_out(found, held, 0, object(), without) == [kept]  # type: ignore[arg-type]
    assert improves_held_out(replace(found, beside_stated=True), held, 0, object(), without) == [True]  # type: ignore[arg-type]


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
