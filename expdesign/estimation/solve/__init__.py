"""Instrumental-variable equations solved, with covariance and null space."""

from expdesign.estimation.solve.between_runs import (
    MOST_FREEDOM,
    NORMAL_95,
    Dispersion,
    Shares,
    Spread,
    differing_note,
    few_runs_factor,
    spread_between_runs,
)
from expdesign.estimation.solve.null_space import Direction, NullSpace, null_space, require_informative
from expdesign.estimation.solve.sandwich import changing_variance, misfit_note, widening
from expdesign.estimation.solve.solution import (
    MOST_REFINEMENTS,
    SETTLED_DEVIATIONS,
    Prior,
    Refined,
    Solution,
    Weighting,
    refine_iv,
    solve_iv,
    solve_ls,
)
from expdesign.estimation.solve.systems import BLOCKS
