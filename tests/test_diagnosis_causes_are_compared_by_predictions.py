"""Where a search by likelihoods finds nothing, causes are compared by predictions a short time ahead."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit import AHEAD_S, HeldOut
from expdesign.diagnosis.prediction_comparison import Compared, _signed_rank_p_value, compare_predictions
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.progress import silent
from expdesign.signals import Record

BIAS_RAD = 0.3
diagnosing = import_module("expdesign.diagnosis.diagnose")


def trial(seed: int, **hidden: object) -> Record:
    return hidden_record("coaster", seed=seed, batches=3, samples=240, **hidden)  # type: ignore[arg-type]


def compared(record: Record, seed: int = 0) -> Compared:
    """Causes beside parameters that the file states to 10 %."""
    ship = extended_model(vessel_of("coaster", relative_std=0.1), record)
    found = compare_predictions(ship, cut_windows(ship.model, record, longest_s=AHEAD_S), seed, silent)
    assert found is not None
    return found


def test_the_hidden_cause_predicts_best_and_is_certain():
    first = compared(trial(1, faults={"heading_bias": BIAS_RAD})).causes[0]
    assert first.cause == "heading_bias"
    assert first.is_certain
    assert abs(first.fit.value("heading_bias") - BIAS_RAD) < 3.5 * first.fit.std("heading_bias")


def test_where_nothing_is_hidden_nothing_is_certain():
    """A trial has a certain cause with a chance of 2.5 % at most: four trials have none in more than 90 of 100."""
    assert not [item.cause for seed in range(4) for item in compared(trial(seed)).causes if item.is_certain]


def test_a_current_that_wanders_gains_and_is_no_certain_cause():
    """Nothing is hidden but weather: a steady current predicts better by six points."""
    record = hidden_record("tug", seed=103, batches=3, samples=240)
    ship = extended_model(vessel_of("tug", relative_std=0.1), record)
    found = compare_predictions(ship, cut_windows(ship.model, record, longest_s=AHEAD_S), 0, silent)
    assert found is not None
    first = found.causes[0]
    assert first.cause == "current"
    assert first.gain_interval[0] > 0.0
    assert not first.is_certain


def errors(squared: np.ndarray) -> HeldOut:
    return HeldOut(squared_error=squared, squared_deviation=np.ones_like(squared))


def test_the_signed_rank_test_counts_stretches_not_their_size():
    """Less in each of n stretches has a chance of one in 2^n, however large the errors of some are."""
    lost = np.geomspace(1.0, 1e9, 10)[:, None] * np.ones(3)
    left = lost * np.linspace(0.5, 0.9, 10)[:, None]
    assert _signed_rank_p_value(errors(lost), errors(left)) == pytest.approx(0.5**10)
    assert _signed_rank_p_value(errors(left), errors(lost)) == 1.0
    assert _signed_rank_p_value(errors(lost), errors(lost)) == 1.0


def test_a_diagnosis_whose_search_finds_nothing_names_what_predicts_best(monkeypatch):
    """The finding carries its gain on the model without it that is fitted in the same way, and says so."""

    def nothing(found, _windows, cross_validated, *_):
        kept, held = cross_validated(found.with_steps(()))
        return replace(kept, beside_stated=True), held

    monkeypatch.setattr(diagnosing, "eliminate_backward", nothing)
    record = trial(2, faults={"heading_bias": BIAS_RAD})
    vessel = vessel_of("coaster", relative_std=0.1)
    found = diagnosing.diagnose(vessel, record)
    assert [item.cause for item in found.findings] == ["heading_bias"]
    (item,) = found.findings
    extended = found.extended.model  # re-estimated, with their new errors and how these correlate
    assert (extended.parameters != vessel.model.parameters).any()
    assert (np.abs(extended.parameter_correlation_matrix - np.eye(len(extended.parameters))) > 0.1).any()
    assert item.gain_interval[0] > 0.0
    assert item.p_value < 0.025
    assert abs(item.estimates[0].value - BIAS_RAD) < 3.5 * item.estimates[0].std
    assert found.unit == "30 s stretches of runs"
    assert [note for note in found.notes if "compared by predictions" in note]
    assert not [note for note in found.notes if "sign of the misalignment" in note]
    assert (found.after.fit > found.before.fit).all()


def test_a_simulation_that_explains_much_is_left_to_the_search(monkeypatch):
    monkeypatch.setattr(diagnosing, "compare_predictions", lambda *_: pytest.fail("causes were compared"))
    diagnosing.diagnose(vessel_of("coaster", relative_std=0.1), trial(3))
