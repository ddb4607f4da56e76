"""CasADi functions of the estimation: fast simulation of batches, and exact derivatives for output error.

Both are built from the terms of the model.

Source: J. A. E. Andersson et al., CasADi, Mathematical Programming Computation 11 (2019), 1-36.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from expdesign.estimation.regression import drive_width
from expdesign.estimation.replay.replay import INTEGRATORS, Called, Simulate, Stretches
from expdesign.simulation import motion_rates
from expdesign.simulation.motion import rates_over_ground, turns_current
from expdesign.simulation.run import SUBSTEPS
from expdesign.values import Array
from expdesign.vessel import VesselModel
from expdesign.vessel._casadi import CASADI

BLOCK_INSTRUCTIONS = 20_000  # size of the flat CasADi functions that simulations are cut into


def batch_simulator(
    model: VesselModel,
    *,
    samples: int,
    sample_time_s: float,
    integrator: str,
    substeps: int,
    parts: int,
    windy: bool,
    flowing: bool = False,
) -> Simulate:
    """A function that simulates batches of so many samples; numbers that run away come back as inf or nan.

    Its inputs have the columns of `drive_of` for so many parts of samples, where `windy` the n-frame wind to north and
    east [m/s], and where `flowing` the current.
    """
    width = drive_width(len(model.inputs), parts) + 2 * windy + 2 * flowing
    x, theta, drive = ca.SX.sym("x", model.states), ca.SX.sym("p", len(model.terms)), ca.SX.sym("i", width)
    current, turning = (drive[width - 2], drive[width - 1]) if flowing else (0.0, 0.0), turns_current(integrator)
    held, wind = _split(drive[: width - 2 * flowing], len(model.inputs), parts, windy)

    def rates(state: tuple[Any, ...], inputs: list[ca.SX]) -> tuple[Any, ...]:
        return motion_rates(
            model, state, inputs, current_to=current, wind_to=wind, ops=CASADI, parameters=theta, turning=turning
        )

    after = _stepped(rates, x, held, sample_time_s, integrator, substeps)
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


def stretch_functions(
    stretches: Stretches, steps: int, count: int, points: int, *, threads: int = 1
) -> tuple[Called, Called]:
    """Simulation of so many samples of so many stretches, and derivatives of the next states of so many points.

    The first takes starts (count, n), drives (count steps, m) and values (count steps, p + n), and gives states
    (count steps, n); the second states, drives and values of points, and gives (points, n, n) and (points, p + n, n),
    the transposes of derivatives by state and by values. Results do not depend on the number of threads.
    """
    m, n = stretches.drive.shape[2], len(stretches.states)
    step = velocity_step(stretches)
    x, u, values = ca.SX.sym("x", n), ca.SX.sym("u", m), ca.SX.sym("t", stretches.values + n)
    after = step(x, u, values)
    # reverse mode: there are three outputs and some thirty values
    reverse = {"helper_options": {"ad_weight": 1}}
    by_x, by_values = (ca.densify(ca.jacobian(after, seen, reverse)) for seen in (x, values))
    slopes = ca.Function("slopes", [x, u, values], [by_x, by_values], {"cse": True})
    q = values.size1()
    simulate = called(_mapped(step.mapaccum("stretch", steps), count, threads), ((count * steps, n),))
    return simulate, called(_mapped(slopes, points, threads), ((points, n, n), (points, q, n)))


def _mapped(function: ca.Function, count: int, threads: int) -> ca.Function:
    """The function, so many times, on as many threads."""
    shared: ca.Function
    shared = function.map(count, "thread", threads) if min(count, threads) > 1 else function.map(count)
    return shared


def called(function: ca.Function, shapes: tuple[tuple[int, ...], ...]) -> Called:
    """The function from arrays of numbers to new arrays of these shapes, without CasADi's matrices in between.

    Arrays lie in memory as CasADi's columns do: the last index counts rows.
    """
    buffer: Any
    buffer, run = function.buffer()

    def call(*arguments: Array) -> tuple[Array, ...]:
        given = [np.ascontiguousarray(rows, dtype=float) for rows in arguments]
        results = tuple(np.empty(shape) for shape in shapes)
        for place, rows in enumerate(given):
            buffer.set_arg(place, rows.data)
        for place, rows in enumerate(results):
            buffer.set_res(place, rows.data)
        run()
        return results

    return call


def velocity_step(problem: Stretches) -> ca.Function:
    """One sample of the modelled velocities: (state (n,), drive (c,), values (p + n,)) -> state.

    Values are parameters, a current, changes of times, and accelerations.
    """
    model, n, p = problem.model, len(problem.states), problem.values
    x, drive, values = ca.SX.sym("x", n), ca.SX.sym("i", problem.drive.shape[2]), ca.SX.sym("p", p + n)
    current, given = _current(problem, drive, values)
    held, wind = _split(_at_times(problem, given, values), len(model.inputs), problem.parts, problem.windy)
    theta = ca.SX(model.parameters)
    for index, place in enumerate(problem.sought):
        theta[place] = values[index]

    def rates(state: tuple[Any, ...], inputs: list[ca.SX]) -> tuple[Any, ...]:
        ground: list[Any] = [0.0, 0.0, 0.0]
        for index, place in enumerate(problem.states):
            ground[place] = state[index]
        water = (ground[0] - current[0], ground[1] - current[1], ground[2])
        air = (ground[0] - wind[0], ground[1] - wind[1])
        all_rates = model.accelerations(water, air, inputs, CASADI, theta)
        if turns_current(problem.integrator):
            all_rates = rates_over_ground(all_rates, current, ground[2])
        return tuple(all_rates[place] + values[p + index] for index, place in enumerate(problem.states))

    after = _stepped(rates, x, held, problem.sample_time_s, problem.integrator, problem.substeps)
    return ca.Function("velocities", [x, drive, values], [after], {"cse": True})


def _current(problem: Stretches, drive: ca.SX, values: ca.SX) -> tuple[tuple[Any, Any], ca.SX]:
    """The current's velocity in the b-frame, and what else acts."""
    if not problem.flowing:
        return (0.0, 0.0), drive
    first, width = len(problem.sought), drive.size1() - 2
    north, east, c, s = values[first], values[first + 1], drive[width], drive[width + 1]
    return (north * c + east * s, east * c - north * s), drive[:width]


def _at_times(problem: Stretches, drive: ca.SX, values: ca.SX) -> ca.SX:
    """What acts after the changes of times, without the derivatives by them."""
    width, first = drive_width(len(problem.model.inputs), problem.parts), problem.values - len(problem.times)
    acting, wind = (
        drive[:width],
        drive[width * (1 + len(problem.times)) :, 0],
    )  # a single row alone has no rest to slice
    for index in range(len(problem.times)):
        acting += values[first + index] * drive[width * (1 + index) : width * (2 + index)]
    return ca.vertcat(acting, wind)


Held = list[tuple[Any, list[ca.SX]]]
"""Share of each part of a sample, and its inputs."""


def _split(drive: ca.SX, m: int, parts: int, windy: bool) -> tuple[Held, tuple[Any, Any]]:
    """Inputs held over each part of a sample, and the wind."""
    signals = ca.vertsplit(drive)
    wind = (signals.pop(-2), signals.pop(-1)) if windy else (0.0, 0.0)
    if parts == 1:
        return [(1.0, signals)], wind
    return [(signals[parts * m + part], signals[part * m : (part + 1) * m]) for part in range(parts)], wind


def _stepped(rates: Any, x: ca.SX, held: Held, sample_time_s: float, integrator: str, substeps: int) -> ca.SX:
    """The state after a sample of so many steps or more; parts take no more than a step of `simulate` each."""
    state: tuple[Any, ...] = tuple(ca.vertsplit(x))
    each = substeps if len(held) == 1 else -(-substeps // SUBSTEPS)
    for share, inputs in held:
        for _ in range(each):
            state = INTEGRATORS[integrator](partial(rates, inputs=inputs), state, share * sample_time_s / each)
    after: ca.SX = ca.vertcat(*state)
    return after
