"""LS and IV: the estimate, its covariance and its residuals; refined IV, with instruments simulated again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from expdesign.errors import Diverged, InputError, NotInformative, ShapeError
from expdesign.estimation.regression import Regression
from expdesign.estimation.solve.between_runs import Shares, differing_note
from expdesign.estimation.solve.null_space import NullSpace, joined, require_informative
from expdesign.estimation.solve.sandwich import Uncertainty, covariance_of
from expdesign.estimation.solve.systems import Part, System, build_part, occupied, split
from expdesign.estimation.solve.systems import Weighting as Weighting
from expdesign.values import Array, sealed

# of the first model, tried one after the other where an estimate is unstable
MOST_REFINEMENTS = 30  # of simulated instruments
SETTLED_DEVIATIONS = 1e-3  # change of an estimate, in standard deviations, that ends the refinement
STABILISING_WEIGHTS = (0.01, 0.1, 1.0, 10.0, 100.0, 1e4)


# LS and IV: the estimate, its covariance and its residuals, from a regression and instruments.
#
#     theta = (sum Z Phi^T)^-1 sum Z y                          LS is IV with Z = Phi
#     P = G^-1 Omega G^-T,   G = sum Z Phi^T,   Omega = covariance of sum Z(k) eps(k), see `sandwich`
#
# With one block of instruments per batch there are more equations than unknowns; they are weighted by the inverse
# second moments of the instruments (two-stage least squares), which keeps the estimate free of the scale of parameters,
# or by weights of the caller.
#
# Source: F. Ljungberg, doctoral thesis, Linköping University, (2.17), (2.21), (4.45); L. P. Hansen, Econometrica 50
# (1982), 1029-1054.


@sealed(values="p", covariance="p p", residuals="k n")
class Solution:
    """Result of a regression."""

    values: Array  # (p,) estimate
    covariance: Array  # (p, p) of the estimate
    # (k, n) one-step residuals; with zero-mean instruments without their mean. Zero in rows not chosen.
    residuals: Array
    lags: int  # last lag that a kernel of the covariance counts, 0 where there is none
    null_space: NullSpace = field(repr=False)  # what the data cannot see
    warnings: tuple[str, ...] = ()  # one sentence each
    between_runs: Array | float = 0.0  # (p, p) what of the covariance is by how runs differ; 0 where they do not


def solve_ls(regression: Regression, weighting: Weighting | None = None) -> Solution:
    """Least squares; arguments and errors as in `solve_iv`."""
    return solve_iv(regression, regression.Phi, weighting)


def solve_iv(regression: Regression, instruments: Array, weighting: Weighting | None = None) -> Solution:
    """Instrumental variables.

    Args:
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
    """A regression split into parts, to be solved with one set of instruments after the other."""

    regression: Regression  # the data
    weighting: Weighting  # how equations are formed
    uses: Array  # (n, p) nonzero where parameters or instruments act
    systems: tuple[System, ...]  # the parts


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
    if weighting.covariance == "components":
        said = _counting_runs(said, regression, parts, residuals)
    return Solution(
        values=values,
        covariance=said.covariance,
        residuals=residuals,
        lags=said.lags,
        null_space=found,
        warnings=said.warnings,
        between_runs=said.between_runs,
    )


def _counting_runs(said: Uncertainty, regression: Regression, parts: Sequence[Part], residuals: Array) -> Uncertainty:
    """The uncertainty with what runs differ by."""
    batches, p = np.unique(regression.batch_of), len(regression.parameters)
    scores, of = np.zeros((len(batches), p)), np.zeros((len(batches), p, p))
    for part in parts:
        system, batch = part.system, regression.batch_of[part.system.rows]
        own = Shares.by_batch(batch, part.W, system.varying, residuals[system.rows][:, system.outputs])
        there = np.searchsorted(batches, np.unique(batch))
        scores[np.ix_(there, system.columns)] = own.scores
        of[np.ix_(there, system.columns, system.columns)] = own.of
    P, ratio = Shares(scores, of).widened(said.covariance)
    if ratio == 1.0:
        return said
    notes = (*said.warnings, differing_note(ratio))
    return replace(said, covariance=P, warnings=notes, between_runs=P - said.covariance)


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


# Refined IV: simulate the instruments, estimate, simulate them again with the estimate, until it stops moving.
#
# From few data an estimate may be an unstable model, which gives no instruments. They are then simulated with the
# estimate drawn towards the first model,
#
#     theta(w) = (P^-1 + w D^-1)^-1 (P^-1 theta + w D^-1 theta_0),    D = diag(spread^2),
#
# by the least of some weights w at which the simulation stays bounded. Combinations that the data show stay as
# estimated, others come near the first model. With such instruments the estimate itself is not biased, as they depend
# on the noise no more than others do; most become stable. One that stays unstable is given as drawn, with the
# covariance before that.
#
# From few data refinement may also wander: a poor estimate simulates weak instruments, which give a poor estimate.
# Outputs whose parameters do not settle keep the first instruments, which do not depend on the noise at all where they
# come from the vessel file. (The strongest instruments met would: they follow what disturbances did to the ship.)
#
# Source: F. Ljungberg, doctoral thesis, Linköping University, (4.37)-(4.39); P. C. Young, refined instrumental
# variables, Automatica 51 (2015), 35-46.

First = Callable[[], Array]
"""The first instruments (k, n, p), each time anew: not kept, as they are among the largest of arrays."""
Simulate = Callable[[Array], Array]
"""Parameter values (p,) of the regression -> instruments (k, n, p); raises Diverged."""


@dataclass(frozen=True, eq=False)
class Prior:
    """A stable model that unstable estimates are drawn to."""

    values: Array  # (p,) of the regression's parameters
    spread: Array  # (p,) how far from them parameters may well be; infinite for those without influence on stability

    def drawn(self, values: Array, covariance: Array, weight: float) -> Array:
        """(p,) values with this covariance, combined with the prior's at a weight."""
        places = np.flatnonzero(np.isfinite(self.spread))
        scale = self.spread[places]
        P = covariance[np.ix_(places, places)] / np.outer(scale, scale)
        gain = np.linalg.solve(P + np.eye(len(places)) / weight, P)  # of the prior, transposed
        result = np.array(values)
        result[places] += scale * (gain.T @ ((self.values - values)[places] / scale))
        return result


@dataclass(frozen=True, eq=False)
class Refined:
    """The outcome."""

    solution: Solution  # from the last instruments
    refinements: int  # how many times instruments were simulated from an estimate
    warnings: tuple[str, ...]  # one sentence each


def refine_iv(
    regression: Regression,
    first: First,
    simulate: Simulate,
    weighting: Weighting,
    *,
    prior: Prior | None = None,
    most: int = MOST_REFINEMENTS,
) -> Refined:
    """Refine from first instruments.

    A model that loses sight of parameters during refinement ends it with a warning, and so does one that diverges where
    there is no prior; the estimate is then the last one whose instruments could be simulated.

    Raises:
        NotInformative: the first instruments already fail.
    """
    instruments = first()
    equations = build_equations(regression, instruments, weighting)
    values, covariance = solve_quick(equations, instruments)
    origin: tuple[Array, Array] | None = None  # of the instruments that the values are from
    moved, count, weight, warnings = np.zeros(len(values)), 0, 0.0, []
    while count < most:
        del instruments
        before = values, covariance
        try:
            instruments, weight = _bounded(simulate, values, covariance, prior)
            newer, covariance = solve_quick(equations, instruments)
        except Diverged as error:
            warnings.append(f"Refinement stopped: the estimated model is unstable ({error}).")
            instruments = _made_again(first, simulate, origin, prior)
            break
        except NotInformative as error:
            warnings.append(f"Refinement stopped: {error}.")
            instruments = _made_again(first, simulate, origin, prior)
            break
        deviations = np.sqrt(np.diag(covariance))
        moved = np.abs(newer - values) / np.maximum(deviations, 1e-150)
        origin, values, count = before, newer, count + 1
        if moved.max() < SETTLED_DEVIATIONS:
            break
    restless = np.zeros(len(equations.uses), dtype=bool)
    if count == most and moved.max() >= SETTLED_DEVIATIONS:
        warnings.append(
            f"The estimate still changes by {moved.max():.2g} standard deviations after {most} refinements; equations "
            "that do not settle keep their first instruments."
        )
        restless = np.asarray((equations.uses[:, moved >= SETTLED_DEVIATIONS] > 0).any(axis=1))
        instruments = np.where(restless[:, None], first(), instruments)
    parts = build_parts(equations, instruments)
    del instruments
    solution = solved(equations, parts)
    if restless.any():
        try:
            _, weight = _bounded(simulate, solution.values, solution.covariance, prior)
        except Diverged as error:
            warnings.append(f"The estimated model is unstable ({error}).")
    if prior is None or not weight:
        return Refined(solution, count, tuple(warnings))
    drawn = prior.drawn(solution.values, solution.covariance, weight)
    shift = float(np.max(np.abs(drawn - solution.values) / np.maximum(np.sqrt(np.diag(solution.covariance)), 1e-150)))
    warnings.append(
        "The data alone give an unstable model. What they show least is drawn towards the first model, by up to "
        f"{shift:.2g} standard deviations."
    )
    return Refined(replace(solution, values=drawn, residuals=regression.residuals(drawn)), count, tuple(warnings))


def _made_again(first: First, simulate: Simulate, origin: tuple[Array, Array] | None, prior: Prior | None) -> Array:
    """Instruments from values and their covariance that gave some before; the first ones without."""
    return first() if origin is None else _bounded(simulate, *origin, prior)[0]


def _bounded(simulate: Simulate, values: Array, covariance: Array, prior: Prior | None) -> tuple[Array, float]:
    """Instruments from the values, or from those drawn to the prior by the least weight at which they stay bounded.

    Raises:
        Diverged: none does.
    """
    try:
        return simulate(values), 0.0
    except Diverged:
        if prior is None:
            raise
    *some, most = STABILISING_WEIGHTS
    for weight in some:
        try:
            return simulate(prior.drawn(values, covariance, weight)), weight
        except Diverged:
            continue
    return simulate(prior.drawn(values, covariance, most)), most
