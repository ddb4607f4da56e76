"""Polynomials in named signals: enough algebra to differentiate the terms of a model.

A model term is evaluated with polynomials for numbers. A modulus becomes sign times what stands inside, which is what
it is wherever the experiment keeps its sign; sines, cosines and moduli of actuator signals become symbols of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import prod
from typing import Any

import numpy as np

from expdesign.errors import InputError
from expdesign.vessel import NUMPY, Operators

SignalTable = Mapping[str, Any]
Monomial = tuple[str, ...]
MOVING = ("u", "v")  # signals that a current or a wind shifts


@dataclass(frozen=True, eq=False)
class Polynomial:
    """Sum of coefficients times products of signals; with the operations of the term language."""

    terms: Mapping[Monomial, float]

    def __add__(self, other: Polynomial | float) -> Polynomial:
        total = dict(self.terms)
        for monomial, coefficient in lift(other).terms.items():
            total[monomial] = total.get(monomial, 0.0) + coefficient
        return Polynomial({monomial: value for monomial, value in total.items() if value})

    def __mul__(self, other: Polynomial | float) -> Polynomial:
        total = Polynomial({})
        for left, a in self.terms.items():
            total = total + Polynomial({_product(left, right): a * b for right, b in lift(other).terms.items()})
        return total

    def __neg__(self) -> Polynomial:
        return self * -1.0

    def __sub__(self, other: Polynomial | float) -> Polynomial:
        return self + -lift(other)

    def __rsub__(self, other: float) -> Polynomial:
        return lift(other) - self

    __radd__, __rmul__ = __add__, __mul__

    def __str__(self) -> str:
        pieces = [
            " ".join(([f"{value:g}"] if value != 1 or not monomial else []) + list(monomial))
            for monomial, value in sorted(self.terms.items())
        ]
        return " + ".join(pieces) or "0"

    @property
    def signals(self) -> frozenset[str]:
        """Every symbol it holds."""
        return frozenset(name for monomial in self.terms for name in monomial)

    @property
    def constant(self) -> bool:
        """Whether it is a number."""
        return not self.signals

    def derivative(self, name: str) -> Polynomial:
        """The derivative by one signal; signs count as constants."""
        total = Polynomial({})
        for monomial, value in self.terms.items():
            if name in monomial:
                rest = list(monomial)
                rest.remove(name)
                total = total + Polynomial({tuple(rest): value * monomial.count(name)})
        return total

    def substituted(self, numbers: Mapping[str, float]) -> Polynomial:
        """The polynomial with numbers in place of some symbols."""
        total = Polynomial({})
        for monomial, value in self.terms.items():
            left = tuple(name for name in monomial if name not in numbers)
            factor = prod(numbers[name] for name in monomial if name in numbers)
            total = total + Polynomial({left: value * factor})
        return total

    @property
    def leading(self) -> float:
        """Its first coefficient."""
        return self.terms[min(self.terms)]

    def normalised(self) -> Polynomial:
        """Scaled so that its first coefficient is one."""
        return self * (1.0 / self.leading)

    def evaluate(self, table: SignalTable, functions: Mapping[str, Callable[[SignalTable], Any]]) -> Any:
        """Its value for a table of signals, with functions for the symbols that are not signals."""

        def value(name: str) -> Any:
            return table[name] if name in table else functions[name](table)

        return sum(
            (number * prod((value(name) for name in monomial), start=1.0) for monomial, number in self.terms.items()),
            start=0.0,
        )


def symbol(name: str) -> Polynomial:
    """One signal."""
    return Polynomial({(name,): 1.0})


@dataclass(frozen=True)
class Algebra:
    """Operators on polynomials, remembering the symbols they introduce."""

    # symbol -> its value for a table of signals; "sign(...)" symbols among them
    functions: dict[str, Callable[[SignalTable], Any]] = field(default_factory=dict)
    signs: dict[str, Polynomial] = field(default_factory=dict)  # "sign(...)" symbol -> the polynomial whose sign it is

    @property
    def operators(self) -> Operators:
        """Operators on polynomials, for `Expression.evaluate`."""
        return Operators(self._modulus, lambda x: self._opaque("sin", x), lambda x: self._opaque("cos", x))

    def _modulus(self, inside: Polynomial | float) -> Polynomial:
        inner = lift(inside)
        if not inner.signals & set(MOVING):
            return self._opaque("abs", inner)
        name = f"sign({inner})"
        self.signs[name] = inner
        self.functions[name] = lambda table: np.sign(inner.evaluate(table, self.functions))
        return symbol(name) * inner

    def _opaque(self, function: str, inside: Polynomial | float) -> Polynomial:
        inner = lift(inside)
        if inner.signals & set(MOVING):
            raise InputError(f"{function}({inner}) is not of second order in the velocities")
        name = f"{function}({inner})"
        operator = getattr(NUMPY, function)
        self.functions[name] = lambda table: operator(inner.evaluate(table, self.functions))
        return symbol(name)


def lift(value: Polynomial | float) -> Polynomial:
    """A number as a polynomial."""
    if isinstance(value, Polynomial):
        return value
    return Polynomial({(): float(value)} if value else {})


def _product(left: Monomial, right: Monomial) -> Monomial:
    """Sorted factors; a sign times itself is one."""
    factors = sorted((*left, *right))
    result: list[str] = []
    for name in factors:
        if name.startswith("sign(") and result and result[-1] == name:
            result.pop()
        else:
            result.append(name)
    return tuple(result)
