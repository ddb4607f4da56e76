"""Durations: how long to run each primitive, with a certificate."""

from expdesign.durations.certificate import (
    Certificate,
    DurationDesign,
    Solver,
    log_det,
    scaled,
    sensitivities,
    whitened,
)
from expdesign.durations.concave import Collected
from expdesign.durations.criteria import CRITERIA, Aim, Criterion
from expdesign.durations.efficiency import Efficiencies, Kept, efficiencies, limits_kept, pool_gains
from expdesign.durations.large_scale import LargeDesign, d_optimal, rows_of
from expdesign.durations.limits import NO_CONSTRAINTS, Budget, Constraints
from expdesign.durations.mining import Subset, best_subset, build_recorded
from expdesign.durations.problem import (
    ROBUST,
    DurationProblem,
    InformationFloor,
    bordered,
    bordered_moments,
    build_durations,
    build_fused,
    monte_carlo_covariance,
)
from expdesign.durations.solve import optimal_shares, solve_durations, with_repeats
from expdesign.information import MEAN_SUBTRACTIONS
