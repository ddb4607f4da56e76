"""The only door to CasADi on this floor: fast simulation of a model over a batch, compiled from the model's own terms.

Source: J. A. E. Andersson et al., CasADi, Mathematical Programming Computation 11 (2019), 1-36.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from expdesign.simulation import euler_step, motion_rates, rk4_step
from expdesign.values import Array
from expdesign.vessel import Operators, VesselModel

CASADI = Operators(ca.fabs, ca.sin, ca.cos)
STEPS = {"euler": euler_step, "rk4": rk4_step}
Simulate = Callable[[Array, Array, Array], Array]
"""(parameters (p,), start state (6,), inputs (k, m)) -> states (k, 6); calm water and air."""


def step_function(model: VesselModel, *, sample_time_s: float, integrator: str, substeps: int) -> ca.Function:
    """One sample: (state (6,), inputs (m,), parameters (p,)) -> state."""
    x, inputs, theta = ca.SX.sym("x", 6), ca.SX.sym("i", len(model.inputs)), ca.SX.sym("p", len(model.terms))

    def rates(state: tuple[Any, ...]) -> tuple[Any, ...]:
        return motion_rates(model, state, ca.vertsplit(inputs), ops=CASADI, parameters=theta)

    state: tuple[Any, ...] = tuple(ca.vertsplit(x))
    for _ in range(substeps):
        state = STEPS[integrator](rates, state, sample_time_s / substeps)
    return ca.Function("sample", [x, inputs, theta], [ca.vertcat(*state)])


def batch_simulator(
    model: VesselModel, *, samples: int, sample_time_s: float, integrator: str, substeps: int
) -> Simulate:
    """A function that simulates batches of so many samples; numbers that run away come back as inf or nan."""
    step = step_function(model, sample_time_s=sample_time_s, integrator=integrator, substeps=substeps)
    p = len(model.terms)
    x, theta, inputs = ca.SX.sym("x", 6), ca.SX.sym("p", p), ca.SX.sym("i", len(model.inputs))
    held = ca.Function("held", [ca.vertcat(x, theta), inputs], [ca.vertcat(step(x, inputs, theta), theta)])
    run = held.mapaccum("batch", max(1, samples - 1))

    def simulate(parameters: Array, start: Array, values: Array) -> Array:
        if samples == 1:
            return np.asarray(start[None, :])
        states = np.asarray(run(np.concatenate([start, parameters]), values[:-1].T))[:6].T
        return np.concatenate([start[None, :], states])

    return simulate
