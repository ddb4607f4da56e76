"""Derivatives of the program of legs: the first ones are exact, the second ones nearly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expdesign.plan.legs._casadi import Program, program
from expdesign.simulation import Environment
from expdesign.values import Array
from expdesign.vessel import IDEAL, Response
from plan_case import ship

RESPONSES = {"ideal": IDEAL, "lag": Response(lag_s=2.0), "lag and delay": Response(lag_s=1.5, delay_s=2.4)}


def program_of(response: Response, block: int, free_time: bool) -> Program:
    vessel = ship()
    slow = tuple(replace(item, responses=(response,) * len(item.limits)) for item in vessel.actuators)
    vessel = replace(vessel, model=replace(vessel.model, actuators=slow))
    weather = Environment(current_to=np.array([0.2, -0.1]), wind_to=np.array([3.0, 4.0]))
    return program(vessel, weather, 4, block, free_time)


def drawn(program: Program) -> tuple[Array, Array, Array]:
    """Variables, of which the sample time is the last, parameters, and weights of the constraints."""
    oracle, rng = program.solver.oracle(), np.random.default_rng(1)
    x, p, rows = (rng.normal(size=size) for size in (oracle.size1_in(0), oracle.size1_in(1), oracle.size1_out(1)))
    return x, p, rows


@pytest.mark.parametrize("response", RESPONSES.values(), ids=RESPONSES)
@pytest.mark.parametrize("block", [1, 2])
@pytest.mark.parametrize("free_time", [True, False])
def test_jacobian_is_that_of_algorithmic_differentiation(response, block, free_time):
    legs = program_of(response, block, free_time)
    x, p, _ = drawn(legs)
    expected = np.array(legs.solver.oracle().factory("theirs", ["x", "p"], ["jac:g:x"])(x, p))
    found = np.array(legs.solver.get_function("nlp_jac_g")(x, p)[1])
    assert np.abs(expected).max() > 1.0
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def error_of_hessian(legs: Program, sample_s: float) -> float:
    """Largest error beside the largest entry, without the column of the sample time."""
    x, p, rows = drawn(legs)
    x[-1] = sample_s
    theirs = legs.solver.oracle().factory(
        "theirs", ["x", "p", "lam:f", "lam:g"], ["triu:hess:gamma:x:x"], {"gamma": ["f", "g"]}
    )
    expected = np.array(theirs(x, p, 1.3, rows))[:, :-1]
    found = np.array(legs.solver.get_function("nlp_hess_l")(x, p, 1.3, rows))[:, :-1]
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("response", RESPONSES.values(), ids=RESPONSES)
@pytest.mark.parametrize("block", [1, 2])
@pytest.mark.parametrize("free_time", [True, False])
def test_hessian_is_nearly_that_of_algorithmic_differentiation(response, block, free_time):
    assert error_of_hessian(program_of(response, block, free_time), 0.1) < 0.01


@pytest.mark.parametrize("block", [1, 2])
@pytest.mark.parametrize("free_time", [True, False])
def test_error_of_the_hessian_falls_with_the_square_of_the_sample_time(block, free_time):
    legs = program_of(IDEAL, block, free_time)
    assert error_of_hessian(legs, 0.05) < 0.3 * error_of_hessian(legs, 0.1)
