"""Data that cannot support a diagnosis are refused with what is missing."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis import diagnose
from expdesign.errors import InputError, NotInformative
from expdesign.signals import Record


def test_a_record_too_short_is_refused():
    record = hidden_record("barge", seed=0, batches=1, samples=60)
    with pytest.raises(NotInformative, match=r"too short.*60 samples"):
        diagnose(vessel_of("barge"), record)


def test_more_data_than_memory_may_hold_are_refused_at_once():
    (batch,) = hidden_record("barge", seed=0, batches=1, samples=200).batches
    with pytest.raises(InputError, match=r"have 400200 samples, expected at most 400000: give fewer runs"):
        diagnose(vessel_of("barge"), Record(batches=(batch,) * 2001))


def test_a_steady_run_is_refused_and_the_inputs_are_named():
    (batch,) = hidden_record("barge", seed=0, batches=1, samples=200).batches
    steady = replace(batch, inputs=np.tile([10.0, 0.0, 0.0], (200, 1)))
    with pytest.raises(NotInformative, match=r"no input changes.*tau_x"):
        diagnose(vessel_of("barge"), Record(batches=(steady,)))


def test_inputs_that_only_tremble_are_a_steady_run():
    """Measured revolutions are never quite constant: what counts is whether the motion answers above its noise."""
    (batch,) = hidden_record("barge", seed=0, batches=1, samples=200).batches
    tremble = 0.01 * np.random.default_rng(0).standard_normal((200, 3))
    steady = replace(batch, inputs=np.tile([10.0, 0.0, 0.0], (200, 1)) + tremble)
    with pytest.raises(NotInformative, match=r"change so little \(tau_x by 0.0.*larger changes"):
        diagnose(vessel_of("barge"), Record(batches=(steady,)))


def test_ten_seconds_at_twenty_hertz_are_too_short_however_many_samples():
    record = hidden_record("barge", seed=0, batches=1, samples=200, step_s=0.05)
    with pytest.raises(NotInformative, match="too short"):
        diagnose(vessel_of("barge", sample_time_s=0.05), record)


def test_an_output_that_is_not_measured_is_named():
    record = hidden_record("barge", seed=0, batches=2, samples=120)
    blind = [replace(b, velocity=b.velocity * [1.0, np.nan, 1.0]) for b in record.batches]
    with pytest.raises(NotInformative, match="v is not measured"):
        diagnose(vessel_of("barge"), Record(batches=tuple(blind)))
