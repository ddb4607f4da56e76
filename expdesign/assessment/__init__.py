"""Assessment: estimates are validated on their estimation runs and on test runs."""

from expdesign.assessment.assess import NO_TESTS, assess, default_methods, settled
from expdesign.assessment.held_out import HeldOut
from expdesign.assessment.limits import Limits, decomposed, sentence
from expdesign.assessment.options import INSTRUMENTS, EstimateOptions
from expdesign.assessment.residuals import OneStep, one_step
from expdesign.assessment.runs import RunCheck, check_run
from expdesign.assessment.values import Assessed, Assessment, Disturbances

__all__ = [
    "INSTRUMENTS",
    "NO_TESTS",
    "Assessed",
    "Assessment",
    "Disturbances",
    "EstimateOptions",
    "HeldOut",
    "Limits",
    "OneStep",
    "RunCheck",
    "assess",
    "check_run",
    "decomposed",
    "default_methods",
    "one_step",
    "sentence",
    "settled",
]
