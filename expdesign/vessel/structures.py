"""The language of model terms, the term library, and the built-in model structures, each a list of terms.

A term is one row of the regressor matrix: an equation (u, v or r), a parameter name and an expression over
`u v r` (through water; r has no relative counterpart), `u_q v_q` (through air), `h` and the actuator signals. `h` is
draught over water depth: 0 in deep water, and wherever no depth is known. Expressions have numbers, signals, + - * and
unary minus, `abs`, `sin`, `cos` and parentheses. One is parsed once into a function of a signal table and a set of
operators, so the same term serves NumPy arrays, plain floats and CasADi symbols; nothing is evaluated as Python source.
Every structure is a second-order modulus model: linear in its parameters.

Source: F. Ljungberg, doctoral thesis, Linköping University, Definition 3.3, (3.58)-(3.65) and (9.1).
"""

from __future__ import annotations

import ast
import math
import sys
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
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

DEEPEST = 50  # nested operations; a term of a ship model has a handful

Signals = Mapping[str, Any]
Evaluate = Callable[[Signals, Operators], Any]


@dataclass(frozen=True)
class Expression:
    """A parsed expression."""

    text: str  # as written
    signals: tuple[str, ...]  # the signal names it reads, sorted
    evaluate: Evaluate  # (signals, operators) -> value
    moduli: tuple[Expression, ...] = ()  # what stands inside each `abs`, innermost first


def parse_expression(text: str, *, signals: tuple[str, ...]) -> Expression:
    """Parse a term such as ``u*abs(u)`` or ``abs(n1)*n1*sin(rudder1)``.

    Args:
        signals: the names it may use.

    Raises:
        InputError: the text is not in the language; the message quotes the offending part.
        UnknownName: it reads a signal that does not exist.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # odd spellings are refused below, in our own words
            tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError(
            f"expression {_short(text)!r} cannot be read: expected signals, numbers, + - *, abs sin cos"
        ) from None
    return replace(_Parser(text, frozenset(signals)).parse(tree), text=text)


class _Parser:
    """Turns a syntax tree into closures, remembering the signals and moduli it meets."""

    def __init__(self, text: str, known: frozenset[str]) -> None:
        self.text, self.known = text, known
        self.used: set[str] = set()
        self.moduli: list[Expression] = []

    def parse(self, tree: ast.expr, depth: int = 0) -> Expression:
        evaluate = self.build(tree, depth)
        return Expression(self._source(tree), tuple(sorted(self.used)), evaluate, tuple(self.moduli))

    def build(self, node: ast.expr, depth: int) -> Evaluate:
        if depth > DEEPEST:
            raise InputError(
                f"expression {_short(self.text)!r} is nested too deeply, expected at most {DEEPEST} levels"
            )
        match node:
            case ast.Constant(value=int() | float() as number) if _is_finite(number):
                constant = float(number)
                return lambda signals, ops: constant
            case ast.Name(id=name):
                return self._signal(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                inner = self.build(operand, depth + 1)
                return lambda signals, ops: -inner(signals, ops)
            case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mult() as operator, right=right):
                return _binary(operator, self.build(left, depth + 1), self.build(right, depth + 1))
            case ast.Call(func=ast.Name(id="abs"), args=[argument], keywords=[]):
                return self._modulus(_Parser(self.text, self.known).parse(argument, depth + 1))
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
                called = self.build(argument, depth + 1)
                return lambda signals, ops: getattr(ops, name)(called(signals, ops))
        raise InputError(
            f"expression {_short(self.text)!r}: {_short(self._source(node))!r} is not allowed, "
            "only signals, finite numbers, + - * and abs sin cos"
        )

    def _source(self, node: ast.expr) -> str:
        return ast.get_source_segment(self.text.strip(), node) or self.text

    def _signal(self, name: str) -> Evaluate:
        if name not in self.known:
            raise UnknownName(f"signal in expression {_short(self.text)!r}:", name, known=sorted(self.known))
        self.used.add(name)
        return lambda signals, ops: signals[name]

    def _modulus(self, inside: Expression) -> Evaluate:
        self.used.update(inside.signals)
        self.moduli += [*inside.moduli, inside]
        return lambda signals, ops: ops.abs(inside.evaluate(signals, ops))


def _is_finite(number: float) -> bool:
    return not isinstance(number, bool) and abs(number) <= sys.float_info.max


def _short(text: str) -> str:
    """Enough of a text to recognise it."""
    return text if len(text) <= 60 else f"{text[:57]}..."


def _binary(operator: ast.operator, left: Evaluate, right: Evaluate) -> Evaluate:
    if isinstance(operator, ast.Add):
        return lambda signals, ops: left(signals, ops) + right(signals, ops)
    if isinstance(operator, ast.Sub):
        return lambda signals, ops: left(signals, ops) - right(signals, ops)
    return lambda signals, ops: left(signals, ops) * right(signals, ops)


SHOAL = "h"  # draught over water depth
MOTION_SIGNALS = ("u", "v", "r", "u_q", "v_q", SHOAL)
FORCE_SIGNALS = ("tau_x", "tau_y", "tau_psi")


@dataclass(frozen=True)
class Term:
    """One parameter and its regressor."""

    equation: str  # "u", "v" or "r"
    name: str  # parameter name, ASCII, e.g. "X_abs_u_u".
    expression: str  # the regressor, in the language of `expdesign.vessel.structures`


TERMS = {
    term.name: term
    for term in (
        Term("u", "X_u", "u"),
        Term("u", "X_vr", "v*r"),
        Term("u", "X_abs_u_u", "abs(u)*u"),
        Term("u", "W_abs_u_u", "abs(u_q)*u_q"),
        Term("u", "X_mu", "tau_x"),
        Term("u", "X_kappa", "u*tau_x"),
        Term("v", "Y_v", "v"),
        Term("v", "Y_ur", "u*r"),
        Term("v", "Y_abs_v_v", "abs(v)*v"),
        Term("v", "Y_abs_v_r", "abs(v)*r"),
        Term("v", "W_abs_v_v", "abs(v_q)*v_q"),
        Term("v", "Y_mu", "tau_y"),
        Term("r", "N_r", "r"),
        Term("r", "N_uv", "u*v"),
        Term("r", "N_abs_v_v", "abs(v)*v"),
        Term("r", "N_abs_v_r", "abs(v)*r"),
        Term("r", "W_uv", "u_q*v_q"),
        Term("r", "N_mu", "tau_psi"),
    )
}


def _terms(*names: str) -> tuple[Term, ...]:
    return tuple(TERMS[name] for name in names)


STRUCTURES: dict[str, tuple[Term, ...]] = {
    "surge": _terms("X_u", "X_abs_u_u", "W_abs_u_u", "X_mu"),
    "manoeuvring-10": _terms("X_u", "X_abs_u_u", "X_vr", "X_mu", "Y_v", "Y_ur", "Y_mu", "N_r", "N_uv", "N_mu"),
    "manoeuvring-18": tuple(TERMS.values()),
}


def structure_terms(structure: str, custom: tuple[Term, ...] = ()) -> tuple[Term, ...]:
    """The terms of a named structure, or the given ones for ``custom``.

    Raises:
        UnknownName: no such structure.
        InputError: ``custom`` without terms, or terms beside a built-in structure.
    """
    if structure == "custom":
        if not custom:
            raise InputError("structure 'custom' needs [[model.terms]]")
        return custom
    if structure not in STRUCTURES:
        raise UnknownName("model structure", structure, known=(*STRUCTURES, "custom"))
    if custom:
        raise InputError(f"structure {structure!r} is built in and takes no [[model.terms]]; use structure = 'custom'")
    return STRUCTURES[structure]
