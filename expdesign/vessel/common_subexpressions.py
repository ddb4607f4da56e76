"""Values of several expressions at once: what they have in common is computed once."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from expdesign.vessel.expressions import Expression, Signals

BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
}
UNARY: dict[str, Callable[[Any], Any]] = {"abs": np.abs, "sin": np.sin, "cos": np.cos}


def evaluated_together(expressions: Sequence[Expression]) -> Program:
    """The expressions, to be evaluated for floats or NumPy arrays; each value is exactly what it would be alone."""
    return _program(tuple(item.text for item in expressions))


@dataclass
class Program:
    """Operations in an order in which each finds its operands among the values before it.

    Attributes:
        steps: function of an operand, or of two, and their places; no function where a signal is read.
        results: places of the expressions' values.
    """

    steps: list[tuple[Any, Any, int]] = field(default_factory=list)
    results: list[int] = field(default_factory=list)
    known: dict[tuple[Any, Any, int], int] = field(default_factory=dict)

    def values(self, signals: Signals) -> list[Any]:
        """Of all expressions."""
        found: list[Any] = []
        for function, first, second in self.steps:
            if function is None:
                found.append(signals[first] if second else first)
            elif second < 0:
                found.append(function(found[first]))
            else:
                found.append(function(found[first], found[second]))
        return [found[place] for place in self.results]

    def add(self, node: ast.expr) -> int:
        """Place of the value of a node of the language of terms."""
        match node:
            case ast.Constant(value=int() | float() as number):
                step: tuple[Any, Any, int] = (None, float(number), 0)
            case ast.Name(id=name):
                step = (None, name, 1)
            case ast.UnaryOp(operand=operand):
                step = (operator.neg, self.add(operand), -1)
            case ast.BinOp(left=left, op=kind, right=right):
                step = (BINARY[type(kind)], self.add(left), self.add(right))
            case ast.Call(func=ast.Name(id=name), args=[argument]):
                step = (UNARY[name], self.add(argument), -1)
            case _:  # pragma: no cover - the parser of the language refuses it
                raise AssertionError(ast.dump(node))
        if step not in self.known:
            self.known[step] = len(self.steps)
            self.steps.append(step)
        return self.known[step]


@lru_cache(maxsize=256)
def _program(texts: tuple[str, ...]) -> Program:
    found = Program()
    for text in texts:
        found.results.append(found.add(ast.parse(text.strip(), mode="eval").body))
    return found
