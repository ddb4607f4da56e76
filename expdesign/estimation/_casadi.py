"""The only door to CasADi on this floor: fast simulation of batches, and least simulation error by multiple shooting.

Both are made from the model's own terms, with exact derivatives.

Source: H. G. Bock, in Modelling of Chemical Reaction Systems (1981), 102-125;
J. A. E. Andersson et al., CasADi, Mathematical Programming Computation 11 (2019), 1-36.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

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
        states = np.asarray(run(np.concatenate([start, parameters]), values[:-1].T)[:6, :]).T
        return np.concatenate([start[None, :], states])

    return simulate


@dataclass(frozen=True, eq=False)
class OutputErrorProblem:
    """Least simulation error over batches, with a shooting node at every sample.

    Attributes:
        model: structure; gives the values of parameters not sought.
        sought: (p,) places of the parameters to find, among the model's.
        states: (n,) places of the velocities that have an equation, among u, v, r.
        inputs: (k, m) of all batches, one after the other.
        measured: (k, n) velocities, nan where missing.
        weights: (n,) one over the variance of each output's noise.
        last: (k,) True at the last sample of each batch.
        sample_time_s: of all batches.
        integrator, substeps: how the model is integrated.
        start: (p,) first guess.
        scale: (p,) typical sizes.
    """

    model: VesselModel
    sought: tuple[int, ...]
    states: tuple[int, ...]
    inputs: Array
    measured: Array
    weights: Array
    last: NDArray[np.bool_]
    sample_time_s: float
    integrator: str
    substeps: int
    start: Array
    scale: Array


def solve_output_error(problem: OutputErrorProblem) -> tuple[Array, Array] | None:
    """Parameters (p,) and states (k, n), or None when IPOPT finds no optimum. Derivatives are exact."""
    step, (k, n) = _velocity_step(problem), problem.measured.shape
    sigma = 1.0 / np.sqrt(problem.weights)
    theta, x = ca.MX.sym("theta", len(problem.sought)), ca.MX.sym("x", n, k)
    states = ca.DM(sigma) * x
    inner = np.flatnonzero(~problem.last)
    after = step.map(len(inner))(
        states[:, inner.tolist()],
        problem.inputs[inner].T,
        ca.repmat(theta * ca.DM(problem.scale), 1, len(inner)),
    )
    defects = ca.vec((after - states[:, (inner + 1).tolist()]) / ca.DM(sigma))
    seen = np.isfinite(problem.measured)
    target = np.where(seen, problem.measured / sigma, 0.0)
    cost = 0.5 * ca.sumsqr(ca.DM(seen.T.astype(float)) * (x - ca.DM(target.T)))
    options: dict[str, Any] = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.max_iter": 200}
    nlp: Any = {"x": ca.vertcat(theta, ca.vec(x)), "f": cost, "g": defects}
    solver = ca.nlpsol("output_error", "ipopt", nlp, options)
    filled = _filled(target, seen)
    answer = solver(x0=np.concatenate([problem.start / problem.scale, filled.ravel()]), lbg=0.0, ubg=0.0)
    if not solver.stats()["success"]:
        return None
    values = np.asarray(answer["x"]).ravel()
    p = len(problem.sought)
    return values[:p] * problem.scale, values[p:].reshape(k, n) * sigma


def sensitivities(problem: OutputErrorProblem, parameters: Array, states: Array) -> Array:
    """(k, n, p + n) derivatives of the simulated states by the parameters and by the batch's first state."""
    step, (k, n) = _velocity_step(problem), states.shape
    x, u, theta = ca.MX.sym("x", n), ca.MX.sym("u", problem.inputs.shape[1]), ca.MX.sym("t", len(parameters))
    after = step(x, u, theta)
    slopes = ca.Function("slopes", [x, u, theta], [ca.jacobian(after, x), ca.jacobian(after, theta)]).map(k)
    A, B = (
        np.asarray(part).reshape(n, k, -1).transpose(1, 0, 2)
        for part in slopes(states.T, problem.inputs.T, np.repeat(parameters[:, None], k, axis=1))
    )
    p = len(parameters)
    first = np.concatenate([np.zeros((n, p)), np.eye(n)], axis=1)
    result, fresh = np.empty((k, n, p + n)), True
    for index in range(k):
        result[index] = first if fresh else A[index - 1] @ result[index - 1]
        if not fresh:
            result[index, :, :p] += B[index - 1]
        fresh = bool(problem.last[index])
    return result


def _velocity_step(problem: OutputErrorProblem) -> ca.Function:
    """One sample of the modelled velocities: (state (n,), inputs (m,), sought parameters (p,)) -> state."""
    full = step_function(
        problem.model,
        sample_time_s=problem.sample_time_s,
        integrator=problem.integrator,
        substeps=problem.substeps,
    )
    n = len(problem.states)
    x, u, sought = ca.SX.sym("x", n), ca.SX.sym("i", problem.inputs.shape[1]), ca.SX.sym("p", len(problem.sought))
    state, theta = ca.SX.zeros(6), ca.SX(problem.model.parameters)
    for index, place in enumerate(problem.states):
        state[3 + place] = x[index]
    for index, place in enumerate(problem.sought):
        theta[place] = sought[index]
    after = full(state, u, theta)
    return ca.Function("velocities", [x, u, sought], [after[[3 + place for place in problem.states]]])


def _filled(values: Array, seen: NDArray[np.bool_]) -> Array:
    """Gaps in columns filled linearly, for a first guess."""
    places = np.arange(len(values))
    return np.stack(
        [
            np.interp(places, places[ok], column[ok]) if ok.any() else column
            for column, ok in zip(values.T, seen.T, strict=True)
        ],
        axis=1,
    )
