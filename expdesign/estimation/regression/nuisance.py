"""Nuisance regressors for an unknown mean current and wind, derived from the terms.

With a current (N, E) in the n-frame the water velocities are u - (N cos psi + E sin psi) and v - (-N sin psi + E cos
psi). A term f(u, v) of second order then grows by its derivatives times cos psi and sin psi, and by its second
derivatives times cos^2 psi and sin 2psi; the unknown factors are estimated along. (sin^2 psi is left out: with
zero-mean instruments it is minus cos^2 psi.) For the manoeuvring model of 18 terms these are exactly the published
regressors. Where a modulus stands over something negative its derivatives change sign; every batch takes the sign that
its data have, so batches excited either way can be estimated together.

The current's components also change along the axes of a ship that turns. This leaves r cos psi and r sin psi in surge
and sway, which most models have by their own terms, too.

Source: F. Ljungberg, doctoral thesis, Linköping University, (4.44), (5.22), (5.37), (5.68)-(5.70).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from expdesign.errors import InputError
from expdesign.estimation.regression.polynomial import MOVING, Algebra, Polynomial, SignalTable, lift, symbol
from expdesign.estimation.regression.tables import AIR
from expdesign.vessel import VesselModel
from expdesign.vessel.expressions import Expression

FIRST = ("cos psi", "sin psi")
SECOND = ("cos^2 psi", "sin 2psi")
NORTH, EAST, DIFFERENCE, PRODUCT = "north", "east", "difference", "product"
"""Moments of a disturbance (N, E) over ground: E N and E E [m/s], E N^2 - E E^2 and E N E [m^2/s^2]."""
SHIFTS = {"u": ((NORTH, -1.0), (EAST, -1.0)), "v": ((EAST, -1.0), (NORTH, 1.0))}
"""What -(N cos psi + E sin psi) and -(-N sin psi + E cos psi) leave with cos psi and with sin psi."""
SQUARES = {
    ("u", "u"): ((DIFFERENCE, 0.5), (PRODUCT, 0.5)),
    ("u", "v"): ((PRODUCT, 2.0), (DIFFERENCE, -0.5)),
    ("v", "v"): ((DIFFERENCE, -0.5), (PRODUCT, -0.5)),
}
"""What half the squares of the shifts, and their product, leave with cos^2 psi and with sin 2psi, beside constants."""


@dataclass(frozen=True)
class Share:
    """What one term adds to a nuisance parameter: the term's parameter times a factor times a moment.

    Attributes:
        parameter: of the term.
        moment: one of `NORTH`, `EAST`, `DIFFERENCE`, `PRODUCT`.
        factor: the number.
        air: whether the moment is the wind's, not the current's.
    """

    parameter: str
    moment: str
    factor: float
    air: bool


@dataclass(frozen=True, eq=False)
class Nuisance:
    """One nuisance regressor: a polynomial of signals times a function of heading.

    Attributes:
        equation: "u", "v" or "r".
        factor: what multiplies the function of heading.
        heading: one of "cos psi", "sin psi", "cos^2 psi", "sin 2psi", or "" for none.
        algebra: gives values to the symbols in the factor.
        shares: what its parameter is the sum of; () where it has no heading.
    """

    equation: str
    factor: Polynomial
    heading: str
    algebra: Algebra
    shares: tuple[Share, ...] = ()

    @property
    def name(self) -> str:
        """Equation and regressor, e.g. "u: r cos psi"."""
        text = str(self.factor)
        parts = [] if text == "1" and self.heading else [f"({text})" if " + " in text else text]
        return f"{self.equation}: {' '.join([*parts, *([self.heading] if self.heading else [])])}"

    def evaluate(self, table: SignalTable) -> Any:
        """(k,) regressor, from a table of signals that includes the signs of the batch and the result of `headings`."""
        return self.factor.evaluate(table, self.algebra.functions) * table[self.heading]


def nuisance_regressors(
    model: VesselModel,
    terms: Sequence[str],
    batches: Sequence[SignalTable],
    *,
    wind_measured: bool,
    turning: bool,
) -> tuple[Nuisance, ...]:
    """The regressors that go with the named terms, without repetition.

    Args:
        model: whose terms they are.
        terms: parameter names.
        batches: one table of measured signals per batch, for the signs of moduli.
        wind_measured: air velocities are data; otherwise the unknown wind acts on them as the current on the water's.
        turning: a current is unknown, whose components change along the axes of a ship that turns.

    Raises:
        InputError: a term is not of second order in the velocities.
    """
    algebra = Algebra()
    found: dict[tuple[str, str, str], Nuisance] = {}
    signs: dict[str, set[float]] = {}
    for term, expression in zip(model.terms, model.expressions, strict=True):
        if term.name not in terms:
            continue
        polynomial = symbolic(expression, algebra, wind_measured=wind_measured)
        air = not wind_measured and bool(set(AIR) & set(expression.signals))
        for factor, heading, moment in _expansion(polynomial, term.name):
            whole = factor.substituted(_steady_signs(algebra, batches, signs))
            known = whole.normalised()
            if known.constant and not heading:
                continue  # a constant: zero-mean instruments do not see it
            key = (term.equation, str(known), heading)
            own = found.setdefault(key, Nuisance(term.equation, known, heading, algebra))
            if moment is not None:
                name, weight = moment
                share = Share(term.name, name, weight * whole.leading, air)
                found[key] = replace(own, shares=(*own.shares, share))
    for item in _of_turning(model, algebra) if found and turning else ():
        found[item.equation, str(item.factor), item.heading] = item
    return tuple(sorted(found.values(), key=lambda item: "uvr".index(item.equation)))


def _of_turning(model: VesselModel, algebra: Algebra) -> list[Nuisance]:
    """Those of a current along the axes of a ship that turns."""
    equations = [name for name in ("u", "v") if name in model.outputs and "r" in model.outputs]
    return [Nuisance(equation, symbol("r"), heading, algebra) for equation in equations for heading in FIRST]


def symbolic(expression: Expression, algebra: Algebra, *, wind_measured: bool) -> Polynomial:
    """A term as a polynomial; without measured wind the air velocities are those through water."""
    table: dict[str, Polynomial] = {name: symbol(name) for name in expression.signals}
    if not wind_measured:
        table |= {f"{name}_q": symbol(name) for name in MOVING}
    return lift(expression.evaluate(table, algebra.operators))


def batch_signs(regressors: Sequence[Nuisance], table: SignalTable) -> dict[str, float]:
    """The sign that each modulus has over most of a batch."""
    names = {name for item in regressors for name in item.factor.signals if name.startswith("sign(")}
    return {name: _sign(item.algebra, name, table) for item in regressors for name in names & set(item.algebra.signs)}


def _expansion(polynomial: Polynomial, name: str) -> list[tuple[Polynomial, str, tuple[str, float] | None]]:
    """Factor and function of heading of each regressor, and the moment, with its weight, that its parameter has."""
    first = {x: polynomial.derivative(x) for x in MOVING}
    second = {(x, y): first[x].derivative(y) for x, y in SQUARES}
    if any(item.signals & set(MOVING) for item in second.values()):
        raise InputError(f"term {name} is of third order in the velocities; augmented predictors end at the second")
    shifts = [
        (item, heading, moment)
        for x, item in first.items()
        for heading, moment in zip(FIRST, SHIFTS[x], strict=True)
        if item.terms
    ]
    squares = [
        (item, heading, moment)
        for pair, item in second.items()
        for heading, moment in zip((*SECOND, ""), (*SQUARES[pair], None), strict=True)
        if item.terms
    ]
    return [*shifts, *squares]


def _steady_signs(algebra: Algebra, batches: Sequence[SignalTable], seen: dict[str, set[float]]) -> Mapping[str, float]:
    """Signs that are the same in all batches; `seen` remembers those of every modulus met so far."""
    for name in algebra.signs:
        if name not in seen:
            seen[name] = {_sign(algebra, name, table) for table in batches}
    return {name: next(iter(values)) for name, values in seen.items() if len(values) == 1}


def _sign(algebra: Algebra, name: str, table: SignalTable) -> float:
    inside = np.asarray(algebra.signs[name].evaluate(table, algebra.functions))
    return -1.0 if np.nanmean(np.sign(inside)) < 0 else 1.0


def headings(psi: Any) -> dict[str, Any]:
    """Every function of heading that regressors are multiplied with, by name."""
    c, s = np.cos(psi), np.sin(psi)
    return {"cos psi": c, "sin psi": s, "cos^2 psi": c * c, "sin 2psi": 2.0 * s * c, "": 1.0}
