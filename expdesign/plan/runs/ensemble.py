"""Drawn ships in drawn weather, simulated sample by sample under commands of their own.

Each ship has parameters of its own, a current and a wind that keep their drawn means or vary round them, and actuators
that deliver as the vessel's file says. For ships that wait, only the weather goes on.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np

from expdesign.simulation import ActuatorState, Environment, step_shares
from expdesign.simulation.environment import vary
from expdesign.simulation.program import RatesProgram
from expdesign.simulation.run import LARGEST_SPEED, SUBSTEPS
from expdesign.values import Array, seal
from expdesign.vessel import Vessel

FEW_SHIPS = 128  # up to so many are quicker one by one than by an operation on all of them at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class Truths:
    """True parameters and mean weather of n ships."""

    parameters: Array  # (n, p) in the model's own form
    # current_to, wind_to: (n, 2) means of their trials [m/s]
    current_to: Array
    wind_to: Array

    def __post_init__(self) -> None:
        seal(self, parameters="n p", current_to="n 2", wind_to="n 2")


class Weather:
    """Current and wind of n ships, drawn for all of them whether they move or wait.

    Attributes:
        varies: whether they change from sample to sample.
        now: (4, n) current and wind to north and east of this sample [m/s].
    """

    def __init__(
        self, environment: Environment, truths: Truths, *, sample_time_s: float, rng: np.random.Generator
    ) -> None:
        """The means; `draw` goes on to the first sample."""
        self._rng, self._sample_time_s = rng, sample_time_s
        self._means = (truths.current_to, truths.wind_to)
        self._variations = (environment.current_variation, environment.wind_variation)
        self._varied: list[Array | None] = [None, None]
        self.varies = any(variation.std_mps > 0.0 for variation in self._variations)
        self.now: Array = np.concatenate([mean.T for mean in self._means])

    def draw(self) -> None:
        """Go on to the next sample."""
        for index, (variation, mean) in enumerate(zip(self._variations, self._means, strict=True)):
            if variation.std_mps > 0.0:
                normal, before = self._rng.standard_normal((1, *mean.shape)), self._varied[index]
                varied = vary(variation, normal, sample_time_s=self._sample_time_s, before=before)[0]
                self.now[2 * index : 2 * index + 2] = (mean + varied).T
                self._varied[index] = varied


class Fleet:
    """n ships and their states, columns of arrays side by side in memory.

    Attributes:
        vessel: the nominal one.
        weather: of all ships, also of those that the fleet is only a part of.
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
        self.vessel = vessel
        self.weather = Weather(environment, truths, sample_time_s=vessel.sample_time_s, rng=rng)
        self.states: Array = np.repeat(state[:, None], runs, axis=1).T
        self.given: Array = np.repeat(standing[:, None], runs, axis=1).T
        self.delivered = self.given
        self.lost = np.zeros(runs, dtype=bool)
        self._shares = step_shares(vessel.responses, sample_time_s=vessel.sample_time_s, substeps=SUBSTEPS)
        self._actuators = ActuatorState.standing(
            vessel.responses, self.given.T, sample_time_s=vessel.sample_time_s, substeps=self._shares
        )
        self._ships, self._parameters = np.arange(runs), truths.parameters
        self._program = RatesProgram(vessel.model, runs=runs, parameters=truths.parameters)
        self._program.sea[...] = self.weather.now

    def part(self, ships: np.ndarray) -> Fleet:
        """Some of the ships (k,), by index, as a fleet that sails on by itself in the same weather."""
        some = copy(self)
        some.states, some.given, some.delivered = (_some(x, ships) for x in (self.states, self.given, self.delivered))
        some.lost, some._ships = self.lost[ships], self._ships[ships]
        some._actuators = self._actuators.part(ships)
        some._program = self._program.part(ships)
        return some

    def rejoin(self, part: Fleet, ships: np.ndarray) -> None:
        """Take over where a part (k ships, by index here) has sailed."""
        self.states, self.given, self.delivered = (
            _with(whole, ships, some)
            for whole, some in (
                (self.states, part.states),
                (self.given, part.given),
                (self.delivered, part.delivered),
            )
        )
        self.lost[ships] = part.lost
        self._actuators = self._actuators.joined(part._actuators, ships)

    def advance(self, commands: Array) -> None:
        """One sample with commands (n, m); ships that are lost wait."""
        sails = ~self.lost
        if not sails.any():
            return
        if sails.all():
            self._advance(commands)
        else:
            ships = np.flatnonzero(sails)
            part = self.part(ships)
            part._advance(commands[ships])
            self.rejoin(part, ships)

    def _advance(self, commands: Array) -> None:
        given = self._actuators.mean(commands.T)  # (substeps or 1, m, n)
        after = self._actuators.after(commands.T)
        if self.weather.varies:
            self.weather.draw()
            self._program.sea[...] = self.weather.now[:, self._ships]
        with np.errstate(over="ignore", invalid="ignore"):
            state = self._together(given) if len(commands) > FEW_SHIPS else self._one_by_one(given)
            settled = np.abs(state[3:]).max(axis=0) < LARGEST_SPEED
        delivered = given[0].T if len(given) == 1 else np.tensordot(self._shares, given, axes=1).T
        if not settled.all():
            self.lost = ~settled
            state, commands, delivered = (
                np.where(settled, new.T, old.T)
                for new, old in ((state.T, self.states), (commands, self.given), (delivered, self.delivered))
            )
            commands, delivered = commands.T, delivered.T
        self.states, self.given, self.delivered, self._actuators = state.T, commands, delivered, after

    def _together(self, given: Array) -> Array:
        """(6, n) states a sample later by operations on all ships at a time."""
        self._program.hold(given)
        state = self.states.T
        for part, share in enumerate(self._shares.tolist()):
            if part < len(given):
                self._program.select(part)
            state = self._program.rk4(state, share * self.vessel.sample_time_s)
        return state

    def _one_by_one(self, given: Array) -> Array:
        """The states a sample later by compiled steps, the quicker way for few ships."""
        from expdesign.simulation._casadi import compiled_sample  # CasADi is loaded when a motion is integrated

        sample = compiled_sample(self.vessel.model, rows=len(given), substeps=len(self._shares))
        after = sample.states(
            self.states,
            given,
            sea=self._program.sea,
            parameters=self._parameters[self._ships],
            steps_s=self._shares * self.vessel.sample_time_s,
        )
        return np.ascontiguousarray(after.T)


def _some(table: Array, ships: np.ndarray) -> Array:
    """Rows (k, ...) of a table (n, ...)."""
    return np.asarray(table.T.take(ships, axis=1).T)


def _with(table: Array, ships: np.ndarray, rows: Array) -> Array:
    """The table (n, ...) with other rows (k, ...) of some ships."""
    result = table.T.copy()
    result[:, ships] = rows.T
    return result.T
