"""Equations of motion as a list of operations, found by running them once with symbols in place of numbers.

The model is written in `+ - *`, `abs`, `sin` and `cos` for any kind of number. Symbols write down what is done to them:
each operation once, however often the model repeats it, and none on constants alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from expdesign.vessel import Operators
from expdesign.vessel.expressions import Expression, parse_expression

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
NEUTRAL = {"add": ZERO, "multiply": Entry("constant", (), 1.0)}
"""Operations that change nothing."""


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
