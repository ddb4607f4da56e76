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
from expdesign.durations.limits import NO_CONSTRAINTS, Budget, Constraints
from expdesign.durations.maximise import LargeDesign, d_optimal, rows_of
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

__all__ = [
    "CRITERIA",
    "MEAN_SUBTRACTIONS",
    "NO_CONSTRAINTS",
    "ROBUST",
    "Aim",
    "Budget",
    "Certificate",
    "Collected",
    "Constraints",
    "Criterion",
    "DurationDesign",
    "DurationProblem",
    "Efficiencies",
    "InformationFloor",
    "Kept",
    "LargeDesign",
    "Solver",
    "Subset",
    "best_subset",
    "bordered",
    "bordered_moments",
    "build_durations",
    "build_fused",
    "build_recorded",
    "d_optimal",
    "efficiencies",
    "limits_kept",
    "log_det",
    "monte_carlo_covariance",
    "optimal_shares",
    "pool_gains",
    "rows_of",
    "scaled",
    "sensitivities",
    "solve_durations",
    "whitened",
    "with_repeats",
]
