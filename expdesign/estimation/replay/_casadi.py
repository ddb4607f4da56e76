"""The only door to CasADi on this floor: fast simulation of batches, and the slopes that least simulation error needs.

Both are made from the model's own terms; derivatives are exact.

Source: J. A. E. Andersson et al., CasADi, Mathematical Programming Computation 11 (2019), 1-36.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from expdesign.simulation import euler_step, motion_rates, rk4_step
from expdesign.values import Array
from expdesign.vessel import Operators, VesselModel

CASADI = Operators(ca.fabs, ca.sin, ca.cos)
STEPS = {"euler": euler_step, "rk4": rk4_step}
Simulate = Callable[[Array, Array, Array], Array]
"""(parameters (p,), start state (6 or 8,), inputs (k, m)) -> states (k, 6 or 8); calm water."""
BLOCK_INSTRUCTIONS = 20_000
"""Size of the flat functions that simulations are cut into."""


def batch_simulator(
    model: VesselModel, *, samples: int, sample_time_s: float, integrator: str, substeps: int, windy: bool = False
) -> Simulate:
    """A function that simulates batches of so many samples; numbers that run away come back as inf or nan.

    Where `windy`, two columns follow the model's inputs: the n-frame wind to north and east [m/s].
    """
    m, p = len(model.inputs), len(model.terms)
    x, theta, drive = ca.SX.sym("x", model.states), ca.SX.sym("p", p), ca.SX.sym("i", m + 2 * windy)
    wind = (drive[m], drive[m + 1]) if windy else (0.0, 0.0)

    def rates(state: tuple[Any, ...]) -> tuple[Any, ...]:
        return motion_rates(model, state, ca.vertsplit(drive[:m]), wind_to=wind, ops=CASADI, parameters=theta)

    after = _stepped(rates, x, sample_time_s, integrator, substeps)
    return _chained(ca.Function("step", [x, drive, theta], [after]), samples)


def _chained(step: ca.Function, samples: int) -> Simulate:
    """Many samples of a step (state, inputs, parameters) -> state, a block of them as one flat function."""
    n, m, p = (step.size1_in(index) for index in range(3))
    length = max(1, min(samples - 1, BLOCK_INSTRUCTIONS // step.n_instructions()))
    x, drive, theta = ca.SX.sym("x", n), ca.SX.sym("i", m, length), ca.SX.sym("p", p)
    states = [x]
    for sample in range(length):
        states.append(step(states[-1], drive[:, sample], theta))
    block = ca.Function("block", [x, drive, theta], [ca.densify(ca.horzcat(*states[1:]))])
    blocks = -(-(samples - 1) // length)

    def simulate(parameters: Array, start: Array, values: Array) -> Array:
        held = np.zeros((blocks * length, m))
        held[: samples - 1] = values[: samples - 1]
        result, theta = np.empty((blocks * length + 1, n)), np.array(parameters, dtype=float)
        result[0] = start
        buffer: Any
        buffer, run = block.buffer()
        buffer.set_arg(2, theta.data)
        for first in range(0, blocks * length, length):
            buffer.set_arg(0, result[first].data)
            buffer.set_arg(1, held[first : first + length].data)
            buffer.set_res(0, result[first + 1 : first + length + 1].data)
            run()
        return result[:samples]

    return simulate


@dataclass(frozen=True, kw_only=True, eq=False)
class Stretches:
    """W stretches of data of L samples each, simulated side by side; the shorter ones are filled up and not compared.

    Attributes:
        model: structure; gives the values of parameters not sought.
        sought: (p,) places of the parameters to find, among the model's.
        states: (n,) places of the velocities that have an equation, among u, v, r.
        drive: (L, W, m) inputs; two columns more, the wind's velocity in the b-frame, where `windy`.
        windy: whether air velocities are those of that wind.
        sample_time_s: of all stretches.
        integrator, substeps: how the model is integrated.
    """

    model: VesselModel
    sought: tuple[int, ...]
    states: tuple[int, ...]
    drive: Array
    windy: bool
    sample_time_s: float
    integrator: str
    substeps: int


@dataclass(frozen=True, eq=False)
class Compiled:
    """Stretches made ready to be simulated with any values.

    Attributes:
        stretches: what is simulated.
        run: (starts, drives, values) -> states after each sample.
        slopes: (states, drives, values) -> derivatives of the next state by state and by values.
    """

    stretches: Stretches
    run: ca.Function
    slopes: ca.Function

    def states(self, values: Array, start: Array) -> Array:
        """(L, W, n) velocities from start velocities (W, n) and values (W, p + n): parameters, then accelerations.

        A constant acceleration [unit of the output per second] stands for whatever steady force acts beside the model.
        """
        (length, count, m), n = self.stretches.drive.shape, start.shape[1]
        if length == 1:
            return start[None].copy()
        drive = self.stretches.drive[:-1].transpose(1, 0, 2).reshape(-1, m)
        states = self.run(start.T, drive.T, np.repeat(values, length - 1, axis=0).T)
        return np.concatenate([start[None], states.full().T.reshape(count, length - 1, n).transpose(1, 0, 2)])

    def sensitivities(self, values: Array, states: Array) -> tuple[Array, Array]:
        """Derivatives of simulated states (L, W, n): by the values (L, W, n, p + n), by the start (L, W, n, n)."""
        (length, count, n), q = states.shape, values.shape[1]
        by_values, by_start = np.zeros((length, count, n, q)), np.zeros((length, count, n, n))
        by_start[0] = np.eye(n)
        flat = (length - 1) * count
        if not flat:
            return by_values, by_start
        held = np.broadcast_to(values, (length - 1, count, q)).reshape(flat, q)
        drive = self.stretches.drive[:-1].reshape(flat, -1)
        A, B = (
            part.full().reshape(n, flat, -1).transpose(1, 0, 2).reshape(length - 1, count, n, -1)
            for part in self.slopes(states[:-1].reshape(flat, n).T, drive.T, held.T)
        )
        for index in range(1, length):
            by_start[index] = A[index - 1] @ by_start[index - 1]
            by_values[index] = A[index - 1] @ by_values[index - 1] + B[index - 1]
        return by_values, by_start


def compiled(stretches: Stretches) -> Compiled:
    """Everything that does not depend on the values, done once."""
    (length, count, m), n = stretches.drive.shape, len(stretches.states)
    steps = max(1, length - 1)
    step = velocity_step(stretches)
    x, u, values = ca.SX.sym("x", n), ca.SX.sym("u", m), ca.SX.sym("t", len(stretches.sought) + n)
    after = step(x, u, values)
    slopes = ca.Function("slopes", [x, u, values], [ca.jacobian(after, x), ca.jacobian(after, values)])
    return Compiled(stretches, step.mapaccum("stretch", steps).map(count), slopes.map(steps * count))


def velocity_step(problem: Stretches) -> ca.Function:
    """One sample of the modelled velocities: (state (n,), drive (m,), values (p + n,)) -> state."""
    model, n, p = problem.model, len(problem.states), len(problem.sought)
    m = len(model.inputs)
    x, drive, values = ca.SX.sym("x", n), ca.SX.sym("i", problem.drive.shape[2]), ca.SX.sym("p", p + n)
    theta = ca.SX(model.parameters)
    for index, place in enumerate(problem.sought):
        theta[place] = values[index]

    def rates(state: tuple[Any, ...]) -> tuple[Any, ...]:
        water: list[Any] = [0.0, 0.0, 0.0]
        for index, place in enumerate(problem.states):
            water[place] = state[index]
        wind = (drive[m], drive[m + 1]) if problem.windy else (0.0, 0.0)
        air = (water[0] - wind[0], water[1] - wind[1])
        all_rates = model.accelerations(water, air, ca.vertsplit(drive[:m]), CASADI, theta)
        return tuple(all_rates[place] + values[p + index] for index, place in enumerate(problem.states))

    after = _stepped(rates, x, problem.sample_time_s, problem.integrator, problem.substeps)
    return ca.Function("velocities", [x, drive, values], [after])


def _stepped(rates: Any, x: ca.SX, sample_time_s: float, integrator: str, substeps: int) -> ca.SX:
    state: tuple[Any, ...] = tuple(ca.vertsplit(x))
    for _ in range(substeps):
        state = STEPS[integrator](rates, state, sample_time_s / substeps)
    after: ca.SX = ca.vertcat(*state)
    return after
