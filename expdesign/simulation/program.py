"""Rates of motion of many runs at once, as a flat list of NumPy calls into memory that is set aside beforehand.

What depends on commands and constants alone, such as the generalised force, is worked out for a whole stretch of
samples at once; a step then only does what depends on the motion. The operations are those of `motion_rates`, so the
result is that of a plain simulation to rounding.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from expdesign.simulation.motion import motion_rates
from expdesign.simulation.tape import SYMBOLIC, Symbol, Tape
from expdesign.values import Array
from expdesign.vessel import VesselModel

STATES = 6


class RatesProgram:
    """Rates of motion of n runs: `hold` inputs, `select` a row of them, then call `rates`, as often as need be.

    Attributes:
        sea: (4, n) n-frame current and wind to north and east [m/s]; write into it.
    """

    def __init__(self, model: VesselModel, *, runs: int, own_inputs: bool, parameters: Array | None = None) -> None:
        """Write the equations down and set memory aside.

        Args:
            model: structure and actuators.
            runs: n.
            own_inputs: every run has inputs of its own; otherwise all share them.
            parameters: (p,) for all runs alike or (n, p), in the model's own form; None for the model's.
        """
        theta = model.parameters if parameters is None else parameters
        self._tape = tape = Tape()
        state, sea = tape.given("state", STATES), tape.given("sea", 4)
        inputs = tape.given("input", len(model.inputs))
        values = theta.tolist() if theta.ndim == 1 else tape.given("parameter", len(model.terms))
        rates = motion_rates(model, state, inputs, current_to=sea[:2], wind_to=sea[2:], ops=SYMBOLIC, parameters=values)
        results = [rate if isinstance(rate, Symbol) else tape.constant(rate) for rate in rates]
        self._places = tape.needed(results)
        self._rested, self._held = self._split()
        self.sea = np.zeros((4, runs))
        self._state, self._rates = np.zeros((STATES, runs)), np.zeros((STATES, runs))
        self._current = np.zeros((len(self._held), runs if own_inputs else 1))
        self._table = np.zeros((0, *self._current.shape))
        self._calls = self._bound(np.ascontiguousarray(theta.T), [result.place for result in results])

    def hold(self, inputs: Array) -> None:
        """Take delivered inputs (k, m, n), or (k, m, 1) where all runs share them."""
        entries, values = self._tape.entries, dict[int, Any]()
        for place in self._places:
            entry = entries[place]
            if entry.name == "constant":
                values[place] = entry.number
            elif entry.name == "input":
                values[place] = inputs[:, int(entry.number)]
            elif place in self._rested:
                values[place] = getattr(np, entry.name)(*(values[argument] for argument in entry.arguments))
        self._table = np.empty((len(inputs), *self._current.shape))
        for index, place in enumerate(self._held):
            self._table[:, index] = values[place]

    def select(self, row: int) -> None:
        """Use one of the rows held."""
        self._current[...] = self._table[row]

    def rates(self, state: tuple[Array, ...]) -> tuple[Array, ...]:
        """Time derivative of the state, (6, n) each, packed as one entry so that every integrator takes them."""
        self._state[...] = state[0]
        for call, arguments in self._calls:
            call(*arguments)
        return (self._rates.copy(),)

    def _split(self) -> tuple[set[int], list[int]]:
        """Places that rest on inputs and constants alone, and those among them that the motion reads."""
        entries, rested = self._tape.entries, set[int]()
        for place in self._places:
            entry = entries[place]
            if entry.name in ("input", "constant") or (entry.arguments and rested.issuperset(entry.arguments)):
                rested.add(place)
        read = {argument for place in self._places if place not in rested for argument in entries[place].arguments}
        return rested, sorted(place for place in rested & read if entries[place].name != "constant")

    def _bound(self, theta: Array, results: list[int]) -> list[tuple[Any, tuple[Any, ...]]]:
        """Every operation with its operands and where its value goes; memory is used again once nobody reads it."""
        entries = self._tape.entries
        given = {"state": self._state, "sea": self.sea, "parameter": theta}
        where: dict[int, Any] = {place: self._current[index] for index, place in enumerate(self._held)}
        last = {argument: place for place in self._places for argument in entries[place].arguments}
        calls, free, temporary = [], list[Array](), set[int]()
        for place in self._places:
            entry = entries[place]
            if entry.name == "constant":
                where[place] = np.asarray(entry.number)
            elif entry.name in given:
                where[place] = given[entry.name][int(entry.number)]
            elif place not in self._rested:
                operands = [where[argument] for argument in entry.arguments]
                free += [where[a] for a in {*entry.arguments} & temporary if last[a] == place]
                if place in results:
                    where[place] = self._rates[results.index(place)]
                else:
                    where[place] = free.pop() if free else np.empty(self._state.shape[1])
                    temporary.add(place)
                calls.append((getattr(np, entry.name), (*operands, where[place])))
        copies = [(np.positive, (where[place], row)) for place, row in zip(results, self._rates, strict=True)]
        return calls + [copy for copy in copies if not np.shares_memory(*copy[1])]
