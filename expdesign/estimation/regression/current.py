"""Regressors of an unknown steady current, exact to first order around a first guess of it.

The acceleration over ground is that through water, Phi(nu - R(psi)^T c)^T theta with the current c to north and east,
and the change of the current's components along the axes of a ship that turns, r S R^T c with S = [[0, 1], [-1, 0]].
Around c_0 and theta_0

    Phi(nu - R^T c)^T theta + r S R^T c ~ Phi(nu - R^T c_0)^T theta + r S R^T c_0 + J(c_0, theta_0) (c - c_0),

with J = d(Phi^T theta) / dc + r S R^T. So two columns stand for all that the current does, whatever the terms are, and
the estimate is repeated around what it found until the current stays. Beside the regressors of (5.68)-(5.70), which
leave every product of a parameter and the current free, the two cost less information; they need no excitation
condition.

Source: Gauss's and Newton's linearisation of the model of T. I. Fossen, Handbook of Marine Craft Hydrodynamics and
Motion Control (2011), 8.3; the predictor of F. Ljungberg, doctoral thesis, Linköping University, (5.63), with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.estimation.regression.tables import Table
from expdesign.simulation.motion import rates_over_ground, to_body
from expdesign.values import Array, seal
from expdesign.vessel import NUMPY, VesselModel

STEADY_CURRENT = ("current to north", "current to east")
"""Names of the nuisance parameters [m/s]."""
STEP_MPS = 1e-4
"""Step of the central difference, which is exact for terms of second order away from a change of sign of a modulus."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Guess:
    """What regressors are linearised around.

    Attributes:
        to_mps: (2,) current to north and east [m/s].
        parameters: (all,) of the model.
    """

    to_mps: Array
    parameters: Array

    def __post_init__(self) -> None:
        seal(self, to_mps="2", parameters="p")


def through_water(table: Table, to_mps: Array) -> Table:
    """The table with velocities u and v through water that moves to north and east [m/s]; those through air stay."""
    c, s = np.cos(table["psi"]), np.sin(table["psi"])
    north, east = to_mps
    return {**table, "u": table["u"] - (north * c + east * s), "v": table["v"] - (east * c - north * s)}


def slopes(model: VesselModel, parameters: Array, table: Table, *, turning: bool = True) -> Array:
    """(2, k, n) change of accelerations over ground, in the model's own scale, with the current to north and to east.

    Args:
        model: gives terms and outputs.
        parameters: (all,) of it.
        table: signals through water.
        turning: as of `simulation.motion_rates`.
    """
    columns = []
    for direction in np.eye(2):
        ahead, back = (_accelerations(model, parameters, through_water(table, sign * direction)) for sign in STEPS)
        columns.append((ahead - back) / (2 * STEP_MPS))
    if turning:
        columns = [own + turned_with(model, table, to) for own, to in zip(columns, np.eye(2), strict=True)]
    return np.array(columns)


def turned_with(model: VesselModel, table: Table, to_mps: Array) -> Array:
    """(k, n) change of a current's components along the axes of a ship that turns, in the model's own scale."""
    zero = np.zeros_like(table["psi"])
    rates = rates_over_ground((zero, zero, zero), to_body(to_mps, table["psi"], NUMPY), table["r"])
    every = np.stack(rates, axis=1) * model.time_scale_s
    return np.asarray(every[:, [OUTPUTS.index(name) for name in model.outputs]])


STEPS = (STEP_MPS, -STEP_MPS)


def _accelerations(model: VesselModel, parameters: Array, table: Table) -> Array:
    """(k, n) accelerations by all terms."""
    total = np.zeros((len(table["psi"]), len(model.outputs)))
    for term, expression, value in zip(model.terms, model.expressions, parameters, strict=True):
        total[:, model.outputs.index(term.equation)] += value * np.asarray(expression.evaluate(table, NUMPY))
    return total
