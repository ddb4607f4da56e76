"""Derivatives of the program of legs, put together from its structure, are those of algorithmic differentiation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expdesign.plan.legs._casadi import program
from expdesign.simulation import Environment
from expdesign.vessel import IDEAL, Response
from plan_case import ship

RESPONSES = {"ideal": IDEAL, "lag": Response(lag_s=2.0), "lag and delay": Response(lag_s=1.5, delay_s=2.4)}


@pytest.mark.parametrize("response", RESPONSES.values(), ids=RESPONSES)
@pytest.mark.parametrize("block", [1, 2])
@pytest.mark.parametrize("free_time", [True, False])
def test_jacobian_and_hessian_are_those_of_algorithmic_differentiation(response, block, free_time):
    vessel = ship()
    slow = tuple(replace(item, responses=(response,) * len(item.limits)) for item in vessel.actuators)
    vessel = replace(vessel, model=replace(vessel.model, actuators=slow))
    weather = Environment(current_to=np.array([0.2, -0.1]), wind_to=np.array([3.0, 4.0]))
    solver = program(vessel, weather, 4, block, free_time).solver
    oracle = solver.oracle()
    ours = solver.get_function("nlp_jac_g"), solver.get_function("nlp_hess_l")
    theirs = (
        oracle.factory("their_jacobian", ["x", "p"], ["jac:g:x"]),
        oracle.factory("their_hessian", ["x", "p", "lam:f", "lam:g"], ["triu:hess:gamma:x:x"], {"gamma": ["f", "g"]}),
    )
    rng = np.random.default_rng(1)
    x, p, rows = (rng.normal(size=size) for size in (oracle.size1_in(0), oracle.size1_in(1), oracle.size1_out(1)))
    jacobians = np.array(ours[0](x, p)[1]), np.array(theirs[0](x, p))
    hessians = np.array(ours[1](x, p, 1.3, rows)), np.array(theirs[1](x, p, 1.3, rows))
    for found, expected in (jacobians, hessians):
        assert np.abs(expected).max() > 1.0
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
