"""Drawn ships in drawn weather, simulated sample by sample under commands of their own.

Each ship has parameters of its own, a current and a wind that keep their drawn means or vary round them, and actuators
that deliver as the vessel's file says. For ships that wait, only the weather goes on.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from expdesign.simulation import ActuatorState, Environment, rk4_step
from expdesign.simulation.environment import vary
from expdesign.simulation.program import RatesProgram
from expdesign.simulation.run import LARGEST_SPEED, SUBSTEPS
from expdesign.values import Array, seal
from expdesign.vessel import Vessel


@dataclass(frozen=True, kw_only=True, eq=False)
class Truths:
    """True parameters and mean weather of n ships.

    Attributes:
        parameters: (n, p) in the model's own form.
        current_to, wind_to: (n, 2) means of their trials [m/s].
    """

    parameters: Array
    current_to: Array
    wind_to: Array

    def __post_init__(self) -> None:
        seal(self, parameters="n p", current_to="n 2", wind_to="n 2")


class Fleet:
    """n ships and their states.

    Attributes:
        vessel: the nominal one.
        states: (n, 6) pose in the n-frame and velocity over ground in the b-frame.
        given: (n, m) commands standing.
        delivered: (n, m) what the actuators gave over the last sample, on average.
        lost: (n,) ships whose motion diverged; they stay where they were.
    """

    def __init__(
        self,
        vessel: Vessel,
        environment: Environment,
        truths: Truths,
        *,
        state: Array,
        standing: Array,
        rng: np.random.Generator,
    ) -> None:
        """All ships begin in one state (6,) with commands (m,) that have stood for long.

        Args:
            vessel: structure, actuators, sample time.
            environment: how current and wind vary.
            truths: of each ship.
            state, standing: at the beginning.
            rng: of the weather.
        """
        runs = len(truths.parameters)
        self.vessel, self._rng = vessel, rng
        self.states: Array = np.tile(state, (runs, 1))
        self.given: Array = np.tile(standing, (runs, 1))
        self.lost = np.zeros(runs, dtype=bool)
        self._actuators = ActuatorState.standing(
            vessel.responses, self.given.T, sample_time_s=vessel.sample_time_s, substeps=SUBSTEPS
        )
        self.delivered = self.given.copy()
        self._variations = (environment.current_variation, environment.wind_variation)
        self._means = (truths.current_to, truths.wind_to)
        self._varied: list[Array | None] = [None, None]
        self._program = RatesProgram(vessel.model, runs=runs, parameters=truths.parameters)

    def advance(self, commands: Array, moving: np.ndarray) -> None:
        """One sample with commands (n, m) for the ships that move (n,); the others wait."""
        moving = moving & ~self.lost
        held = np.where(moving[:, None], commands, self.given)
        given = self._actuators.mean(held.T)  # (substeps or 1, m, n)
        self._actuators = self._actuators.after(held.T, moving)
        self._program.sea[...] = self._weather()
        self._program.hold(given)
        state = self.states.T
        step_s = self.vessel.sample_time_s / SUBSTEPS
        with np.errstate(over="ignore", invalid="ignore"):
            for part in range(SUBSTEPS):
                if part < len(given):
                    self._program.select(part)
                (state,) = rk4_step(self._rates, (state,), step_s)
            settled = np.abs(state[3:]).max(axis=0) < LARGEST_SPEED
        self.lost |= moving & ~settled
        moved = moving & settled
        self.states = np.where(moved[:, None], state.T, self.states)
        self.given = np.where(moved[:, None], held, self.given)
        self.delivered = np.where(moved[:, None], given.mean(axis=0).T, self.delivered)

    def _rates(self, state: tuple[Array, ...]) -> tuple[Array, ...]:
        return (self._program.rates(state)[0].copy(),)

    def _weather(self) -> Array:
        """(4, n) current and wind of the next sample."""
        rows = []
        draw = partial(vary, sample_time_s=self.vessel.sample_time_s)
        for index, (variation, mean) in enumerate(zip(self._variations, self._means, strict=True)):
            if variation.std_mps == 0.0:
                rows.append(mean.T)
                continue
            normal = self._rng.standard_normal((1, *mean.shape))
            self._varied[index] = now = draw(variation, normal, before=self._varied[index])[0]
            rows.append((mean + now).T)
        return np.concatenate(rows)
