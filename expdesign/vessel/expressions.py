"""The small language of model terms: numbers, signals, + - * and unary minus, `abs`, `sin`, `cos`, parentheses.

An expression is parsed once into a function of a signal table and a set of operators, so the same term serves NumPy
arrays, plain floats and CasADi symbols. Nothing is ever evaluated as Python source.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from expdesign.errors import InputError, UnknownName


@dataclass(frozen=True)
class Operators:
    """The functions a term may call, for one kind of number."""

    abs: Callable[[Any], Any]
    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]


NUMPY = Operators(np.abs, np.sin, np.cos)
SCALAR = Operators(abs, math.sin, math.cos)
FUNCTIONS = ("abs", "sin", "cos")

Signals = Mapping[str, Any]
Evaluate = Callable[[Signals, Operators], Any]


@dataclass(frozen=True)
class Expression:
    """A parsed expression.

    Attributes:
        text: as written.
        signals: the signal names it reads, sorted.
        evaluate: (signals, operators) -> value.
        moduli: what stands inside each `abs`, in the same form as `evaluate`.
    """

    text: str
    signals: tuple[str, ...]
    evaluate: Evaluate
    moduli: tuple[Evaluate, ...] = ()


def parse_expression(text: str, *, signals: tuple[str, ...]) -> Expression:
    """Parse a term such as ``u*abs(u)`` or ``abs(n1)*n1*sin(rudder1)``.

    Args:
        text: the expression.
        signals: the names it may use.

    Raises:
        InputError: the text is not in the language; the message quotes the offending part.
        UnknownName: it reads a signal that does not exist.
    """
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError(f"expression {text!r} cannot be read: expected signals, numbers, + - *, abs sin cos") from None
    parser = _Parser(text, frozenset(signals))
    evaluate = parser.build(tree)
    return Expression(text, tuple(sorted(parser.used)), evaluate, tuple(parser.moduli))


class _Parser:
    """Turns a syntax tree into closures, remembering the signals and moduli it meets."""

    def __init__(self, text: str, known: frozenset[str]) -> None:
        self.text, self.known = text, known
        self.used: set[str] = set()
        self.moduli: list[Evaluate] = []

    def build(self, node: ast.expr) -> Evaluate:
        match node:
            case ast.Constant(value=int() | float() as number) if _is_finite(number):
                constant = float(number)
                return lambda signals, ops: constant
            case ast.Name(id=name):
                return self._signal(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                inner = self.build(operand)
                return lambda signals, ops: -inner(signals, ops)
            case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mult() as operator, right=right):
                return _binary(operator, self.build(left), self.build(right))
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
                return self._call(name, self.build(argument))
        raise InputError(
            f"expression {self.text!r}: {ast.unparse(node)!r} is not allowed, "
            "only signals, finite numbers, + - * and abs sin cos"
        )

    def _signal(self, name: str) -> Evaluate:
        if name not in self.known:
            raise UnknownName(f"signal in expression {self.text!r}:", name, known=sorted(self.known))
        self.used.add(name)
        return lambda signals, ops: signals[name]

    def _call(self, name: str, inner: Evaluate) -> Evaluate:
        if name == "abs":
            self.moduli.append(inner)
        return lambda signals, ops: getattr(ops, name)(inner(signals, ops))


def _is_finite(number: float) -> bool:
    return not isinstance(number, bool) and math.isfinite(number)


def _binary(operator: ast.operator, left: Evaluate, right: Evaluate) -> Evaluate:
    if isinstance(operator, ast.Add):
        return lambda signals, ops: left(signals, ops) + right(signals, ops)
    if isinstance(operator, ast.Sub):
        return lambda signals, ops: left(signals, ops) - right(signals, ops)
    return lambda signals, ops: left(signals, ops) * right(signals, ops)
