"""Assessment: estimates are validated on their estimation runs and on test runs."""

from expdesign.assessment.assess import NO_TESTS, assess, settled, to_fix, uses_measured_wind, with_unstated
from expdesign.assessment.misfit import Limits, RunCheck, check_run, decomposed, sentence
from expdesign.assessment.prior import apart_from_stated
from expdesign.assessment.unstated import Answer, Current, Moved
from expdesign.assessment.values import INSTRUMENTS, Assessed, Assessment, EstimateOptions
