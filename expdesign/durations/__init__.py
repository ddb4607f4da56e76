"""Durations: how long to run each primitive, with a certificate."""

from expdesign.durations.certificate import log_det, sensitivities
from expdesign.durations.constraints import NO_CONSTRAINTS, Budget, Constraints
from expdesign.durations.criteria import CRITERIA, Aim, Criterion
from expdesign.durations.efficiency import Efficiencies, Kept, efficiencies, limits_kept
from expdesign.durations.fused import build_fused, monte_carlo_covariance
from expdesign.durations.mining import Subset, best_subset
from expdesign.durations.solve import bordered, build_durations, optimal_shares, solve_durations, with_repeats
from expdesign.durations.values import ROBUST, Certificate, DurationDesign, DurationProblem
from expdesign.information import MEAN_SUBTRACTIONS

__all__ = [
    "CRITERIA",
    "MEAN_SUBTRACTIONS",
    "NO_CONSTRAINTS",
    "ROBUST",
    "Aim",
    "Budget",
    "Certificate",
    "Constraints",
    "Criterion",
    "DurationDesign",
    "DurationProblem",
    "Efficiencies",
    "Kept",
    "Subset",
    "best_subset",
    "bordered",
    "build_durations",
    "build_fused",
    "efficiencies",
    "limits_kept",
    "log_det",
    "monte_carlo_covariance",
    "optimal_shares",
    "sensitivities",
    "solve_durations",
    "with_repeats",
]
