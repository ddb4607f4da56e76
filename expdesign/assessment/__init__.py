"""Assessment: estimates are validated on their estimation runs and on test runs."""

from expdesign.assessment.assess import NO_TESTS, assess, default_methods, settled
from expdesign.assessment.held_out import HeldOut
from expdesign.assessment.misfit import Limits, OneStep, RunCheck, check_run, decomposed, one_step, sentence
from expdesign.assessment.values import INSTRUMENTS, Assessed, Assessment, Disturbances, EstimateOptions
