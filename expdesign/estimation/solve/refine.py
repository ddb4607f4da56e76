"""Refined IV: simulate the instruments, estimate, simulate them again with the estimate, until it stops moving.

Source: F. Ljungberg, doctoral thesis, Linköping University, (4.37)-(4.39); P. C. Young, refined instrumental variables,
Automatica 51 (2015), 35-46.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from expdesign.errors import Diverged, NotInformative
from expdesign.estimation.regression import Regression
from expdesign.estimation.solve.solution import Solution, Weighting, build_equations, solve, solve_quick
from expdesign.estimation.tuning import TUNING
from expdesign.values import Array

Simulate = Callable[[Array], Array]
"""Parameter values (p,) of the regression -> instruments (k, n, p); raises Diverged."""


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
    first: Array,
    simulate: Simulate,
    weighting: Weighting,
    *,
    most: int = TUNING.most_refinements,
    settled: float = TUNING.settled_deviations,
) -> Refined:
    """Refine from first instruments (k, n, p).

    A model that diverges, or that loses sight of parameters, during refinement ends it with a warning; the estimate is
    then the last one whose instruments could be simulated.

    Raises:
        NotInformative: the first instruments already fail.
    """
    equations = build_equations(regression, first, weighting)
    instruments, (values, _) = first, solve_quick(equations, first)
    moved, count, warnings = 0.0, 0, []
    while count < most:
        try:
            newer_instruments = simulate(values)
            newer, deviations = solve_quick(equations, newer_instruments)
        except Diverged as error:
            warnings.append(f"Refinement stopped: the estimated model is unstable ({error}).")
            break
        except NotInformative as error:
            warnings.append(f"Refinement stopped: {error}.")
            break
        moved = float(np.max(np.abs(newer - values) / np.maximum(deviations, 1e-150)))
        instruments, values, count = newer_instruments, newer, count + 1
        if moved < settled:
            break
    if count == most and moved >= settled:
        warnings.append(f"The estimate still changes by {moved:.2g} standard deviations after {most} refinements.")
    return Refined(solve(equations, instruments), count, tuple(warnings))
