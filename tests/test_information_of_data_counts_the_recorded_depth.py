"""Information of data is counted at the depth of the data, not in deep water."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.estimation.regression.regression import with_depth
from expdesign.information.recorded import recorded_information
from expdesign.signals import Record
from expdesign.simulation import CALM
from expdesign.vessel import Term
from expdesign.workflows.steps.known import data_parts, expected_std, in_recorded_depth

SHOAL, GROWTH = 0.4, 0.8
PARAMETERS = ("Y_v", "Y_ur", "Y_mu")


@pytest.fixture(scope="module")
def case():
    """A record in water of one depth; the ship as a model that reads depth, and as one whose numbers hold there."""
    plain = vessel_of("barge")
    noisy = replace(plain.sensors, velocity_mps=0.02, yaw_rate_radps=0.003, wind_mps=0.1)
    plain = replace(plain, sensors=noisy)
    factor = 1 + GROWTH * SHOAL
    terms = tuple(
        Term("v", "Y_v", f"(v)*(1 + {GROWTH}*h)") if term.name == "Y_v" else term for term in plain.model.terms
    )
    reading = replace(plain, model=replace(plain.model, terms=terms))
    value = plain.model.parameters[plain.model.names.index("Y_v")]
    there = replace(plain, model=plain.model.with_parameters({"Y_v": factor * value}))
    record = hidden_record("barge", seed=5, batches=2, samples=200)
    depth = np.full(200, plain.draught_m / SHOAL)
    record = Record(batches=tuple(replace(batch, depth_m=depth) for batch in record.batches))
    return reading, there, record, factor


def test_expected_deviations_scale_with_the_factor_of_the_depth(case):
    """theta (1 + a h) is one number where h is constant, so theta is known by that factor better."""
    reading, there, record, factor = case
    deep = with_depth(record, reading.draught_m)
    arguments = {"environment": CALM, "mean_subtraction": "none"}
    found = expected_std(in_recorded_depth(reading), data_parts(deep, reading), PARAMETERS, **arguments)
    wanted = expected_std(there, data_parts(record, there), PARAMETERS, **arguments) / [factor, 1.0, 1.0]
    np.testing.assert_allclose(found, wanted, rtol=1e-6)


def test_information_of_prior_data_scales_with_the_factor_of_the_depth(case):
    reading, there, record, factor = case
    found = recorded_information(
        with_depth(record, reading.draught_m), reading.model, PARAMETERS, regressors="simulated"
    )
    wanted = recorded_information(record, there.model, PARAMETERS, regressors="simulated")
    scale = np.array([factor, 1.0, 1.0])
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_allclose(one.X, other.X * np.outer(scale, scale), rtol=1e-9)
