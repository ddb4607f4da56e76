"""The simulation's only use of CasADi: integrator steps of the equations of motion as compiled functions.

Parameters, weather and the length of a step are inputs, so models of one structure share the functions. Steps are
chained into flat functions of 1, 2, 4, ... steps, so that any number of them takes few calls.

Source: J. A. E. Andersson et al., CasADi, Mathematical Programming Computation 11 (2019), 1-36.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from expdesign.simulation.actuation import step_times
from expdesign.simulation.motion import State, integrator_step, motion_rates, turns_current
from expdesign.values import Array
from expdesign.vessel import Actuator, Inertia, Roll, Term, VesselModel
from expdesign.vessel._casadi import CASADI, fill, for_ships

LARGEST = 16_000  # largest number of instructions in one function; in longer ones a step takes as much time


class CompiledIntegrator:
    """Integrator steps of a model."""

    def __init__(self, model: VesselModel, integrator: str) -> None:
        """Take the structure and the parameters of a model.

        Raises:
            UnknownName: no such integrator.
            InputError: Euler's map for a model that rolls.
        """
        integrator_step(integrator, model)
        structure = model.terms, model.form, model.sample_time_s, model.actuators, model.roll, model.inertia
        self._functions = compiled_steps(structure, integrator)
        self._states, self._parameters = model.states, np.array(model.parameters)

    def states(
        self,
        start: Array,
        delivered: Array,
        *,
        sea: Array,
        sample_time_s: float,
        substeps: int | Array,
        parameters: Array | None = None,
    ) -> Array:
        """States at every sample; not-a-numbers and infinities where the motion diverges.

        Args:
            start: (6,) pose and velocity, with a roll mode (8,).
            delivered: (k, substeps, m) inputs over each step, or (k, 1, m) where they are held over a sample.
            sea: (k, 4), or (1, 4) where steady: n-frame current and wind to north and east [m/s].
            sample_time_s: time between samples [s].
            substeps: integrator steps per sample, or the shares of it that they take.
            parameters: (p,) in the model's own form; None for the model's.

        Returns:
            (k + 1, 6 or 8), the start first.
        """
        samples, _, inputs = delivered.shape
        steps_s = step_times(substeps, sample_time_s)
        count = len(steps_s)
        drive = np.empty((samples, count, inputs + 4))
        drive[..., :inputs], drive[..., inputs:] = delivered, sea[:, None]
        result = np.empty((samples * count + 1, self._states))
        result[0] = start
        theta = self._parameters if parameters is None else np.array(parameters, dtype=float)
        self._fill(result, drive.reshape(samples * count, inputs + 4), theta, np.tile(steps_s, samples))
        return result[::count]

    def _fill(self, result: Array, drive: Array, parameters: Array, steps_s: Array) -> None:
        """Write the states (k + 1, n) after the first, for drives (k, m + 4) over steps of these lengths (k,)."""
        done = 0
        for length, function in self._functions.items():
            if done + length > len(drive):
                continue
            buffer, run = function.buffer()
            buffer.set_arg(2, parameters.data)
            while done + length <= len(drive):
                end = done + length
                buffer.set_arg(0, result[done].data)
                buffer.set_arg(1, drive[done:end].data)
                buffer.set_arg(3, steps_s[done:end].data)
                buffer.set_res(0, result[done + 1 : end + 1].data)
                run()
                done = end


class CompiledSample:
    """One sample of several ships, each with parameters, inputs and weather of its own."""

    def __init__(self, model: VesselModel, *, rows: int, substeps: int) -> None:
        """Compile `substeps` Runge-Kutta steps, with as many `rows` of inputs, or one where they are held."""
        structure = model.terms, model.form, model.sample_time_s, model.actuators, model.roll, model.inertia
        self._functions = compiled_samples(structure, rows, substeps)

    def states(self, start: Array, delivered: Array, *, sea: Array, parameters: Array, steps_s: Array) -> Array:
        """(n, 6) states a sample later; not-a-numbers and infinities where the motion diverges.

        Args:
            start: (n, 6) pose and velocity; with a roll mode (n, 8).
            delivered: (rows, m, n) inputs.
            sea: (4, n) n-frame current and wind to north and east [m/s].
            parameters: (n, p) in the model's own form.
            steps_s: (substeps,) lengths of the steps [s].
        """
        rows, inputs, ships = delivered.shape
        drive = np.empty((ships, rows, inputs + 4))
        drive[..., :inputs], drive[..., inputs:] = delivered.transpose(2, 0, 1), sea.T[:, None]
        result = np.empty(start.shape)
        fill(self._functions, (start, drive, parameters), (steps_s,), (result,))
        return result


@lru_cache(maxsize=64)
def compiled_sample(model: VesselModel, *, rows: int, substeps: int) -> CompiledSample:
    """The sample of a model, made once and kept."""
    return CompiledSample(model, rows=rows, substeps=substeps)


@lru_cache(maxsize=64)
def compiled_integrator(model: VesselModel, integrator: str) -> CompiledIntegrator:
    """The integrator of a model, made once and kept."""
    return CompiledIntegrator(model, integrator)


Structure = tuple[tuple[Term, ...], str, float, tuple[Actuator, ...], Roll | None, Inertia | None]
"""Terms, form, sample time, actuators, roll and inertia of a model: everything but the values of its parameters."""


@lru_cache(maxsize=16)
def compiled_steps(structure: Structure, integrator: str) -> dict[int, Any]:
    """Number of steps, largest first -> (state, drive of each step, parameters, length of each step) -> states."""
    step = _step(structure, integrator)
    most = max(1, LARGEST // step.n_instructions())
    return {length: _chained(step, length) for length in (1 << power for power in reversed(range(most.bit_length())))}


@lru_cache(maxsize=32)
def compiled_samples(structure: Structure, rows: int, substeps: int) -> dict[int, Any]:
    """Number of ships, largest first -> (state, drive, parameters of each, length of each step) -> states."""
    step = _step(structure, "rk4")
    x, theta = ca.SX.sym("x", step.size1_in(0)), ca.SX.sym("theta", step.size1_in(2))
    drive, steps_s = ca.SX.sym("drive", step.size1_in(1), rows), ca.SX.sym("steps_s", substeps)
    state = x
    for index in range(substeps):
        state = step(state, drive[:, index % rows], theta, steps_s[index])
    one = ca.Function("sample", [x, ca.vec(drive), theta, steps_s], [ca.cse(state)])
    return for_ships(one, own=3)


def _chained(step: ca.Function, length: int) -> ca.Function:
    """So many steps as one flat function."""
    x, drive = ca.SX.sym("x", step.size1_in(0)), ca.SX.sym("drive", step.size1_in(1), length)
    theta, steps_s = ca.SX.sym("theta", step.size1_in(2)), ca.SX.sym("steps_s", length)
    states = [x]
    for index in range(length):
        states.append(step(states[-1], drive[:, index], theta, steps_s[index]))
    return ca.Function("steps", [x, drive, theta, steps_s], [ca.horzcat(*states[1:])])


def _step(structure: Structure, integrator: str) -> ca.Function:
    """`motion_rates` stepped once; what depends on the inputs alone is worked out once."""
    terms, form, sample_time_s, actuators, roll, inertia = structure
    zeros = np.zeros(len(terms))
    model = VesselModel(
        terms=terms,
        parameters=zeros,
        parameter_std=zeros,
        form=form,
        sample_time_s=sample_time_s,
        actuators=actuators,
        roll=roll,
        inertia=inertia,
    )
    m = len(model.inputs)
    x, drive = ca.SX.sym("x", model.states), ca.SX.sym("drive", m + 4)
    theta, step_s = ca.SX.sym("theta", len(terms)), ca.SX.sym("step_s")
    inputs, current, wind = (ca.vertsplit(part) for part in ca.vertsplit(drive, [0, m, m + 2, m + 4]))
    values = ca.vertsplit(theta)

    def rates(state: State) -> State:
        return motion_rates(
            model,
            state,
            inputs,
            current_to=current,
            wind_to=wind,
            ops=CASADI,
            parameters=values,
            turning=turns_current(integrator),
        )

    after = integrator_step(integrator, model)(rates, tuple(ca.vertsplit(x)), step_s)
    return ca.Function("step", [x, drive, theta, step_s], [ca.densify(ca.cse(ca.vertcat(*after)))])
