"""Durations: how long to run each primitive, with a certificate."""

from expdesign.durations.certificate import DurationDesign, log_det, scaled, whitened
from expdesign.durations.concave import Collected
from expdesign.durations.criteria import CRITERIA, Aim
from expdesign.durations.efficiency import Efficiencies, efficiencies, limits_kept, pool_gains
from expdesign.durations.large_scale import d_optimal, rows_of
from expdesign.durations.limits import Budget, Constraints
from expdesign.durations.mining import Subset, best_subset, build_recorded, require_told_apart
from expdesign.durations.problem import (
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
