"""Stretches of data simulated side by side, with derivatives by parameters and first states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from expdesign.simulation import euler_step, rk4_step
from expdesign.values import Array
from expdesign.vessel import VesselModel

INTEGRATORS = {"euler": euler_step, "rk4": rk4_step}
Simulate = Callable[[Array, Array, Array], Array]
"""(parameters (p,), start state (6 or 8,), inputs (k, m)) -> states (k, 6 or 8); calm water."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Stretches:
    """W stretches of data of L samples each, simulated side by side; the shorter ones are filled up and not compared.

    Attributes:
        model: structure; gives the values of parameters not sought.
        sought: (p,) places of the parameters to find, among the model's.
        states: (n,) places of the velocities that have an equation, among u, v, r.
        drive: (L, W, c) inputs as of `drive_of`; two columns more, the wind's velocity in the b-frame, where `windy`.
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
        stretches: the simulated stretches.
        run: (starts, drives, values) -> states after each sample.
        slopes: (states, drives, values) -> derivatives of the next state by state and by values.
    """

    stretches: Stretches
    run: Any
    slopes: Any

    def states(self, values: Array, start: Array) -> Array:
        """(L, W, n) velocities from start velocities (W, n) and values (W, p + n): parameters, then accelerations.

        A constant acceleration [unit of the output per second] stands for steady forces outside the model.
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
    from expdesign.estimation.replay._casadi import stretch_functions  # CasADi takes a second to load

    return Compiled(stretches, *stretch_functions(stretches))
