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
    """

    text: str
    signals: tuple[str, ...]
    evaluate: Evaluate


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
    used: set[str] = set()
    evaluate = _build(tree, text, frozenset(signals), used)
    return Expression(text, tuple(sorted(used)), evaluate)


def _build(node: ast.expr, text: str, known: frozenset[str], used: set[str]) -> Evaluate:
    match node:
        case ast.Constant(value=bool()):
            raise InputError(f"expression {text!r}: {node.value} is not a number")
        case ast.Constant(value=int() | float() as number) if math.isfinite(number):
            constant = float(number)
            return lambda signals, ops: constant
        case ast.Name(id=name):
            if name not in known:
                raise UnknownName(f"signal in expression {text!r}:", name, known=sorted(known))
            used.add(name)
            return lambda signals, ops: signals[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = _build(operand, text, known, used)
            return lambda signals, ops: -inner(signals, ops)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mult() as operator, right=right):
            return _binary(operator, _build(left, text, known, used), _build(right, text, known, used))
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
            inner = _build(argument, text, known, used)
            return lambda signals, ops: getattr(ops, name)(inner(signals, ops))
    raise InputError(
        f"expression {text!r}: {ast.unparse(node)!r} is not allowed, only signals, numbers, + - * and abs sin cos"
    )


def _binary(operator: ast.operator, left: Evaluate, right: Evaluate) -> Evaluate:
    if isinstance(operator, ast.Add):
        return lambda signals, ops: left(signals, ops) + right(signals, ops)
    if isinstance(operator, ast.Sub):
        return lambda signals, ops: left(signals, ops) - right(signals, ops)
    return lambda signals, ops: left(signals, ops) * right(signals, ops)
