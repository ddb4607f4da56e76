"""Durations: how long to run each primitive, with a certificate."""

from expdesign.durations.certificate import log_det, sensitivities
from expdesign.durations.solve import bordered, build_durations, solve_durations, with_repeats
from expdesign.durations.values import MEAN_SUBTRACTIONS, DurationDesign, DurationProblem

__all__ = [
    "MEAN_SUBTRACTIONS",
    "DurationDesign",
    "DurationProblem",
    "bordered",
    "build_durations",
    "log_det",
    "sensitivities",
    "solve_durations",
    "with_repeats",
]
