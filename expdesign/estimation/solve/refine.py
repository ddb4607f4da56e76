"""Refined IV: simulate the instruments, estimate, simulate them again with the estimate, until it stops moving.

From few data an estimate may be an unstable model, which gives no instruments. They are then simulated with the
estimate drawn towards the first model,

    theta(w) = (P^-1 + w D^-1)^-1 (P^-1 theta + w D^-1 theta_0),    D = diag(spread^2),

by the least of some weights w at which the simulation stays bounded. Combinations that the data show stay as estimated,
others come near the first model. With such instruments the estimate itself is not biased, as they depend on the noise
no more than others do; most become stable. One that stays unstable is given as drawn, with the covariance before that.

From few data refinement may also wander: a poor estimate simulates weak instruments, which give a poor estimate.
Outputs whose parameters do not settle keep the first instruments, which do not depend on the noise at all where they
come from the vessel file. (The strongest instruments met would: they follow what disturbances did to the ship.)

Source: F. Ljungberg, doctoral thesis, Linköping University, (4.37)-(4.39); P. C. Young, refined instrumental variables,
Automatica 51 (2015), 35-46.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from expdesign.errors import Diverged, NotInformative
from expdesign.estimation.regression import Regression
from expdesign.estimation.solve.solution import Solution, Weighting, build_equations, build_parts, solve_quick, solved
from expdesign.estimation.tuning import TUNING
from expdesign.values import Array

First = Callable[[], Array]
"""The first instruments (k, n, p), each time anew: not kept, as they are among the largest of arrays."""
Simulate = Callable[[Array], Array]
"""Parameter values (p,) of the regression -> instruments (k, n, p); raises Diverged."""


@dataclass(frozen=True, eq=False)
class Prior:
    """A stable model that unstable estimates are drawn to.

    Attributes:
        values: (p,) of the regression's parameters.
        spread: (p,) how far from them parameters may well be; infinite for those without influence on stability.
    """

    values: Array
    spread: Array

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
    """The outcome.

    Attributes:
        solution: from the last instruments.
        refinements: how many times instruments were simulated from an estimate.
        warnings: one sentence each.
    """

    solution: Solution
    refinements: int
    warnings: tuple[str, ...]


def refine_iv(
    regression: Regression,
    first: First,
    simulate: Simulate,
    weighting: Weighting,
    *,
    prior: Prior | None = None,
    most: int = TUNING.most_refinements,
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
        if moved.max() < TUNING.settled_deviations:
            break
    restless = np.zeros(len(equations.uses), dtype=bool)
    if count == most and moved.max() >= TUNING.settled_deviations:
        warnings.append(
            f"The estimate still changes by {moved.max():.2g} standard deviations after {most} refinements; equations "
            "that do not settle keep their first instruments."
        )
        restless = np.asarray((equations.uses[:, moved >= TUNING.settled_deviations] > 0).any(axis=1))
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
    *some, most = TUNING.stabilising_weights
    for weight in some:
        try:
            return simulate(prior.drawn(values, covariance, weight)), weight
        except Diverged:
            continue
    return simulate(prior.drawn(values, covariance, most)), most
