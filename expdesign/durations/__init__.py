"""Durations: how long to run each primitive, with a certificate."""

from expdesign.durations.certificate import log_det, sensitivities
from expdesign.durations.solve import bordered, build_durations, solve_durations, with_repeats
from expdesign.durations.values import DurationDesign, DurationProblem
from expdesign.information import MEAN_SUBTRACTIONS

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
