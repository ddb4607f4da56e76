"""Nuisance regressors: an unknown current and wind, and terms of the wind from a vane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.errors import InputError
from expdesign.estimation.regression.polynomial import MOVING, Algebra, Polynomial, SignalTable, lift, symbol
from expdesign.estimation.regression.regression import AIR, Table
from expdesign.signals import Record
from expdesign.simulation.motion import rates_over_ground, to_body
from expdesign.values import Array, sealed
from expdesign.vessel import NUMPY, VesselModel
from expdesign.vessel.structures import Expression

# Nuisance regressors for an unknown mean current and wind, derived from the terms.
#
# With a current (N, E) in the n-frame the water velocities are u - (N cos psi + E sin psi) and v - (-N sin psi + E cos
# psi). A term f(u, v) of second order then grows by its derivatives times cos psi and sin psi, and by its second
# derivatives times cos^2 psi and sin 2psi; the unknown factors are estimated along. (sin^2 psi is left out: with
# zero-mean instruments it is minus cos^2 psi.) For the manoeuvring model of 18 terms these are exactly the published
# regressors. Where a modulus stands over something negative its derivatives change sign; every batch takes the sign
# that its data have, so batches excited either way can be estimated together.
#
# The current's components also change along the axes of a ship that turns. This leaves r cos psi and r sin psi in surge
# and sway, which most models have by their own terms, too.
#
# Source: F. Ljungberg, doctoral thesis, Linköping University, (4.44), (5.22), (5.37), (5.68)-(5.70).

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
    """What one term adds to a nuisance parameter: the term's parameter times a factor times a moment."""

    parameter: str  # of the term
    moment: str  # one of `NORTH`, `EAST`, `DIFFERENCE`, `PRODUCT`
    factor: float  # the number
    air: bool  # whether the moment is the wind's, not the current's


@dataclass(frozen=True, eq=False)
class Nuisance:
    """One nuisance regressor: a polynomial of signals times a function of heading."""

    equation: str  # "u", "v" or "r"
    factor: Polynomial  # what multiplies the function of heading
    heading: str  # one of "cos psi", "sin psi", "cos^2 psi", "sin 2psi", or "" for none
    algebra: Algebra  # gives values to the symbols in the factor
    shares: tuple[Share, ...] = ()  # what its parameter is the sum of; () where it has no heading

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


# Regressors of an unknown steady current, exact to first order around a first guess of it.
#
# The acceleration over ground is that through water, Phi(nu - R(psi)^T c)^T theta with the current c to north and east,
# and the change of the current's components along the axes of a ship that turns, r S R^T c with S = [[0, 1], [-1, 0]].
# Around c_0 and theta_0
#
#     Phi(nu - R^T c)^T theta + r S R^T c ~ Phi(nu - R^T c_0)^T theta + r S R^T c_0 + J(c_0, theta_0) (c - c_0),
#
# with J = d(Phi^T theta) / dc + r S R^T. So two columns stand for all that the current does, whatever the terms are,
# and the estimate is repeated around what it found until the current stays. Beside the regressors of (5.68)-(5.70),
# which leave every product of a parameter and the current free, the two cost less information; they need no excitation
# condition.
#
# Source: Gauss's and Newton's linearisation of the model of T. I. Fossen, Handbook of Marine Craft Hydrodynamics and
# Motion Control (2011), 8.3; the predictor of F. Ljungberg, doctoral thesis, Linköping University, (5.63), with it.

STEADY_CURRENT = ("current to north", "current to east")  # names of the nuisance parameters [m/s]
STEP_MPS = 1e-4
"""Step of the central difference, which is exact for terms of second order away from a change of sign of a modulus."""


@sealed(to_mps="2", parameters="p")
class Guess:
    """What regressors are linearised around."""

    to_mps: Array  # (2,) current to north and east [m/s]
    parameters: Array  # (all,) of the model


def through_water(table: Table, to_mps: Array) -> Table:
    """The table with velocities u and v through water that moves to north and east [m/s]; those through air stay."""
    u, v = to_body(to_mps, table["psi"], NUMPY)
    return {**table, "u": table["u"] - u, "v": table["v"] - v}


def slopes(model: VesselModel, parameters: Array, table: Table, *, turning: bool = True) -> Array:
    """(2, k, n) change of accelerations over ground, in the model's own scale, with the current to north and to east.

    Args:
        parameters: (all,) of it.
        table: signals through water.
        turning: as of `simulation.motion_rates`.
    """
    c, s = np.cos(table["psi"])[:, None], np.sin(table["psi"])[:, None]
    by_u, by_v = (_slope(model, parameters, table, name) for name in ("u", "v"))
    columns = [s * by_v - c * by_u, -s * by_u - c * by_v]
    if turning:
        columns = [own + turned_with(model, table, to) for own, to in zip(columns, np.eye(2), strict=True)]
    return np.array(columns)


def turned_with(model: VesselModel, table: Table, to_mps: Array) -> Array:
    """(k, n) change of a current's components along the axes of a ship that turns, in the model's own scale."""
    zero = np.zeros_like(table["psi"])
    rates = rates_over_ground((zero, zero, zero), to_body(to_mps, table["psi"], NUMPY), table["r"])
    every = np.stack(rates, axis=1) * model.time_scale_s
    return np.asarray(every[:, [OUTPUTS.index(name) for name in model.outputs]])


def _slope(model: VesselModel, parameters: Array, table: Table, name: str) -> Array:
    """(k, n) derivative of the accelerations by a velocity through water."""
    total = np.zeros((len(table["psi"]), len(model.outputs)))
    moved = [{**table, name: table[name] + step} for step in (STEP_MPS, -STEP_MPS)]
    for term, expression, value in zip(model.terms, model.expressions, parameters, strict=True):
        if name in expression.signals:
            ahead, back = (np.asarray(expression.evaluate(at, NUMPY)) for at in moved)
            total[:, model.outputs.index(term.equation)] += value * (ahead - back) / (2 * STEP_MPS)
    return total


# Terms of the wind from a vane: unbiased for noise on its angle.
#
# Gaussian noise of standard deviation s on an angle shrinks its n-th harmonic by exp(-n**2 s**2 / 2). Components of the
# wind, n = 1, come divided by exp(-s**2 / 2). In a term of second degree, such as u_q v_q, or |u_q| u_q where u_q keeps
# its sign, that leaves the mean over the angle, n = 0, too large by exp(s**2) and the rest, n = 2, too small by as
# much. Both are known from the term at the wind turned by 90 degrees.
#
# That is right for instruments. Least squares is biased towards zero by the noise left in its regressors, and more so
# the more they are enlarged; it uses the wind as measured.
#
# Source: F. Ljungberg, doctoral thesis, Linköping University, (5.47)-(5.50), for components; K. V. Mardia and P. E.
# Jupp, Directional Statistics (2000), 3.5.7, for the harmonics of an angle with Gaussian noise.


def with_wind_as_measured(record: Record) -> Record:
    """The record with winds from a vane as it measured them, shrunk by its noise."""
    if not any(batch.vane_std_rad for batch in record.batches):
        return record
    batches = tuple(
        batch
        if batch.wind is None
        else replace(batch, wind=batch.wind * np.exp(-(batch.vane_std_rad**2) / 2.0), vane_std_rad=0.0)
        for batch in record.batches
    )
    return replace(record, batches=batches)


def unbiased_value(expression: Expression, table: Table, std_rad: float) -> Array:
    """(k,) a term of at most second degree in the wind, whose mean over the noise is the term without noise.

    Args:
        table: measured signals, with components of the wind divided by their shrinkage.
        std_rad: of the noise on the vane's angle.
    """
    signs: list[Any] = []

    def recorded(inside: Any) -> Any:
        signs.append(np.sign(inside))
        return np.abs(inside)

    value = expression.evaluate(table, replace(NUMPY, abs=recorded))
    if not set(AIR) & set(expression.signals):
        return np.asarray(value)
    u, v = (table[name] for name in AIR)

    def at(u_q: Array, v_q: Array) -> Any:
        known = iter(signs)  # moduli keep their sign while the wind is turned
        return expression.evaluate({**table, "u_q": u_q, "v_q": v_q}, replace(NUMPY, abs=lambda x: next(known) * x))

    even = (value + at(-u, -v)) / 2
    mean = (even + (at(-v, u) + at(v, -u)) / 2) / 2
    gain = np.exp(std_rad**2)
    return np.asarray(value + (gain - 1.0) * (even - mean) + (1.0 / gain - 1.0) * mean)
