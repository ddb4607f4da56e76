"""Which causes explain the data: score tests, forward selection, backward elimination, profile likelihood."""

from expdesign.diagnosis.select.backward_elimination import eliminate_backward, only_nuisance
from expdesign.diagnosis.select.forward_selection import select_forward
from expdesign.diagnosis.select.selection import Selection, Step
from expdesign.diagnosis.select.selection_round import leading_candidates
from expdesign.diagnosis.select.tuning import TUNING as SELECTION_TUNING

__all__ = [
    "SELECTION_TUNING",
    "Selection",
    "Step",
    "eliminate_backward",
    "leading_candidates",
    "only_nuisance",
    "select_forward",
]
