"""Data that cannot support a diagnosis are refused with what is missing."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_case import hidden_record, vessel_of

from expdesign.diagnosis import diagnose
from expdesign.errors import NotInformative
from expdesign.signals import Record


def test_a_record_too_short_is_refused():
    record = hidden_record("barge", seed=0, batches=1, samples=60)
    with pytest.raises(NotInformative, match=r"too short.*60 samples"):
        diagnose(vessel_of("barge"), record)


def test_a_steady_run_is_refused_and_the_inputs_are_named():
    (batch,) = hidden_record("barge", seed=0, batches=1, samples=200).batches
    steady = replace(batch, inputs=np.tile([10.0, 0.0, 0.0], (200, 1)))
    with pytest.raises(NotInformative, match=r"no input changes.*tau_x"):
        diagnose(vessel_of("barge"), Record(batches=(steady,)))
