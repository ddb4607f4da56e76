"""Equations of motion as a list of operations, found by running them once with symbols in place of numbers.

The model is written in `+ - *`, `abs`, `sin` and `cos` for any kind of number. Symbols write down what is done to them:
each operation once, however often the model repeats it, and none on constants alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from expdesign.vessel import Operators

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
    """One value on a tape.

    Attributes:
        name: a key of `FUNCTIONS`, "constant", or the name of a given value.
        arguments: places of the operands on the tape; none for constants and given values.
        number: value of a constant, or place among given values of that name.
    """

    name: str
    arguments: tuple[int, ...] = ()
    number: float = 0.0


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
