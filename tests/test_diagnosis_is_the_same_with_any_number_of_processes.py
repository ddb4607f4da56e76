"""Fits of candidates and folds may be shared among processes; what is found does not depend on it."""

import sys

import numpy as np

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis import Diagnosis, diagnose
from expdesign.processes import local_processes


def test_two_processes_find_what_one_finds(monkeypatch):
    monkeypatch.setattr(sys.modules["expdesign.diagnosis.diagnose"], "FEW_SAMPLES", 0)
    record = hidden_record("barge", seed=12, batches=2, samples=80, effects={"gain": -0.2})

    def found(processes: int) -> Diagnosis:
        with local_processes(processes):
            return diagnose(vessel_of("barge"), record)

    one, two = found(1), found(2)
    assert [item.cause for item in one.findings] == ["thrust_gain"]
    assert two.verdict == one.verdict
    assert two.notes == one.notes
    for first, second in zip(one.findings, two.findings, strict=True):
        assert [(each.name, each.value, each.std) for each in first.estimates] == [
            (each.name, each.value, each.std) for each in second.estimates
        ]
        assert second.gain_interval == first.gain_interval
    assert np.array_equal(two.extended.model.parameters, one.extended.model.parameters)
