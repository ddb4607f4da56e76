"""A simulation that runs away is told in words, with numbers that stay numbers."""

import re
from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis import diagnose
from expdesign.diagnosis.accuracy import LARGEST_ERROR, accuracy, clipped
from expdesign.diagnosis.conclusions import note_on_divergence
from expdesign.diagnosis.data import cut_windows
from expdesign.diagnosis.vessel_file.reading import extended_model


def test_a_model_that_runs_away_has_a_bounded_error():
    """Anti-damping of 2 per second: the speeds pass every number within a minute."""
    record, ship = hidden_record("barge", seed=1, batches=2, samples=150), vessel_of("barge")
    wild = replace(ship, model=ship.model.with_parameters({"X_u": 2.0, "N_r": 2.0}))
    found = accuracy(extended_model(wild, record), record)
    velocity = np.concatenate([batch.velocity for batch in record.batches])
    assert (found.rmse <= (1 + 1e-6) * LARGEST_ERROR * velocity.std(axis=0) + 1e-9).all()
    assert (np.abs(found.bias) <= found.rmse).all()
    assert (found.fit[[0, 2]] < -500).all()
    assert np.isfinite(found.growth).all()


def test_errors_of_simulations_that_hold_are_not_touched():
    rng = np.random.default_rng(0)
    measured = rng.standard_normal((3, 50, 2))
    error = rng.standard_normal((3, 50, 2))
    np.testing.assert_array_equal(clipped(error, measured), error)


@pytest.mark.thorough
def test_a_diagnosis_says_that_the_model_diverges_and_how_it_begins():
    """Anti-damping of 0.3 per second, where the vessel file allows damping: what is fitted to short windows holds."""
    record, ship = hidden_record("barge", seed=1, batches=2, samples=150), vessel_of("barge", relative_std=0.5)
    wild = replace(ship, model=ship.model.with_parameters({"N_r": 0.3}))
    (note,) = (note for note in diagnose(wild, record).notes if "diverges" in note)
    assert "begins with the model re-estimated within its standard deviations" in note
    assert not any("diverges" in note for note in diagnose(ship, record).notes)


@pytest.mark.parametrize(
    ("uncertain", "why"),
    [(True, "its parameters re-estimated .* diverge too"), (False, "nothing .* has a standard deviation")],
)
def test_a_diagnosis_says_why_it_begins_with_a_model_that_diverges(uncertain: bool, why: str):
    record, ship = hidden_record("barge", seed=1, batches=2, samples=150), vessel_of("barge")
    wild = extended_model(replace(ship, model=ship.model.with_parameters({"N_r": 2.0})), record)
    short = cut_windows(ship.model, record, longest_s=12.0)
    (note,) = note_on_divergence(accuracy(wild, record), short, re_estimated=False, uncertain=uncertain)
    assert re.search(f"begins with the model as it is, because {why}", note)
