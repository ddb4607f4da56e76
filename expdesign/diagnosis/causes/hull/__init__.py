"""Causes in the model of the hull: terms, parameters, load, roll, a change during the trial."""

from expdesign.diagnosis.causes.hull.change_point import CHANGE_POINT
from expdesign.diagnosis.causes.hull.load_change import LOAD_CHANGE
from expdesign.diagnosis.causes.hull.missing_term import MISSING_TERM, absent_terms
from expdesign.diagnosis.causes.hull.parameters import PARAMETERS
from expdesign.diagnosis.causes.hull.roll_coupling import ROLL_COUPLING
from expdesign.diagnosis.causes.hull.unlisted_term import UNLISTED_TERM

__all__ = [
    "CHANGE_POINT",
    "LOAD_CHANGE",
    "MISSING_TERM",
    "PARAMETERS",
    "ROLL_COUPLING",
    "UNLISTED_TERM",
    "absent_terms",
]
