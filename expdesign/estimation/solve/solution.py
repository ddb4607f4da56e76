"""LS and IV: the estimate, its covariance and its residuals, from a regression and instruments.

    theta = (sum Z Phi^T)^-1 sum Z y                          LS is IV with Z = Phi
    P = G^-1 Omega G^-T,   G = sum Z Phi^T,   Omega = covariance of sum Z(k) eps(k), see `sandwich`

With one block of instruments per batch there are more equations than unknowns; they are weighted by the inverse second
moments of the instruments (two-stage least squares), which keeps the estimate free of the scale of parameters, or by
weights of the caller.

Source: F. Ljungberg, doctoral thesis, Linköping University, (2.17), (2.21), (4.45); L. P. Hansen, Econometrica 50
(1982), 1029-1054.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from expdesign.errors import InputError, ShapeError
from expdesign.estimation.regression import Regression
from expdesign.estimation.solve.null_space import NullSpace, joined, require_informative
from expdesign.estimation.solve.sandwich import covariance_of
from expdesign.estimation.solve.systems import Part, System, build_part, occupied, split
from expdesign.estimation.solve.weighting import Weighting as Weighting
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """Result of a regression.

    Attributes:
        values: (p,) estimate.
        covariance: (p, p) of the estimate.
        residuals: (k, n) one-step residuals; with zero-mean instruments without their mean. Zero in rows not chosen.
        lags: last lag that a kernel of the covariance counts, 0 where there is none.
        null_space: what the data cannot see.
        warnings: one sentence each.
    """

    values: Array
    covariance: Array
    residuals: Array
    lags: int
    null_space: NullSpace = field(repr=False)
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        seal(self, values="p", covariance="p p", residuals="k n")


def solve_ls(regression: Regression, weighting: Weighting | None = None) -> Solution:
    """Least squares; arguments and errors as in `solve_iv`."""
    return solve_iv(regression, regression.Phi, weighting)


def solve_iv(regression: Regression, instruments: Array, weighting: Weighting | None = None) -> Solution:
    """Instrumental variables.

    Args:
        regression: the data.
        instruments: (k, n, p), one instrument per parameter.
        weighting: how equations are formed; one block, no mean subtraction when left out.

    Raises:
        NotInformative: some parameters cannot be told apart; the message names the combinations.
        ShapeError: the instruments do not fit the regression.
        InputError: weights that do not fit, or blocks per batch with a mean subtracted over all of them.
    """
    return solve(build_equations(regression, instruments, weighting or Weighting()), instruments)


@dataclass(frozen=True, eq=False)
class Equations:
    """A regression split into parts, to be solved with one set of instruments after the other.

    Attributes:
        regression: the data.
        weighting: how equations are formed.
        uses: (n, p) nonzero where parameters or instruments act.
        systems: the parts.
    """

    regression: Regression
    weighting: Weighting
    uses: Array
    systems: tuple[System, ...]


def build_equations(regression: Regression, instruments: Array, weighting: Weighting) -> Equations:
    """Equations for instruments (k, n, p) that act where these do; errors as in `solve_iv`."""
    _check(regression, weighting)
    uses = occupied(regression.Phi) + _power(regression, instruments)
    return Equations(regression, weighting, uses, split(regression, uses, weighting.mean))


def solve(equations: Equations, instruments: Array) -> Solution:
    """The estimate with instruments (k, n, p); errors as in `solve_iv`."""
    return solved(equations, build_parts(equations, instruments))


def build_parts(equations: Equations, instruments: Array) -> list[Part]:
    """Parts with instruments (k, n, p), which are not needed afterwards; errors as in `solve_iv`."""
    exogenous = instruments is equations.regression.Phi
    return _parts(_fitting(equations, instruments), instruments, exogenous=exogenous)


def solved(equations: Equations, parts: Sequence[Part]) -> Solution:
    """The estimate from parts."""
    regression, weighting = equations.regression, equations.weighting
    values, residuals = np.zeros(len(regression.parameters)), np.array(regression.y)
    if regression.chosen is not None:
        residuals[~regression.chosen] = 0.0
    for part in parts:
        theta, left = part.solved(weighting.mean)
        values[part.system.columns] = theta
        rows = np.arange(len(residuals))[part.system.rows]
        residuals[np.ix_(rows, part.system.outputs)] = left
    found = joined([part.found for part in parts])
    said = covariance_of(regression, weighting, parts, residuals)
    return Solution(
        values=values,
        covariance=said.covariance,
        residuals=residuals,
        lags=said.lags,
        null_space=found,
        warnings=said.warnings,
    )


def solve_quick(equations: Equations, instruments: Array) -> tuple[Array, Array]:
    """Parameters (p,), and a covariance (p, p) that ignores correlation in time: for iterations."""
    equations = _fitting(equations, instruments)
    count = len(equations.regression.parameters)
    values, covariance = np.zeros(count), np.zeros((count, count))
    for part in _parts(equations, instruments, exogenous=True):  # spares the search for weak instruments
        theta, left = part.solved(equations.weighting.mean)
        influences = np.einsum("knp,kn->kp", part.W, left)
        values[part.system.columns] = theta
        covariance[np.ix_(part.system.columns, part.system.columns)] = influences.T @ influences
    return values, covariance


def _fitting(equations: Equations, instruments: Array) -> Equations:
    """The equations, split again where the instruments couple the parts."""
    power = _power(equations.regression, instruments)
    if not ((equations.uses == 0) & (power > 0)).any():
        return equations
    return build_equations(equations.regression, instruments, equations.weighting)


def _parts(equations: Equations, instruments: Array, *, exogenous: bool) -> list[Part]:
    parts = [build_part(item, instruments, equations.weighting, exogenous=exogenous) for item in equations.systems]
    require_informative(joined([part.found for part in parts]))
    return parts


def _power(regression: Regression, instruments: Array) -> Array:
    """(n, p) sum of squares of instruments that fit."""
    if instruments.shape != regression.Phi.shape:
        raise ShapeError(f"instruments have shape {instruments.shape}, expected {regression.Phi.shape}")
    power = occupied(instruments)
    if not np.isfinite(power).all():
        raise InputError("instruments hold numbers that are not finite")
    return power


def _check(regression: Regression, weighting: Weighting) -> None:
    if weighting.blocks == "batch" and weighting.mean == "complete":
        raise InputError("instrument blocks per batch need their mean subtracted per batch, found 'complete'")
    batches = len(np.unique(regression.batch_of))
    if regression.chosen is not None and weighting.batch_weights:
        raise InputError("batch_weights need equations that use all samples, found equation-wise ones")
    for what, weights, count in (
        ("batch_weights", weighting.batch_weights, batches),
        ("output_weights", weighting.output_weights, len(regression.outputs)),
    ):
        if weights and len(weights) != count:
            raise InputError(f"{what} has {len(weights)} entries, expected {count}")
