"""Motion of many runs at once: rates as a flat list of NumPy calls into memory that is set aside beforehand.

The model is written in `+ - *`, `abs`, `sin` and `cos` for any kind of number. It is run once with symbols, which write
down what is done to them on a tape: each operation once, however often the model repeats it, and none on constants
alone. What depends on commands and constants alone, such as the generalised force, is worked out for a whole stretch of
samples at once; a step then only does what depends on the motion. The operations are those of `motion_rates`, so the
result is that of a plain simulation to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from expdesign.simulation.motion import Step, motion_rates, relative_velocity, rk4_step
from expdesign.values import Array
from expdesign.vessel import Operators, VesselModel
from expdesign.vessel.structures import Expression, parse_expression

FUNCTIONS: dict[str, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "negative": lambda a: -a,
    "absolute": abs,
    "sin": math.sin,
    "cos": math.cos,
}
"""NumPy's name of each operation -> the same on plain numbers."""
Code = tuple[Callable[..., object], tuple[int, ...]]
"""A NumPy function, and the rows of memory of its operands and its result."""


@dataclass(frozen=True)
class Entry:
    """One value on a tape."""

    name: str  # a key of `FUNCTIONS`, "constant", or the name of a given value
    arguments: tuple[int, ...] = ()  # places of the operands on the tape; none for constants and given values
    number: float = 0.0  # value of a constant, or place among given values of that name


class Tape:
    """Where symbols write."""

    def __init__(self) -> None:
        self.entries: list[Entry] = []
        self._places: dict[Entry, int] = {}

    def given(self, name: str, count: int) -> tuple[Symbol, ...]:
        """Symbols of values that will be given under a name."""
        return tuple(self._symbol(Entry(name, (), float(index))) for index in range(count))

    def constant(self, number: float) -> Symbol:
        """A number."""
        return self._symbol(Entry("constant", (), float(number)))

    def apply(self, name: str, *operands: Symbol) -> Symbol:
        """The symbol of an operation, the earlier one where it was done before."""
        values = [self.entries[operand.place] for operand in operands]
        if all(value.name == "constant" for value in values):
            return self.constant(FUNCTIONS[name](*(value.number for value in values)))
        for value, other in zip(values, reversed(operands), strict=True):
            if len(values) == 2 and value == NEUTRAL.get(name):
                return other
            if name == "multiply" and value == ZERO:
                return self.constant(0.0)
        places = tuple(operand.place for operand in operands)
        return self._symbol(Entry(name, places if name == "subtract" else tuple(sorted(places))))

    def needed(self, results: Iterable[Symbol]) -> list[int]:
        """Places that results rest on, themselves included, in order."""
        reached: set[int] = set()
        waiting = [result.place for result in results]
        while waiting:
            place = waiting.pop()
            if place not in reached:
                reached.add(place)
                waiting += self.entries[place].arguments
        return sorted(reached)

    def _symbol(self, entry: Entry) -> Symbol:
        if entry not in self._places:
            self._places[entry] = len(self.entries)
            self.entries.append(entry)
        return Symbol(self, self._places[entry])


ZERO = Entry("constant", (), 0.0)
NEUTRAL = {"add": ZERO, "multiply": Entry("constant", (), 1.0)}  # operations that change nothing


@dataclass(frozen=True, eq=False)
class Symbol:
    """A value on a tape."""

    tape: Tape
    place: int

    __array_ufunc__ = None

    def __add__(self, other: Any) -> Symbol:
        return self.tape.apply("add", self, self._like(other))

    def __radd__(self, other: Any) -> Symbol:
        return self.tape.apply("add", self._like(other), self)

    def __sub__(self, other: Any) -> Symbol:
        return self.tape.apply("subtract", self, self._like(other))

    def __rsub__(self, other: Any) -> Symbol:
        return self.tape.apply("subtract", self._like(other), self)

    def __mul__(self, other: Any) -> Symbol:
        return self.tape.apply("multiply", self, self._like(other))

    def __rmul__(self, other: Any) -> Symbol:
        return self.tape.apply("multiply", self._like(other), self)

    def __neg__(self) -> Symbol:
        return self.tape.apply("negative", self)

    def __abs__(self) -> Symbol:
        return self.tape.apply("absolute", self)

    def _like(self, other: Any) -> Symbol:
        return other if isinstance(other, Symbol) else self.tape.constant(other)


def _function(name: str) -> Callable[[Any], Any]:
    """An operation on symbols and plain numbers."""
    return lambda x: x.tape.apply(name, x) if isinstance(x, Symbol) else FUNCTIONS[name](x)


SYMBOLIC = Operators(_function("absolute"), _function("sin"), _function("cos"))


@dataclass(frozen=True)
class Evaluation:
    """Several expressions, to be evaluated at once."""

    signals: tuple[tuple[int, str], ...]  # (place, name) of what is read
    constants: Mapping[int, float]  # place -> number
    # (place, function, places of its operands), in order
    operations: tuple[tuple[int, Callable[..., Any], tuple[int, ...]], ...]
    results: tuple[int, ...]  # places of the values

    def values(self, signals: Mapping[str, Any]) -> list[Any]:
        """Values of all expressions, for signals that are numbers or arrays; what they share is computed once."""
        found: dict[int, Any] = {**self.constants}
        for place, name in self.signals:
            found[place] = signals[name]
        for place, function, operands in self.operations:
            found[place] = function(*[found[operand] for operand in operands])
        return [found[place] for place in self.results]


def evaluation(expressions: Sequence[Expression]) -> Evaluation:
    """The evaluation of expressions; the same ones are written down once."""
    return _evaluation(tuple((item.text, item.signals) for item in expressions))


@lru_cache(maxsize=256)
def _evaluation(written: tuple[tuple[str, tuple[str, ...]], ...]) -> Evaluation:
    tape, names = Tape(), sorted({name for _, own in written for name in own})
    given = dict(zip(names, tape.given("signal", len(names)), strict=True))
    values = [parse_expression(text, signals=own).evaluate(given, SYMBOLIC) for text, own in written]
    results = [value if isinstance(value, Symbol) else tape.constant(value) for value in values]
    entries = [(place, tape.entries[place]) for place in tape.needed(results)]
    return Evaluation(
        signals=tuple((place, names[int(entry.number)]) for place, entry in entries if entry.name == "signal"),
        constants={place: entry.number for place, entry in entries if entry.name == "constant"},
        operations=tuple(
            (place, getattr(np, entry.name), entry.arguments) for place, entry in entries if entry.arguments
        ),
        results=tuple(result.place for result in results),
    )


STATES = 6  # number of states of a motion: pose and velocity


class RatesProgram:
    """Rates of motion of n runs: `hold` inputs, `select` a row of them, then call `rates`, as often as need be.

    All memory is one table with a row of n numbers for each value: state, sea, results (rates and relative wind), then
    parameters of the runs' own, inputs and more. The state has two rows more than `STATES` where the model rolls.

    Attributes:
        sea: (4, n) n-frame current and wind to north and east [m/s]; write into it.
        air: (2, n) where the next call of `rates` leaves the relative wind (u_q, v_q), or None.
    """

    def __init__(
        self,
        model: VesselModel,
        *,
        runs: int,
        parameters: Array | None = None,
        turning: bool = True,
    ) -> None:
        """Write the equations down and set memory aside.

        Args:
            runs: n.
            parameters: (p,) for all runs alike or (n, p), in the model's own form; None for the model's.
            turning: as of `motion_rates`.
        """
        theta = model.parameters if parameters is None else parameters
        self._tape, self._states = Tape(), model.states
        self._out = self._states + 4
        self._first = self._out + self._states + 2
        tape = self._tape
        state, sea = tape.given("state", self._states), tape.given("sea", 4)
        inputs = tape.given("input", len(model.inputs))
        own = np.ptp(np.atleast_2d(theta), axis=0) != 0.0  # parameters in which runs differ
        given = iter(tape.given("parameter", int(own.sum())))
        known = np.atleast_2d(theta)[0].tolist()
        values = [next(given) if differs else value for differs, value in zip(own, known, strict=True)]
        rates = motion_rates(
            model,
            state,
            inputs,
            current_to=sea[:2],
            wind_to=sea[2:],
            ops=SYMBOLIC,
            parameters=values,
            turning=turning,
        )
        _, air = relative_velocity(state, sea[:2], sea[2:], SYMBOLIC)
        results = [value if isinstance(value, Symbol) else tape.constant(value) for value in (*rates, *air)]
        self._places = tape.needed(results)
        self._rested, self._held = self._split(results)
        entries = [(place, tape.entries[place]) for place in self._places if place in self._rested]
        self._constant = {place: entry.number for place, entry in entries if entry.name == "constant"}
        self._inputs = [(place, int(entry.number)) for place, entry in entries if entry.name == "input"]
        self._resting = [(place, getattr(np, x.name), x.arguments) for place, x in entries if x.arguments]
        self._own = int(own.sum())
        self._codes, rows, self._constants = self._laid_out([result.place for result in results])
        memory = np.zeros((rows, runs))
        for row, number in self._constants.items():
            memory[row] = number
        if self._own:
            memory[self._first : self._first + self._own] = theta.T[own]
        self._take(memory)

    def part(self, runs: np.ndarray) -> RatesProgram:
        """The program for some of the runs (k,), by index."""
        some = copy(self)
        some._take(self._memory.take(runs, axis=1))
        return some

    def _take(self, memory: Array) -> None:
        """Use memory (rows, n)."""
        self._memory, self._table = memory, np.zeros((0, 0, 0))
        self._state, self.sea = memory[: self._states], memory[self._states : self._out]
        self._results = memory[self._out : self._first]
        self.air: Array | None = None
        first = self._first + self._own
        self._current = memory[first : first + len(self._held)]
        self._sums = np.empty((2, *self._state.shape))
        self._run = prepared(self._codes, memory, self._constants)

    def hold(self, inputs: Array) -> None:
        """Take delivered inputs (k, m, n); or of fewer runs, 1 or a divisor of n, that the others repeat in turn."""
        values: dict[int, Any] = {**self._constant}
        values |= {place: inputs[:, index] for place, index in self._inputs}
        for place, call, arguments in self._resting:
            values[place] = call(*[values[argument] for argument in arguments])
        self._table = np.empty((len(inputs), len(self._held), inputs.shape[-1]))
        for index, place in enumerate(self._held):
            self._table[:, index] = values[place]

    def select(self, row: int) -> None:
        """Use one of the rows held."""
        held = self._table[row]
        rows, own = held.shape
        self._current.reshape(rows, self._current.shape[1] // own, own)[...] = held[:, None]

    def rates(self, state: tuple[Array, ...]) -> tuple[Array, ...]:
        """Time derivative of the state, (6 or 8, n) each, packed as one entry so that every integrator takes them.

        The next call overwrites it.
        """
        self._state[...] = state[0]
        self._run()
        if self.air is not None:
            self.air[...], self.air = self._results[self._states :], None
        return (self._results[: self._states],)

    def rk4(self, state: Array, step_s: float) -> Array:
        """The state (6 or 8, n) one `rk4_step` later, worked out in memory set aside."""
        total, part = self._sums
        slope = self.rates((state,))[0]
        total[...] = slope
        for fraction, weight in ((0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            np.multiply(fraction * step_s, slope, out=part)
            np.add(state, part, out=self._state)
            self._run()
            np.multiply(weight, slope, out=part)
            total += part
        total *= step_s / 6.0
        return np.asarray(state + total)

    def _split(self, results: list[Symbol]) -> tuple[set[int], list[int]]:
        """Places that rest on inputs and constants alone, and those among them that the motion reads or results are."""
        entries, rested = self._tape.entries, set[int]()
        for place in self._places:
            entry = entries[place]
            if entry.name in ("input", "constant") or (entry.arguments and rested.issuperset(entry.arguments)):
                rested.add(place)
        read = {argument for place in self._places if place not in rested for argument in entries[place].arguments}
        read |= {result.place for result in results}
        return rested, sorted(place for place in rested & read if entries[place].name != "constant")

    def _laid_out(self, results: list[int]) -> tuple[list[Code], int, dict[int, float]]:
        """Operations on rows of memory, the number of rows, and constant rows.

        A row is used again once nobody reads what it holds.
        """
        entries, begins = self._tape.entries, {"state": 0, "sea": self._states, "parameter": self._first}
        first = self._first + self._own
        where = {place: first + index for index, place in enumerate(self._held)}
        rows, constants = first + len(self._held), dict[int, float]()
        last = {argument: place for place in self._places for argument in entries[place].arguments}
        codes, free, temporary = list[Code](), list[int](), set[int]()
        for place in self._places:
            entry = entries[place]
            if entry.name in begins:
                where[place] = begins[entry.name] + int(entry.number)
            elif entry.name == "constant":
                where[place], constants[rows], rows = rows, entry.number, rows + 1
            elif place not in self._rested:
                operands = [where[argument] for argument in entry.arguments]
                free += [where[a] for a in {*entry.arguments} & temporary if last[a] == place]
                if place in results:
                    where[place] = self._out + results.index(place)
                elif free:
                    where[place] = free.pop()
                else:
                    where[place], rows = rows, rows + 1
                if place not in results:
                    temporary.add(place)
                codes.append((getattr(np, entry.name), (*operands, where[place])))
        for row, place in enumerate(results, start=self._out):
            if where[place] != row:
                codes.append((np.positive, (where[place], row)))
        return codes, rows, constants


def prepared(codes: Sequence[Code], memory: Array, constants: Mapping[int, float]) -> Callable[[], None]:
    """A function that does the operations on the memory."""
    rows = [np.asarray(constants[row]) if row in constants else memory[row] for row in range(len(memory))]
    calls = [(call, [rows[row] for row in used]) for call, used in codes]

    def run() -> None:
        for call, arguments in calls:
            call(*arguments)

    return run


def march(
    program: RatesProgram, given: Array, state: Array, *, step: Step, step_s: float | Array, substeps: int
) -> Iterator[Array]:
    """The state (6 or 8, n) at every sample, then at the end of the last one.

    While it stands at a sample, the caller may set the program's `sea` and `air`.

    Args:
        given: (k, substeps, m, n), or 1 in place of substeps where inputs are held over a sample, or in place of n
            where runs share them.
        state: (6 or 8, n) at the first sample.
        step_s: its length, or (substeps,) that of each in a sample [s].
        substeps: steps per sample.
    """
    rows, steps_s = given.shape[1], np.broadcast_to(step_s, substeps).tolist()
    program.hold(given.reshape(-1, *given.shape[2:]))
    for k in range(len(given)):
        yield state
        for part, each_s in enumerate(steps_s):
            if part < rows:
                program.select(k * rows + part)
            state = program.rk4(state, each_s) if step is rk4_step else step(program.rates, (state,), each_s)[0]
    yield state
